// SPDX-License-Identifier: Apache-2.0
// How long a run still takes: what its steps cost as their Gaussians become more, and what textures will cost.
#pragma once
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "training/settings/schedule.h"
#include "training/settings/settings.h"

namespace tg {

// What a trainer is about to do. Counts of iterations are those left.
struct RunPlan {
  bool densifies = false;     // this stage is one that changes the number of Gaussians
  bool grows_sh = false;      // and one that begins with constant colours
  int iteration = 0;          // of this stage, done
  int left = 0;               // of this stage
  std::size_t gaussians = 0;  // now
  std::size_t limit = 0;      // of them in this stage; 0: none
  std::size_t merged = 0;     // of them after so many iterations, if it has more until then
  int merge_after = 0;        // 0: never
  bool swaps = false;         // at the limit Gaussians are replaced by others
  double growth = -1;         // MCMC: of the count, a round; -1: as the rounds before
  bool textured = false;      // this stage is one with textures
  double texels = 0;          // a Gaussian's, of the textured stage; first those before adaptive textures are cut
  double texels_cut = 0;      // after that; 0: they are not cut
  int cut_left = 0;           // iterations of the textured stage after the cut, as far as they are still to come
  int first_left = 0;         // of stage plain after a counting one, whose limit is first_share of the count
  double first_share = 1;
  std::uint64_t first_pixels = 0;  // of the training views, where that stage merges down to its limit
  int textured_left = 0;           // of a textured stage to come
  int untextured_left = 0;         // of its twin
  int quantized_left = 0;          // of a stage for a file, with the textures that there are then
  int scorings = 0;                // of the test views, to come
  std::size_t test_views = 0;
};

// Steps of one stage teach; a new stage begins with what the one before has said.
class TimeLeft {
 public:
  // `pixels`: of a training view.
  TimeLeft(const TrainSettings& settings, const Schedule& schedule, double pixels)
      : settings_(settings), schedule_(schedule), pixels_(pixels) {}

  // What it is about to do.
  void beginStage(const RunPlan& plan);
  // It has iterations behind it already, in `seconds`, of a run that is resumed.
  void resume(int iterations, double seconds, std::size_t gaussians);
  // A step of so many Gaussians took so long.
  void add(double seconds, std::size_t gaussians);
  // Textures have been cut: their steps cost less from here on.
  void rescale(double texels, std::size_t gaussians);

  // [s]
  double seconds(const RunPlan& plan) const;

 private:
  // Of a step with so much to do for its Gaussians (load()).
  double stepCost(double load) const;
  // So many Gaussians, in Gaussians of constant colour, after so many iterations of this stage, or with all colours.
  double load(double gaussians, int iteration) const;
  double load(double gaussians) const;
  // Of a textured step in plain ones of as many Gaussians.
  double textureFactor(double texels, double gaussians) const;
  void changeFactor(double factor);
  // What the last round has added, and the next one in multiples of that.
  std::pair<double, double> growth() const;
  // Calls use(steps, count, iteration) for the rest of the stage, piece by piece, and returns the count at its end.
  template <typename Use>
  double forEachPiece(const RunPlan& plan, Use use) const;

  const TrainSettings settings_;
  const Schedule schedule_;
  const double pixels_;
  bool textured_ = false;
  bool grows_sh_ = false;
  bool swaps_ = false;
  double factor_ = 1;  // textureFactor of this stage
  int steps_ = 0;
  // Forgetting means over the last steps.
  double weight_ = 0, cost_ = 0, load_ = 0;
  // Of load and cost over blocks of steps, for what of the cost grows with the load.
  double block_cost_ = 0, block_load_ = 0;
  int block_steps_ = 0;
  double n_ = 0, x_ = 0, y_ = 0, xx_ = 0, xy_ = 0;
  double before_ = 0;            // count before the last step
  std::vector<double> growths_;  // of the count, in the last rounds
};

}  // namespace tg

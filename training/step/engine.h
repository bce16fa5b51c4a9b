// SPDX-License-Identifier: Apache-2.0
// Where the arithmetic of training runs: an iteration from forward pass to the moved parameters, and what changes the
// set of Gaussians between iterations. The host's engine works on the state in place; one with a device of its own
// keeps the state there.
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "training/data/photographs.h"
#include "training/step/densify.h"
#include "training/step/filter_3d.h"
#include "training/step/gradient.h"
#include "training/step/loss.h"
#include "training/step/mcmc.h"
#include "training/step/optimizer.h"
#include "training/step/run_state.h"

namespace tg {

// What a step is told beside what lies in memory: plain numbers, which cross from process to process as a whole.
struct StepChoices {
  std::size_t view;  // of the data set
  // The view of the next step, where it is known.
  std::optional<std::size_t> following = {};
  glm::vec3 background;
  bool background_varies;
  int iteration;  // of the stage, from 1
  GradientOptions gradient;
  bool gather_statistics;  // add to RunState::statistics
  LearningRates rates;
  bool mcmc;  // the four below count
  float opacity_weight;
  float scale_weight;
  float noise;
  std::uint64_t noise_seed;
  bool clamp_colors;  // texel colours to [0, 1]
};

struct StepInput : StepChoices {
  const Camera& camera;  // stays where it is until the step's loss is known
  // What the picture is compared with; the same for every step with this view unless background_varies. May be null
  // where the engine hasPhotograph().
  std::shared_ptr<const ViewPixels> photograph;
  // [N] textureGroups(): Gaussians of a group keep to one texture. Empty: each has its own.
  std::span<const std::uint32_t> texture_groups = {};
};

class TrainingEngine {
 public:
  virtual ~TrainingEngine() = default;
  // Whether the next steps with this view need not come with its photograph, which the engine keeps or takes from the
  // data set itself.
  virtual bool hasPhotograph(std::size_t /*view*/, bool /*background_varies*/) const { return false; }
  // Whether step() heeds texture_groups.
  virtual bool sharesTextures() const { return false; }
  // One iteration, which may still be under way at return. A state with min_sigma is drawn through the 3D filter. After
  // a loss that is not finite the state is not to be used. Throws Error(device).
  virtual void step(RunState& state, const StepInput& input) = 0;
  // The losses, in order, of the steps that it did not yet return: those that are known, or, waiting, all. Nothing
  // follows one that is not finite.
  virtual std::vector<LossValue> losses(RunState& state, bool wait) = 0;

  // Between steps: the functions of the same name, on training, statistics, min_sigma and densify_random of `state`.
  // relocateAndGrow() also starts the statistics anew.
  virtual DensifyResult densify(RunState& state, const DensifySettings& settings) = 0;
  virtual McmcResult relocateAndGrow(RunState& state, const McmcSettings& settings) = 0;
  virtual void resetOpacity(RunState& state) = 0;
  virtual void growShDegree(RunState& state, int degree) = 0;
  // minSigmas(). cameras: the same in every call.
  virtual void updateFilter(RunState& state, std::span<const Pinhole> cameras) = 0;

  // Whether splitWide() by `bound` may find one in `state`. eyes: the same in every call. Changes nothing.
  virtual bool mayHaveWide(RunState& /*state*/, std::span<const glm::dvec3> /*eyes*/, double /*bound*/) { return true; }

  // What step() would draw of `state` from `camera`: [height * width], not clamped. Changes nothing.
  virtual const std::vector<glm::vec3>& picture(RunState& state, const Camera& camera, glm::vec3 background) = 0;
  // How many Gaussians there are, whether or not `state` is up to date.
  virtual std::size_t gaussians(const RunState& state) const = 0;
  // Likewise of its textures.
  virtual std::size_t texels(const RunState& state) const { return state.training.model.atlas.texels.size(); }
  // Brings training, statistics and min_sigma of `state` up to date with what was done. Before, the arrays there are
  // old, their sizes included; the SH degree and densify_random are always right.
  virtual void pull(RunState& state) = 0;
  // `state` was changed by others after a pull.
  virtual void stateChanged() = 0;
};

// The engine that goes through a renderer's forward() and backward(); the renderer must outlive it.
std::unique_ptr<TrainingEngine> makeHostTrainingEngine(DifferentiableRenderer& renderer, float ssim_weight);

}  // namespace tg

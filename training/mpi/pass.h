// SPDX-License-Identifier: Apache-2.0
// A picture and its gradient over all ranks. Each projects its own Gaussians and sends the splats to the ranks whose
// rows of tiles they meet; a rank blends its rows, and sends the sums of pairs back to the splats' owners (after
// Grendel-GS, Zhao et al. 2024, arXiv 2406.18533). Sums are added in the order in which one process adds them, so that
// the number of ranks does not show in a bit.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/cpu/blend.h"
#include "render/cpu/project.h"
#include "render/cpu/tiles.h"
#include "training/cpu/pairs.h"
#include "training/data/photographs.h"
#include "training/mpi/channel.h"
#include "training/mpi/messages.h"
#include "training/step/gradient.h"
#include "training/step/loss.h"

namespace tg {

// Runs of rows of tiles, one a rank, top to bottom, of about the same cost each; costs: [rows of tiles]. Ranks that no
// row is left for have none.
std::vector<cpu::TileRows> shareRows(std::span<const std::uint64_t> costs, int ranks);

// All ranks call the same functions in the same order, each with its own Gaussians.
class ShardedPass {
 public:
  // texels_in_flight: as makeCpuDifferentiableRenderer() takes it.
  ShardedPass(Channel& channel, std::size_t texels_in_flight)
      : channel_(channel), texels_in_flight_(texels_in_flight) {}

  // part: this rank's Gaussians; it must stay as it is until the last call for this picture returned.
  void forward(const GaussianModel& part, const Camera& camera, const glm::vec3& background);
  // The picture as the first rank has it then: [height * width]. Elsewhere `picture` is emptied.
  void collect(std::vector<glm::vec3>& picture);
  // Compares the picture; `photograph` is what the rank `owner` compares it with, null elsewhere. The same value on all
  // ranks.
  LossValue compare(PhotometricLoss& loss, int owner, const ViewPixels* photograph);
  // The gradient of this rank's Gaussians, after compare().
  void backward(const GradientOptions& options, ModelGradient& gradient);

 private:
  // A splat's place in what was sent: numbers[begin + b] is its number among those sent to rank `first` + b.
  struct Reach {
    std::size_t begin = 0;
    int first = 0;
    int count = 0;
  };
  // What a rank has sent back of the splats that it was given.
  struct Returned {
    std::vector<std::uint32_t> begin;  // [splats sent + 1] into what follows
    std::vector<cpu::PairSums> sums;
    std::vector<float> screen_abs;
    std::vector<cpu::PairTextureSums> texture_sums;
    std::vector<cpu::TexelSlots::Range> written;
    std::vector<std::size_t> texels_begin;
    std::vector<glm::vec4> texels;
  };

  std::size_t ranks() const { return static_cast<std::size_t>(channel_.size()); }
  LossRows pixelRows(const cpu::TileRows& band) const;
  void shareTiles();
  void sendSplats();
  void receiveSplats(const std::vector<Message>& messages);
  // Whether no band above this rank's has pairs of the splat.
  bool beginsHere(const cpu::Splat& splat) const { return cpu::tileRowsOf(splat).first >= band_.first; }
  void keepTexels();
  Message sumsFor(std::size_t rank, const GradientOptions& options) const;
  Returned readSums(const Message& message, std::size_t splats, const GradientOptions& options) const;
  bool gather(std::uint32_t k, const std::vector<Returned>& returned, cpu::SplatSums& sums) const;
  void gatherTexels(const std::vector<Returned>& returned, ModelGradient& gradient) const;

  Channel& channel_;
  const std::size_t texels_in_flight_;
  const GaussianModel* part_ = nullptr;
  cpu::View view_;
  // Of this rank's Gaussians.
  std::vector<std::uint32_t> gaussians_;
  std::vector<cpu::DepthKey> keys_;
  cpu::ScreenSplats screen_;
  std::vector<Reach> reach_;                      // [splats]
  std::vector<std::uint32_t> numbers_;            // Reach
  std::vector<std::vector<std::uint32_t>> sent_;  // [ranks] positions in screen_.splats
  // Of this rank's rows of tiles; splats of all ranks, one rank's after the other's.
  std::vector<cpu::TileRows> bands_;  // [ranks]
  cpu::TileRows band_;
  std::vector<std::size_t> received_begin_;  // [ranks + 1]
  cpu::ScreenSplats received_;
  std::vector<glm::vec4> received_texels_;
  std::vector<cpu::DepthKey> received_keys_;
  std::vector<std::uint32_t> order_;
  cpu::TileLists lists_;
  cpu::BlendRecord record_;
  std::vector<glm::vec3> picture_;    // of the band
  std::vector<glm::vec3> v_picture_;  // of the band
  cpu::PairBuffers pairs_;
  // Of splats that begin here, the sums of their texels; of others, a pair's own.
  std::vector<glm::vec4> v_texels_;                     // as received_texels_
  std::vector<cpu::TexelSlots::Range> v_texels_range_;  // [received splats]
  std::vector<std::size_t> kept_begin_;                 // [pairs] into kept_texels_
  std::vector<cpu::TexelSlots::Range> kept_range_;      // [pairs]
  std::vector<glm::vec4> kept_texels_;
  std::vector<std::uint32_t> splat_of_;  // scratch
};

}  // namespace tg

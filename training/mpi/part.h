// SPDX-License-Identifier: Apache-2.0
// What one rank does in a training over several: its shard of the model, and its part in every step.
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "training/data/dataset.h"
#include "training/mpi/channel.h"
#include "training/mpi/pass.h"
#include "training/mpi/shards.h"
#include "training/step/engine.h"
#include "training/step/loss.h"

namespace tg {

// Which rank keeps a photograph in memory, and reads it for the others.
inline int photographOwner(std::size_t view, int ranks) {
  return static_cast<int>(view % static_cast<std::size_t>(ranks));
}

// All ranks call the same functions in the same order with the same arguments, but for those that are the first rank's
// alone, which are null elsewhere.
class Part {
 public:
  // Both outlive it. Of a data set the photographs that this rank owns are read.
  Part(Channel& channel, const Dataset& dataset);

  void scatter(RunState* whole);
  void gather(RunState* whole);
  // Of `input` no photograph.
  LossValue step(const StepInput& input, float ssim_weight);
  // picture: the first rank's.
  void draw(const Camera& camera, const glm::vec3& background, std::vector<glm::vec3>& picture);
  DensifyResult densify(const DensifySettings& settings, Random* random);
  McmcResult relocateAndGrow(const McmcSettings& settings, Random* random);
  void resetOpacity();
  void growShDegree(int degree);
  void updateFilter(std::span<const Pinhole> cameras);

  std::size_t gaussians() const { return shards_.total(); }
  std::size_t texels() const { return shards_.texels_begin.back(); }

 private:
  void move(std::span<const std::uint32_t> source, std::size_t kept);
  // This shard's number of a Gaussian, where it has it.
  std::optional<std::size_t> own(std::size_t gaussian) const;

  Channel& channel_;
  const Dataset& dataset_;
  Shards shards_;
  ShardState shard_;
  ShardedPass pass_;
  std::optional<PhotometricLoss> loss_;
  EffectiveParameters effective_;
  ModelGradient gradient_;
};

}  // namespace tg

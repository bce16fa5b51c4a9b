// SPDX-License-Identifier: Apache-2.0
// A model in training, cut by the index of its Gaussians: rank r has a run of them, and the next rank the next one. One
// after the other they are the model in its order.
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "training/mpi/channel.h"
#include "training/step/run_state.h"

namespace tg {

struct Shards {
  std::vector<std::size_t> begin{0};         // [ranks + 1] Gaussians
  std::vector<std::size_t> texels_begin{0};  // [ranks + 1] texels of the model's atlas

  static Shards even(std::size_t gaussians, int ranks);
  std::size_t total() const { return begin.back(); }
  std::size_t first(int rank) const { return begin[static_cast<std::size_t>(rank)]; }
  std::size_t count(int rank) const { return begin[static_cast<std::size_t>(rank) + 1] - first(rank); }
};

// What a rank has of a RunState: model and moments, min_sigma, statistics. All ranks call the functions below.
struct ShardState {
  TrainingState training;
  bool filtered = false;  // whether the model has min_sigma, also where this shard has no Gaussian
  std::vector<float> min_sigma;
  DensityStatistics statistics;
};

// From `whole` of the first rank, whose arrays are gone then but for the rectangles of textures: a copy of it all
// would be what the shards are to spare. Throws Error(badData) for textures whose texels do not lie in the Gaussians'
// order, without gaps.
void scatter(Channel& channel, RunState& whole, Shards& shards, ShardState& shard);
// Back into `whole` of the first rank; shards keep what they have.
void gather(Channel& channel, const Shards& shards, const ShardState& shard, RunState& whole);

// The arrays that scatter() takes away, where they are not needed any more.
void dropArrays(RunState& whole);

// One array of all Gaussians at the first rank, as long as it was elsewhere; part: the shard's, a value a Gaussian.
template <typename T>
void gatherValues(Channel& channel, const Shards& shards, std::span<const T> part, std::vector<T>& whole);
extern template void gatherValues(Channel&, const Shards&, std::span<const float>, std::vector<float>&);
extern template void gatherValues(Channel&, const Shards&, std::span<const std::uint32_t>, std::vector<std::uint32_t>&);
extern template void gatherValues(Channel&, const Shards&, std::span<const glm::vec3>, std::vector<glm::vec3>&);
extern template void gatherValues(Channel&, const Shards&, std::span<const glm::vec4>, std::vector<glm::vec4>&);

// selectGaussians() over all ranks: Gaussian i of the new model is a copy of the old Gaussian source[i], and the first
// `kept` take their moments along. `source` is the same everywhere. Shards are even again; statistics start anew, and
// the filter is to be updated. For models without textures.
void selectGaussians(Channel& channel, std::span<const std::uint32_t> source, std::size_t kept, Shards& shards,
                     ShardState& shard);

}  // namespace tg

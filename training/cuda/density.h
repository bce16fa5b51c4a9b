// SPDX-License-Identifier: Apache-2.0
// What changes the set of Gaussians, and the 3D filter, with everything on the device: the twins of densify.h, mcmc.h,
// filter_3d.h and of optimizer.h's changes of size. Counts alone come back.
#pragma once
#include "training/cuda/state.h"
#include "training/step/density_math.h"

namespace tg::cuda {

struct DensityScratch {
  Primitives primitives;
  Buffer<std::uint32_t> keep, grow, split;                  // [N + 1] flags, 0 behind the last
  Buffer<std::uint32_t> keep_rank, grow_rank, split_rank;   // [N + 1] their exclusive sums
  Buffer<std::uint32_t> keys, sorted_keys, indices, order;  // [N]
  Buffer<float> scores, magnitudes;                         // [N]
  Buffer<std::uint32_t> source;                             // [new N] the old Gaussian that each is a copy of
  Buffer<std::uint64_t> weights, cumulative;                // [N + 1]
  Buffer<std::uint32_t> copies;                             // [N] how many more than one come from a Gaussian
  Buffer<std::uint32_t> counter;                            // [1] how many scores reach 1
};

// The statistics are zero afterwards, of the new size.
DensifyResult densify(DeviceState& state, const DensifySettings& settings, Random& random, DensityScratch& scratch);
// Draws from sums of integers, in units of 2^-63 or so of the count, where the CPU adds up doubles: on an edge between
// two Gaussians a draw may take the other one.
McmcResult relocateAndGrow(DeviceState& state, const McmcSettings& settings, Random& random, DensityScratch& scratch);
void resetOpacity(DeviceState& state);
void growShDegree(DeviceState& state, int degree);
// minSigmas(). cameras: on the device. largest: scratch.
void updateFilter(DeviceState& state, const Buffer<Pinhole>& cameras, Buffer<std::uint32_t>& largest);
// Whether a sigma is larger than `bound` times the distance to the nearest of the eyes, or a billionth short of it: the
// host's exponential, by which splitWide() decides, has other last bits. eyes, found: on the device, the latter
// scratch.
bool mayHaveWide(const Parameters& model, const Buffer<glm::dvec3>& eyes, double bound, Buffer<std::uint32_t>& found);

}  // namespace tg::cuda

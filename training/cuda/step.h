// SPDX-License-Identifier: Apache-2.0
// What happens to a picture and to gradients in a training step: loss, 3D filter, regularisers, Adam, noise,
// statistics. The formulas are those of training/step/step_math.h.
#pragma once
#include "training/cuda/memory.h"
#include "training/cuda/types.h"
#include "training/step/step_math.h"

namespace tg::cuda {

struct LossInput {
  int width, height;
  float ssim_weight;
  double counted;              // values that count: 3 for each pixel that the mask leaves
  const float* picture;        // [height, width, 3]
  const std::uint8_t* target;  // [height, width, 3]
  const std::uint8_t* mask;    // [height, width], 0: ignored; null: all count
};
struct LossBuffers {
  Buffer<float> derivatives;  // [3, 3, height, width] dSSIM/d mean, variance, covariance of each window
  Buffer<double> block_sums;  // [blocks, 3]
  Buffer<double> sums;        // [3] of |x - y|, SSIM and squared clamped difference
};
// v_picture: [height, width, 3], dL/d(picture). The sums stay on the device.
void evaluateLoss(const LossInput& input, LossBuffers& buffers, float* v_picture);

// What an iteration leaves for the host to read later.
struct StepRecord {
  double sums[3];         // LossBuffers::sums
  PairCount pairs;        // (tile, splat) pairs of its picture
  std::uint64_t applied;  // 1: parameters, moments and statistics have moved; as wide as no padding leaves unwritten
};
struct VerdictInput {
  const double* sums;
  const PairCount* pairs;
  std::size_t room;  // of the frame
  std::uint32_t* stop;
  StepRecord* record;
};
// Sets `stop` where the pairs had no room or the loss is not finite. From then on what has `stop` below changes
// nothing, in this step and all that follow, until the host clears it. A null `stop` never stops.
void judgeStep(const VerdictInput& input);

// What the 3D filter draws: log_scale [N, 3], opacity_logit [N].
void applyFilter(const Parameters& model, const float* min_sigma, float* log_scale, float* opacity_logit);

struct ChainInput {
  Parameters model;
  const float* min_sigma;  // null: no 3D filter
  bool mcmc;
  double opacity_weight, scale_weight;  // over the number of Gaussians
  const std::uint32_t* stop = nullptr;  // set: the gradient may hold nothing
};
// From gradients with respect to what was drawn to those of what is stored, with the regularisers', in place.
void chainGradients(const ChainInput& input, const Parameters& gradient);

// Adam's moments of one parameter.
struct DeviceMoments {
  Buffer<float> first, second;
};
struct AdamInput {
  float* value;
  const float* gradient;
  const DeviceMoments& moments;
  std::size_t count;  // [floats]
  unsigned row;       // floats of a row; the first `leading` have the first rate, the others the second
  unsigned leading;
  float first_rate, rate;
  AdamScales scales;
  const std::uint32_t* stop = nullptr;
  std::size_t first = 0;  // of the moments: where value's and gradient's are
};
void adamStep(const AdamInput& input);

void addNoise(const Parameters& model, float strength, std::uint64_t seed, int iteration,
              const std::uint32_t* stop = nullptr);

struct DeviceStatistics {
  Buffer<float> score_sum, magnitude_sum, max_radius;
  Buffer<std::uint32_t> view_count;
};
// DensityStatistics::add. All [N].
void addStatistics(const float* screen_gradient, const float* screen_gradient_abs, const float* screen_radius,
                   std::size_t count, const DeviceStatistics& statistics, const std::uint32_t* stop = nullptr);

}  // namespace tg::cuda

// SPDX-License-Identifier: Apache-2.0
// From gradients to moved parameters: one thread a Gaussian, or a float for Adam, whose traffic is the cost.
#include "training/cuda/geometry.h"
#include "training/cuda/step.h"

namespace tg::cuda {
namespace {

TG_KERNEL filterKernel(Parameters model, const float* min_sigma, float* log_scale, float* opacity_logit) {
  const std::size_t i = itemIndex();
  if (i >= model.count) return;
  const EffectiveGaussian effective = effectiveGaussian(readLogScale(model, i), model.opacity_logit[i], min_sigma[i]);
  writeVector(log_scale, i, effective.log_scale);
  opacity_logit[i] = effective.opacity_logit;
}

TG_KERNEL chainKernel(ChainInput in, Parameters gradient) {
  const std::size_t i = itemIndex();
  if (i >= in.model.count || stopped(in.stop)) return;
  const glm::vec3 log_scale = readLogScale(in.model, i);
  const float logit = in.model.opacity_logit[i];
  glm::vec3 v_log_scale = readVector(gradient.log_scale, i);
  float v_logit = gradient.opacity_logit[i];
  if (in.min_sigma != nullptr) filterGradientOf(log_scale, logit, in.min_sigma[i], v_log_scale, v_logit);
  if (in.mcmc) addRegularizerGradientOf(log_scale, logit, in.opacity_weight, in.scale_weight, v_log_scale, v_logit);
  writeVector(gradient.log_scale, i, v_log_scale);
  gradient.opacity_logit[i] = v_logit;
}

struct AdamArguments {
  float* value;
  const float* gradient;
  float* first;
  float* second;
  std::size_t count;
  unsigned row, leading;
  float first_rate, rate;
  AdamScales scales;
  const std::uint32_t* stop;
};
TG_KERNEL adamKernel(AdamArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.count || stopped(a.stop)) return;
  const float rate = i % a.row < a.leading ? a.first_rate : a.rate;
  adamUpdate(a.value[i], a.gradient[i], a.first[i], a.second[i], rate, a.scales);
}

TG_KERNEL noiseKernel(Parameters model, float strength, std::uint64_t seed, int iteration, const std::uint32_t* stop) {
  const std::size_t i = itemIndex();
  if (i >= model.count || stopped(stop)) return;
  const glm::vec3 noise = explorationNoise(glm::vec4(readRotation(model, i)), readLogScale(model, i),
                                           model.opacity_logit[i], strength, seed, iteration, i);
  for (int k = 0; k < 3; ++k) model.mean[3 * i + k] += noise[k];
}

struct StatisticsArguments {
  const float* screen_gradient;
  const float* screen_gradient_abs;
  const float* screen_radius;
  std::size_t count;
  float* score_sum;
  float* magnitude_sum;
  float* max_radius;
  std::uint32_t* view_count;
  const std::uint32_t* stop;
};
TG_KERNEL statisticsKernel(StatisticsArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.count || stopped(a.stop) || !(a.screen_radius[i] > 0.0f)) return;
  a.score_sum[i] += a.screen_gradient[i];
  a.magnitude_sum[i] += a.screen_gradient_abs[i];
  a.max_radius[i] = max(a.max_radius[i], a.screen_radius[i]);
  ++a.view_count[i];
}

// One thread.
TG_KERNEL verdictKernel(VerdictInput in) {
  if (itemIndex() != 0) return;
  StepRecord record;
  double sum = 0;
  for (int k = 0; k < 3; ++k) sum += record.sums[k] = in.sums[k];
  record.pairs = *in.pairs;
  // An infinity or what is no number, however it came about, is not below.
  if (record.pairs > in.room || !(::fabs(sum) < 1e300)) *in.stop = 1;
  record.applied = *in.stop == 0;
  *in.record = record;
}

}  // namespace

void judgeStep(const VerdictInput& input) { launch("verdict", verdictKernel, 1, input); }

void applyFilter(const Parameters& model, const float* min_sigma, float* log_scale, float* opacity_logit) {
  launch("3D filter", filterKernel, blocksFor(model.count), model, min_sigma, log_scale, opacity_logit);
}

void chainGradients(const ChainInput& input, const Parameters& gradient) {
  if (input.min_sigma == nullptr && !input.mcmc) return;
  launch("chain", chainKernel, blocksFor(input.model.count), input, gradient);
}

void adamStep(const AdamInput& input) {
  launch("Adam", adamKernel, blocksFor(input.count),
         AdamArguments{input.value, input.gradient, input.moments.first.data() + input.first,
                       input.moments.second.data() + input.first, input.count, input.row, input.leading,
                       input.first_rate, input.rate, input.scales, input.stop});
}

void addNoise(const Parameters& model, float strength, std::uint64_t seed, int iteration, const std::uint32_t* stop) {
  launch("noise", noiseKernel, blocksFor(model.count), model, strength, seed, iteration, stop);
}

void addStatistics(const float* screen_gradient, const float* screen_gradient_abs, const float* screen_radius,
                   std::size_t count, const DeviceStatistics& statistics, const std::uint32_t* stop) {
  launch("statistics", statisticsKernel, blocksFor(count),
         StatisticsArguments{screen_gradient, screen_gradient_abs, screen_radius, count, statistics.score_sum.data(),
                             statistics.magnitude_sum.data(), statistics.max_radius.data(),
                             statistics.view_count.data(), stop});
}

}  // namespace tg::cuda

// SPDX-License-Identifier: Apache-2.0
// Draws from a prefix sum of opacities; then one pass rebuilds parameters and moments.
#include "training/mcmc.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/parallel.h"
#include "training/step_math.h"

namespace tg {
namespace {

constexpr int kMostShared = 51;  // the paper's implementation; binomials stay exact in double
constexpr std::int64_t kGrain = 1024;

// Index drawn with probability proportional to the steps of `cumulative`.
std::uint32_t draw(const std::vector<double>& cumulative, Random& random) {
  const double at = std::min(random.uniform() * cumulative.back(), std::nextafter(cumulative.back(), 0.0));
  const auto found = std::upper_bound(cumulative.begin(), cumulative.end(), at);
  return static_cast<std::uint32_t>(
      std::min<std::ptrdiff_t>(found - cumulative.begin(), static_cast<std::ptrdiff_t>(cumulative.size()) - 1));
}

}  // namespace

SharedGaussian shareGaussian(float opacity, int count) {
  count = std::clamp(count, 1, kMostShared);
  const double o = std::clamp(static_cast<double>(opacity), 1e-6, 1 - 1e-6);
  const double shared = 1 - std::pow(1 - o, 1.0 / count);
  // The integral along a line through the centre of the sum of the blended shares, over one share's own.
  double denominator = 0;
  std::array<double, kMostShared> binomial{};  // row i - 1 of Pascal's triangle
  for (int i = 1; i <= count; i++) {
    for (int k = i - 1; k > 0; k--) binomial[k] = k == i - 1 ? 1 : binomial[k] + binomial[k - 1];
    binomial[0] = 1;
    double power = shared;
    for (int k = 0; k < i; k++) {
      denominator += binomial[k] * (k % 2 == 0 ? 1 : -1) * power / std::sqrt(k + 1.0);
      power *= shared;
    }
  }
  return {static_cast<float>(shared), static_cast<float>(o / denominator)};
}

McmcResult relocateAndGrow(TrainingState& state, const McmcSettings& settings, Random& random) {
  const GaussianModel& model = state.model;
  const std::size_t count = model.size();
  std::vector<double> cumulative(count);
  std::vector<std::uint32_t> dead;
  double sum = 0;
  for (std::size_t i = 0; i < count; i++) {
    const double opacity = sigmoid(model.opacity_logit[i]);
    if (opacity <= settings.dead_opacity) {
      dead.push_back(static_cast<std::uint32_t>(i));
    } else {
      sum += opacity;
    }
    cumulative[i] = sum;
  }
  McmcResult result;
  if (sum <= 0) return result;

  std::vector<std::uint32_t> source(count);
  std::iota(source.begin(), source.end(), 0u);
  std::vector<int> copies(count, 1);
  for (const std::uint32_t i : dead) {
    source[i] = draw(cumulative, random);
    copies[source[i]]++;
  }
  result.relocated = dead.size();
  const auto step = static_cast<std::size_t>(std::ceil(static_cast<double>(count) * double{settings.growth} - 1e-3));
  const std::size_t target = std::max(count, std::min(settings.max_gaussians, count + step));
  while (source.size() < target) {
    source.push_back(draw(cumulative, random));
    copies[source.back()]++;
  }
  result.added = target - count;

  selectGaussians(state, source, count);
  for (std::size_t i = 0; i < source.size(); i++) {
    const int shared = copies[source[i]];
    if (shared == 1) continue;
    const SharedGaussian share = shareGaussian(static_cast<float>(sigmoid(state.model.opacity_logit[i])), shared);
    const float opacity = std::clamp(share.opacity, settings.dead_opacity, 1 - 1e-6f);
    state.model.opacity_logit[i] = std::log(opacity / (1 - opacity));
    state.model.log_scale[i] += std::log(share.scale);
    clearMoments(state, i);
  }
  return result;
}

void addExplorationNoise(GaussianModel& model, float strength, std::uint64_t seed, int iteration) {
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    model.mean[i] += explorationNoise(model.rotation[i], model.log_scale[i], model.opacity_logit[i], strength, seed,
                                      iteration, static_cast<std::uint64_t>(i));
  });
}

void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight,
                            ModelGradient& gradient) {
  const auto count = static_cast<double>(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), kGrain, [&](std::int64_t i) {
    addRegularizerGradientOf(model.log_scale[i], model.opacity_logit[i], opacity_weight / count, scale_weight / count,
                             gradient.v_log_scale[i], gradient.v_opacity_logit[i]);
  });
}

}  // namespace tg

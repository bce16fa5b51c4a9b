// SPDX-License-Identifier: Apache-2.0
// Draws from a prefix sum of opacities; then one pass rebuilds parameters and moments.
#include "training/step/mcmc.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "training/step/step_math.h"

namespace tg {
namespace {

// Index drawn with probability proportional to the steps of `cumulative`.
std::uint32_t draw(const std::vector<double>& cumulative, Random& random) {
  const double at = std::min(random.uniform() * cumulative.back(), std::nextafter(cumulative.back(), 0.0));
  const auto found = std::upper_bound(cumulative.begin(), cumulative.end(), at);
  return static_cast<std::uint32_t>(
      std::min<std::ptrdiff_t>(found - cumulative.begin(), static_cast<std::ptrdiff_t>(cumulative.size()) - 1));
}

}  // namespace

McmcResult relocateAndGrow(TrainingState& state, const McmcSettings& settings, Random& random) {
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  TG_ASSERT(state.model.atlas.rects.empty(), "stage 1 has no textures");
  const GaussianModel& model = state.model;
  const std::size_t count = model.size();
  std::vector<double> cumulative(count);
  std::vector<std::uint32_t> dead;
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
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
    ++copies[source[i]];
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
  for (std::size_t i = 0; i < source.size(); ++i) {
    const int shared = copies[source[i]];
    if (shared == 1) continue;
    shareParameters(shared, settings.dead_opacity, state.model.opacity_logit[i], state.model.log_scale[i]);
    clearMoments(state, i);
  }
  return result;
}

void addExplorationNoise(GaussianModel& model, float strength, std::uint64_t seed, int iteration) {
  TG_ASSERT(iteration >= 1, "iterations count from 1");
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    model.mean[i] += explorationNoise(model.rotation[i], model.log_scale[i], model.opacity_logit[i], strength, seed,
                                      iteration, static_cast<std::uint64_t>(i));
  });
}

void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight,
                            ModelGradient& gradient) {
  TG_ASSERT(gradient.log_scale.size() == model.size() && gradient.opacity_logit.size() == model.size(),
            "the gradient has the model's size");
  const auto count = static_cast<double>(model.size());
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    addRegularizerGradientOf(model.log_scale[i], model.opacity_logit[i], opacity_weight / count, scale_weight / count,
                             gradient.log_scale[i], gradient.opacity_logit[i]);
  });
}

}  // namespace tg

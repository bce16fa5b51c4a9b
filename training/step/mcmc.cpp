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

McmcPlan planRelocation(std::span<const float> opacity_logit, const McmcSettings& settings, Random& random) {
  const std::size_t count = opacity_logit.size();
  std::vector<double> cumulative(count);
  std::vector<std::uint32_t> dead;
  double sum = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const double opacity = sigmoid(opacity_logit[i]);
    if (opacity <= settings.dead_opacity) {
      dead.push_back(static_cast<std::uint32_t>(i));
    } else {
      sum += opacity;
    }
    cumulative[i] = sum;
  }
  McmcPlan plan;
  if (sum <= 0) return plan;

  std::vector<std::uint32_t>& source = plan.source;
  source.resize(count);
  std::iota(source.begin(), source.end(), 0u);
  plan.copies.assign(count, 1);
  for (const std::uint32_t i : dead) {
    source[i] = draw(cumulative, random);
    ++plan.copies[source[i]];
  }
  plan.result.relocated = dead.size();
  const auto step = static_cast<std::size_t>(std::ceil(static_cast<double>(count) * double{settings.growth} - 1e-3));
  const std::size_t target = std::max(count, std::min(settings.max_gaussians, count + step));
  while (source.size() < target) {
    source.push_back(draw(cumulative, random));
    ++plan.copies[source.back()];
  }
  plan.result.added = target - count;
  return plan;
}

void shareGaussian(TrainingState& state, std::size_t i, int shared, const McmcSettings& settings) {
  if (shared == 1) return;
  shareParameters(shared, settings.dead_opacity, state.model.opacity_logit[i], state.model.log_scale[i]);
  clearMoments(state, i);
}

McmcResult relocateAndGrow(TrainingState& state, const McmcSettings& settings, Random& random) {
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  TG_ASSERT(state.model.atlas.rects.empty(), "stage 1 has no textures");
  const McmcPlan plan = planRelocation(state.model.opacity_logit, settings, random);
  if (plan.source.empty()) return plan.result;
  selectGaussians(state, plan.source, state.model.size());
  for (std::size_t i = 0; i < plan.source.size(); ++i) shareGaussian(state, i, plan.copies[plan.source[i]], settings);
  return plan.result;
}

void addExplorationNoise(GaussianModel& model, float strength, std::uint64_t seed, int iteration, std::uint64_t first) {
  TG_ASSERT(iteration >= 1, "iterations count from 1");
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    model.mean[i] += explorationNoise(model.rotation[i], model.log_scale[i], model.opacity_logit[i], strength, seed,
                                      iteration, first + static_cast<std::uint64_t>(i));
  });
}

void addRegularizerGradient(const GaussianModel& model, float opacity_weight, float scale_weight, std::size_t count,
                            ModelGradient& gradient) {
  TG_ASSERT(gradient.log_scale.size() == model.size() && gradient.opacity_logit.size() == model.size(),
            "the gradient has the model's size");
  const auto number = static_cast<double>(count);
  parallelFor(static_cast<std::int64_t>(model.size()), kGaussiansPerTask, [&](std::int64_t i) {
    addRegularizerGradientOf(model.log_scale[i], model.opacity_logit[i], opacity_weight / number, scale_weight / number,
                             gradient.log_scale[i], gradient.opacity_logit[i]);
  });
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Decides from statistics, then rebuilds parameters and moments in one pass.
#include "training/step/densify.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "core/system/assert.h"

namespace tg {
namespace {

// Scores of 1 and more densify: the mean gradient over its threshold, the mean magnitude over its quantile.
std::vector<float> densificationScores(const DensityStatistics& statistics, const DensifySettings& settings) {
  const std::size_t count = statistics.score_sum.size();
  std::vector<float> scores(count, 0.0f);
  std::size_t passing = 0;
  for (std::size_t i = 0; i < count; ++i) {
    scores[i] = meanOverViews(statistics.score_sum[i], statistics.view_count[i]) / settings.score_threshold;
    passing += scores[i] >= 1;
  }
  if (settings.score == DensifyScore::sum) return scores;
  std::vector<float> magnitudes(count, 0.0f);
  for (std::size_t i = 0; i < count; ++i) {
    magnitudes[i] = meanOverViews(statistics.magnitude_sum[i], statistics.view_count[i]);
  }
  float quantile = 0;
  if (passing > 0) {
    std::vector<float> sorted = magnitudes;
    const auto at = sorted.begin() + static_cast<std::ptrdiff_t>(passing - 1);
    std::nth_element(sorted.begin(), at, sorted.end(), std::greater<>());
    quantile = *at;
  }
  for (std::size_t i = 0; i < count; ++i) {
    scores[i] = growthScore(scores[i], magnitudes[i], quantile, settings.score);
  }
  return scores;
}

}  // namespace

void DensityStatistics::reset(std::size_t count) {
  score_sum.assign(count, 0.0f);
  magnitude_sum.assign(count, 0.0f);
  view_count.assign(count, 0u);
  max_radius.assign(count, 0.0f);
}

void DensityStatistics::select(std::span<const std::uint32_t> kept) {
  const auto pick = [&](auto& values) {
    for (std::size_t i = 0; i < kept.size(); ++i) values[i] = values[kept[i]];
    values.resize(kept.size());
  };
  TG_ASSERT(std::ranges::is_sorted(kept), "indices ascend");
  pick(score_sum);
  pick(magnitude_sum);
  pick(view_count);
  pick(max_radius);
}

void DensityStatistics::grow(std::size_t count) {
  TG_ASSERT(count >= score_sum.size(), "none goes");
  score_sum.resize(count);
  magnitude_sum.resize(count);
  view_count.resize(count);
  max_radius.resize(count);
}

void DensityStatistics::add(const ModelGradient& gradient) {
  TG_ASSERT(gradient.screen_gradient.size() == score_sum.size() &&
                gradient.screen_gradient_abs.size() == score_sum.size() &&
                gradient.screen_radius.size() == score_sum.size(),
            "the gradient is of the model that is counted");
  for (std::size_t i = 0; i < score_sum.size(); ++i) {
    if (gradient.screen_radius[i] <= 0) continue;
    score_sum[i] += gradient.screen_gradient[i];
    magnitude_sum[i] += gradient.screen_gradient_abs[i];
    ++view_count[i];
    max_radius[i] = std::max(max_radius[i], gradient.screen_radius[i]);
  }
}

DensifyPlan planDensification(const GaussianModel& model, const DensityStatistics& statistics,
                              const DensifySettings& settings, Random& random) {
  TG_ASSERT(statistics.score_sum.size() == model.size() && statistics.magnitude_sum.size() == model.size(),
            "statistics are of the model");
  TG_ASSERT(statistics.view_count.size() == model.size() && statistics.max_radius.size() == model.size(),
            "statistics are of the model");
  TG_ASSERT(model.atlas.rects.empty(), "stage 1 has no textures");
  struct Candidate {
    std::uint32_t gaussian;
    float score;
  };
  const std::vector<float> scores = densificationScores(statistics, settings);
  DensifyPlan plan;
  std::vector<std::uint32_t>& source = plan.source;
  std::vector<Candidate> candidates;
  for (std::uint32_t i = 0; i < model.size(); ++i) {
    const bool grows = scores[i] >= 1;
    if (prunable(model.opacity_logit[i], model.log_scale[i], statistics.max_radius[i], grows, settings)) continue;
    source.push_back(i);
    if (grows) candidates.push_back({i, scores[i]});
  }
  plan.result.pruned = model.size() - source.size();
  const std::size_t kept = plan.kept = source.size();

  // Every clone and every split adds one Gaussian: the cap leaves room for the highest scores.
  if (settings.max_gaussians > 0) {
    const std::size_t room = settings.max_gaussians > kept ? settings.max_gaussians - kept : 0;
    if (candidates.size() > room) {
      std::stable_sort(candidates.begin(), candidates.end(),
                       [](const Candidate& a, const Candidate& b) { return a.score > b.score; });
      candidates.resize(room);
      std::sort(candidates.begin(), candidates.end(),
                [](const Candidate& a, const Candidate& b) { return a.gaussian < b.gaussian; });
    }
  }

  for (const Candidate& candidate : candidates) {
    const std::size_t added = source.size();
    source.push_back(candidate.gaussian);
    if (clonable(model.log_scale[candidate.gaussian], settings)) {
      ++plan.result.cloned;
      continue;
    }
    ++plan.result.split;
    const auto place = static_cast<std::size_t>(
        std::lower_bound(source.begin(), source.begin() + static_cast<std::ptrdiff_t>(kept), candidate.gaussian) -
        source.begin());
    const glm::vec3 log_scale = model.log_scale[candidate.gaussian] - std::log(settings.split_shrink);
    for (std::size_t index : {place, added}) {
      const glm::vec3 mean = sampleGaussian(model.mean[candidate.gaussian], model.rotation[candidate.gaussian],
                                            model.log_scale[candidate.gaussian], random);
      plan.children.push_back({index, mean, log_scale});
    }
    plan.fresh.push_back(place);
  }
  return plan;
}

DensifyResult densify(TrainingState& state, DensityStatistics& statistics, const DensifySettings& settings,
                      Random& random) {
  const DensifyPlan plan = planDensification(state.model, statistics, settings, random);
  selectGaussians(state, plan.source, plan.kept);
  for (const DensifyPlan::Child& child : plan.children) {
    state.model.mean[child.index] = child.mean;
    state.model.log_scale[child.index] = child.log_scale;
  }
  for (std::size_t place : plan.fresh) clearMoments(state, place);
  statistics.reset(state.model.size());
  return plan.result;
}

void resetOpacity(TrainingState& state) {
  TG_ASSERT(momentsAgree(state), "moments have the model's size");
  const float limit = std::log(kResetOpacity / (1 - kResetOpacity));
  for (float& logit : state.model.opacity_logit) logit = std::min(logit, limit);
  std::fill(state.moments.opacity_logit.first.begin(), state.moments.opacity_logit.first.end(), 0.0f);
  std::fill(state.moments.opacity_logit.second.begin(), state.moments.opacity_logit.second.end(), 0.0f);
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// A model made for somebody else's viewer.
#include "converter/edit/adapt.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "converter/edit/quality.h"
#include "converter/edit/viewer_fit.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/model/views.h"
#include "core/model/wide_splats.h"
#include "render/affine/affine_picture.h"
#include "render/contribution.h"

namespace tg {
namespace {

constexpr std::size_t kFitViews = 32, kHeldViews = 6, kChoiceViews = 6;
constexpr int kFitSide = 256, kHeldSide = 512;  // [px]
constexpr int kFitSteps = 288;
constexpr std::size_t kHeldEvery = 6;  // view, where no test views are there
constexpr double kWideSigma = 0.3;     // of the distance to the nearest camera
// Skirts: of viewers that cut nearer than this [sigma], so many for a Gaussian, so much wider and fainter at the start.
constexpr float kSkirtsBelow = 2.5f;
constexpr double kSkirts = 0.25;
constexpr float kSkirtWidth = 1.4f;
constexpr double kSkirtOpacity = 0.1;
// What is no shell of its own: so much of the Gaussians, those nearest to the cameras' middle, and what is within the
// cameras' reach, times this.
constexpr double kInnerPart = 0.9, kBeyondCameras = 1.05;
constexpr float kInvisible = static_cast<float>(-kLogitLimit);

// Some to fit, others to judge by.
void shareViews(const Bundle& source, std::vector<Camera>& fit, std::vector<Camera>& held) {
  for (const Camera& camera : source.cameras) (camera.test ? held : fit).push_back(camera);
  if (fit.empty() || held.empty()) {
    fit = held = {};
    const std::vector<Camera> all =
        source.cameras.size() > 1 ? source.cameras : contributionViews(source.model, source.cameras);
    for (std::size_t k = 0; k < all.size(); ++k) (k % kHeldEvery == kHeldEvery / 2 ? held : fit).push_back(all[k]);
    if (held.empty()) {  // of few the last, which is fitted, too, only where it is alone
      held.push_back(all.back());
      if (fit.size() > 1) fit.pop_back();
    }
  }
  fit = evenly(fit, kFitViews);
  held = evenly(held, kHeldViews);
}

// The base with pieces behind it for what is wide. It stays where it is, out of sight, or goes.
GaussianModel inPieces(const GaussianModel& base, const WidePieces& split, bool keep) {
  GaussianModel result = base;
  if (keep) {
    for (const std::uint32_t i : split.wide) result.opacity_logit[i] = kInvisible;
  } else {
    std::vector<std::uint32_t> rest;
    for (std::uint32_t i = 0; i < base.size(); ++i) {
      if (!std::ranges::binary_search(split.wide, i)) rest.push_back(i);
    }
    result = select(base, rest);
  }
  append(result, split.pieces);
  return result;
}

// What there is of the base before it is fitted.
struct Start {
  GaussianModel base;
  std::vector<std::uint8_t> fixed = {};  // [N] not 0: rotation and place are those of readers with textures, too
  std::vector<std::size_t> parts = {};   // as keepSplats has them
  std::size_t wide = 0, pieces = 0, skirts = 0;
  std::vector<std::uint32_t> order = {};  // Gaussian i here is order[i] of the source's and of what was put behind them
};

double shownPsnr(const Start& start, SplatViewer viewer, const FitViews& views) {
  return viewerPsnr(start.base, viewer, views, start.parts);
}

// With or without pieces: what looks better in the viewer before anything is fitted.
Start bestStart(SplatViewer viewer, const Start& untouched, std::span<const Camera> cameras, const FitViews& views,
                bool keep) {
  std::vector<glm::dvec3> eyes;
  for (const Camera& camera : cameras) eyes.push_back(camera.position());
  const WidePieces split = splitWide(untouched.base, eyes, {.bound = kWideSigma});
  if (split.wide.empty()) return untouched;
  Start trial{.base = inPieces(untouched.base, split, keep), .fixed = untouched.fixed};
  trial.wide = split.wide.size();
  trial.pieces = split.pieces.size();
  return shownPsnr(trial, viewer, views) > shownPsnr(untouched, viewer, views) ? trial : untouched;
}

// A second Gaussian, wider and faint, around those that pictures show most.
void addSkirts(Start& start, std::size_t count, std::span<const Camera> views) {
  const std::vector<double> weights = blendWeights(start.base, views, nearOf(start.base, views));
  std::vector<std::uint32_t> shown(start.base.size());
  std::iota(shown.begin(), shown.end(), 0u);
  std::ranges::stable_sort(shown, [&](std::uint32_t a, std::uint32_t b) { return weights[a] > weights[b]; });
  shown.resize(std::min(shown.size(), count));
  std::erase_if(shown, [&](std::uint32_t i) { return !(weights[i] > 0); });
  GaussianModel skirts = select(start.base, shown);
  for (std::size_t k = 0; k < skirts.size(); ++k) {
    skirts.log_scale[k] += std::log(kSkirtWidth);
    skirts.opacity_logit[k] = logitFromOpacity(kSkirtOpacity * opacityOf(skirts, k));
  }
  append(start.base, skirts);
  start.skirts = skirts.size();
}

// A viewer that sorts in bins over a sphere around a primitive's splats has finer ones where what is far beyond the
// cameras is a primitive of its own. It is drawn first: from inside of the sphere that parts them it is behind the
// rest.
Start inShells(Start start, std::span<const Camera> cameras) {
  glm::dvec3 center(0.0);
  for (const Camera& camera : cameras) center += camera.position() / static_cast<double>(cameras.size());
  double reach = 0;
  for (const Camera& camera : cameras) reach = std::max(reach, glm::distance(center, camera.position()));
  std::vector<double> distances;
  for (const glm::vec3& mean : start.base.mean) distances.push_back(glm::distance(center, glm::dvec3(mean)));
  std::vector<double> sorted = distances;
  const auto inner = sorted.begin() + static_cast<std::ptrdiff_t>(kInnerPart * static_cast<double>(sorted.size() - 1));
  std::ranges::nth_element(sorted, inner);
  const double radius = std::max(*inner, kBeyondCameras * reach);
  std::vector<std::uint32_t> order(start.base.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto far_end = std::ranges::stable_partition(order, [&](std::uint32_t i) { return distances[i] > radius; });
  const auto far = static_cast<std::size_t>(far_end.begin() - order.begin());
  if (far == 0 || far == order.size()) return start;
  start.base = select(start.base, order);
  start.fixed.resize(order.size(), 0);
  start.fixed = gathered(start.fixed, 1, order, order.size());
  start.parts = {far};
  start.order = std::move(order);
  return start;
}

// The source with what its base has beside its own Gaussians, invisible. `order`: as a Start's.
GaussianModel withAdded(const GaussianModel& source, const GaussianModel& base, std::span<const std::uint32_t> order) {
  std::vector<std::uint32_t> added;
  for (std::uint32_t i = 0; i < order.size(); ++i) {
    if (order[i] >= source.size()) added.push_back(i);
  }
  GaussianModel extra = select(base, added);
  std::fill(extra.opacity_logit.begin(), extra.opacity_logit.end(), kInvisible);
  GaussianModel all = source;
  append(all, extra);
  // Of the added ones the k-th that comes is the k-th behind the source's.
  std::vector<std::uint32_t> from(order.begin(), order.end());
  auto next = static_cast<std::uint32_t>(source.size());
  for (const std::uint32_t i : added) from[i] = next++;
  return select(all, from);
}

}  // namespace

Adapted adaptTo(SplatViewer viewer, const Bundle& source, bool as_gltf, FitAim aim, const ConvertListener& listener) {
  const bool keep = as_gltf && isTextured(source.model);
  const std::size_t own = source.model.size();
  const GaussianModel base = bakeFallback(source.model, FallbackScale::kept);
  const GaussianModel& aimed = aim == FitAim::base ? base : source.model;
  std::vector<Camera> fit_cameras, held_cameras;
  shareViews(source, fit_cameras, held_cameras);
  const FitViews held = fitViews(aimed, held_cameras, source.background, kHeldSide);
  const FitViews other =
      fitViews(aim == FitAim::base ? source.model : base, held_cameras, source.background, kHeldSide);
  const FitViews choice = fitViews(aimed, evenly(fit_cameras, kChoiceViews), source.background, kFitSide);
  const ViewerProfile& profile = profileOf(viewer);
  Adapted adapted;
  AdaptReport& report = adapted.report;
  report.viewer = viewer;
  report.fit_views = fit_cameras.size();
  report.held_views = held_cameras.size();

  const Start untouched{.base = base, .fixed = std::vector<std::uint8_t>(keep ? own : 0, 1)};
  const double before = shownPsnr(untouched, viewer, held);
  Start start = bestStart(viewer, untouched, source.cameras, choice, keep);
  Start fitted = start;
  if (profile.cut < kSkirtsBelow) {
    const auto count = static_cast<std::size_t>(kSkirts * static_cast<double>(own));
    addSkirts(fitted, count, contributionViews(base, fit_cameras));
  }
  if (as_gltf && profile.order == ViewerOrder::sphereBins && !source.cameras.empty()) {
    Start parted = inShells(fitted, source.cameras);
    if (shownPsnr(parted, viewer, choice) > shownPsnr(fitted, viewer, choice)) fitted = std::move(parted);
  }
  fitToViewer(fitted.base, viewer, fitViews(aimed, fit_cameras, source.background, kFitSide),
              {.steps = kFitSteps, .fixed = fitted.fixed, .parts = fitted.parts}, listener);
  double best = shownPsnr(start, viewer, held);
  if (best < before) start = untouched, best = before;
  report.fitted = shownPsnr(fitted, viewer, held) > best;
  if (report.fitted) start = std::move(fitted);
  report.wide = start.wide;
  report.pieces = start.pieces;
  report.skirts = start.skirts;
  report.parts = start.parts.size() + 1;
  const AdaptedPsnr to_aim{before, shownPsnr(start, viewer, held)};
  const AdaptedPsnr to_other{shownPsnr(untouched, viewer, other), shownPsnr(start, viewer, other)};
  report.to_model = aim == FitAim::base ? to_other : to_aim;
  report.to_base = aim == FitAim::base ? to_aim : to_other;

  adapted.parts = start.parts;
  if (keep) {
    // What was added stands behind the source's Gaussians, or among them in their primitives.
    std::vector<std::uint32_t> order = start.order;
    order.resize(start.base.size());
    if (start.order.empty()) std::iota(order.begin(), order.end(), 0u);
    adapted.model = withAdded(source.model, start.base, order);
    report.ours = renderedPsnr(source.model, adapted.model, held.cameras, source.background);
    adapted.base = std::move(start.base);
  } else {
    report.ours = renderedPsnr(source.model, start.base, held.cameras, source.background);
    adapted.model = std::move(start.base);
  }
  return adapted;
}

}  // namespace tg

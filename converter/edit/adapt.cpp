// SPDX-License-Identifier: Apache-2.0
// A model made for somebody else's viewer.
#include "converter/edit/adapt.h"

#include <algorithm>
#include <numeric>
#include <span>
#include <utility>
#include <vector>

#include "converter/edit/quality.h"
#include "converter/edit/viewer_fit.h"
#include "core/model/fallback.h"
#include "core/model/verbs.h"
#include "core/model/wide_splats.h"
#include "render/affine/affine_picture.h"

namespace tg {
namespace {

constexpr std::size_t kFitViews = 32, kHeldViews = 6, kChoiceViews = 6;
constexpr int kFitSide = 256, kHeldSide = 512;  // [px]
constexpr int kFitSteps = 288;
constexpr std::size_t kHeldEvery = 6;  // view, where no test views are there
constexpr double kWideSigma = 0.3;     // of the distance to the nearest camera
constexpr float kInvisible = static_cast<float>(-kLogitLimit);

std::vector<Camera> evenly(const std::vector<Camera>& cameras, std::size_t most) {
  std::vector<Camera> some;
  const std::size_t count = std::min(cameras.size(), most);
  for (std::size_t k = 0; k < count; ++k) some.push_back(cameras[k * cameras.size() / count]);
  return some;
}

// Some to fit, others to judge by.
void shareViews(const Bundle& source, std::vector<Camera>& fit, std::vector<Camera>& held) {
  for (const Camera& camera : source.cameras) (camera.test ? held : fit).push_back(camera);
  if (fit.empty() || held.empty()) {
    fit = held = {};
    const std::vector<Camera> all =
        source.cameras.size() > 1 ? source.cameras : contributionViews(source.model, source.cameras);
    for (std::size_t k = 0; k < all.size(); ++k) (k % kHeldEvery == kHeldEvery / 2 ? held : fit).push_back(all[k]);
    if (held.empty()) held.push_back(all.back());
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

struct Start {
  GaussianModel base;
  std::size_t wide = 0, pieces = 0;
};

// With or without pieces: what looks better in the viewer before anything is fitted.
Start bestStart(SplatViewer viewer, const GaussianModel& base, std::span<const Camera> cameras, const FitViews& views,
                bool keep) {
  std::vector<glm::dvec3> eyes;
  for (const Camera& camera : cameras) eyes.push_back(camera.position());
  const WidePieces split = splitWide(base, eyes, {.bound = kWideSigma});
  if (split.wide.empty()) return {base, 0, 0};
  Start trial{inPieces(base, split, keep), split.wide.size(), split.pieces.size()};
  if (viewerPsnr(trial.base, viewer, views) > viewerPsnr(base, viewer, views)) return trial;
  return {base, 0, 0};
}

}  // namespace

Adapted adaptTo(SplatViewer viewer, const Bundle& source, bool keep_textures) {
  const bool keep = keep_textures && isTextured(source.model);
  const GaussianModel base = bakeFallback(source.model);
  std::vector<Camera> fit_cameras, held_cameras;
  shareViews(source, fit_cameras, held_cameras);
  const FitViews held = fitViews(source.model, held_cameras, source.background, kHeldSide);
  const FitViews choice = fitViews(source.model, evenly(fit_cameras, kChoiceViews), source.background, kFitSide);
  Adapted adapted;
  AdaptReport& report = adapted.report;
  report.viewer = viewer;
  report.fit_views = fit_cameras.size();
  report.held_views = held_cameras.size();
  report.before = viewerPsnr(base, viewer, held);

  Start start = bestStart(viewer, base, source.cameras, choice, keep);
  double best = viewerPsnr(start.base, viewer, held);
  if (best < report.before) start = {base, 0, 0}, best = report.before;
  GaussianModel fitted = start.base;
  fitToViewer(fitted, viewer, fitViews(source.model, fit_cameras, source.background, kFitSide),
              {.steps = kFitSteps, .shapes_from = keep ? source.model.size() : 0});
  const double after = viewerPsnr(fitted, viewer, held);
  report.fitted = after > best;
  report.after = std::max(after, best);
  report.wide = start.wide;
  report.pieces = start.pieces;

  GaussianModel shown = report.fitted ? std::move(fitted) : std::move(start.base);
  if (keep) {
    std::vector<std::uint32_t> pieces(shown.size() - source.model.size());
    std::iota(pieces.begin(), pieces.end(), static_cast<std::uint32_t>(source.model.size()));
    adapted.model = source.model;
    append(adapted.model, select(shown, pieces));
    std::fill(adapted.model.opacity_logit.begin() + static_cast<std::ptrdiff_t>(source.model.size()),
              adapted.model.opacity_logit.end(), kInvisible);
    report.ours = renderedPsnr(source.model, adapted.model, held.cameras, source.background);
    adapted.base = std::move(shown);
  } else {
    report.ours = renderedPsnr(source.model, shown, held.cameras, source.background);
    adapted.model = std::move(shown);
  }
  return adapted;
}

}  // namespace tg

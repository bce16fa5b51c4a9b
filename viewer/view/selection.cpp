// SPDX-License-Identifier: Apache-2.0
// Masks over the Gaussians of a model.
#include "viewer/view/selection.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "converter/edit/select.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "render/contribution.h"
#include "render/reference/inspect.h"

namespace tg {
namespace {

constexpr std::int64_t kGrain = 8192;    // Gaussians a thread takes at once
constexpr double kSeenWeight = 0.05;     // [px] of a Gaussian that is seen
constexpr double kVisibilitySide = 480;  // [px] of the picture that visibility is told by: it is slow
constexpr double kLeastLogged = 1e-12;   // of values whose logarithm is taken
constexpr double kMostCounted = 1e30;    // of values in a histogram

constexpr std::array kSelectValues = {
    SelectValue{"opacity", "Opacity", false, "After the sigmoid"},
    SelectValue{"max_scale", "Size", true, "The longest sigma, in world units"},
    SelectValue{"rank", "Rank", false, "1 a needle, 2 a disc, 3 a ball"},
    SelectValue{"distance", "Distance", true, "From the median of all means, in world units: floaters lie far out"},
};

bool drawn(const RenderSettings& settings, glm::vec3 mean) {
  if (!settings.crop) return true;
  return glm::all(glm::greaterThanEqual(mean, settings.crop->min)) &&
         glm::all(glm::lessThanEqual(mean, settings.crop->max));
}

template <typename Holds>
std::vector<std::uint8_t> where(std::size_t count, const Holds& holds) {
  std::vector<std::uint8_t> mask(count);
  parallelFor(static_cast<std::int64_t>(count), kGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    mask[i] = holds(i);
  });
  return mask;
}

// The model as these settings draw it, as far as it hides and is hidden.
void applySettings(GaussianModel& model, const RenderSettings& settings) {
  model.texture_mode =
      static_cast<TextureMode>(static_cast<unsigned>(model.texture_mode) & static_cast<unsigned>(settings.textures));
  model.intersection = settings.intersection.value_or(model.intersection);
  model.outside = settings.outside.value_or(model.outside);
  for (glm::vec3& scale : model.log_scale) scale += std::log(settings.splat_scale);
  if (settings.opacity_scale == 1) return;
  for (float& logit : model.opacity_logit) {
    const double opacity = settings.opacity_scale / (1 + std::exp(-double{logit}));
    logit = static_cast<float>(opacity < 1 ? std::log(opacity / (1 - opacity)) : std::numeric_limits<float>::max());
  }
}

}  // namespace

SelectionPtr selectionOf(const GaussianModel& model, std::vector<std::uint8_t> chosen) {
  TG_ASSERT(chosen.size() == model.size(), "a choice a Gaussian");
  auto selection = std::make_shared<Selection>();
  selection->count = static_cast<std::size_t>(std::ranges::count_if(chosen, [](std::uint8_t c) { return c != 0; }));
  if (selection->count == 0) return nullptr;
  const std::size_t stride = (selection->count + kMostDots - 1) / kMostDots;
  std::size_t met = 0;
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    if (chosen[i] == 0) continue;
    selection->center += glm::dvec3(model.mean[i]);
    if (met++ % stride == 0) selection->dots.push_back(static_cast<std::uint32_t>(i));
  }
  selection->center /= static_cast<double>(selection->count);
  selection->chosen = std::move(chosen);
  return selection;
}

std::vector<std::uint32_t> indicesOf(const Selection& selection) {
  std::vector<std::uint32_t> indices;
  indices.reserve(selection.count);
  for (std::size_t i = 0; i < selection.chosen.size(); ++i) {
    if (selection.chosen[i] != 0) indices.push_back(static_cast<std::uint32_t>(i));
  }
  return indices;
}

std::vector<std::uint8_t> combined(const SelectionPtr& before, std::vector<std::uint8_t> found, SelectMode mode) {
  if (mode == SelectMode::replace) return found;
  if (!before) return mode == SelectMode::add ? found : std::vector<std::uint8_t>(found.size());
  TG_ASSERT(before->chosen.size() == found.size(), "both are of one model");
  for (std::size_t i = 0; i < found.size(); ++i) {
    const bool was = before->chosen[i] != 0, is = found[i] != 0;
    found[i] = mode == SelectMode::add ? was || is : mode == SelectMode::subtract ? was && !is : was && is;
  }
  return found;
}

std::vector<std::uint8_t> inverted(const SelectionPtr& before, std::size_t count) {
  std::vector<std::uint8_t> mask(count, 1);
  if (!before) return mask;
  TG_ASSERT(before->chosen.size() == count, "the selection is of the model");
  std::ranges::transform(before->chosen, mask.begin(), [](std::uint8_t c) { return std::uint8_t{c == 0}; });
  return mask;
}

std::vector<glm::vec2> projectedMeans(const GaussianModel& model, const Camera& camera,
                                      const RenderSettings& settings) {
  std::vector<glm::vec2> points(model.size());
  parallelFor(static_cast<std::int64_t>(points.size()), kGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    const glm::dvec3 p = cameraFromWorld(camera, glm::dvec3(model.mean[i]));
    const bool seen = p.z > double{settings.near} && drawn(settings, model.mean[i]);
    points[i] = seen ? glm::vec2(project(camera, p)) : glm::vec2(std::numeric_limits<float>::quiet_NaN());
  });
  return points;
}

std::vector<std::uint8_t> insideRectangle(std::span<const glm::vec2> points, glm::dvec2 a, glm::dvec2 b) {
  const glm::dvec2 low = glm::min(a, b), high = glm::max(a, b);
  return where(points.size(), [&](std::size_t i) {
    const glm::dvec2 p(points[i]);
    return p.x >= low.x && p.y >= low.y && p.x <= high.x && p.y <= high.y;
  });
}

void sweep(std::span<const glm::vec2> points, glm::dvec2 a, glm::dvec2 b, double radius,
           std::vector<std::uint8_t>& swept) {
  TG_ASSERT(points.size() == swept.size(), "a mark a point");
  const glm::dvec2 way = b - a;
  const double squared = glm::dot(way, way);
  parallelFor(static_cast<std::int64_t>(points.size()), kGrain, [&](std::int64_t item) {
    const auto i = static_cast<std::size_t>(item);
    const glm::dvec2 p(points[i]);
    const double along = squared > 0 ? std::clamp(glm::dot(p - a, way) / squared, 0.0, 1.0) : 0.0;
    if (glm::distance(p, a + along * way) <= radius) swept[i] = 1;
  });
}

void keepVisible(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                 std::vector<std::uint8_t>& mask) {
  TG_ASSERT(mask.size() == model.size(), "a choice a Gaussian");
  // What is cropped away hides nothing.
  std::vector<std::uint32_t> shown;
  for (std::size_t i = 0; i < model.size(); ++i) {
    if (drawn(settings, model.mean[i])) shown.push_back(static_cast<std::uint32_t>(i));
  }
  const double scale = std::min(1.0, kVisibilitySide / std::max(camera.size.x, camera.size.y));
  const glm::ivec2 size = glm::max(glm::ivec2(glm::round(scale * glm::dvec2(camera.size))), glm::ivec2(1));
  const Camera small = resized(camera, size.x, size.y);
  GaussianModel drawn_model = select(model, shown);
  applySettings(drawn_model, settings);
  const std::vector<double> weights = blendWeights(drawn_model, {&small, 1}, settings.near);
  std::vector<std::uint8_t> seen(mask.size());
  for (std::size_t j = 0; j < shown.size(); ++j) seen[shown[j]] = weights[j] >= kSeenWeight * scale * scale;
  for (std::size_t i = 0; i < mask.size(); ++i) mask[i] = mask[i] != 0 && seen[i] != 0;
}

std::optional<glm::dvec3> surfaceAt(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                                    glm::ivec2 pixel) {
  const std::vector<PixelHit> hits = inspectPixel(model, camera, settings, pixel);
  if (hits.empty()) return std::nullopt;
  auto hit = std::ranges::find_if(hits, [](const PixelHit& h) { return h.transmittance * (1 - h.alpha) < 0.5; });
  if (hit == hits.end()) hit = std::ranges::max_element(hits, {}, &PixelHit::weight);
  const glm::dvec3 p = hit->t * ray(camera, glm::dvec2(pixel) + 0.5);
  return glm::transpose(camera.rotation) * (p - camera.translation);
}

std::span<const SelectValue> selectValues() { return kSelectValues; }

Histogram histogramOf(const std::shared_ptr<const GaussianModel>& model, std::size_t value) {
  TG_ASSERT(model && model->size() > 0, "a model with Gaussians");
  TG_ASSERT(value < kSelectValues.size(), "a value that there is");
  Histogram histogram;
  histogram.of = model;
  histogram.value = value;
  const std::vector<double> values = valuesOf(*model, kSelectValues[value].name);
  histogram.values.resize(values.size());
  std::ranges::transform(values, histogram.values.begin(), [&](double v) {
    if (std::isnan(v)) return 0.0f;  // a ratio of sigmas that doubles cannot hold
    if (kSelectValues[value].logarithmic) v = std::log10(std::max(v, kLeastLogged));
    return static_cast<float>(std::clamp(v, -kMostCounted, kMostCounted));
  });
  const auto [low, high] = std::ranges::minmax(histogram.values);
  histogram.low = low;
  histogram.high = std::max(double{high}, histogram.low + 1e-6);
  std::array<std::size_t, kHistogramBars> counts{};
  const double bars_per_unit = double{kHistogramBars} / (histogram.high - histogram.low);
  for (const float v : histogram.values) {
    ++counts[std::min(static_cast<std::size_t>((v - histogram.low) * bars_per_unit), kHistogramBars - 1)];
  }
  const double most = static_cast<double>(*std::ranges::max_element(counts));
  for (const std::size_t count : counts) {
    histogram.bars.push_back(static_cast<float>(std::sqrt(static_cast<double>(count) / most)));
  }
  return histogram;
}

std::vector<std::uint8_t> insideRange(const Histogram& histogram, double low, double high) {
  return where(histogram.values.size(), [&](std::size_t i) {
    return double{histogram.values[i]} >= low && double{histogram.values[i]} <= high;
  });
}

}  // namespace tg

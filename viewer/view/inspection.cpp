// SPDX-License-Identifier: Apache-2.0
// Pixels to lists of splats, and Gaussians to numbers.
#include "viewer/view/inspection.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <nlohmann/json.hpp>
#include <numeric>
#include <utility>

#include "core/file/json.h"
#include "core/model/effective_rank.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr int kInspectVersion = 1;

// [world] on the ray of a pixel's middle, at that camera z.
glm::dvec3 pointAt(const Camera& camera, glm::ivec2 pixel, double depth) {
  return glm::transpose(camera.rotation) * (depth * ray(camera, glm::dvec2(pixel) + 0.5) - camera.translation);
}

}  // namespace

void inspect(ViewerState& state, glm::ivec2 pixel) {
  state.inspect.asked = pixel;
  state.ui.tab = Tab::inspect;
}

void pickHit(ViewerState& state, int hit) {
  const int count = static_cast<int>(state.inspect.hits.size());
  state.inspect.picked = count == 0 ? -1 : std::clamp(hit, 0, count - 1);
  state.inspect.seek = true;
}

void stepHit(ViewerState& state, int step) {
  if (state.inspect.hits.empty()) return notify(state, "Nothing is picked: Alt+click a pixel, or M and click");
  pickHit(state, state.inspect.picked < 0 ? 0 : state.inspect.picked + step);
}

int strongestHit(const std::vector<PixelHit>& hits) {
  const auto strongest = std::ranges::max_element(hits, {}, &PixelHit::weight);
  return strongest == hits.end() ? -1 : static_cast<int>(strongest - hits.begin());
}

std::vector<int> sortedHits(const GaussianModel& model, const std::vector<PixelHit>& hits, HitColumn column,
                            bool descending) {
  std::vector<int> order(hits.size());
  std::iota(order.begin(), order.end(), 0);
  const auto value = [&](int i) {
    const PixelHit& hit = hits[static_cast<std::size_t>(i)];
    switch (column) {
      case HitColumn::order:
        return static_cast<double>(i);
      case HitColumn::index:
        return static_cast<double>(hit.index);
      case HitColumn::depth:
        return hit.t;
      case HitColumn::weight:
        return hit.weight;
      case HitColumn::alpha:
        return hit.alpha;
      case HitColumn::opacity:
        return opacityOf(model, hit.index);
      case HitColumn::size:
        break;
    }
    const glm::dvec3 sigma = sigmaOf(model, hit.index);
    return std::max({sigma.x, sigma.y, sigma.z});
  };
  std::ranges::stable_sort(order, {}, [&](int i) { return descending ? -value(i) : value(i); });
  return order;
}

void sortHits(ViewerState& state, HitColumn column) {
  InspectState& inspection = state.inspect;
  const bool ascends = column == HitColumn::index || column == HitColumn::depth || column == HitColumn::order;
  inspection.descending = inspection.sorted_by == column ? !inspection.descending : !ascends;
  inspection.sorted_by = column;
  inspection.seek = true;
}

void turnAbout(ViewerState& state, const Camera& camera, glm::ivec2 pixel, const std::vector<PixelHit>& hits) {
  if (hits.empty()) return notify(state, "Nothing is seen there to turn about");
  auto at =
      std::find_if(hits.begin(), hits.end(), [](const PixelHit& h) { return h.transmittance * (1 - h.alpha) < 0.5; });
  if (at == hits.end()) at = hits.begin() + strongestHit(hits);
  centerOn(state.camera.pose, pointAt(camera, pixel, at->t));
  leaveCamera(state.camera);
  state.path.playing = false;
}

std::optional<glm::dvec3> inspectedPoint(const ViewerState& state) {
  const InspectState& inspection = state.inspect;
  if (!inspection.inspected) return std::nullopt;
  const Camera& camera = inspection.camera;
  const int picked = inspection.picked;
  const double depth = picked >= 0 ? inspection.hits[static_cast<std::size_t>(picked)].t : state.camera.pose.distance;
  return pointAt(camera, inspection.pixel, depth);
}

std::vector<glm::dvec3> outlineOf(const GaussianModel& model, std::size_t index, double sigmas, glm::dvec3 eye) {
  TG_ASSERT(index < model.size(), "the model has this Gaussian");
  constexpr int kPoints = 64;
  const glm::vec4 q = model.rotation[index];
  const glm::dmat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
  const glm::dvec3 mean(model.mean[index]), sides = sigmas * sigmaOf(model, index);
  // As a sphere of radius 1: where its tangents from the eye touch it is a circle.
  const glm::dvec3 from = (glm::transpose(axes) * (eye - mean)) / sides;
  const double distance = glm::length(from);
  if (!(distance > 1) || !std::isfinite(distance)) return {};
  const glm::dvec3 n = from / distance;
  const glm::dvec3 helper = std::abs(n.x) < 0.8 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(n, helper)), v = glm::cross(n, u);
  const double radius = std::sqrt(1 - 1 / (distance * distance));
  std::vector<glm::dvec3> points;
  for (int i = 0; i < kPoints; ++i) {
    const double angle = 360 * kDegrees * i / kPoints;
    const glm::dvec3 p = n / distance + radius * (std::cos(angle) * u + std::sin(angle) * v);
    points.push_back(mean + axes * (sides * p));
  }
  return points;
}

void clearInspection(ViewerState& state) {
  InspectState fresh;
  fresh.active = state.inspect.active;
  fresh.sorted_by = state.inspect.sorted_by;
  fresh.descending = state.inspect.descending;
  state.inspect = std::move(fresh);
}

std::optional<std::uint32_t> pickedGaussian(const ViewerState& state) {
  const InspectState& inspection = state.inspect;
  if (inspection.picked < 0 || inspection.picked >= static_cast<int>(inspection.hits.size())) return std::nullopt;
  return inspection.hits[static_cast<std::size_t>(inspection.picked)].index;
}

GaussianFacts factsOf(const GaussianModel& model, std::size_t index) {
  TG_ASSERT(index < model.size(), "the model has this Gaussian");
  GaussianFacts facts;
  facts.mean = model.mean[index];
  facts.sigma = sigmaOf(model, index);
  facts.opacity = opacityOf(model, index);
  facts.effective_rank = effectiveRank(model.log_scale[index]);
  facts.width = rectOf(model, index).width;
  facts.height = rectOf(model, index).height;
  return facts;
}

TexelColors texelColors(const GaussianModel& model, std::size_t index, int i, int j) {
  TG_ASSERT(index < model.atlas.rects.size(), "the Gaussian has a texture");
  TG_ASSERT(i >= 0 && j >= 0 && i < model.atlas.rects[index].width && j < model.atlas.rects[index].height,
            "the texture has this texel");
  const TextureRect& rect = model.atlas.rects[index];
  const glm::vec4 texel = model.atlas.texels[rect.offset + static_cast<std::size_t>(j) * rect.width + i];
  const auto unit = [](glm::vec3 color) { return glm::clamp(color, 0.0f, 1.0f); };
  return {unit(0.5f + 0.5f * glm::vec3(texel.x, texel.y, texel.z)), unit(glm::vec3(texel.w))};
}

glm::dvec2 texelPosition(glm::dvec2 uv, int width, int height) {
  TG_ASSERT(width > 0 && height > 0, "a texture has texels");
  const glm::dvec2 size(width, height);
  return (uv + double{kTextureExtent}) * (size - 1.0) / (2.0 * kTextureExtent) + 0.5;
}

double lightLeft(const std::vector<PixelHit>& hits) {
  return hits.empty() ? 1 : hits.back().transmittance * (1 - hits.back().alpha);
}

glm::dvec3 colorOf(const std::vector<PixelHit>& hits, glm::vec3 background) {
  glm::dvec3 color(0.0);
  for (const PixelHit& hit : hits) color += hit.weight * (hit.base + hit.texture);
  return color + lightLeft(hits) * glm::dvec3(background);
}

std::string formatInspection(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                             glm::ivec2 pixel, const std::vector<PixelHit>& hits) {
  using nlohmann::ordered_json;
  const auto vector = [](glm::dvec3 v) { return ordered_json{v.x, v.y, v.z}; };
  ordered_json list = ordered_json::array();
  for (const PixelHit& hit : hits) {
    const GaussianFacts facts = factsOf(model, hit.index);
    list.push_back({{"index", hit.index},
                    {"t", hit.t},
                    {"alpha", hit.alpha},
                    {"weight", hit.weight},
                    {"transmittance", hit.transmittance},
                    {"value", hit.value},
                    {"texture_alpha", hit.texture_alpha},
                    {"uv", {hit.uv.x, hit.uv.y}},
                    {"base", vector(hit.base)},
                    {"texture", vector(hit.texture)},
                    {"mean", vector(facts.mean)},
                    {"sigma", vector(facts.sigma)},
                    {"opacity", facts.opacity},
                    {"effective_rank", facts.effective_rank},
                    {"texture_size", {facts.width, facts.height}}});
  }
  const ordered_json json = {{"format", "tgview-inspect"},
                             {"version", kInspectVersion},
                             {"pixel", {pixel.x, pixel.y}},
                             {"image", {camera.size.x, camera.size.y}},
                             {"color", vector(colorOf(hits, settings.background))},
                             {"transmittance", lightLeft(hits)},
                             {"hits", std::move(list)}};
  return dumpJson(json, 1) + "\n";
}

}  // namespace tg

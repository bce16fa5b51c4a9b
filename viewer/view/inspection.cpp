// SPDX-License-Identifier: Apache-2.0
// Pixels to lists of splats, and Gaussians to numbers.
#include "viewer/view/inspection.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "core/file/json.h"
#include "core/model/effective_rank.h"
#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "shared/limits.h"

namespace tg {
namespace {

constexpr int kInspectVersion = 1;

}  // namespace

void inspect(ViewerState& state, glm::ivec2 pixel) {
  state.inspect.asked = pixel;
  state.ui.tab = Tab::inspect;
}

void pickHit(ViewerState& state, int hit) {
  const int count = static_cast<int>(state.inspect.hits.size());
  state.inspect.picked = count == 0 ? -1 : std::clamp(hit, 0, count - 1);
}

void stepHit(ViewerState& state, int step) {
  if (state.inspect.hits.empty()) return notify(state, "Nothing is picked: Alt+click a pixel, or M and click");
  pickHit(state, state.inspect.picked < 0 ? 0 : state.inspect.picked + step);
}

void turnAbout(ViewerState& state, const Camera& camera, glm::ivec2 pixel, const std::vector<PixelHit>& hits) {
  if (hits.empty()) return notify(state, "Nothing is seen there to turn about");
  auto at =
      std::find_if(hits.begin(), hits.end(), [](const PixelHit& h) { return h.transmittance * (1 - h.alpha) < 0.5; });
  if (at == hits.end()) {
    at = std::max_element(hits.begin(), hits.end(),
                          [](const PixelHit& a, const PixelHit& b) { return a.weight < b.weight; });
  }
  const glm::dvec2 ray = (glm::dvec2(pixel) + 0.5 - camera.center) / camera.focal;
  const glm::dvec3 seen = at->t * glm::dvec3(ray, 1.0);
  centerOn(state.camera.pose, glm::transpose(camera.rotation) * (seen - camera.translation));
  state.camera.index = -1;
  state.path.playing = false;
}

void clearInspection(ViewerState& state) {
  const bool active = state.inspect.active;
  state.inspect = {};
  state.inspect.active = active;
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

std::string formatInspection(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                             glm::ivec2 pixel, const std::vector<PixelHit>& hits) {
  using nlohmann::ordered_json;
  const auto vector = [](glm::dvec3 v) { return ordered_json{v.x, v.y, v.z}; };
  glm::dvec3 color(0.0);
  double left = 1;
  ordered_json list = ordered_json::array();
  for (const PixelHit& hit : hits) {
    color += hit.weight * (hit.base + hit.texture);
    left = hit.transmittance * (1 - hit.alpha);
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
                             {"color", vector(color + left * glm::dvec3(settings.background))},
                             {"transmittance", left},
                             {"hits", std::move(list)}};
  return dumpJson(json, 1) + "\n";
}

}  // namespace tg

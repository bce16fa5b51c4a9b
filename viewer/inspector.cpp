// SPDX-License-Identifier: Apache-2.0
// Pixels to lists of splats, and Gaussians to numbers.
#include "viewer/inspector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "core/effective_rank.h"
#include "core/error.h"
#include "core/json.h"
#include "shared/limits.h"
#include "viewer/headless_renderer.h"
#include "viewer/options.h"

namespace tg {
namespace {

constexpr int kInspectVersion = 1;

// What the pixel was drawn with: isolating shows one of its splats, but the list stays that of all.
RenderSettings inspectedSettings(const ViewerState& state) {
  RenderSettings settings = effectiveSettings(state);
  settings.crop.reset();
  if (state.display.crop) settings.crop = state.display.box;
  return settings;
}

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
  GaussianFacts facts;
  facts.mean = model.mean[index];
  facts.sigma = glm::exp(glm::dvec3(model.log_scale[index]));
  facts.opacity = 1.0 / (1.0 + std::exp(-double{model.opacity_logit[index]}));
  facts.effective_rank = effectiveRank(model.log_scale[index]);
  if (!model.atlas.rects.empty()) {
    facts.width = model.atlas.rects[index].width;
    facts.height = model.atlas.rects[index].height;
  }
  return facts;
}

TexelColors texelColors(const GaussianModel& model, std::size_t index, int i, int j) {
  const TextureRect& rect = model.atlas.rects[index];
  const glm::vec4 texel = model.atlas.texels[rect.offset + static_cast<std::size_t>(j) * rect.width + i];
  const auto unit = [](glm::vec3 color) { return glm::clamp(color, 0.0f, 1.0f); };
  return {unit(0.5f + 0.5f * glm::vec3(texel.x, texel.y, texel.z)), unit(glm::vec3(texel.w))};
}

glm::dvec2 texelPosition(glm::dvec2 uv, int width, int height) {
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
                             {"image", {camera.width, camera.height}},
                             {"color", vector(color + left * glm::dvec3(settings.background))},
                             {"transmittance", left},
                             {"hits", std::move(list)}};
  return dumpJson(json, 1) + "\n";
}

bool InspectorThread::update(ViewerState& state, glm::ivec2 size) {
  InspectState& inspection = state.inspect;
  bool fresh = false;
  if (answer_.valid() && answer_.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    inspection.busy = false;
    Answer answer = answer_.get();
    fresh = answer.model == state.scene.model;
    if (fresh) {
      inspection.hits = std::move(answer.hits);
      inspection.camera = answer.camera;
      inspection.pixel = answer.pixel;
      inspection.inspected = true;
      inspection.isolated = false;
      pickHit(state, 0);
    }
  }
  if (!inspection.asked || answer_.valid()) return fresh;
  const glm::ivec2 pixel = *std::exchange(inspection.asked, std::nullopt);
  if (!state.scene.model) return fresh;
  inspection.busy = true;
  answer_ = std::async(std::launch::async, [pixel, model = state.scene.model, settings = inspectedSettings(state),
                                            camera = toCamera(state.camera.pose, state.camera.lens, size.x, size.y)] {
    return Answer{camera, pixel, model, inspectPixel(*model, camera, settings, pixel)};
  });
  return fresh;
}

void inspectHeadless(const ViewOptions& options) {
  const Scene scene = sceneFor(options, readModel(options.model));
  printWarnings(scene, options);
  const Camera camera = cameraFor(options, scene);
  const glm::ivec2 pixel = *options.inspect;
  if (pixel.x >= camera.width || pixel.y >= camera.height)
    throw Error(ErrorKind::usage, "--inspect: expected a pixel of the " + std::to_string(camera.width) + "x" +
                                      std::to_string(camera.height) + " picture, found " + std::to_string(pixel.x) +
                                      "," + std::to_string(pixel.y));
  const RenderSettings settings = settingsFor(options, scene.background);
  const std::vector<PixelHit> hits = inspectPixel(*scene.model, camera, settings, pixel);
  std::fputs(formatInspection(*scene.model, camera, settings, pixel, hits).c_str(), stdout);
}

}  // namespace tg

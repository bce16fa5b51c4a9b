// SPDX-License-Identifier: Apache-2.0
// One pixel after the other, in float64.
#include "viewer/picture/inspector_thread.h"

#include <string>
#include <utility>

#include "viewer/view/inspection.h"

namespace tg {
namespace {

// What the pixel was drawn with: isolating shows one of its splats, but the list stays that of all.
RenderSettings inspectedSettings(const ViewerState& state) {
  RenderSettings settings = effectiveSettings(state);
  settings.crop.reset();
  if (state.display.crop) settings.crop = state.display.box;
  return settings;
}

}  // namespace

InspectorThread::InspectorThread()
    : thread_(startWorker(answers_, [this](const std::stop_token& stop) {
        while (auto asked = asked_.take(stop)) {
          asked->hits = inspectPixel(*asked->model, asked->camera, asked->settings, asked->pixel);
          answers_.give(std::move(*asked));
        }
      })) {}

bool InspectorThread::update(ViewerState& state, glm::ivec2 size) {
  InspectState& inspection = state.inspect;
  bool fresh = false;
  if (std::optional<Inspection> answer = answers_.poll()) {
    busy_ = inspection.busy = false;
    fresh = answer->model == state.scene.model;
    if (fresh && answer->turns) {
      turnAbout(state, answer->camera, answer->pixel, answer->hits);
    } else if (fresh) {
      inspection.hits = std::move(answer->hits);
      inspection.camera = answer->camera;
      inspection.pixel = answer->pixel;
      inspection.inspected = true;
      inspection.isolated = false;
      pickHit(state, strongestHit(inspection.hits));
    }
  }
  if (busy_) return fresh;
  const bool turns = state.desktop.turn_about.has_value();
  const auto asked = std::exchange(turns ? state.desktop.turn_about : inspection.asked, std::nullopt);
  if (!asked) return fresh;
  const glm::ivec2 pixel = *asked;
  if (!state.scene.model) return fresh;
  if (glm::any(glm::lessThan(pixel, glm::ivec2(0))) || glm::any(glm::greaterThanEqual(pixel, size))) {
    state.messages.error = "Pixel " + std::to_string(pixel.x) + " " + std::to_string(pixel.y) +
                           " lies outside the picture (" + std::to_string(size.x) + " x " + std::to_string(size.y) +
                           ")";
    return true;
  }
  busy_ = inspection.busy = true;
  asked_.give({toCamera(state.camera.pose, state.camera.lens, size.x, size.y),
               pixel,
               state.scene.model,
               inspectedSettings(state),
               {},
               turns});
  return fresh;
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
#include "viewer/picture/inspector_thread.h"

#include <chrono>
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

}  // namespace tg

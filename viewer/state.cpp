// SPDX-License-Identifier: Apache-2.0
// Changes of the viewer's state: scenes, cameras, messages.
#include "viewer/state.h"

#include <algorithm>
#include <utility>

namespace tg {
namespace {

constexpr double kNoticeSeconds = 3;

}  // namespace

RenderSettings effectiveSettings(const ViewerState& state) {
  RenderSettings settings = state.display.settings;
  if (state.display.textures_held_off) settings.textures = TextureMode::none;
  return settings;
}

void setScene(ViewerState& state, Scene scene) {
  state.scene = std::move(scene);
  state.display.settings.background = state.scene.background;
  state.messages.error.clear();
  resetView(state);
}

void replaceScene(ViewerState& state, Scene scene) {
  state.scene = std::move(scene);
  if (state.camera.index >= static_cast<int>(state.scene.cameras.size())) state.camera.index = -1;
}

void goToCamera(ViewerState& state, int index) {
  setCamera(state, state.scene.cameras.at(index));
  state.camera.index = index;
}

void setCamera(ViewerState& state, const Camera& camera) {
  state.camera.pose = poseOf(camera, state.scene.up, state.scene.bounds);
  state.camera.lens = lensOf(camera, state.camera.aspect);
  state.camera.index = -1;
}

int startCamera(std::span<const Camera> cameras) {
  if (cameras.empty()) return -1;
  const auto test = std::find_if(cameras.begin(), cameras.end(), [](const Camera& c) { return c.test; });
  return test == cameras.end() ? 0 : static_cast<int>(test - cameras.begin());
}

void notify(ViewerState& state, std::string text) {
  state.messages.notice = std::move(text);
  state.messages.notice_until = state.time + kNoticeSeconds;
}

void resetView(ViewerState& state) {
  const int start = startCamera(state.scene.cameras);
  if (start >= 0) return goToCamera(state, start);
  state.camera.lens = {};
  state.camera.pose = startPose(state.scene.up, state.scene.bounds, state.camera.lens, state.camera.aspect);
  state.camera.index = -1;
}

std::filesystem::path freeName(const std::string& stem, const std::string& extension) {
  for (int i = 1;; ++i) {
    std::string number = std::to_string(i);
    if (number.size() < 3) number.insert(0, 3 - number.size(), '0');
    const std::filesystem::path path = stem + "-" + number + extension;
    if (!std::filesystem::exists(path)) return path;
  }
}

}  // namespace tg

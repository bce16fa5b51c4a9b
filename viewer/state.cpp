// SPDX-License-Identifier: Apache-2.0
// Changes of the viewer's state: scenes, cameras, keys, mouse.
#include "viewer/state.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace tg {
namespace {

constexpr double kPi = 3.14159265358979323846;
constexpr double kNoticeSeconds = 3;
constexpr double kRollSpeed = 0.8;     // [rad / s]
constexpr double kWheelFactor = 0.88;  // of the distance, per notch

constexpr std::array kBindings = {
    KeyBinding{'1', false, Action::final, "1", "Final picture"},
    KeyBinding{'2', false, Action::base, "2", "Base colour (SH)"},
    KeyBinding{'3', false, Action::texture, "3", "Texture colour"},
    KeyBinding{'4', false, Action::alpha, "4", "Alpha"},
    KeyBinding{'5', false, Action::depth, "5", "Depth"},
    KeyBinding{'6', false, Action::normal, "6", "Normals"},
    KeyBinding{'7', false, Action::count, "7", "Splats per pixel"},
    KeyBinding{'T', false, Action::cycleTextures, "T", "Textures: RGBA, RGB, alpha, off"},
    KeyBinding{'I', false, Action::toggleIntersection, "I", "Intersection: plane / max response"},
    KeyBinding{'F', false, Action::frameScene, "F", "Frame the model"},
    KeyBinding{'F', true, Action::resetView, "Shift+F", "Back to the first view"},
    KeyBinding{' ', false, Action::nextCamera, "Space", "Next camera of the model"},
    KeyBinding{' ', true, Action::previousCamera, "Shift+Space", "Previous camera"},
    KeyBinding{'.', false, Action::nextCamera, "", ""},
    KeyBinding{',', false, Action::previousCamera, "", ""},
    KeyBinding{'P', false, Action::screenshot, "P", "Save the picture as PNG"},
    KeyBinding{'P', true, Action::windowShot, "Shift+P", "Save the whole window as PNG"},
    KeyBinding{'C', false, Action::saveCamera, "C", "Save the camera as JSON"},
    KeyBinding{'H', false, Action::togglePanel, "H", "Hide or show the panel"},
    KeyBinding{'/', true, Action::toggleHelp, "? or F1", "This help"},
    KeyBinding{290, false, Action::toggleHelp, "", ""},  // F1
    KeyBinding{kKeyEscape, false, Action::quit, "Esc", "Close help or error, else quit"},
};

constexpr std::array kMouseHelp = {
    HelpLine{"Left drag", "Orbit"},
    HelpLine{"Right drag", "Look around"},
    HelpLine{"Middle or Shift+left drag", "Pan"},
    HelpLine{"Wheel", "Closer or farther"},
    HelpLine{"Ctrl+wheel", "Field of view"},
    HelpLine{"W A S D, Q E", "Fly; Q down, E up"},
    HelpLine{"Shift / Ctrl while flying", "4 x faster / slower"},
    HelpLine{"Z / X", "Roll"},
    HelpLine{"Tab, held", "Textures off, to compare"},
};

void cycleTextures(ViewerState& state) {
  constexpr std::array order = {TextureMode::rgba, TextureMode::rgb, TextureMode::alpha, TextureMode::none};
  const auto at = std::find(order.begin(), order.end(), state.settings.textures);
  state.settings.textures = order[(at - order.begin() + 1) % order.size()];
  const auto mode = state.settings.textures;
  notify(state, std::string("Textures: ") + (mode == TextureMode::none ? "off" : std::string(name(mode))));
}

void toggleIntersection(ViewerState& state) {
  const auto now = state.settings.intersection.value_or(state.scene.intersection);
  state.settings.intersection =
      now == IntersectionModel::plane ? IntersectionModel::maxResponse : IntersectionModel::plane;
  notify(state, "Intersection: " + std::string(name(*state.settings.intersection)));
}

void frameScene(ViewerState& state) {
  frame(state.pose, state.lens, state.aspect, state.scene.bounds);
  state.camera = -1;
}

void resetView(ViewerState& state) {
  const int start = startCamera(state.scene.cameras);
  if (start >= 0) return goToCamera(state, start);
  state.lens = {};
  state.pose = startPose(state.scene.up, state.scene.bounds, state.lens, state.aspect);
  state.camera = -1;
}

void stepCamera(ViewerState& state, int step) {
  const int count = static_cast<int>(state.scene.cameras.size());
  if (count == 0) return notify(state, "This model has no cameras");
  const int from = state.camera >= 0 ? state.camera : (step > 0 ? -1 : 0);
  goToCamera(state, (from + step + count) % count);
}

void escape(ViewerState& state) {
  if (!state.error.empty())
    state.error.clear();
  else if (state.show_help)
    state.show_help = false;
  else
    state.quit = true;
}

std::string stemOf(const ViewerState& state) {
  const std::string stem = state.scene.path.stem().string();
  return stem.empty() ? "tgview" : stem;
}

}  // namespace

RenderSettings effectiveSettings(const ViewerState& state) {
  RenderSettings settings = state.settings;
  if (state.textures_held_off) settings.textures = TextureMode::none;
  return settings;
}

void setScene(ViewerState& state, Scene scene) {
  state.scene = std::move(scene);
  state.settings.background = state.scene.background;
  state.error.clear();
  resetView(state);
}

void replaceScene(ViewerState& state, Scene scene) {
  state.scene = std::move(scene);
  if (state.camera >= static_cast<int>(state.scene.cameras.size())) state.camera = -1;
}

void goToCamera(ViewerState& state, int index) {
  setCamera(state, state.scene.cameras.at(index));
  state.camera = index;
}

void setCamera(ViewerState& state, const Camera& camera) {
  state.pose = poseOf(camera, state.scene.up, state.scene.bounds);
  state.lens = lensOf(camera, state.aspect);
  state.camera = -1;
}

int startCamera(std::span<const Camera> cameras) {
  if (cameras.empty()) return -1;
  const auto test = std::find_if(cameras.begin(), cameras.end(), [](const Camera& c) { return c.test; });
  return test == cameras.end() ? 0 : static_cast<int>(test - cameras.begin());
}

void notify(ViewerState& state, std::string text) {
  state.notice = std::move(text);
  state.notice_until = state.time + kNoticeSeconds;
}

void apply(ViewerState& state, Action action) {
  switch (action) {
    case Action::final:
      state.output = Output::final;
      break;
    case Action::base:
      state.output = Output::base;
      break;
    case Action::texture:
      state.output = Output::texture;
      break;
    case Action::alpha:
      state.output = Output::alpha;
      break;
    case Action::depth:
      state.output = Output::depth;
      break;
    case Action::normal:
      state.output = Output::normal;
      break;
    case Action::count:
      state.output = Output::count;
      break;
    case Action::cycleTextures:
      cycleTextures(state);
      break;
    case Action::toggleIntersection:
      toggleIntersection(state);
      break;
    case Action::frameScene:
      frameScene(state);
      break;
    case Action::resetView:
      resetView(state);
      break;
    case Action::nextCamera:
      stepCamera(state, 1);
      break;
    case Action::previousCamera:
      stepCamera(state, -1);
      break;
    case Action::screenshot:
      state.capture.picture = freeName(stemOf(state), ".png");
      break;
    case Action::windowShot:
      state.capture.window = freeName(stemOf(state) + "-window", ".png");
      break;
    case Action::saveCamera:
      state.capture.camera = freeName(stemOf(state) + "-camera", ".json");
      break;
    case Action::togglePanel:
      state.show_panel = !state.show_panel;
      break;
    case Action::toggleHelp:
      state.show_help = !state.show_help;
      break;
    case Action::quit:
      escape(state);
      break;
  }
}

std::span<const KeyBinding> keyBindings() { return kBindings; }
std::span<const HelpLine> mouseHelp() { return kMouseHelp; }

std::optional<Action> actionOf(int key, bool shift) {
  for (const KeyBinding& binding : kBindings) {
    if (binding.key == key && binding.shift == shift) return binding.action;
  }
  return std::nullopt;
}

bool applyInput(ViewerState& state, const Input& input, int height) {
  const ViewPose before = state.pose;
  const Lens lens_before = state.lens;
  const double radians_per_pixel = kPi / std::max(height, 1);
  const glm::dvec2 drag = input.drag;
  if (input.middle || (input.left && input.shift)) {
    // A point at the pivot's distance stays under the pointer.
    const double units_per_pixel = 2.0 * state.pose.distance * std::tan(0.5 * state.lens.fov_y) / std::max(height, 1);
    pan(state.pose, -drag.x * units_per_pixel / state.lens.pixel_aspect, -drag.y * units_per_pixel);
  } else if (input.left) {
    orbit(state.pose, -drag.x * radians_per_pixel, -drag.y * radians_per_pixel);
  } else if (input.right) {
    look(state.pose, -drag.x * radians_per_pixel, -drag.y * radians_per_pixel);
  }
  if (input.wheel != 0 && input.control) {
    state.lens.fov_y = std::clamp(state.lens.fov_y * std::pow(0.95, input.wheel), kMinFov, kMaxFov);
  } else if (input.wheel != 0) {
    dolly(state.pose, std::pow(kWheelFactor, input.wheel));
  }
  const double boost = input.shift ? 4.0 : input.control ? 0.25 : 1.0;
  const double step = state.speed * boost * state.scene.bounds.radius * input.seconds;
  if (input.fly != glm::dvec3(0.0)) fly(state.pose, input.fly * step);
  state.pose.roll = std::remainder(state.pose.roll + input.roll * kRollSpeed * input.seconds, 2.0 * kPi);

  const bool moved = state.pose.position != before.position || state.pose.yaw != before.yaw ||
                     state.pose.pitch != before.pitch || state.pose.roll != before.roll ||
                     state.lens.fov_y != lens_before.fov_y;
  if (moved) state.camera = -1;
  return moved;
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

// SPDX-License-Identifier: Apache-2.0
// Keys and what they do.
#include "viewer/actions.h"

#include <algorithm>
#include <array>

namespace tg {
namespace {

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
    KeyBinding{'.', false, Action::nextTestCamera, ". / ,", "Next, previous test camera"},
    KeyBinding{',', false, Action::previousTestCamera, "", ""},
    KeyBinding{'.', true, Action::nextTrainCamera, "Shift+. / ,", "Next, previous training camera"},
    KeyBinding{',', true, Action::previousTrainCamera, "", ""},
    KeyBinding{'V', false, Action::cycleCompare, "V", "Compare: side, wipe, flicker, difference, off"},
    KeyBinding{'V', true, Action::showOther, "Shift+V", "Flicker: show the other one"},
    KeyBinding{'P', false, Action::screenshot, "P", "Save the picture as PNG"},
    KeyBinding{'P', true, Action::windowShot, "Shift+P", "Save the whole window as PNG"},
    KeyBinding{'C', false, Action::saveCamera, "C", "Save the camera as JSON"},
    KeyBinding{kKeyPageDown, false, Action::nextDocument, "Page Down", "Next open model"},
    KeyBinding{kKeyPageUp, false, Action::previousDocument, "Page Up", "Previous open model"},
    KeyBinding{kKeyDelete, false, Action::closeDocument, "Delete", "Close the model shown"},
    KeyBinding{'H', false, Action::togglePanel, "H", "Hide or show the panel"},
    KeyBinding{'/', true, Action::toggleHelp, "? or F1", "This help"},
    KeyBinding{290, false, Action::toggleHelp, "", ""},  // F1
    KeyBinding{kKeyEscape, false, Action::quit, "Esc", "Close help or error, stop loading, else quit"},
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
  const auto at = std::find(order.begin(), order.end(), state.display.settings.textures);
  state.display.settings.textures = order[(at - order.begin() + 1) % order.size()];
  const auto mode = state.display.settings.textures;
  notify(state, std::string("Textures: ") + (mode == TextureMode::none ? "off" : std::string(name(mode))));
}

void toggleIntersection(ViewerState& state) {
  const auto now = state.display.settings.intersection.value_or(state.scene.intersection);
  state.display.settings.intersection =
      now == IntersectionModel::plane ? IntersectionModel::maxResponse : IntersectionModel::plane;
  notify(state, "Intersection: " + std::string(name(*state.display.settings.intersection)));
}

void frameScene(ViewerState& state) {
  frame(state.camera.pose, state.camera.lens, state.camera.aspect, state.scene.bounds);
  state.camera.index = -1;
}

void stepCamera(ViewerState& state, int step) {
  const int count = static_cast<int>(state.scene.cameras.size());
  if (count == 0) return notify(state, "This model has no cameras");
  const int from = state.camera.index >= 0 ? state.camera.index : (step > 0 ? -1 : 0);
  goToCamera(state, (from + step + count) % count);
}

// Round the cameras of one split.
void stepSplit(ViewerState& state, int step, bool test) {
  const std::vector<Camera>& cameras = state.scene.cameras;
  const int count = static_cast<int>(cameras.size());
  const int from = state.camera.index >= 0 ? state.camera.index : (step > 0 ? -1 : 0);
  for (int i = 1; i <= count; ++i) {
    const int index = ((from + step * i) % count + count) % count;
    if (cameras[index].test == test) return goToCamera(state, index);
  }
  notify(state, test ? "This model has no test cameras" : "This model has no training cameras");
}

void cycleCompare(ViewerState& state) {
  CompareMode& mode = state.compare.how.mode;
  mode = static_cast<CompareMode>((static_cast<int>(mode) + 1) % 5);
  notify(state, "Compare: " + std::string(name(mode)));
}

void showOther(ViewerState& state) {
  state.compare.how.mode = CompareMode::flicker;
  state.compare.how.shows_other = !state.compare.how.shows_other;
}

void escape(ViewerState& state) {
  if (!state.messages.error.empty())
    state.messages.error.clear();
  else if (state.ui.help)
    state.ui.help = false;
  else if (state.loading.active)
    state.loading.cancel = true;
  else
    state.quit = true;
}

std::string stemOf(const ViewerState& state) {
  const std::string stem = state.scene.path.stem().string();
  return stem.empty() ? "tgview" : stem;
}

}  // namespace

void apply(ViewerState& state, Action action) {
  switch (action) {
    case Action::final:
      state.display.output = Output::final;
      break;
    case Action::base:
      state.display.output = Output::base;
      break;
    case Action::texture:
      state.display.output = Output::texture;
      break;
    case Action::alpha:
      state.display.output = Output::alpha;
      break;
    case Action::depth:
      state.display.output = Output::depth;
      break;
    case Action::normal:
      state.display.output = Output::normal;
      break;
    case Action::count:
      state.display.output = Output::count;
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
      state.ui.panel = !state.ui.panel;
      break;
    case Action::toggleHelp:
      state.ui.help = !state.ui.help;
      break;
    case Action::nextTestCamera:
      stepSplit(state, 1, true);
      break;
    case Action::previousTestCamera:
      stepSplit(state, -1, true);
      break;
    case Action::nextTrainCamera:
      stepSplit(state, 1, false);
      break;
    case Action::previousTrainCamera:
      stepSplit(state, -1, false);
      break;
    case Action::cycleCompare:
      cycleCompare(state);
      break;
    case Action::showOther:
      showOther(state);
      break;
    case Action::nextDocument:
      stepDocument(state, 1);
      break;
    case Action::previousDocument:
      stepDocument(state, -1);
      break;
    case Action::closeDocument:
      if (state.documents.shown >= 0) state.documents.close_request = state.documents.shown;
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

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Keys and what they do.
#include "viewer/view/actions.h"

#include <algorithm>
#include <array>

#include "viewer/view/bookmarks.h"
#include "viewer/view/documents.h"
#include "viewer/view/inspection.h"
#include "viewer/view/path_editor.h"

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
    KeyBinding{'8', false, Action::depthMedian, "8", "Median depth"},
    KeyBinding{'9', false, Action::overdraw, "9", "Overdraw"},
    KeyBinding{'0', false, Action::ellipsoids, "0", "Ellipsoids"},
    KeyBinding{'-', false, Action::centers, "-", "Centres"},
    KeyBinding{'=', false, Action::texelDensity, "=", "Texel density"},
    KeyBinding{'T', false, Action::cycleTextures, "T", "Textures: RGBA, RGB, alpha, off"},
    KeyBinding{'I', false, Action::toggleIntersection, "I", "Intersection: plane / max response"},
    KeyBinding{'O', false, Action::toggleOrder, "O", "Order: global / per pixel"},
    KeyBinding{'Y', false, Action::toggleFilter, "Y", "Texture filter: bilinear / footprint"},
    KeyBinding{'Y', true, Action::toggleAntialiasing, "Shift+Y", "Antialiasing: off / screen"},
    KeyBinding{'J', false, Action::toggleCrop, "J", "Crop box on / off"},
    KeyBinding{'F', false, Action::frameScene, "F", "Frame the model"},
    KeyBinding{'F', true, Action::resetView, "Shift+F", "Back to the first view"},
    KeyBinding{' ', false, Action::nextCamera, "Space", "Next camera of the model"},
    KeyBinding{' ', true, Action::previousCamera, "Shift+Space", "Previous camera"},
    KeyBinding{'.', false, Action::nextTestCamera, ". / ,", "Next, previous test camera"},
    KeyBinding{',', false, Action::previousTestCamera, "", ""},
    KeyBinding{'.', true, Action::nextTrainCamera, "Shift+. / ,", "Next, previous training camera"},
    KeyBinding{',', true, Action::previousTrainCamera, "", ""},
    KeyBinding{'V', false, Action::cycleCompare, "V", "Compare: side, wipe, flicker, ..."},
    KeyBinding{'V', true, Action::showOther, "Shift+V", "Flicker: show the other one"},
    KeyBinding{'G', false, Action::toggleFly, "G", "Left drag: orbit / look around"},
    KeyBinding{'U', false, Action::nextUp, "U", "Another up axis"},
    KeyBinding{'R', false, Action::toggleTurntable, "R", "Turntable"},
    KeyBinding{'B', false, Action::nextBookmark, "B", "Next bookmark"},
    KeyBinding{'B', true, Action::addBookmark, "Shift+B", "Bookmark this view"},
    KeyBinding{'K', false, Action::addKey, "K", "Key frame of the path here"},
    KeyBinding{'L', false, Action::togglePlaying, "L", "Play or pause the path"},
    KeyBinding{'R', true, Action::toggleRecording, "Shift+R", "Record path or turntable; cancel"},
    KeyBinding{'M', false, Action::toggleInspecting, "M", "A click inspects its pixel"},
    KeyBinding{'[', false, Action::previousHit, "[ / ]", "Splat in front, behind"},
    KeyBinding{']', false, Action::nextHit, "", ""},
    KeyBinding{'N', false, Action::toggleIsolated, "N", "The picked Gaussian alone"},
    KeyBinding{'P', false, Action::screenshot, "P", "Save the picture as PNG"},
    KeyBinding{'P', true, Action::windowShot, "Shift+P", "Save the whole window as PNG"},
    KeyBinding{'C', false, Action::saveCamera, "C", "Save the camera as JSON"},
    KeyBinding{kKeyPageDown, false, Action::nextDocument, "Page Down / Up", "Next, previous open model"},
    KeyBinding{kKeyPageUp, false, Action::previousDocument, "", ""},
    KeyBinding{kKeyDelete, false, Action::closeDocument, "Delete", "Close the model shown"},
    KeyBinding{'H', false, Action::togglePanel, "H", "Hide or show the panel"},
    KeyBinding{'/', true, Action::toggleHelp, "? or F1", "This help"},
    KeyBinding{290, false, Action::toggleHelp, "", ""},  // F1
    KeyBinding{kKeyEscape, false, Action::quit, "Esc", "Close this, stop loading, or quit"},
};

constexpr std::array kMouseHelp = {
    HelpLine{"Left drag", "Orbit"},
    HelpLine{"Right drag", "Look around"},
    HelpLine{"Middle, Shift+left drag", "Pan"},
    HelpLine{"Alt+click", "Inspect a pixel"},
    HelpLine{"Wheel", "Closer or farther"},
    HelpLine{"Ctrl+wheel", "Field of view"},
    HelpLine{"W A S D, Q E", "Fly; Q down, E up"},
    HelpLine{"Shift / Ctrl", "Fly 4 x faster / slower"},
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

void show(ViewerState& state, Output output) { state.display.output = output; }

// Between an enumeration's two values.
template <typename Choice>
void toggle(ViewerState& state, Choice& choice, const char* what) {
  choice = choice == Choice{0} ? Choice{1} : Choice{0};
  notify(state, what + std::string(name(choice)));
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

bool canCompare(ViewerState& state) {
  if (!state.compare.photographs.empty() || otherDocument(state) >= 0) return true;
  state.compare.how.mode = CompareMode::off;
  notify(state, "Nothing to compare with: open another model");
  return false;
}

void cycleCompare(ViewerState& state) {
  if (!canCompare(state)) return;
  CompareMode& mode = state.compare.how.mode;
  mode = static_cast<CompareMode>((static_cast<int>(mode) + 1) % 5);
  notify(state, "Compare: " + std::string(name(mode)));
}

void showOther(ViewerState& state) {
  if (!canCompare(state)) return;
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
      return show(state, Output::final);
    case Action::base:
      return show(state, Output::base);
    case Action::texture:
      return show(state, Output::texture);
    case Action::alpha:
      return show(state, Output::alpha);
    case Action::depth:
      return show(state, Output::depth);
    case Action::normal:
      return show(state, Output::normal);
    case Action::count:
      return show(state, Output::count);
    case Action::depthMedian:
      return show(state, Output::depthMedian);
    case Action::overdraw:
      return show(state, Output::overdraw);
    case Action::ellipsoids:
      return show(state, Output::ellipsoids);
    case Action::centers:
      return show(state, Output::centers);
    case Action::texelDensity:
      return show(state, Output::texelDensity);
    case Action::cycleTextures:
      cycleTextures(state);
      break;
    case Action::toggleIntersection:
      toggleIntersection(state);
      break;
    case Action::toggleOrder:
      toggle(state, state.display.settings.order, "Order: ");
      break;
    case Action::toggleFilter:
      toggle(state, state.display.settings.texture_filter, "Texture filter: ");
      break;
    case Action::toggleAntialiasing:
      toggle(state, state.display.settings.antialiasing, "Antialiasing: ");
      break;
    case Action::toggleCrop:
      state.display.crop = !state.display.crop;
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
    case Action::toggleFly:
      state.camera.fly = !state.camera.fly;
      notify(state, state.camera.fly ? "Fly: left drag looks around" : "Orbit: left drag goes round");
      break;
    case Action::toggleTurntable:
      state.camera.turntable = !state.camera.turntable;
      state.path.playing = false;
      break;
    case Action::nextUp:
      setUp(state, static_cast<UpAxis>((static_cast<int>(state.camera.up) + 1) % kUpAxes));
      notify(state, "Up: " + std::string(name(state.camera.up)));
      break;
    case Action::addBookmark:
      attempt(state, [&state] { addBookmark(state); });
      break;
    case Action::nextBookmark:
      stepBookmark(state, 1);
      break;
    case Action::addKey:
      attempt(state, [&state] { addKey(state); });
      break;
    case Action::togglePlaying:
      togglePlaying(state);
      break;
    case Action::toggleRecording:
      state.record.wanted = !state.record.wanted;
      break;
    case Action::toggleInspecting:
      state.inspect.active = !state.inspect.active;
      notify(state, state.inspect.active ? "A click inspects its pixel" : "A click no longer inspects");
      break;
    case Action::previousHit:
      stepHit(state, -1);
      break;
    case Action::nextHit:
      stepHit(state, 1);
      break;
    case Action::toggleIsolated:
      if (pickedGaussian(state))
        state.inspect.isolated = !state.inspect.isolated;
      else
        notify(state, "Nothing is picked: Alt+click a pixel, or M and click");
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

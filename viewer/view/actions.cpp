// SPDX-License-Identifier: Apache-2.0
// Keys and what they do.
#include "viewer/view/actions.h"

#include <algorithm>
#include <array>

#include "viewer/view/bookmarks.h"
#include "viewer/view/documents.h"
#include "viewer/view/edits.h"
#include "viewer/view/inspection.h"
#include "viewer/view/path_editor.h"

namespace tg {
namespace {

constexpr double kEscapeSeconds = 2;  // in which a second press quits, once the window says so

template <Output kOutput>
void show(ViewerState& state) {
  state.display.output = kOutput;
}

template <Named E>
E next(E value) {
  return static_cast<E>((static_cast<int>(value) + 1) % kCount<E>);
}

// To the choice before the one at hand, round about.
void stepSetting(ViewerState& state, const KeyBinding& binding) {
  const RenderSetting& setting = renderSetting(binding.setting);
  const auto& choices = setting.choices;
  const std::string now = setting.get(shownSettings(state, state.display.settings));
  const auto at =
      std::find_if(choices.begin(), choices.end(), [&now](const auto& choice) { return choice.name == now; });
  const std::string name((at == choices.begin() ? choices.back() : *(at - 1)).name);
  setting.set(state.display.settings, name, "");
  notify(state, std::string(menuWords(binding.setting)) + ": " + name);
}

// Round the cameras of one split.
void stepSplit(ViewerState& state, int step, bool test) {
  const std::vector<Camera>& cameras = state.scene.cameras;
  const int count = static_cast<int>(cameras.size());
  const int last = lastCamera(state), from = last >= 0 ? last : (step > 0 ? -1 : 0);
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
  mode = next(mode);
  notify(state, "Compare: " + std::string(name(mode)));
}

void showOther(ViewerState& state) {
  if (!canCompare(state)) return;
  state.compare.how.mode = CompareMode::flicker;
  state.compare.how.shows_other = !state.compare.how.shows_other;
}

bool hasOther(const ViewerState& state) { return !state.compare.photographs.empty() || otherDocument(state) >= 0; }

template <int kStep>
void toModelCamera(ViewerState& state) {
  stepCamera(state, kStep);
}

template <int kStep, bool kTest>
void toSplitCamera(ViewerState& state) {
  stepSplit(state, kStep, kTest);
}

bool hasSplit(const ViewerState& state, bool test) {
  return std::ranges::any_of(state.scene.cameras, [test](const Camera& camera) { return camera.test == test; });
}

void nextBookmark(ViewerState& state) { stepBookmark(state, 1); }

void toggleFly(ViewerState& state) {
  state.camera.fly = !state.camera.fly;
  notify(state, state.camera.fly ? "Fly: left drag looks around" : "Orbit: left drag goes round");
}

void nextUp(ViewerState& state) {
  setUp(state, next(state.camera.up));
  notify(state, "Up: " + std::string(name(state.camera.up)));
}

void toggleInspecting(ViewerState& state) {
  state.inspect.active = !state.inspect.active;
  if (state.inspect.active) setTool(state, EditTool::none);
  notify(state, state.inspect.active ? "A click inspects its pixel" : "A click no longer inspects");
}

void toggleIsolated(ViewerState& state) {
  if (pickedGaussian(state)) {
    state.inspect.isolated = !state.inspect.isolated;
  } else {
    notify(state, "Nothing is picked: Alt+click a pixel, or M and click");
  }
}

template <int kStep>
void toDocument(ViewerState& state) {
  stepDocument(state, kStep);
}

template <int kStep>
void toHit(ViewerState& state) {
  stepHit(state, kStep);
}

void togglePanel(ViewerState& state) { state.ui.panel = !state.ui.panel; }

void toggleFullscreen(ViewerState& state) { state.desktop.fullscreen = !state.desktop.fullscreen; }

void toggleHelp(ViewerState& state) { state.ui.help = !state.ui.help; }

void closeDocument(ViewerState& state) { askToClose(state, state.documents.shown); }

template <EditTool kTool>
void tool(ViewerState& state) {
  if (state.edit.tool != kTool && !mayEdit(state)) return;
  setTool(state, kTool);
  if (state.edit.tool == kTool) state.ui.tab = Tab::edit;
}

void escape(ViewerState& state) {
  if (!state.messages.error.empty()) {
    state.messages.error.clear();
  } else if (state.ui.help) {
    state.ui.help = false;
  } else if (cancelDrag(state)) {
    return;
  } else if (state.edit.tool != EditTool::none) {
    setTool(state, EditTool::none);
  } else if (state.inspect.active || state.inspect.isolated) {
    state.inspect.active = state.inspect.isolated = false;
  } else if (state.loading.active) {
    state.loading.cancel = true;
  } else if (state.record.wanted) {
    state.record.wanted = false;
  } else if (movesByItself(state)) {
    state.path.playing = state.camera.turntable = false;
  } else if (state.desktop.fullscreen) {
    state.desktop.fullscreen = false;
  } else if (state.ui.key_time > state.ui.escape_seen && state.ui.key_time < state.ui.escape_seen + kEscapeSeconds) {
    askToQuit(state);
  } else {
    notify(state, "Esc once more ends tgview, and so does Ctrl+Q");
    state.ui.escape_said = true;
  }
}

void lookFrom(ViewerState& state, Side side) {
  lookFrom(state.camera.pose, side);
  leaveCamera(state.camera);
  state.camera.turntable = false;
  state.path.playing = false;
}

template <FileUse kUse>
void ask(ViewerState& state) {
  state.desktop.wanted = kUse;
}

template <Side kSide>
void lookFrom(ViewerState& state) {
  lookFrom(state, kSide);
}

std::string stemOf(const ViewerState& state) {
  const std::string stem = state.scene.path.stem().string();
  return stem.empty() ? "tgview" : stem;
}

void savePicture(ViewerState& state) {
  state.capture.picture = freeName(stemOf(state), ".png");
  state.capture.dialog.reset();
}

void saveWindow(ViewerState& state) { state.capture.window = freeName(stemOf(state) + "-window", ".png"); }

using S = ViewerState;

constexpr std::array kBindings = {
    KeyBinding{kControl | 'O', false, "Ctrl+O", "Open a file", ask<FileUse::open>, {}, Menu::file, true},
    KeyBinding{kControl | 'R', false, "Ctrl+R", "Read the file again", readAgain, {}, Menu::file},
    KeyBinding{kControl | 'S', false, "Ctrl+S", "Save the model as", ask<FileUse::saveModel>, {}, Menu::file},
    KeyBinding{'P', false, "P", "Save the picture as PNG", savePicture, {}, Menu::file, true},
    KeyBinding{kControl | 'P', false, "Ctrl+P", "Save the picture as", ask<FileUse::savePicture>, {}, Menu::file},
    KeyBinding{'P', true, "Shift+P", "Save the whole window as PNG", saveWindow, {}, Menu::file},
    KeyBinding{'C', false, "C", "Save the camera as JSON", saveCamera, {}, Menu::file, true},
    KeyBinding{kControl | 'C', false, "Ctrl+C", "Copy the camera", [](S& s) { s.desktop.copy = true; }, {}, Menu::file},
    KeyBinding{kControl | 'V',
               false,
               "Ctrl+V",
               "Go to the camera that was copied",
               [](S& s) { s.desktop.paste = true; },
               {},
               Menu::file},
    KeyBinding{kKeyPageDown, false, "Page Down", "Next open model", toDocument<1>, {}, Menu::file, true},
    KeyBinding{kKeyPageUp, false, "Page Up", "Previous open model", toDocument<-1>, {}, Menu::file},
    KeyBinding{kControl | 'W', false, "Ctrl+W", "Close the model shown", closeDocument, {}, Menu::file},
    KeyBinding{kControl | 'Q', false, "Ctrl+Q", "Quit", askToQuit, {}, Menu::file, true},
    KeyBinding{kControl | 'Z', false, "Ctrl+Z", "Undo", undo, {}, Menu::edit},
    KeyBinding{kControl | 'Y', false, "Ctrl+Y, Ctrl+Shift+Z", "Redo", redo, {}, Menu::edit},
    KeyBinding{kControl | 'Z', true, "", "", redo},
    KeyBinding{kControl | 'A', false, "Ctrl+A", "Select all Gaussians", chooseAll, {}, Menu::edit, true},
    KeyBinding{kControl | 'A', true, "Ctrl+Shift+A", "Select none", chooseNone, {}, Menu::edit},
    KeyBinding{kControl | 'I', false, "Ctrl+I", "Select the others", invertChoice, {}, Menu::edit},
    KeyBinding{kKeyF2, false, "F2", "Select by a rectangle", tool<EditTool::rectangle>, {}, Menu::edit, true},
    KeyBinding{kKeyF3, false, "F3", "Select by a brush", tool<EditTool::brush>, {}, Menu::edit},
    KeyBinding{kKeyF4, false, "F4", "Select by a sphere", tool<EditTool::sphere>, {}, Menu::edit},
    KeyBinding{kKeyF5, false, "F5", "Move the selection", tool<EditTool::move>, {}, Menu::edit, true},
    KeyBinding{kKeyF6, false, "F6", "Turn the selection", tool<EditTool::turn>, {}, Menu::edit},
    KeyBinding{kKeyF7, false, "F7", "Scale the selection", tool<EditTool::scale>, {}, Menu::edit},
    KeyBinding{kKeyDelete, false, "Delete", "Delete the selection", deleteChosen, {}, Menu::edit},
    KeyBinding{'1', false, "1", "Final picture", show<Output::final>, {}, Menu::output},
    KeyBinding{'2', false, "2", "Base colour (SH)", show<Output::base>, {}, Menu::output},
    KeyBinding{'3', false, "3", "Texture colour", show<Output::texture>, {}, Menu::output},
    KeyBinding{'4', false, "4", "Alpha", show<Output::alpha>, {}, Menu::output},
    KeyBinding{'5', false, "5", "Depth", show<Output::depth>, {}, Menu::output},
    KeyBinding{'6', false, "6", "Normals", show<Output::normal>, {}, Menu::output},
    KeyBinding{'7', false, "7", "Splats per pixel", show<Output::count>, {}, Menu::output},
    KeyBinding{'8', false, "8", "Median depth", show<Output::depthMedian>, {}, Menu::output},
    KeyBinding{'9', false, "9", "Overdraw", show<Output::overdraw>, {}, Menu::output},
    KeyBinding{'0', false, "0", "Ellipsoids", show<Output::ellipsoids>, {}, Menu::output},
    KeyBinding{'-', false, "-", "Centres", show<Output::centers>, {}, Menu::output},
    KeyBinding{'=', false, "=", "Texel density", show<Output::texelDensity>, {}, Menu::output},
    KeyBinding{'T', false, "T", "Textures: RGBA, RGB, alpha, off", nullptr, "textures", Menu::view},
    KeyBinding{'I', false, "I", "Intersection: plane / max response", nullptr, "intersection", Menu::view},
    KeyBinding{'O', false, "O", "Order: global / per pixel", nullptr, "sort", Menu::view},
    KeyBinding{'Y', false, "Y", "Texture filter: bilinear / footprint", nullptr, "texture-filter", Menu::view},
    KeyBinding{'Y', true, "Shift+Y", "Antialiasing: off / screen", nullptr, "antialiasing", Menu::view},
    KeyBinding{'J', false, "J", "Crop box on / off", [](S& s) { s.display.crop = !s.display.crop; }, {}, Menu::view, true},
    KeyBinding{'V', false, "V", "Compare: side, wipe, flicker, ...", cycleCompare, {}, Menu::view, true},
    KeyBinding{'V', true, "Shift+V", "Flicker: show the other one", showOther, {}, Menu::view},
    KeyBinding{'M', false, "M", "A click inspects its pixel", toggleInspecting, {}, Menu::view},
    KeyBinding{'[', false, "[", "Splat in front", toHit<-1>, {}, Menu::view},
    KeyBinding{']', false, "]", "Splat behind", toHit<1>, {}, Menu::view},
    KeyBinding{'N', false, "N", "The picked Gaussian alone", toggleIsolated, {}, Menu::view},
    KeyBinding{'H', false, "H", "Hide or show the panel", togglePanel, {}, Menu::view, true},
    KeyBinding{kKeyF11, false, "F11", "Full screen", toggleFullscreen, {}, Menu::view},
    KeyBinding{'F', false, "F, Home", "Frame the model", frameScene, {}, Menu::camera},
    KeyBinding{kKeyHome, false, "", "", frameScene},
    KeyBinding{'F', true, "Shift+F", "Back to the first view", resetView, {}, Menu::camera},
    KeyBinding{kKeyPad7, false, "Num 7", "From the top", lookFrom<Side::top>, {}, Menu::camera, true},
    KeyBinding{kKeyPad1, false, "Num 1", "From the front", lookFrom<Side::front>, {}, Menu::camera},
    KeyBinding{kKeyPad3, false, "Num 3", "From the right", lookFrom<Side::right>, {}, Menu::camera},
    KeyBinding{kControl | kKeyPad7, false, "Ctrl+Num 7", "From below", lookFrom<Side::bottom>, {}, Menu::camera},
    KeyBinding{kControl | kKeyPad1, false, "Ctrl+Num 1", "From behind", lookFrom<Side::back>, {}, Menu::camera},
    KeyBinding{kControl | kKeyPad3, false, "Ctrl+Num 3", "From the left", lookFrom<Side::left>, {}, Menu::camera},
    KeyBinding{' ', false, "Space", "Next camera of the model", toModelCamera<1>, {}, Menu::camera, true},
    KeyBinding{' ', true, "Shift+Space", "Previous camera", toModelCamera<-1>, {}, Menu::camera},
    KeyBinding{'.', false, ".", "Next test camera", toSplitCamera<1, true>, {}, Menu::camera},
    KeyBinding{',', false, ",", "Previous test camera", toSplitCamera<-1, true>, {}, Menu::camera},
    KeyBinding{'.', true, "Shift+.", "Next training camera", toSplitCamera<1, false>, {}, Menu::camera},
    KeyBinding{',', true, "Shift+,", "Previous training camera", toSplitCamera<-1, false>, {}, Menu::camera},
    KeyBinding{'G', false, "G", "Left drag: orbit / look around", toggleFly, {}, Menu::camera, true},
    KeyBinding{'U', false, "U", "Another up axis", nextUp, {}, Menu::camera},
    KeyBinding{'R', false, "R", "Turntable", toggleTurntable, {}, Menu::camera},
    KeyBinding{'B', false, "B", "Next bookmark", nextBookmark, {}, Menu::camera, true},
    KeyBinding{'B',
               true,
               "Shift+B",
               "Bookmark this view",
               [](S& s) { attempt(s, [&s] { addBookmark(s); }); },
               {},
               Menu::camera},
    KeyBinding{
        'K', false, "K", "Key frame of the path here", [](S& s) { attempt(s, [&s] { addKey(s); }); }, {}, Menu::path},
    KeyBinding{'L', false, "L", "Play or pause the path", togglePlaying, {}, Menu::path},
    KeyBinding{'R',
               true,
               "Shift+R",
               "Record path or turntable; cancel",
               toggleRecording,
               {},
               Menu::path},
    KeyBinding{'/', true, "? or F1", "Keys and mouse", toggleHelp, {}, Menu::help},
    KeyBinding{kKeyF1, false, "", "", toggleHelp},
    KeyBinding{kKeyEscape, false, "Esc", "Close this, put the tool down, stop what goes on; twice: quit", escape},
};

constexpr std::array kMouseHelp = {
    HelpLine{"Left drag", "Orbit"},
    HelpLine{"Right drag", "Look around"},
    HelpLine{"Middle, Shift+left drag", "Pan"},
    HelpLine{"Alt+click", "Inspect a pixel"},
    HelpLine{"Double click", "Turn around that point"},
    HelpLine{"Wheel", "Closer or farther, to the pointer"},
    HelpLine{"Ctrl+wheel", "Field of view"},
    HelpLine{"W A S D, Q E", "Fly; Q down, E up"},
    HelpLine{"Shift / Alt", "Fly 4 x faster / slower"},
    HelpLine{"Arrows", "Orbit; with Shift pan"},
    HelpLine{"Z / X", "Roll"},
    HelpLine{"Tab, held", "Textures off, to compare"},
};

}  // namespace

std::span<const KeyBinding> keyBindings() { return kBindings; }
std::span<const HelpLine> mouseHelp() { return kMouseHelp; }

bool canRun(const ViewerState& state, const KeyBinding& binding) {
  const auto is = [&](auto... runs) { return ((binding.run == runs) || ...); };
  if (is(undo)) return !undoName(state).empty();
  if (is(redo)) return !redoName(state).empty();
  if (is(toDocument<1>, toDocument<-1>)) return state.documents.open.size() > 1;
  if (is(closeDocument, readAgain)) return !state.documents.open.empty();
  if (is(ask<FileUse::open>, askToQuit, saveWindow, togglePanel, toggleFullscreen, toggleHelp, escape)) return true;
  if (!state.scene.model) return false;
  const bool edits = is(chooseAll, chooseNone, invertChoice, deleteChosen, tool<EditTool::rectangle>,
                        tool<EditTool::brush>, tool<EditTool::sphere>, tool<EditTool::move>, tool<EditTool::turn>,
                        tool<EditTool::scale>, ask<FileUse::saveModel>);
  if (edits && !isWhole(state.scene)) return false;
  if (is(deleteChosen, chooseNone)) return state.edit.selection != nullptr;
  if (is(cycleCompare, showOther)) return hasOther(state);
  if (is(toHit<1>, toHit<-1>)) return !state.inspect.hits.empty();
  if (is(toggleIsolated)) return static_cast<bool>(pickedGaussian(state));
  if (is(toModelCamera<1>, toModelCamera<-1>)) return !state.scene.cameras.empty();
  if (is(toSplitCamera<1, true>, toSplitCamera<-1, true>)) return hasSplit(state, true);
  if (is(toSplitCamera<1, false>, toSplitCamera<-1, false>)) return hasSplit(state, false);
  if (is(nextBookmark)) return !state.camera.bookmarks.empty();
  if (is(togglePlaying)) return state.path.path.keys.size() > 1;
  return true;
}

void runAction(ViewerState& state, const KeyBinding& binding) {
  binding.run ? binding.run(state) : stepSetting(state, binding);
}

bool pressKey(ViewerState& state, int key, bool shift, std::optional<double> time) {
  state.ui.key_time = time.value_or(state.time);
  if (state.ui.help && state.ui.help_scrolls && !shift && (key == kKeyPageDown || key == kKeyPageUp)) {
    state.ui.help_pages += key == kKeyPageDown ? 1 : -1;
    return true;
  }
  for (const KeyBinding& binding : kBindings) {
    if (binding.key != key || binding.shift != shift) continue;
    runAction(state, binding);
    return true;
  }
  return false;
}

std::string_view menuWords(std::string_view setting) {
  const auto binding = std::ranges::find(kBindings, setting, &KeyBinding::setting);
  if (setting.empty() || binding == kBindings.end()) return "";
  const std::string_view text = binding->text;
  return text.substr(0, text.find(':'));
}

std::string keyOf(std::string_view setting) {
  for (const KeyBinding& binding : kBindings) {
    if (binding.setting == setting) return " (" + std::string(binding.keys) + ")";
  }
  return "";
}

void stepCamera(ViewerState& state, int step) {
  const int count = static_cast<int>(state.scene.cameras.size());
  if (count == 0) return notify(state, "This model has no cameras");
  const int last = lastCamera(state), from = last >= 0 ? last : (step > 0 ? -1 : 0);
  goToCamera(state, (from + step + count) % count);
}

void frameScene(ViewerState& state) {
  state.camera.lens.kept = state.camera.lens.pixel_aspect;  // what a sphere is framed in
  frame(state.camera.pose, state.camera.lens, state.camera.aspect, state.scene.bounds,
        double{state.display.settings.near});
  leaveCamera(state.camera);
  state.path.playing = false;
}

void saveCamera(ViewerState& state) { state.capture.camera = freeName(stemOf(state) + "-camera", ".json"); }

void toggleTurntable(ViewerState& state) {
  state.camera.turntable = !state.camera.turntable;
  state.path.playing = false;
}

}  // namespace tg

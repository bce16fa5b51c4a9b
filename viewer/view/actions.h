// SPDX-License-Identifier: Apache-2.0
// What keys and buttons do, and the table that both the keyboard and the help read.
#pragma once
#include <optional>
#include <span>

#include "viewer/view/state.h"

namespace tg {

enum class Action {
  final,
  base,
  texture,
  alpha,
  depth,
  normal,
  count,
  depthMedian,
  overdraw,
  ellipsoids,
  centers,
  texelDensity,
  cycleTextures,
  toggleIntersection,
  toggleOrder,
  toggleFilter,
  toggleAntialiasing,
  toggleCrop,
  frameScene,
  resetView,
  nextCamera,
  previousCamera,
  toggleFly,
  toggleTurntable,
  nextUp,
  addBookmark,
  nextBookmark,
  addKey,
  togglePlaying,
  toggleRecording,
  toggleInspecting,
  previousHit,
  nextHit,
  toggleIsolated,
  screenshot,
  windowShot,
  saveCamera,
  togglePanel,
  toggleHelp,
  nextTestCamera,
  previousTestCamera,
  nextTrainCamera,
  previousTrainCamera,
  cycleCompare,
  showOther,
  nextDocument,
  previousDocument,
  closeDocument,
  quit,
};
void apply(ViewerState& state, Action action);

// One table feeds the keyboard and the help overlay. Keys are GLFW's numbers: ASCII for printable ones.
struct KeyBinding {
  int key = 0;
  bool shift = false;
  Action action = Action::quit;
  const char* keys = "";  // as the help shows it; "" = an alias that is not listed
  const char* text = "";
};
constexpr int kKeyEscape = 256;
constexpr int kKeyDelete = 261;
constexpr int kKeyPageUp = 266;
constexpr int kKeyPageDown = 267;
constexpr int kKeyTab = 258;  // held: textures off
std::span<const KeyBinding> keyBindings();
std::optional<Action> actionOf(int key, bool shift);
// What the mouse and held keys do, for help and documentation: pairs of key and text.
struct HelpLine {
  const char* keys;
  const char* text;
};
std::span<const HelpLine> mouseHelp();

}  // namespace tg

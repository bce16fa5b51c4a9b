// SPDX-License-Identifier: Apache-2.0
// What keys and buttons do: one table that the keyboard and the help read. Keys are GLFW's numbers: ASCII for printable
// ones.
#pragma once
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "viewer/view/state.h"

namespace tg {

// Where the menu bar has an action; `output` is a list in `view`.
enum class Menu { none, file, edit, view, output, camera, path, help };

struct KeyBinding {
  int key = 0;  // kControl + a letter: with Ctrl held; 0 = none
  bool shift = false;
  const char* keys = "";                      // as the help shows it; "" = not there
  const char* text = "";                      // "" = an alias that is not listed
  void (*run)(ViewerState& state) = nullptr;  // null: steps through the choices of
  std::string_view setting{};                 // a RenderSetting, which `text` calls what it has before its colon
  Menu menu = Menu::none;
  bool begins_group = false;  // of the menu
};
constexpr int kControl = 1 << 10;  // above all keys
constexpr int kKeyEscape = 256;
constexpr int kKeyDelete = 261;
constexpr int kKeyPageUp = 266;
constexpr int kKeyPageDown = 267;
constexpr int kKeyHome = 268;
constexpr int kKeyF1 = 290;
constexpr int kKeyF2 = 291, kKeyF3 = 292, kKeyF4 = 293, kKeyF5 = 294, kKeyF6 = 295, kKeyF7 = 296;
constexpr int kKeyF11 = 300;
constexpr int kKeyPad1 = 321;
constexpr int kKeyPad3 = 323;
constexpr int kKeyPad7 = 327;
constexpr int kKeyTab = 258;  // held: textures off
std::span<const KeyBinding> keyBindings();
void runAction(ViewerState& state, const KeyBinding& binding);
// False: it would only say that there is nothing to do it with.
bool canRun(const ViewerState& state, const KeyBinding& binding);
// `time`: [s] of the window, when it was taken up; none: now. False: the key does nothing.
bool pressKey(ViewerState& state, int key, bool shift, std::optional<double> time = std::nullopt);
// What the menu calls a setting; "" where no key steps through it.
std::string_view menuWords(std::string_view setting);
std::string keyOf(std::string_view setting);  // " (O)", to follow a text; "" where no key steps through the setting

// What the mouse and held keys do, for help and documentation: pairs of key and text.
struct HelpLine {
  const char* keys;
  const char* text;
};
std::span<const HelpLine> mouseHelp();

// Keys that are buttons, too.
void stepCamera(ViewerState& state, int step);  // round the model's cameras
void frameScene(ViewerState& state);
void saveCamera(ViewerState& state);
void toggleTurntable(ViewerState& state);

}  // namespace tg

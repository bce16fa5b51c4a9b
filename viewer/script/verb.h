// SPDX-License-Identifier: Apache-2.0
// What a script's commands are made of; tables of them lie in script.cpp and *_verbs.cpp.
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "viewer/view/state.h"

namespace tg {

using Words = std::vector<std::string>;

// A command: its words, and what it does.
struct Verb {
  std::string_view name;
  std::size_t words;
  int wait;  // frames to draw before the next one
  // Throws Error that begins with `what`. Null: script.cpp sees to it.
  void (*run)(ViewerState& state, const Words& words, const std::string& what);
  // Whether it may run yet: asked every frame. Null: at once.
  bool (*ready)(const ViewerState& state) = nullptr;
  const RenderSetting* setting = nullptr;  // what the word is a value of, instead of `run`
};

constexpr int kFramesOfPanels = 2;  // an overlay measures itself in its first frame, unseen

std::span<const Verb> cameraVerbs();
std::span<const Verb> displayVerbs();
std::span<const Verb> settingVerbs();  // of all render settings; `crop` is one of displayVerbs(), too, and does more

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// What a script's commands are made of; tables of them lie in script.cpp and *_verbs.cpp.
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "viewer/view/parse.h"
#include "viewer/view/state.h"

namespace tg {

// A command that runs. Its getters throw Error(usage) that begins with `what`.
struct Call {
  ViewerState& state;
  const std::vector<std::string>& words;
  const std::string& what;

  const std::string& operator[](std::size_t word) const { return words[word]; }
  bool on() const { return parseSwitch(words[0], what); }
  double number(std::size_t word) const { return parseNumber(words[word], what); }
  double number(std::size_t word, double low, double high) const { return parseNumber(words[word], low, high, what); }
  std::int64_t count(std::size_t word, std::int64_t low, std::int64_t high) const {
    return parseCount(words[word], low, high, what);
  }
  std::size_t index(std::size_t count) const { return parseIndex(words[0], count, what); }
  template <Named E>
  E named() const {
    return parse<E>(words[0], what);
  }
};

// A command: its words, and what it does.
struct Verb {
  std::string_view name;
  std::size_t words;
  int wait;  // frames to draw before the next one
  // Throws Error that begins with Call::what. Null: script.cpp sees to it.
  void (*run)(const Call& call);
  // Whether it may run yet: asked every frame. Null: at once.
  bool (*ready)(const ViewerState& state) = nullptr;
  const RenderSetting* setting = nullptr;  // what the word is a value of, instead of `run`
};

constexpr int kFramesOfPanels = 2;  // an overlay measures itself in its first frame, unseen

std::span<const Verb> cameraVerbs();
std::span<const Verb> displayVerbs();
std::span<const Verb> editVerbs();
std::span<const Verb> settingVerbs();  // of all render settings; `crop` is one of displayVerbs(), too, and does more

}  // namespace tg

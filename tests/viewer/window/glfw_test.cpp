// SPDX-License-Identifier: Apache-2.0
// What a frame takes of the events that wait.
#include "viewer/window/glfw.h"

#include <utility>
#include <vector>

#include "support/catch.h"
#include "viewer/view/actions.h"

using namespace tg;
using Kind = InputEvent::Kind;

namespace {

Events waiting(const std::vector<std::pair<Kind, int>>& list) {
  Events events;
  for (const auto& [kind, code] : list) {
    InputEvent& event = events.waiting.emplace_back();
    event.kind = kind;
    event.code = code;
  }
  return events;
}

// How many events each frame takes.
std::vector<std::size_t> frames(Events& events) {
  std::vector<std::size_t> counts;
  while (!events.waiting.empty() && counts.size() < 99) {
    takeInput(events);
    counts.push_back(events.taken.size());
    const auto& pointer = events.taken.empty() ? events.waiting.front().pointer : events.taken.back().pointer;
    events.told = pointer;
  }
  return counts;
}

}  // namespace

TEST_CASE("digits of the keypad are typed in one frame, as others are, and its commands are not") {
  Events typed = waiting({{Kind::key, GLFW_KEY_KP_1},
                          {Kind::character, '1'},
                          {Kind::key, GLFW_KEY_KP_1},
                          {Kind::character, '1'},
                          {Kind::key, '2'},
                          {Kind::character, '2'}});
  CHECK(frames(typed) == std::vector<std::size_t>{6});
  Events commands = waiting({{Kind::key, GLFW_KEY_KP_7}, {Kind::key, GLFW_KEY_KP_1}, {Kind::key, GLFW_KEY_KP_1}});
  CHECK(frames(commands) == std::vector<std::size_t>{1, 1, 0, 1});
  Events chord = waiting({{Kind::key, GLFW_KEY_S | kControl}, {Kind::character, 'a'}});
  CHECK(frames(chord) == std::vector<std::size_t>{1, 1});
}

TEST_CASE("a button that goes up elsewhere than it was told does so a frame after the drag") {
  Events events = waiting({{Kind::press, 0}, {Kind::release, 0}, {Kind::press, 0}, {Kind::release, 0}});
  for (InputEvent& event : events.waiting) event.pointer = {10, 20};
  CHECK(frames(events) == std::vector<std::size_t>{1, 1, 1, 1});
  events = waiting({{Kind::press, 0}, {Kind::release, 0}});
  events.waiting.front().pointer = {10, 20};
  events.waiting.back().pointer = {30, 20};
  CHECK(frames(events) == std::vector<std::size_t>{1, 0, 1});
}

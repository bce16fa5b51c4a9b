// SPDX-License-Identifier: Apache-2.0
// Which actions can run.
#include "viewer/view/actions.h"

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "support/catch.h"
#include "viewer/keys.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edited_state.h"
#include "viewer/view/path_editor.h"

using namespace tg;
using test::frame;
using test::sampleState;

TEST_CASE("actions that have nothing to act on cannot run, and can once they have") {
  ViewerState state = sampleState();
  const auto can = [&](const std::string& text) {
    const auto found =
        std::ranges::find_if(keyBindings(), [&](const KeyBinding& binding) { return binding.text == text; });
    REQUIRE(found != keyBindings().end());
    return canRun(state, *found);
  };
  const auto none = [&](std::initializer_list<const char*> texts) {
    return std::ranges::none_of(texts, [&](const char* text) { return can(text); });
  };
  CHECK(none({"Undo", "Redo", "Delete the selection", "Next open model", "Previous open model"}));
  CHECK(none({"Flicker: show the other one", "Splat in front", "Splat behind", "The picked Gaussian alone"}));
  CHECK(none({"Select none", "Next bookmark", "Play or pause the path", "Next test camera"}));
  CHECK(can("Select all Gaussians"));
  chooseAll(state);
  frame(state);
  CHECK(can("Delete the selection"));
  CHECK(can("Undo"));
  state.documents.open.emplace_back().path = "other.tgz";
  CHECK(can("Next open model"));
  CHECK(can("Flicker: show the other one"));
  state.inspect.hits.resize(1);
  CHECK(can("Splat behind"));
  addBookmark(state);
  CHECK(can("Next bookmark"));
  addKey(state);
  CHECK(none({"Play or pause the path"}));
  addKey(state);
  CHECK(can("Play or pause the path"));
  state.scene.cameras.assign(1, currentCamera(state));
  CHECK(can("Next training camera"));
  CHECK(none({"Next test camera"}));
  state.scene.cameras.front().test = true;
  CHECK(can("Next test camera"));
  CHECK(none({"Next training camera"}));
}

TEST_CASE("a part of a model and a scene with levels are neither edited nor saved by the menus") {
  ViewerState state = sampleState();
  chooseAll(state);
  const auto offered = [&] {
    std::set<std::string_view> texts;
    for (const KeyBinding& binding : keyBindings()) {
      if (*binding.text && canRun(state, binding)) texts.insert(binding.text);
    }
    return texts;
  };
  const std::set<std::string_view> whole = offered();
  const bool partial = GENERATE(false, true);
  partial ? void(state.scene.partial = true) : void(state.scene.streamed_from = 1000);
  const std::set<std::string_view> now = offered();
  std::set<std::string_view> missing;
  std::ranges::set_difference(whole, now, std::inserter(missing, missing.end()));
  CHECK(missing == std::set<std::string_view>{"Save the model as", "Select all Gaussians", "Select none",
                                              "Select the others", "Select by a rectangle", "Select by a brush",
                                              "Select by a sphere", "Move the selection", "Turn the selection",
                                              "Scale the selection", "Delete the selection"});
  for (const int key : {kKeyF2, kKeyF3, kKeyF4, kKeyF5, kKeyF6, kKeyF7}) {
    state.messages.notice.clear();
    test::press(state, key);
    CHECK(state.edit.tool == EditTool::none);
    CHECK(state.ui.tab == Tab::view);
    CHECK_FALSE(state.messages.notice.empty());
  }
  // What was taken up before is put down.
  state.edit.tool = EditTool::brush;
  test::press(state, kKeyF3);
  CHECK(state.edit.tool == EditTool::none);
}

TEST_CASE("clicks are a tool's or inspect: what is switched on last has them") {
  ViewerState state = sampleState();
  test::press(state, kKeyF2);
  test::press(state, 'M');
  CHECK(state.inspect.active);
  CHECK(state.messages.notice == "A click inspects its pixel");
  CHECK(state.edit.tool == EditTool::none);
  test::press(state, kKeyF3);
  CHECK(state.edit.tool == EditTool::brush);
  CHECK_FALSE(state.inspect.active);
  test::press(state, 'M');
  test::press(state, 'M');
  CHECK_FALSE(state.inspect.active);
  CHECK(state.edit.tool == EditTool::none);
}

TEST_CASE("without a model the menus offer what opens one, what shows the window, and the keys") {
  const ViewerState state;
  std::vector<std::string> offered;
  for (const KeyBinding& binding : keyBindings()) {
    if (binding.menu != Menu::none && canRun(state, binding)) offered.emplace_back(binding.text);
  }
  CHECK(offered == std::vector<std::string>{"Open a file", "Save the whole window as PNG", "Quit",
                                            "Hide or show the panel", "Full screen", "Keys and mouse"});
}

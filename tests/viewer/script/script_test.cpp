// SPDX-License-Identifier: Apache-2.0
// Scripts that drive the window.
#include "viewer/script/script.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <sstream>
#include <string>
#include <utility>

#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "viewer/view/actions.h"

using namespace tg;

TEST_CASE("commands change the state in order and stop where a frame is due") {
  ViewerState state;
  Script script = parseScript("# comment\noutput depth\n\ntextures off  # why not\npicture a.png\noutput alpha\n", "s");
  step(script, state);
  CHECK(state.display.output == Output::depth);
  CHECK(state.display.settings.textures == TextureMode::none);
  CHECK(state.capture.picture == "a.png");
  CHECK_FALSE(state.quit);
  state.capture = {};
  step(script, state);
  CHECK(state.display.output == Output::alpha);
  CHECK(state.quit);
}

TEST_CASE("a program may add verbs to its scripts, and other programs do not know them") {
  constexpr Verb kMore[] = {{"quit", 0, 0, [](const Call& c) { c.state.quit = true; }}};
  ViewerState state;
  Script script = parseScript("quit\nwait 1\n", "s", kMore);
  step(script, state);
  CHECK(state.quit);
  CHECK_THROWS_WITH(parseScript("quit\n", "s"), "s: line 1: unknown command \"quit\"");
}

TEST_CASE("wait draws that many frames") {
  ViewerState state;
  Script script = parseScript("wait 3\noutput base", "s");
  for (int frame = 0; frame < 3; ++frame) {
    step(script, state);
    CHECK(state.display.output == Output::final);
  }
  step(script, state);
  CHECK(state.display.output == Output::base);
}

TEST_CASE("repeat runs a script so many times, a frame between") {
  ViewerState state;
  int rounds = 0;
  Script script = parseScript("panel on\nturntable off\nrepeat 3\n", "s");
  for (int frame = 0; !state.quit && frame < 10; ++frame) {
    state.camera.turntable = true;
    step(script, state);
    rounds += state.camera.turntable ? 0 : 1;
  }
  CHECK(rounds == 3);
  CHECK_THROWS_WITH(parseScript("repeat 2\nwait 1\n", "s.txt"),
                    "s.txt: line 2: wait comes after repeat (expected as the last command)");
}

TEST_CASE("await waits for the models of --follow, but not for ever") {
  ViewerState state;
  state.time = 5;
  Script script = parseScript("await 2\noutput base", "s");
  step(script, state);
  state.follow.reloads = 1;
  state.time = 60;
  step(script, state);
  CHECK(state.display.output == Output::final);
  state.follow.reloads = 2;
  for (int frame = 0; frame < 4; ++frame) step(script, state);
  CHECK(state.display.output == Output::base);
  Script late = parseScript("await 3", "s");
  step(late, state);
  state.time += 61;
  CHECK_THROWS_WITH(step(late, state),
                    "s: line 1: await: no such model came in 60 s (expected --follow and 3 models, found 2)");
}

TEST_CASE("a second recording is refused while one goes on") {
  ViewerState state;
  Script script = parseScript("record a/#.png\nrecord b/#.png\n", "s.txt");
  step(script, state);
  CHECK_THROWS_WITH(step(script, state),
                    "s.txt: line 2: record: a recording goes on (expected await-recording or "
                    "cancel-recording before it)");
  CHECK(state.record.out == "a/#.png");
  for (const std::string between : {"cancel-recording", "await-recording"}) {
    state.quit = state.record.wanted = false;
    script = parseScript("record a/#.png\n" + between + "\nrecord b/#.png\n", "s.txt");
    for (int frame = 0; frame < 9 && state.record.out != "b/#.png"; ++frame) {
      step(script, state);
      if (frame == 4) state.record.wanted = false;  // it is done
    }
    CHECK(std::exchange(state.record.out, "") == "b/#.png");
  }
}

TEST_CASE("a size request is handed to the window, and time given to follow it") {
  ViewerState state;
  Script script = parseScript("size 320x200\noutput base", "s");
  CHECK(step(script, state) == glm::ivec2(320, 200));
  CHECK_FALSE(step(script, state));
  CHECK(state.display.output == Output::final);
}

TEST_CASE("keys do what the keyboard does") {
  ViewerState state;
  Script script = parseScript("key 5\nkey Shift+/\n", "s");
  step(script, state);
  CHECK(state.display.output == Output::depth);
  while (!state.quit) step(script, state);
  CHECK(state.ui.help);
}

TEST_CASE("a script presses every key by the name that the help has for it") {
  ViewerState state;
  int pressed = 0;
  for (const KeyBinding& binding : keyBindings()) {
    std::string names = binding.keys;
    std::erase(names, ' ');  // "Page Up" is one word of a script, and "? or F1" are two keys
    if (const std::size_t either = names.find("or"); either != std::string::npos) names.replace(either, 2, ",");
    std::istringstream list(names == "," || names == "Shift+," ? "" : names);
    for (std::string name; std::getline(list, name, ',');) {
      CAPTURE(name);
      Script script = parseScript("key " + name, "s");
      CHECK_NOTHROW(step(script, state));
      ++pressed;
    }
  }
  CHECK(pressed > 50);
  state.ui.help = false;
  Script question = parseScript("key ?", "s");
  step(question, state);
  CHECK(state.ui.help);
}

TEST_CASE("a key that acts while it is held has its commands named") {
  ViewerState state;
  for (const char* key : {"W", "A", "S", "D", "Q", "E", "Z", "X", "Shift+W"}) {
    Script script = parseScript(std::string("key ") + key, "s");
    CHECK_THROWS_WITH(step(script, state), Contains("moves the camera while it is held, a script does by orbit"));
  }
  Script pad = parseScript("key Shift+Num1", "s");
  CHECK_THROWS_WITH(step(pad, state), Contains("one of the keys that do something"));
}

TEST_CASE("what a command began and fails frames later has the command's line") {
  ViewerState state;
  Script script = parseScript("tab view\nrecord x.gif\n", "s.txt");
  const Error refused(ErrorKind::usage, "recording: expected a video");
  CHECK_THROWS_WITH(failAtLast(script, refused), "s.txt: before line 1: recording: expected a video");
  for (int frame = 0; !state.record.wanted && frame < 9; ++frame) step(script, state);
  CHECK_THROWS_WITH(failAtLast(script, refused), "s.txt: line 2: record: recording: expected a video");
}

TEST_CASE("scripts choose, change and take back Gaussians") {
  ViewerState state;
  Scene scene;
  scene.path = "a.tgz";
  scene.model = std::make_shared<GaussianModel>(tinyModel(20, 0));
  measure(scene);
  setScene(state, scene);
  const GaussianModel before = *scene.model;
  const auto run = [&](const std::string& text) {
    Script script = parseScript(text + "\nwait 9\n", "s");
    for (int frame = 0; frame < 20 && !state.quit; ++frame) {
      step(script, state);
      recordChanges(state, false, false);
    }
    state.quit = false;
  };
  const auto left = static_cast<std::size_t>(std::ranges::count_if(before.mean, [](glm::vec3 p) { return p.x > 0; }));
  run("select x>0");
  REQUIRE(state.edit.selection);
  CHECK(state.edit.selection->count == left);
  run("select-mode subtract\nselect index<20\nselect-mode add\nselect x>0\nselect invert\ndelete-selection");
  CHECK(state.scene.model->size() == left);
  run("undo");
  CHECK(*state.scene.model == before);
  run("select none\nmove-selection 1,2,3");
  CHECK(glm::distance(state.scene.model->mean[4], before.mean[4] + glm::vec3(1, 2, 3)) < 1e-6f);
  run("scale-selection 2\nturn-selection 0,0,90");
  CHECK(state.scene.model->log_scale[4].x == Approx(before.log_scale[4].x + std::log(2.0f)));
  run("undo\nundo\nundo");
  CHECK(*state.scene.model == before);
  run("redo\nkey Ctrl+Z\nkey Ctrl+Shift+Z\nsave-model b.tgz");
  CHECK_FALSE(*state.scene.model == before);
  CHECK(state.desktop.save_request == std::filesystem::path("b.tgz"));
  for (const char* bad :
       {"select x>", "select everything", "select-sphere 0,0,0,-1", "select-rectangle 0 0 2 1", "move-selection 1,2",
        "move-selection 1,2,nan", "scale-selection 0", "tool hammer", "save-model a.docx", "key F0"}) {
    Script script = parseScript(bad, "s.txt");
    CAPTURE(bad);
    CHECK_THROWS_WITH(step(script, state), Contains("s.txt: line 1: "));
  }
  ViewerState empty;
  Script script = parseScript("select all", "s.txt");
  CHECK_THROWS_AS(step(script, empty), Error);
}

TEST_CASE("a broken script names its line") {
  CHECK_THROWS_WITH(parseScript("output final\nrotate 5\n", "s.txt"), "s.txt: line 2: unknown command \"rotate\"");
  CHECK_THROWS_WITH(parseScript("orbit 5", "s.txt"), "s.txt: line 1: orbit (expected 2 words, found 1)");
  ViewerState state;
  for (const char* bad : {"output red", "textures maybe", "background 3", "camera 0", "wait 0", "wait x", "repeat 0",
                          "repeat 1e9", "size 1", "key Pause", "key a", "key W", "key Ctrl+9", "panel yes", "fov wide",
                          "orbit 1 x", "dolly 0", "dolly -1", "dolly 1e9"}) {
    Script script = parseScript(bad, "s.txt");
    CHECK_THROWS_AS(step(script, state), Error);
  }
  CHECK_THROWS_AS(readScript("no-such-script.txt"), Error);
}

TEST_CASE("what a script counts is whole") {
  for (const char* bad : {"wait 1.5", "repeat 2.5", "await 0.5", "record-frames 2.9", "inspect 1.5 2", "inspect 1 2.5",
                          "splat-budget 10.5"}) {
    CAPTURE(bad);
    ViewerState state;
    Script script = parseScript(bad, "s.txt");
    CHECK_THROWS_WITH(step(script, state), Contains("expected a whole number from "));
  }
}

TEST_CASE("what the viewer says that did not work ends the script under the command before it") {
  ViewerState state;
  state.messages.error = "of the last session";
  Script script = parseScript("tab edit\nload-path none.json\ntab view\n", "s.txt");
  CHECK_THROWS_WITH(step(script, state), "s.txt: before line 1: of the last session");
  script.error = state.messages.error;
  CHECK_FALSE(step(script, state));
  const auto go = [&] {
    while (!state.quit) step(script, state);
  };
  CHECK_THROWS_WITH(go(), Catch::Matchers::StartsWith("s.txt: line 2: load-path: none.json: "));
  CHECK(state.ui.tab == Tab::edit);

  state.messages.error.clear();
  script = parseScript("open none.tgz", "s.txt");
  CHECK_FALSE(step(script, state));
  state.messages.error = "none.tgz: no such file";
  CHECK_THROWS_WITH(go(), "s.txt: line 1: open: none.tgz: no such file");
  script = parseScript("keep-going on\nopen none.tgz\ntab view\n", "s.txt");
  state.messages.error.clear();
  CHECK_FALSE(step(script, state));
  state.messages.error = "none.tgz: no such file";
  CHECK_NOTHROW(go());
  CHECK(state.ui.tab == Tab::view);
}

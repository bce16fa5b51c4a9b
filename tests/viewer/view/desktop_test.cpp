// SPDX-License-Identifier: Apache-2.0
// What is asked before a window or a model is closed.
#include "viewer/view/desktop.h"

#include <set>

#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/keys.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/path_editor.h"

using namespace tg;
using test::press;

namespace {

ViewerState stateWithModel() {
  Scene scene;
  scene.path = "tiny.tgz";
  scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(6));
  scene.bounds = sceneBounds(*scene.model);
  ViewerState state;
  setScene(state, scene);
  state.documents.open.emplace_back().path = "tiny.tgz";
  state.documents.shown = 0;
  return state;
}

}  // namespace

TEST_CASE("a window with nothing to lose closes at once, one with a new path asks, and not once it is saved") {
  const TemporaryFolder folder;
  ViewerState state = stateWithModel();
  press(state, kControl | 'Q');
  CHECK(state.quit);

  state = stateWithModel();
  addKey(state);
  press(state, kControl | 'Q');
  CHECK_FALSE(state.quit);
  REQUIRE(state.desktop.question);
  CHECK(isModal(state));
  keepUnsaved(state);
  CHECK_FALSE(isModal(state));
  savePath(state, folder / "path.json");
  notePathKept(state);
  askToQuit(state);
  CHECK(state.quit);

  state = stateWithModel();
  readPathFile(state, folder / "path.json");
  addKey(state);
  askToQuit(state);
  CHECK_FALSE(state.quit);
  discardUnsaved(state);
  CHECK(state.quit);
}

TEST_CASE("Save of the question asks for a file, and a change of mind forgets what was discarded") {
  ViewerState state = stateWithModel();
  addKey(state);
  addBookmark(state);
  askToQuit(state);
  discardUnsaved(state);  // the path
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::bookmarks);
  keepUnsaved(state);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::path);
  saveUnsaved(state);
  CHECK(state.desktop.wanted == FileUse::savePath);
  REQUIRE(state.desktop.after_saving);
  CHECK_FALSE(state.quit);
}

TEST_CASE("a run that waits because the window has said so is not left waiting without a question") {
  ViewerState state = stateWithModel();
  state.follow.active = true;
  state.follow.status = RunStatus{};
  const auto asks = [&](RunPhase phase) {
    state.follow.status->phase = phase;
    state.quit = false;
    askToQuit(state);
    CHECK(state.quit != state.desktop.question.has_value());
    return state.desktop.question && state.desktop.question->what == Unsaved::run;
  };
  CHECK_FALSE(asks(RunPhase::paused));  // by somebody else
  tellRun(state.follow, {RunCommand::pause, 1});
  CHECK_FALSE(asks(RunPhase::finished));
  CHECK(asks(RunPhase::training));  // the order is under way
  keepUnsaved(state);
  CHECK(asks(RunPhase::paused));
  keepUnsaved(state);
  CHECK_FALSE(state.quit);
  CHECK(asks(RunPhase::paused));
  discardUnsaved(state);
  CHECK(state.quit);
  CHECK(state.follow.order->command == RunCommand::pause);
  tellRun(state.follow, {RunCommand::step, 100});
  CHECK(asks(RunPhase::paused));
  saveUnsaved(state);
  CHECK(state.quit);
  CHECK(state.follow.order->command == RunCommand::go);
  CHECK_FALSE(asks(RunPhase::paused));
}

TEST_CASE("a recording that is under way is asked about before the window closes, and may end first") {
  ViewerState state = stateWithModel();
  state.record.wanted = true;
  const auto asks = [&] {
    state.quit = false;
    press(state, kControl | 'Q');
    CHECK(state.quit != state.desktop.question.has_value());
    return state.desktop.question && state.desktop.question->what == Unsaved::recording;
  };
  press(state, kControl | 'W');  // closing the model cancels it, which says so
  CHECK_FALSE(state.desktop.question);
  CHECK(asks());
  keepUnsaved(state);
  CHECK(state.record.wanted);
  CHECK(asks());
  discardUnsaved(state);
  CHECK(state.quit);
  CHECK(asks());
  saveUnsaved(state);
  CHECK_FALSE(state.quit);
  CHECK(state.record.wanted);
  CHECK(state.desktop.after_recording);
  CHECK(asks());  // once more: it may end while the question is open, which then decides
  CHECK_FALSE(state.desktop.after_recording);
  saveUnsaved(state);
  CHECK(state.desktop.after_recording);
  keepUnsaved(state);
  CHECK_FALSE(state.desktop.after_recording);
  // It ends while the question is open.
  CHECK(asks());
  state.record.wanted = false;
  saveUnsaved(state);
  CHECK(state.quit);
  CHECK_FALSE(asks());
}

TEST_CASE("a model that is closed asks for its bookmarks, unless they are kept between runs") {
  ViewerState state = stateWithModel();
  addKey(state);  // the path stays with the window
  press(state, kControl | 'W');
  CHECK(state.documents.close_request == 0);
  state.documents.close_request.reset();
  addBookmark(state);
  press(state, kControl | 'W');
  CHECK_FALSE(state.documents.close_request);
  REQUIRE(state.desktop.question);
  discardUnsaved(state);
  CHECK(state.documents.close_request == 0);
  state.documents.close_request.reset();
  state.desktop.bookmarks_kept = true;
  askToClose(state, 0);
  CHECK(state.documents.close_request == 0);
}

TEST_CASE("bookmarks of every open model are asked for, in view") {
  ViewerState state = stateWithModel();
  addBookmark(state);
  leaveDocument(state);
  Scene other = state.scene;
  other.path = "other.tgz";
  state.documents.open.emplace_back().path = other.path;
  state.documents.shown = 1;
  setScene(state, other);
  noteBookmarksKept(state);
  askToQuit(state);
  CHECK_FALSE(state.quit);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::bookmarks);
  CHECK(state.desktop.question->model == "tiny.tgz");
  CHECK(state.documents.show_request == 0);
  keepUnsaved(state);
  addBookmark(state);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "other.tgz");
  discardUnsaved(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "tiny.tgz");
  discardUnsaved(state);
  CHECK(state.quit);
  state.documents.close_request.reset();
  askToClose(state, 0);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "tiny.tgz");
}

TEST_CASE("Cancel ends what was to follow a file that is being saved") {
  ViewerState state = stateWithModel();
  addKey(state);
  askToQuit(state);
  saveUnsaved(state);
  REQUIRE(state.desktop.after_saving);
  askToQuit(state);
  keepUnsaved(state);
  CHECK_FALSE(state.desktop.after_saving);
  CHECK(state.desktop.stays_open);
}

TEST_CASE("Esc leaves the full screen before it leaves the program") {
  ViewerState state = stateWithModel();
  press(state, kKeyF11);
  CHECK(state.desktop.fullscreen);
  press(state, kKeyEscape);
  CHECK_FALSE(state.desktop.fullscreen);
  press(state, kKeyEscape);
  CHECK_FALSE(state.quit);
  state.time += 60;
  press(state, kKeyEscape);
  CHECK_FALSE(state.quit);  // one press too many, long after another one
  press(state, kKeyEscape);
  CHECK(state.quit);
}

TEST_CASE("a second Esc quits only once the window has shown that it does") {
  ViewerState state = stateWithModel();
  state.time = 100;
  const auto quitsBy = [&](double time) {
    CHECK(pressKey(state, kKeyEscape, false, time));
    return std::exchange(state.quit, false);
  };
  CHECK_FALSE(quitsBy(100));
  CHECK_FALSE(quitsBy(100));  // in the same slow frame
  state.time = 110;           // which is shown so much later
  test::frameShown(state);
  CHECK_FALSE(quitsBy(100.5));  // taken up before it was
  test::frameShown(state);
  CHECK(quitsBy(state.time + 1));
  state.time = 200;
  CHECK_FALSE(quitsBy(200));
  test::frameShown(state);
  CHECK_FALSE(quitsBy(203));  // one press too many, long after another one
  test::frameShown(state);
  CHECK(quitsBy(state.time));
}

TEST_CASE("a second Esc does not quit where something else stands in the place of its notice") {
  ViewerState state = stateWithModel();
  const bool is_shown = GENERATE(false, true), is_error = GENERATE(false, true);
  CAPTURE(is_shown, is_error);
  state.time = 100;
  CHECK(pressKey(state, kKeyEscape, false, state.time));
  if (is_shown) test::frameShown(state);
  if (is_error) {
    attempt(state, [] { throw Error(ErrorKind::badData, "broken"); });
  } else {
    notify(state, "Saved a.png");
  }
  test::frameShown(state);
  if (is_error) press(state, kKeyEscape);
  press(state, kKeyEscape);
  CHECK_FALSE(state.quit);
  press(state, kKeyEscape);
  CHECK(state.quit);
}

TEST_CASE("Esc ends what the pointer does and what goes on before it leaves the program") {
  ViewerState state = stateWithModel();
  const bool turns = GENERATE(false, true);
  state.record.wanted = state.inspect.active = state.inspect.isolated = true;
  state.edit.tool = EditTool::move;
  press(state, kKeyEscape);
  CHECK(state.edit.tool == EditTool::none);
  CHECK(state.inspect.active);
  press(state, kKeyEscape);
  CHECK_FALSE(state.inspect.active);
  CHECK_FALSE(state.inspect.isolated);
  CHECK(state.record.wanted);
  (turns ? state.camera.turntable : state.path.playing) = true;
  press(state, kKeyEscape);
  CHECK_FALSE(state.record.wanted);
  CHECK(movesByItself(state));
  press(state, kKeyEscape);
  CHECK_FALSE(movesByItself(state));
  state.time += 60;
  press(state, kKeyEscape);
  CHECK_FALSE(state.quit);
  press(state, kKeyEscape);
  CHECK(state.quit);
}

TEST_CASE("no key has two meanings, and a letter with Ctrl is not the letter") {
  std::set<std::pair<int, bool>> keys;
  for (const KeyBinding& binding : keyBindings()) {
    INFO(binding.text);
    CHECK((binding.key == 0 || keys.emplace(binding.key, binding.shift).second));
    CHECK((binding.menu == Menu::none || *binding.text));
  }
  ViewerState state = stateWithModel();
  const Output before = state.display.output;
  CHECK_FALSE(pressKey(state, kControl | '5', false));
  CHECK(state.display.output == before);
  press(state, kControl | 'O');
  CHECK(state.desktop.wanted == FileUse::open);
}

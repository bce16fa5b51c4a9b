// SPDX-License-Identifier: Apache-2.0
// A recording in the window, without one.
#include "viewer/picture/recording_run.h"

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <thread>

#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/picture/runs.h"
#include "viewer/view/desktop.h"
#include "viewer/view/path_editor.h"

using namespace tg;

TEST_CASE("a recording takes pictures of the path, or of a turn, in order") {
  const TemporaryFolder folder;
  Scene scene;
  scene.bounds = {{0, 0, 0}, 2.0};
  scene.cameras.push_back(lookAt({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 36));
  ViewerState state;
  setScene(state, scene);
  state.record.out = folder / "f";
  state.record.size = {8, 6};
  state.record.turntable_frames = 4;
  {
    RecordingRun turn(state);
    CHECK(turn.frames() == 4);
    while (turn.done() < turn.frames()) {
      const Camera* due = turn.due();
      if (!due) continue;
      CHECK(due->size.x == 8);
      turn.take({}, [] { return Image(8, 6, 3, 0.5f); });
    }
    CHECK_FALSE(turn.due());
    turn.finish();
  }
  CHECK(std::filesystem::exists(folder / "f/0003.png"));
  addKey(state);
  orbit(state.camera.pose, 0.5, 0.1);
  addKey(state);
  state.record.fps = 2;
  RecordingRun path(state);
  CHECK(path.frames() == 5);
  state.record.out = "f.gif";
  CHECK_THROWS_AS(RecordingRun(state), Error);
}

TEST_CASE("a window records no numbers: its pictures have colours") {
  const TemporaryFolder folder;
  ViewerState state;
  state.record.out = folder / "frames/##.EXR";
  CHECK_THROWS_WITH(RecordingRun(state),
                    Contains("frames/##.EXR: expected a video (") &&
                        Contains("(frames/####.png, .jpg; numbers as .exr are tgview --output's)") &&
                        Contains("##.EXR"));
  CHECK_FALSE(std::filesystem::exists(folder / "frames"));
}

TEST_CASE("the question whether a recording may end is gone once it fails or is cancelled, and nothing closes") {
  const TemporaryFolder folder;
  const auto begun = [&](PictureRuns& runs) {
    Scene scene;
    scene.model = std::make_shared<GaussianModel>(tinyTexturedModel(6));
    scene.bounds = {{0, 0, 0}, 2.0};
    ViewerState state;
    setScene(state, scene);
    state.record.wanted = true;
    state.record.out = folder / "f";
    state.record.size = {8, 6};
    state.record.turntable_frames = 2;
    runs.update(state, {8, 6});
    REQUIRE(runs.active());
    askToQuit(state);
    REQUIRE(state.desktop.question);
    return state;
  };
  const auto stays = [](ViewerState& state) {
    CHECK_FALSE(state.desktop.question);
    CHECK(state.desktop.stays_open);
    saveUnsaved(state);  // the key came in the same frame
    CHECK_FALSE(state.quit);
  };
  const auto take = [](PictureRuns& runs, ViewerState& state, const std::function<Image()>& read) {
    Picture picture;
    while (true) {
      std::this_thread::yield();
      if (const auto request = runs.due({})) {
        picture.request = *request;
        break;
      }
    }
    CHECK(runs.take(state, picture, read));
  };
  const auto now = std::chrono::steady_clock::now();
  {
    PictureRuns runs({}, now, false);
    ViewerState state = begun(runs);
    take(runs, state, []() -> Image { throw Error(ErrorKind::cannotWrite, "no space"); });
    CHECK(state.messages.error == "no space");
    stays(state);
  }
  {
    PictureRuns runs({}, now, false);
    ViewerState state = begun(runs);
    state.record.wanted = false;
    CHECK(runs.update(state, {8, 6}));
    stays(state);
  }
  {
    PictureRuns runs({}, now, false);
    ViewerState state = begun(runs);
    runs.giveUp(state, "no device");
    stays(state);
  }
  PictureRuns runs({}, now, false);
  ViewerState state = begun(runs);
  for (int i = 0; i < 2; ++i) take(runs, state, [] { return Image(8, 6, 3, 0.5f); });
  CHECK(runs.update(state, {8, 6}));
  CHECK(state.desktop.question);  // it ended well
  saveUnsaved(state);
  CHECK(state.quit);
}

// SPDX-License-Identifier: Apache-2.0
// A recording in the window, without one.
#include "viewer/picture/recording_run.h"

#include <filesystem>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
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

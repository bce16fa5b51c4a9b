// SPDX-License-Identifier: Apache-2.0
// Bookmarks, the path and what moves the camera by itself, as changes of the state.
#include "viewer/view/path_editor.h"

#include <filesystem>
#include <fstream>

#include "core/system/error.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/keys.h"
#include "viewer/view/actions.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/input.h"

using namespace tg;
using test::press;

namespace {

ViewerState stateAt(glm::dvec3 eye) {
  Scene scene;
  scene.path = "fox.tgz";
  scene.bounds = {{0, 0, 0}, 2.0};
  scene.cameras.push_back(lookAt(eye, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 36));
  ViewerState state;
  setScene(state, scene);
  return state;
}

// Three keys, 2 s apart.
ViewerState stateWithPath() {
  ViewerState state = stateAt({0, 0, -4});
  for (int i = 0; i < 3; ++i) {
    press(state, 'K');
    orbit(state.camera.pose, 0.5, 0.1);
  }
  return state;
}

double distanceOf(const ViewPose& a, const ViewPose& b) {
  double sum = glm::length(a.position - b.position);
  for (int c = 0; c < 3; ++c) sum += glm::length(a.cameraFromWorldRotation()[c] - b.cameraFromWorldRotation()[c]);
  return sum;
}

}  // namespace

TEST_CASE("a bookmark brings back pose and lens, in this window and after a file") {
  const TemporaryFolder folder;
  ViewerState state = stateAt({1, 2, -4});
  state.camera.pose.roll = 0.3;
  state.camera.lens.fov_y = 0.5;
  press(state, 'B', true);
  const CameraState before = state.camera;
  saveBookmarks(state, folder / "b.json");
  for (int i = 0; i < 2; ++i) {
    orbit(state.camera.pose, 1, 0.2);
    state.camera.lens.fov_y = 0.9;
    press(state, 'B');
    CHECK(distanceOf(state.camera.pose, before.pose) < 1e-9);
    CHECK(state.camera.lens.fov_y == Approx(before.lens.fov_y).epsilon(1e-12));
    CHECK(state.camera.index == -1);
    readBookmarks(state, folder / "b.json");
  }
}

TEST_CASE("B goes through the bookmarks, removed ones leave their number to new ones") {
  ViewerState state = stateAt({0, 0, -4});
  press(state, 'B');
  CHECK_FALSE(state.messages.notice.empty());
  for (int i = 0; i < 3; ++i) {
    press(state, 'B', true);
    orbit(state.camera.pose, 0.4, 0);
  }
  CHECK(state.camera.bookmarks[2].name == "view 3");
  press(state, 'B');
  CHECK(state.camera.bookmark == 0);
  removeBookmark(state, 1);
  addBookmark(state);
  CHECK(state.camera.bookmarks[2].name == "view 4");
  removeBookmark(state, 0);
  addBookmark(state);
  CHECK(state.camera.bookmarks[2].name == "view 5");
  goToBookmark(state, 1);
  state.camera.bookmark = 1;
  const std::string at = state.camera.bookmarks[1].name;
  removeBookmark(state, 0);
  CHECK(state.camera.bookmarks[static_cast<std::size_t>(state.camera.bookmark)].name == at);
  addBookmark(state);
  CHECK_THROWS_AS(readBookmarks(state, "no-such-file.json"), Error);
  CHECK(state.camera.bookmarks.size() == 3);
}

TEST_CASE("buttons that load say what has come, and those that save add the extension that is missing") {
  const TemporaryFolder folder;
  ViewerState state = stateAt({0, 0, -4});
  for (int i = 0; i < 2; ++i) addBookmark(state);
  goToBookmark(state, 1);
  addKey(state);
  saveBookmarks(state, folder / "b.json");
  savePath(state, folder / "p.json");
  loadPath(state, folder / "p.json");
  CHECK(state.messages.notice == "1 key from p.json");
  loadBookmarks(state, folder / "b.json");
  CHECK(state.messages.notice == "2 bookmarks from b.json");
  CHECK(state.camera.bookmark == 1);  // they are the same
  removeBookmark(state, 0);
  loadBookmarks(state, folder / "b.json");
  CHECK(state.camera.bookmark == -1);
  CHECK(withJson("views") == "views.json");
  CHECK(withJson("a.b/views.1") == "a.b/views.1.json");
  CHECK(withJson("views.JSON") == "views.JSON");
  CHECK(withJson("") == "");
}

TEST_CASE("a button that writes a file asks before it replaces one, and not of its own") {
  const TemporaryFolder folder;
  ViewerState state = stateWithPath();
  const std::filesystem::path there = folder / "a.mp4";
  std::ofstream(there) << "somebody's";
  state.record.out = there;
  press(state, 'R', true);
  CHECK_FALSE(state.record.wanted);
  CHECK(state.messages.notice == "a.mp4 is there already: once more replaces it");
  press(state, 'R', true);
  CHECK(state.record.wanted);
  press(state, 'R', true);
  CHECK_FALSE(state.record.wanted);
  CHECK_FALSE(mayReplace(state, there, "path"));  // another use of the same file
  CHECK(mayReplace(state, there, "path"));
  CHECK(mayReplace(state, folder / "new.json", "path"));
  std::ofstream(folder / "new.json") << "written by the button";
  CHECK(mayReplace(state, folder / "new.json", "path"));
  CHECK_FALSE(mayReplace(state, folder / "new.json", "cameras"));
  CHECK(mayReplace(state, folder / "new.json", "cameras"));
  state.scene.path = "another.tgz";  // whose cameras these are not
  CHECK_FALSE(mayReplace(state, folder / "new.json", "cameras"));
  CHECK(mayReplace(state, folder / "new.json", "cameras"));
  state.record.out = folder.path;  // pictures, numbered
  press(state, 'R', true);
  CHECK(state.record.wanted);
}

TEST_CASE("a new model has its own bookmarks and no path") {
  ViewerState state = stateWithPath();
  addBookmark(state);
  setScene(state, state.scene);
  CHECK(state.camera.bookmarks.empty());
  CHECK(state.path.path.keys.size() == 3);  // a path may be compared on two models
}

TEST_CASE("playing goes through the keys and stops at the end, input takes over") {
  ViewerState state = stateWithPath();
  showKey(state, 0);
  const ViewPose first = state.camera.pose;
  showKey(state, 2);
  const ViewPose last = state.camera.pose;
  CHECK(state.path.at == 4);
  press(state, 'L');
  CHECK(state.path.at == 0);  // it stood at the end
  CHECK(advance(state, 0));
  CHECK(distanceOf(state.camera.pose, first) < 1e-9);
  for (int i = 0; i < 100 && state.path.playing; ++i) advance(state, 0.1);
  CHECK_FALSE(state.path.playing);
  CHECK(state.path.at == 4);
  CHECK(distanceOf(state.camera.pose, last) < 1e-9);
  CHECK_FALSE(advance(state, 0.1));
  press(state, 'L');
  Input input;
  input.left = true;
  input.drag = {10, 0};
  applyInput(state, input, 480);
  CHECK_FALSE(state.path.playing);
}

TEST_CASE("whoever goes to a camera, a bookmark or all of the model ends a path that plays") {
  ViewerState state;
  Scene scene;
  scene.cameras.resize(2);
  for (Camera& camera : scene.cameras) camera = lookAt({0, 0, -3}, {0, 0, 0}, {0, -1, 0}, 0.7, 64, 48);
  setScene(state, scene);
  state.camera.bookmarks = {scene.cameras[0]};
  for (const std::function<void()>& go : std::vector<std::function<void()>>{
           [&] { goToCamera(state, 1); }, [&] { goToCamera(state, "1", "--camera"); }, [&] { goToBookmark(state, 0); },
           [&] { frameScene(state); }, [&] { resetView(state); }}) {
    state.path.playing = true;
    go();
    CHECK_FALSE(state.path.playing);
  }
  CHECK(state.camera.index == 0);
}

TEST_CASE("a closed path plays on, seeking shows the view of the recording") {
  ViewerState state = stateWithPath();
  changeKeySeconds(state, 2, 1);
  press(state, 'L');
  for (int i = 0; i < 70; ++i) advance(state, 0.1);
  CHECK(state.path.playing);
  CHECK(state.path.at < 5);
  seekPath(state, 1.5);
  CHECK_FALSE(state.path.playing);
  const Camera shown = currentCamera(state);
  const Camera recorded = pathCameras(state.path.path, 2, shown.size.x, shown.size.y)[3];
  CHECK(glm::length(shown.position() - recorded.position()) < 1e-9);
  CHECK(shown.focal.y == Approx(recorded.focal.y).epsilon(1e-3));
}

TEST_CASE("keys can be set, deleted and cleared") {
  ViewerState state = stateWithPath();
  const ViewPose here = state.camera.pose;
  replaceKey(state, 1);
  showKey(state, 0);
  showKey(state, 1);
  CHECK(distanceOf(state.camera.pose, here) < 1e-9);
  CHECK(state.path.at == 2);
  for (PathKey& key : state.path.path.keys) key.time += 100;  // as a file may have them
  addKey(state);
  CHECK(state.path.at == duration(state.path.path));
  deleteKey(state, state.path.path.keys.size() - 1);
  showKey(state, 1);
  deleteKey(state, 0);
  CHECK(state.path.path.keys.size() == 2);
  CHECK(state.path.key == 0);
  clearPath(state);
  press(state, 'L');
  CHECK_FALSE(state.path.playing);
  CHECK_THROWS_AS(savePath(state, "p.json"), Error);
}

TEST_CASE("a path goes to files and back, also as cameras") {
  const TemporaryFolder folder;
  ViewerState state = stateWithPath();
  const CameraPath path = state.path.path;
  savePath(state, folder / "p.json");
  saveKeyCameras(state, folder / "c.json");
  clearPath(state);
  readPathFile(state, folder / "p.json");
  REQUIRE(state.path.path.keys.size() == 3);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(state.path.path.keys[i].position == path.keys[i].position);
    CHECK(state.path.path.keys[i].time == path.keys[i].time);
    CHECK(state.path.path.keys[i].lens == path.keys[i].lens);
  }
  readPathFile(state, folder / "c.json");
  REQUIRE(state.path.path.keys.size() == 3);
  CHECK(glm::length(state.path.path.keys[2].position - path.keys[2].position) < 1e-9);
  CHECK_THROWS_AS(readPathFile(state, folder / "none.json"), Error);
  CHECK(state.path.path.keys.size() == 3);
}

TEST_CASE("the turntable turns by its speed, another up axis keeps position and pivot") {
  ViewerState state = stateAt({0, 0, -4});
  const glm::dvec3 pivot = state.camera.pose.pivot();
  const double yaw = state.camera.pose.yaw;
  CHECK_FALSE(advance(state, 1));
  press(state, 'R');
  for (int i = 0; i < 10; ++i) CHECK(advance(state, 0.1));
  CHECK(std::abs(std::remainder(state.camera.pose.yaw - yaw - state.camera.turntable_speed, 6.283185307179586)) < 1e-9);
  CHECK(glm::length(state.camera.pose.pivot() - pivot) < 1e-9);
  const glm::dvec3 position = state.camera.pose.position;
  for (int i = 0; i < kCount<UpAxis>; ++i) {
    press(state, 'U');
    CHECK(state.camera.pose.position == position);
    CHECK(glm::length(state.camera.pose.pivot() - pivot) < 1e-9);
  }
  CHECK(state.camera.up == UpAxis::cameras);
  setUp(state, UpAxis::plusZ);
  goToCamera(state, 0);
  CHECK(state.camera.pose.up() == glm::dvec3(0, 0, 1));
}

TEST_CASE("in fly mode the left button looks around, in orbit mode it goes round") {
  for (bool flying : {false, true}) {
    ViewerState state = stateAt({0, 0, -4});
    if (flying) press(state, 'G');
    const ViewPose before = state.camera.pose;
    Input input;
    input.left = true;
    input.drag = {40, 10};
    applyInput(state, input, 480);
    CHECK((state.camera.pose.position == before.position) == flying);
    CHECK((glm::length(state.camera.pose.pivot() - before.pivot()) < 1e-9) == !flying);
  }
}

TEST_CASE("an action that fails shows why") {
  ViewerState state;
  attempt(state, [] { throw Error(ErrorKind::badData, "x.json: broken"); });
  CHECK(state.messages.error == "x.json: broken");
}

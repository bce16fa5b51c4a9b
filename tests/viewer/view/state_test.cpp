// SPDX-License-Identifier: Apache-2.0
// What keys, mouse and new models do to the viewer's state.
#include "viewer/view/state.h"

#include <functional>
#include <set>
#include <string>
#include <utility>

#include "support/catch.h"
#include "viewer/keys.h"
#include "viewer/view/actions.h"
#include "viewer/view/input.h"
#include "viewer/view/names.h"

using namespace tg;
using test::press;

namespace {

ViewerState stateWithCameras(int count) {
  Scene scene;
  scene.path = "fox.tgz";
  scene.background = glm::vec3(1, 0.5f, 0);
  scene.bounds = {{0, 0, 0}, 2.0};
  for (int i = 0; i < count; ++i) {
    scene.cameras.push_back(lookAt({i - 1.0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  }
  ViewerState state;
  setScene(state, scene);
  return state;
}

}  // namespace

TEST_CASE("a new model brings its background and its first test camera, and keeps the switches") {
  ViewerState state = stateWithCameras(3);
  CHECK(state.display.settings.background == glm::vec3(1, 0.5f, 0));
  CHECK(state.camera.index == 0);
  state.display.output = Output::depth;
  state.display.settings.textures = TextureMode::alpha;
  Scene next = state.scene;
  next.cameras[1].test = true;
  setScene(state, next);
  CHECK(state.camera.index == 1);
  CHECK(state.display.output == Output::depth);
  CHECK(state.display.settings.textures == TextureMode::alpha);
}

TEST_CASE("a model without cameras is framed") {
  const ViewerState state = stateWithCameras(0);
  CHECK(state.camera.index == -1);
  CHECK(glm::length(state.camera.pose.pivot() - state.scene.bounds.center) < 1e-9);
  CHECK(state.camera.pose.distance > state.scene.bounds.radius);
}

TEST_CASE("every listed key has a text, and none is one that flies") {
  for (const KeyBinding& binding : keyBindings()) {
    CHECK((*binding.keys == 0 || *binding.text != 0));
    for (char fly : std::string("WASDQEZX")) CHECK(binding.key != fly);
  }
  ViewerState state = stateWithCameras(1);
  CHECK_FALSE(pressKey(state, 'W', false));
}

TEST_CASE("the number keys choose the output") {
  ViewerState state = stateWithCameras(1);
  for (int i = 0; i < 7; ++i) {
    press(state, '1' + i);
    CHECK(static_cast<int>(state.display.output) == i);
  }
}

TEST_CASE("T steps through the texture terms and back, Tab switches them off only while held") {
  ViewerState state = stateWithCameras(1);
  std::vector<TextureMode> seen;
  for (int i = 0; i < 4; ++i) {
    press(state, 'T');
    seen.push_back(state.display.settings.textures);
  }
  CHECK(seen == std::vector{TextureMode::rgb, TextureMode::alpha, TextureMode::none, TextureMode::rgba});
  state.display.textures_held_off = true;
  CHECK(effectiveSettings(state).textures == TextureMode::none);
  CHECK(state.display.settings.textures == TextureMode::rgba);
}

TEST_CASE("I starts from the model's own intersection") {
  ViewerState state = stateWithCameras(1);
  state.scene.intersection = IntersectionModel::plane;
  press(state, 'I');
  CHECK(state.display.settings.intersection == IntersectionModel::maxResponse);
  press(state, 'I');
  CHECK(state.display.settings.intersection == IntersectionModel::plane);
}

TEST_CASE("what lies beyond textures is shown as the model has it until a button says otherwise") {
  ViewerState state = stateWithCameras(1);
  state.scene.outside = TextureOutside::clip;
  CHECK(shownSettings(state, effectiveSettings(state)).outside == TextureOutside::clip);
  CHECK_FALSE(effectiveSettings(state).outside);
  state.display.settings.outside = TextureOutside::edge;
  CHECK(shownSettings(state, effectiveSettings(state)).outside == TextureOutside::edge);
}

TEST_CASE("Space goes round the cameras in both directions") {
  ViewerState state = stateWithCameras(3);
  press(state, ' ');
  CHECK(state.camera.index == 1);
  press(state, ' ', true);
  press(state, ' ', true);
  CHECK(state.camera.index == 2);
  press(state, ' ');
  CHECK(state.camera.index == 0);
  ViewerState none = stateWithCameras(0);
  press(none, ' ');
  CHECK(none.camera.index == -1);
  CHECK_FALSE(none.messages.notice.empty());
}

TEST_CASE("Esc closes an error, then the help, and pressed twice the viewer") {
  ViewerState state = stateWithCameras(1);
  state.messages.error = "x.ply: broken";
  state.ui.help = true;
  press(state, kKeyEscape);
  CHECK(state.messages.error.empty());
  CHECK(state.ui.help);
  press(state, kKeyEscape);
  CHECK_FALSE(state.ui.help);
  press(state, kKeyEscape);
  CHECK_FALSE(state.quit);
  CHECK_FALSE(state.messages.notice.empty());
  press(state, kKeyEscape);
  CHECK(state.quit);
}

TEST_CASE("the window has letters for every name that it shows") {
  ViewerState state = stateWithCameras(1);
  state.compare.photograph = "images/a.jpg";
  state.compare.problem = "b";
  state.messages.error = "c";
  state.recent = {"d"};
  std::set<std::string, std::less<>> names;
  forEachName(state, [&](std::string_view text) { names.emplace(text); });
  for (const char* shown : {"images/a.jpg", "b", "c", "d"}) CHECK(names.contains(shown));
}

TEST_CASE("a press of a button without a movement leaves the view to the last bit") {
  ViewerState state = stateWithCameras(20);
  state.scene.bounds.center = {7, 3, 11};  // a pivot farther from the origin than the camera, which takes digits away
  for (int camera = 0; camera < 20; ++camera) {
    const glm::dvec3 eye(0.37 * camera - 1.1, 0.21 * camera, 0.13 * camera - 4.3);
    state.scene.cameras[static_cast<std::size_t>(camera)] = lookAt(eye, {0.1, 0.2, 0.3}, {0, -1, 0}, 0.8, 64, 48);
    goToCamera(state, camera);
    const ViewPose start = state.camera.pose;
    for (const bool left : {true, false}) {
      Input input;
      input.seconds = 0.1;
      input.left = left;
      input.middle = !left;
      CHECK_FALSE(applyInput(state, input, 480));
      CHECK(state.camera.pose == start);
      CHECK(state.camera.index == camera);
    }
  }
}

TEST_CASE("after a move Space, full stop and comma go on from the camera that was left") {
  ViewerState state = stateWithCameras(6);
  for (int i : {1, 3, 5}) state.scene.cameras[i].test = true;
  const auto stepped = [&](int from, int key, bool shift) {
    goToCamera(state, from);
    Input input;
    input.left = true;
    input.drag = {12, -5};
    CHECK(applyInput(state, input, 480));
    press(state, key, shift);
    return state.camera.index;
  };
  CHECK(stepped(3, ' ', false) == 4);
  CHECK(stepped(3, ' ', true) == 2);
  CHECK(stepped(3, '.', false) == 5);
  CHECK(stepped(3, ',', false) == 1);
  CHECK(stepped(3, '.', true) == 4);
  frameScene(state);
  press(state, ' ');
  CHECK(state.camera.index == 5);
  frameScene(state);
  // Another model has none that was left.
  Scene other = state.scene;
  other.cameras.clear();
  setScene(state, other);
  replaceScene(state, stateWithCameras(3).scene);
  press(state, ' ');
  CHECK(state.camera.index == 0);
  press(state, ' ');
  press(state, ' ');
  frameScene(state);
  replaceScene(state, stateWithCameras(2).scene);  // which the third one is none of
  press(state, ' ');
  CHECK(state.camera.index == 0);
}

TEST_CASE("the view is at a model's camera, but for rounding and through any lens, until it moves") {
  ViewerState state = stateWithCameras(3);
  goToCamera(state, 2);
  Camera saved = toCamera(state.camera.pose, state.camera.lens, 640, 480);
  saved.translation += 1e-9;
  setCamera(state, saved);
  CHECK(state.camera.index == -1);
  CHECK(cameraHere(state) == 2);
  Input input;
  input.wheel = 3;
  input.control = true;
  CHECK(applyInput(state, input, 480));
  CHECK(cameraHere(state) == 2);
  input.control = false;
  CHECK(applyInput(state, input, 480));
  CHECK(cameraHere(state) == -1);
}

TEST_CASE("of cameras at one place the view is at the one that was left, else at that of the nearest lens") {
  ViewerState state = stateWithCameras(9);
  state.scene.cameras[3] = state.scene.cameras[7];
  state.scene.cameras[3].focal *= 2.0;
  goToCamera(state, 7);
  Input input;
  input.wheel = 1;
  input.control = true;
  CHECK(applyInput(state, input, 480));
  CHECK(state.camera.index == -1);
  CHECK(cameraHere(state) == 7);
  for (const int left : {3, 7}) {
    goToCamera(state, left);
    const Lens lens = state.camera.lens;
    goToCamera(state, 1);
    state.camera.pose = poseOf(state.scene.cameras[static_cast<std::size_t>(left)], upOf(state), state.scene.bounds);
    state.camera.lens = lens;
    leaveCamera(state.camera);
    CHECK(cameraHere(state) == left);
  }
}

TEST_CASE("the camera that was left is one of the list that is there, and comes back with its step") {
  ViewerState state = stateWithCameras(6);
  Input input;
  input.left = true;
  input.drag = {12, -5};
  recordChanges(state, false, false);
  for (const int camera : {3, 1}) {
    goToCamera(state, camera);
    recordChanges(state, false, false);
    CHECK(applyInput(state, input, 480));
    recordChanges(state, false, false);
  }
  CHECK(lastCamera(state) == 1);
  undo(state);
  undo(state);
  CHECK(state.camera.index == -1);
  CHECK(lastCamera(state) == 3);
  Scene other = state.scene;  // with as many cameras, others
  std::reverse(other.cameras.begin(), other.cameras.end());
  replaceScene(state, other);
  CHECK(lastCamera(state) == -1);
  recordChanges(state, false, false);
  redo(state);
  redo(state);
  CHECK(lastCamera(state) == -1);
  goToCamera(state, 4);
  CHECK(applyInput(state, input, 480));
  CHECK(lastCamera(state) == 4);
  replaceCameras(state, std::vector<Camera>(other.cameras));
  CHECK(state.camera.visited == -1);
}

TEST_CASE("moving leaves the model's camera, Shift+F comes back to it") {
  ViewerState state = stateWithCameras(2);
  const ViewPose start = state.camera.pose;
  Input input;
  input.seconds = 0.1;
  CHECK_FALSE(applyInput(state, input, 480));
  CHECK(state.camera.index == 0);
  input.left = true;
  input.drag = {12, -5};
  CHECK(applyInput(state, input, 480));
  CHECK(state.camera.index == -1);
  press(state, 'F', true);
  CHECK(state.camera.index == 0);
  CHECK(glm::length(state.camera.pose.position - start.position) < 1e-12);
}

TEST_CASE("a panned point stays under the pointer") {
  ViewerState state = stateWithCameras(1);
  const glm::dvec3 pivot = state.camera.pose.pivot();
  Input input;
  input.middle = true;
  input.drag = {17, -9};
  applyInput(state, input, 480);
  const Camera camera = toCamera(state.camera.pose, state.camera.lens, 640, 480);
  const glm::dvec3 p = camera.rotation * pivot + camera.translation;
  CHECK(camera.focal.x * p.x / p.z == Approx(17));
  CHECK(camera.focal.y * p.y / p.z == Approx(-9));
}

TEST_CASE("the wheel comes closer, with Ctrl it changes the lens within its limits") {
  ViewerState state = stateWithCameras(1);
  const double distance = state.camera.pose.distance;
  Input input;
  input.wheel = 1;
  applyInput(state, input, 480);
  CHECK(state.camera.pose.distance < distance);
  input.control = true;
  for (int i = 0; i < 200; ++i) applyInput(state, input, 480);
  CHECK(state.camera.lens.fov_y == kMinFov);
  input.wheel = -1;
  for (int i = 0; i < 400; ++i) applyInput(state, input, 480);
  CHECK(state.camera.lens.fov_y == kMaxFov);
  input.control = false;
  input.wheel = 1e6;  // events of a program that plays the hand
  applyInput(state, input, 480);
  CHECK(state.camera.pose.distance > 0);
}

TEST_CASE("the wheel keeps what is under the pointer there, whatever the lens") {
  ViewerState state = stateWithCameras(1);
  state.camera.lens.pixel_aspect = 1.2;
  state.camera.lens.shift = {0.05, -0.02};
  const glm::dvec2 cursor(150, -70);
  const Camera before = toCamera(state.camera.pose, state.camera.lens, 640, 480);
  const glm::dvec2 ray = (cursor + glm::dvec2(320, 240) - before.center) / before.focal;
  const glm::dvec3 seen = state.camera.pose.distance * glm::dvec3(ray, 1.0);
  const glm::dvec3 point = glm::transpose(before.rotation) * (seen - before.translation);
  const double distance = state.camera.pose.distance;
  Input input;
  input.wheel = 3;
  input.cursor = cursor;
  applyInput(state, input, 480);
  CHECK(state.camera.pose.distance < 0.8 * distance);
  const Camera after = toCamera(state.camera.pose, state.camera.lens, 640, 480);
  const glm::dvec3 p = after.rotation * point + after.translation;
  CHECK(after.focal.x * p.x / p.z + after.center.x == Approx(320 + cursor.x));
  CHECK(after.focal.y * p.y / p.z + after.center.y == Approx(240 + cursor.y));
}

TEST_CASE("arrow keys go round the pivot, with Shift sideways, and when flying turn the camera") {
  ViewerState state = stateWithCameras(1);
  Input input;
  input.seconds = 0.1;
  input.arrows = {1, 1};
  const ViewPose start = state.camera.pose;
  applyInput(state, input, 480);
  CHECK(glm::distance(state.camera.pose.pivot(), start.pivot()) < 1e-9);
  // To its right, and up.
  const glm::dvec3 moved = start.cameraFromWorldRotation() * (state.camera.pose.position - start.position);
  CHECK(moved.x > 0);
  CHECK(moved.y < 0);
  state.camera.pose = start;
  input.shift = true;
  applyInput(state, input, 480);
  CHECK(state.camera.pose.yaw == start.yaw);
  CHECK((start.cameraFromWorldRotation() * (state.camera.pose.position - start.position)).x > 0);
  state.camera.pose = start;
  input.shift = false;
  state.camera.fly = true;
  applyInput(state, input, 480);
  CHECK(state.camera.pose.position == start.position);
  CHECK((start.cameraFromWorldRotation() * state.camera.pose.forward()).x > 0);
  CHECK((start.cameraFromWorldRotation() * state.camera.pose.forward()).y < 0);
}

TEST_CASE("flying covers speed x radius in a second, whatever the frame rate") {
  for (int frames : {10, 60}) {
    ViewerState state = stateWithCameras(1);
    const glm::dvec3 start = state.camera.pose.position;
    Input input;
    input.fly = {0, 0, 1};
    input.seconds = 1.0 / frames;
    for (int i = 0; i < frames; ++i) applyInput(state, input, 480);
    CHECK(glm::length(state.camera.pose.position - start) == Approx(state.camera.speed * state.scene.bounds.radius));
  }
}

TEST_CASE("full stop and comma go round the test cameras, with Shift round the training cameras") {
  ViewerState state = stateWithCameras(5);
  for (int i : {1, 4}) state.scene.cameras[i].test = true;
  goToCamera(state, 0);
  std::vector<int> seen;
  for (int i = 0; i < 3; ++i) {
    press(state, '.');
    seen.push_back(state.camera.index);
  }
  CHECK(seen == std::vector{1, 4, 1});
  press(state, ',');
  CHECK(state.camera.index == 4);
  press(state, '.', true);
  CHECK(state.camera.index == 0);
  press(state, ',', true);
  CHECK(state.camera.index == 3);
  ViewerState train = stateWithCameras(2);
  press(train, '.');
  CHECK(train.camera.index == 0);
  CHECK_FALSE(train.messages.notice.empty());
}

TEST_CASE("V goes through the ways to compare, Shift+V shows the other one") {
  ViewerState state = stateWithCameras(1);
  for (const bool shift : {false, true}) {  // nothing is there to compare with
    press(state, 'V', shift);
    CHECK(state.compare.how.mode == CompareMode::off);
    CHECK_THAT(state.messages.notice, Contains("Nothing to compare with"));
  }
  state.compare.photographs = "images";
  std::vector<CompareMode> seen;
  for (int i = 0; i < 6; ++i) {
    press(state, 'V');
    seen.push_back(state.compare.how.mode);
  }
  CHECK(seen == std::vector{CompareMode::side, CompareMode::wipe, CompareMode::flicker, CompareMode::difference,
                            CompareMode::flip, CompareMode::off});
  press(state, 'V', true);
  CHECK(state.compare.how.mode == CompareMode::flicker);
  CHECK(state.compare.how.shows_other);
  press(state, 'V', true);
  CHECK_FALSE(state.compare.how.shows_other);
}

// SPDX-License-Identifier: Apache-2.0
// Dragging: rectangles, brushes, spheres, handles and the histogram's range.
#include "viewer/view/edit_pointer.h"

#include <vector>

#include "support/catch.h"
#include "viewer/view/edited_state.h"

using namespace tg;
using test::everyThird;
using test::frame;
using test::kRedo;
using test::kUndo;
using test::press;
using test::sampleState;

namespace {

// A pointer in a picture of 960 x 720.
struct Hand {
  PointerTaken go(ViewerState& state, glm::dvec2 at, bool down) {
    pointer.at = at;
    pointer.pressed = down && !pointer.down;
    pointer.down = down;
    return editPointer(state, pointer, camera(state));
  }
  static Camera camera(const ViewerState& state) { return toCamera(state.camera.pose, state.camera.lens, 960, 720); }
  // Where the handles are.
  static glm::dvec2 middle(const ViewerState& state) {
    return project(camera(state), cameraFromWorld(camera(state), editPivot(state)));
  }
  EditPointer pointer{.over = true};
};

}  // namespace

TEST_CASE("the pointer drags rectangles, brushes, spheres and handles, and leaves the rest to the camera") {
  ViewerState state = sampleState();
  const Camera camera = Hand::camera(state);
  Hand hand;
  EditPointer& pointer = hand.pointer;
  const auto go = [&](glm::dvec2 at, bool down) { return hand.go(state, at, down); };
  CHECK_FALSE(go({100, 100}, true).button);
  (void)go({100, 100}, false);
  setTool(state, EditTool::rectangle);
  CHECK(go({300, 200}, true).button);
  CHECK(go({600, 500}, true).button);
  CHECK_FALSE(state.edit.selection);
  (void)go({600, 500}, false);
  REQUIRE(state.edit.selection);
  const std::size_t found = state.edit.selection->count;
  const std::vector<std::uint8_t> expected =
      insideRectangle(projectedMeans(*state.scene.model, camera, effectiveSettings(state)), {300, 200}, {600, 500});
  CHECK(state.edit.selection->chosen == expected);
  // Ctrl takes away.
  setTool(state, EditTool::brush);
  pointer.control = true;
  (void)go({450, 350}, true);
  (void)go({500, 350}, true);
  (void)go({500, 350}, false);
  pointer.control = false;
  CHECK(state.edit.selection->count < found);
  pointer.wheel = 2;
  CHECK(go({500, 350}, false).wheel);
  pointer.wheel = 0;
  CHECK(state.edit.brush > 24);
  // Esc takes a drag back, then puts the tool down.
  const SelectionPtr before = state.edit.selection;
  (void)go({300, 350}, true);
  (void)go({700, 350}, true);
  CHECK(state.edit.selection != before);
  press(state, kKeyEscape);
  CHECK(state.edit.selection == before);
  press(state, kKeyEscape);
  CHECK(state.edit.tool == EditTool::none);
  CHECK_FALSE(state.quit);
  (void)go({300, 350}, false);
  // A sphere around the surface in the middle.
  setTool(state, EditTool::sphere);
  (void)go({480, 360}, true);
  (void)go({480, 360}, false);
  REQUIRE(state.edit.surface);
  REQUIRE(state.edit.selection);
  const double radius = state.edit.sphere * state.scene.bounds.radius;
  for (const std::uint32_t i : indicesOf(*state.edit.selection)) {
    CHECK(glm::distance(glm::dvec3(state.scene.model->mean[i]), *state.edit.surface) <= radius);
  }
  // The square of the handles moves in the picture's plane.
  setTool(state, EditTool::move);
  const ModelPtr still = state.scene.model;
  const glm::dvec2 handle = project(camera, cameraFromWorld(camera, editPivot(state)));
  CHECK(go(handle, true).button);
  CHECK(go(handle + glm::dvec2(40, 0), true).button);
  CHECK(state.scene.model == still);
  updatePreview(state);
  const ModelPtr preview = shownModel(state);
  CHECK(preview != still);
  (void)go(handle + glm::dvec2(40, 0), false);
  CHECK(state.scene.model == preview);  // nothing is drawn anew
  const glm::dvec2 after =
      project(camera, cameraFromWorld(camera, selectionOf(*state.scene.model, state.edit.selection->chosen)->center));
  CHECK(glm::distance(after, handle + glm::dvec2(40, 0)) < 1);
  CHECK(undoName(state).starts_with("Move "));
  undo(state);
  CHECK(*state.scene.model == *still);
  CHECK_FALSE(go({5, 5}, true).button);  // beside the handles the camera has it
}

TEST_CASE("undo, redo and Delete end a drag first, and what is left of it does nothing") {
  ViewerState state = sampleState();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  frame(state);
  press(state, kKeyDelete);
  frame(state);
  setTool(state, EditTool::brush);
  state.edit.mode = SelectMode::add;
  Hand hand;
  (void)hand.go(state, {300, 350}, true);
  (void)hand.go(state, {700, 350}, true);
  REQUIRE(state.edit.selection);
  const SelectionPtr swept = state.edit.selection;
  (void)hand.go(state, {700, 350}, true);
  CHECK(state.edit.selection == swept);  // a pointer that rests costs nothing
  press(state, kUndo);
  CHECK_FALSE(state.edit.selection);
  CHECK_FALSE(state.edit.selecting);
  CHECK(state.scene.model->size() == 266);
  press(state, kUndo);
  CHECK(state.scene.model->size() == 400);
  const SelectionPtr before = state.edit.selection;
  CHECK(hand.go(state, {500, 350}, true).button);  // not the camera's
  CHECK(state.edit.selection == before);
  (void)hand.go(state, {500, 350}, false);
  (void)hand.go(state, {500, 300}, true);
  press(state, kRedo);
  CHECK_FALSE(state.edit.selecting);
  press(state, kRedo);
  CHECK(state.scene.model->size() == 266);
  (void)hand.go(state, {500, 350}, false);
  (void)hand.go(state, {300, 350}, true);
  (void)hand.go(state, {700, 350}, true);
  const std::size_t chosen = state.edit.selection->count;
  press(state, kKeyDelete);
  CHECK(state.scene.model->size() == 266 - chosen);
  (void)hand.go(state, {500, 400}, true);
  CHECK_FALSE(state.edit.selection);
}

TEST_CASE("a range of the histogram that is being dragged survives undo, redo and Delete") {
  ViewerState state = sampleState();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  frame(state);
  for (const SelectMode mode : {SelectMode::add, SelectMode::subtract, SelectMode::intersect}) {
    state.edit.mode = mode;
    const std::size_t size = state.scene.model->size();
    const SelectionPtr before = state.edit.selection;
    state.edit.range_before = before;
    const Histogram* histogram = histogramShown(state);
    const double middle = (histogram->low + histogram->high) / 2;
    chooseRange(state, histogram->low, middle, state.edit.mode);
    press(state, kUndo);
    CHECK_FALSE(state.edit.range_before);
    CHECK(state.edit.selection == before);
    state.edit.range_before = before;
    chooseRange(state, middle, histogram->high, state.edit.mode);
    REQUIRE(state.edit.selection);
    press(state, kKeyDelete);
    CHECK(state.scene.model->size() < size);
    CHECK_FALSE(state.edit.range_before);
    press(state, kUndo);
    CHECK(state.scene.model->size() == size);
    CHECK(state.edit.selection == before);
  }
}

TEST_CASE("another selection, and another model, end the drag of a handle without an edit") {
  ViewerState state = sampleState();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  frame(state);
  setTool(state, EditTool::move);
  Hand hand;
  const glm::dvec2 handle = Hand::middle(state);
  const ModelPtr still = state.scene.model;
  for (const int key : {kControl | 'A', kControl | 'I'}) {
    CHECK(hand.go(state, handle, true).button);
    CHECK(hand.go(state, handle + glm::dvec2(40, 0), true).button);
    updatePreview(state);
    CHECK(shownModel(state) != still);
    press(state, key, key == (kControl | 'A'));
    CHECK(shownModel(state) == still);
    CHECK(hand.go(state, handle + glm::dvec2(60, 0), false).button == false);
    frame(state);
    CHECK(state.scene.model == still);
    CHECK(undoName(state).starts_with("Select"));
    press(state, kUndo);
  }
  (void)hand.go(state, handle, true);
  (void)hand.go(state, handle + glm::dvec2(40, 0), true);
  REQUIRE(state.edit.moving);
  updatePreview(state);
  leaveDocument(state);
  const EditState& left = state.documents.open.front().edit;
  CHECK_FALSE(left.moving);
  CHECK_FALSE(left.preview);
  CHECK(left.selection);
}

TEST_CASE("the handles that the pointer meets are as large as the interface is") {
  ViewerState state = sampleState();
  state.ui.scale = 2;
  setTool(state, EditTool::scale);
  Hand hand;
  (void)hand.go(state, Hand::middle(state) + glm::dvec2(160, 0), false);
  CHECK(state.edit.hovered == Handle::view);
  (void)hand.go(state, Hand::middle(state) + glm::dvec2(80, 0), false);
  CHECK(state.edit.hovered == Handle::none);
}

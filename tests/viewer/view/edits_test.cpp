// SPDX-License-Identifier: Apache-2.0
// Choosing, changing and taking back, and what is asked before edits are lost.
#include "viewer/view/edits.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "viewer/keys.h"
#include "viewer/view/actions.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edit_pointer.h"
#include "viewer/view/path_editor.h"

using namespace tg;
using test::press;

namespace {

ViewerState sampleState(GaussianModel model = test::trainedLikeModel(11, 400)) {
  Scene scene;
  scene.path = "sample.tgz";
  scene.model = std::make_shared<GaussianModel>(std::move(model));
  measure(scene);
  scene.cameras.push_back(test::trainedLikeCamera(96, 72));
  ViewerState state;
  state.camera.aspect = 96.0 / 72.0;
  setScene(state, scene);
  state.documents.open.emplace_back().path = scene.path;
  state.documents.shown = 0;
  recordChanges(state, false, false);
  return state;
}

void frame(ViewerState& state, bool busy = false, bool flowing = false) {
  state.time += 1;
  recordChanges(state, busy, flowing);
}

std::vector<std::uint8_t> everyThird(std::size_t count) {
  std::vector<std::uint8_t> mask(count);
  for (std::size_t i = 0; i < count; i += 3) mask[i] = 1;
  return mask;
}

Similarity someSimilarity() {
  Similarity s;
  s.scale = 1.25;
  s.rotation = glm::dmat3(0, 1, 0, -1, 0, 0, 0, 0, 1);
  s.translation = {0.5, -1, 2};
  return s;
}

constexpr int kUndo = kControl | 'Z', kRedo = kControl | 'Y';

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

TEST_CASE("edits of Gaussians are taken back bit by bit and done again") {
  for (const bool textured : {false, true}) {
    // The texels in their order, as select() and files have them.
    std::vector<std::uint32_t> all(60);
    std::iota(all.begin(), all.end(), 0u);
    const GaussianModel model = select(textured ? tinyTexturedModel(60) : tinyModel(60, 3), all);
    for (const bool erases : {false, true}) {
      ModelEdit edit;
      edit.erases = erases;
      edit.similarity = someSimilarity();
      for (std::uint32_t i = 1; i < 60; i += 4) edit.which.push_back(i);
      const ModelPtr after = applied(model, edit);
      CHECK(after->size() == (erases ? 45 : 60));
      CHECK_FALSE(*after == model);
      CHECK(*takenBack(*after, edit) == model);
      ModelEdit again = edit;
      CHECK(*applied(model, again) == *after);
    }
  }
}

TEST_CASE("an edit keeps only the numbers that it replaces") {
  const GaussianModel model = tinyModel(100, 3);
  ModelEdit move;
  move.similarity.translation = {1, 0, 0};
  for (std::uint32_t i = 0; i < 10; ++i) move.which.push_back(i);
  (void)applied(model, move);
  CHECK(bytesOf(move) == 10 * (4 + 12));
  ModelEdit turn = move;
  turn.similarity = someSimilarity();
  (void)applied(model, turn);
  CHECK(bytesOf(turn) == 10 * (4 + 12 + 16 + 12 + 16 * 12));
}

TEST_CASE("an edit that floats cannot hold changes nothing") {
  ViewerState state = sampleState();
  const ModelPtr before = state.scene.model;
  Similarity far;
  far.translation = {1e300, 0, 0};
  attempt(state, [&] { transformChosen(state, far); });
  CHECK_FALSE(state.messages.error.empty());
  CHECK(state.scene.model == before);
  CHECK(state.edit.revision == state.edit.saved);
}

TEST_CASE("selections are replaced, added to, cut and turned round") {
  const GaussianModel model = tinyModel(9, 0);
  const SelectionPtr thirds = selectionOf(model, everyThird(9));
  REQUIRE(thirds);
  CHECK(thirds->count == 3);
  CHECK(indicesOf(*thirds) == std::vector<std::uint32_t>{0, 3, 6});
  const glm::dvec3 sum = glm::dvec3(model.mean[0]) + glm::dvec3(model.mean[3]) + glm::dvec3(model.mean[6]);
  CHECK(glm::distance(thirds->center, sum / 3.0) < 1e-12);
  const std::vector<std::uint8_t> low = {1, 1, 1, 1, 0, 0, 0, 0, 0};
  using Mask = std::vector<std::uint8_t>;
  CHECK(combined(thirds, low, SelectMode::replace) == low);
  CHECK(combined(thirds, low, SelectMode::add) == Mask{1, 1, 1, 1, 0, 0, 1, 0, 0});
  CHECK(combined(thirds, low, SelectMode::subtract) == Mask{0, 0, 0, 0, 0, 0, 1, 0, 0});
  CHECK(combined(thirds, low, SelectMode::intersect) == Mask{1, 0, 0, 1, 0, 0, 0, 0, 0});
  CHECK(combined(nullptr, low, SelectMode::add) == low);
  CHECK(combined(nullptr, low, SelectMode::subtract) == Mask(9));
  CHECK(inverted(thirds, 9) == Mask{0, 1, 1, 0, 1, 1, 0, 1, 1});
  CHECK(inverted(nullptr, 2) == Mask{1, 1});
  CHECK(selectionOf(model, Mask(9)) == nullptr);
}

TEST_CASE("a rectangle and a brush choose the means that they cover, and nothing that is not drawn") {
  ViewerState state = sampleState();
  const GaussianModel& model = *state.scene.model;
  const Camera camera = toCamera(state.camera.pose, state.camera.lens, 96, 72);
  RenderSettings settings = effectiveSettings(state);
  const std::vector<glm::vec2> points = projectedMeans(model, camera, settings);
  const std::vector<std::uint8_t> box = insideRectangle(points, {60, 40}, {30, 20});
  std::vector<std::uint8_t> swept(points.size());
  sweep(points, {20, 30}, {70, 30}, 5, swept);
  std::size_t in_box = 0, in_sweep = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dvec3 p = cameraFromWorld(camera, glm::dvec3(model.mean[i]));
    const glm::dvec2 at = project(camera, p);
    const bool drawn = p.z > settings.near;
    CHECK((box[i] != 0) == (drawn && at.x >= 30 && at.x <= 60 && at.y >= 20 && at.y <= 40));
    const double nearest = glm::distance(at, glm::dvec2(std::clamp(at.x, 20.0, 70.0), 30));
    if (std::abs(nearest - 5) > 1e-3) CHECK((swept[i] != 0) == (drawn && nearest < 5));
    in_box += box[i];
    in_sweep += swept[i];
  }
  CHECK(in_box > 5);
  CHECK(in_sweep > 5);
  settings.crop = CropBox{model.mean[7], model.mean[7]};
  const std::vector<glm::vec2> cropped = projectedMeans(model, camera, settings);
  CHECK(std::ranges::count_if(cropped, [](glm::vec2 p) { return !std::isnan(p.x); }) <= 1);
}

TEST_CASE("only what the picture shows is left of a selection of the visible") {
  GaussianModel model = tinyModel(2, 0);
  for (int i = 0; i < 2; ++i) {
    model.mean[i] = {0, 0, i == 0 ? 2 : 6};
    model.rotation[i] = {1, 0, 0, 0};
    model.log_scale[i] = glm::vec3(std::log(i == 0 ? 0.5f : 0.05f));
    model.opacity_logit[i] = 12;
  }
  const Camera camera = lookAt({0, 0, -1}, {0, 0, 1}, {0, -1, 0}, 0.6, 64, 64);
  std::vector<std::uint8_t> mask = {1, 1};
  keepVisible(model, camera, {}, mask);
  CHECK(mask == std::vector<std::uint8_t>{1, 0});
  RenderSettings far;
  far.crop = CropBox{{-1, -1, 5}, {1, 1, 7}};
  mask = {1, 1};
  keepVisible(model, camera, far, mask);
  CHECK(mask == std::vector<std::uint8_t>{0, 1});
  // What another setting takes out of the picture hides nothing either.
  RenderSettings settings;
  const auto visible = [&] {
    mask = {1, 1};
    keepVisible(model, camera, settings, mask);
    return mask;
  };
  settings.near = 5;
  CHECK(visible() == std::vector<std::uint8_t>{0, 1});
  settings = {};
  settings.opacity_scale = 0.3f;
  CHECK(visible() == std::vector<std::uint8_t>{1, 1});
  settings = {};
  model.mean[1].x = 1.5f;  // beside the other one
  CHECK(visible() == std::vector<std::uint8_t>{1, 1});
  settings.splat_scale = 0.05f;  // less than a twentieth of a pixel
  CHECK(visible() == std::vector<std::uint8_t>{1, 0});
  model.mean[1].x = 0;
  const auto surface = surfaceAt(model, camera, {}, {32, 32});
  REQUIRE(surface);
  CHECK(std::abs(surface->z - 2) < 0.6);
  CHECK_FALSE(surfaceAt(model, camera, {}, {-300, 0}));
}

TEST_CASE("a histogram counts every Gaussian, and its range chooses them") {
  ViewerState state = sampleState();
  for (std::size_t value = 0; value < selectValues().size(); ++value) {
    state.edit.value = value;
    const Histogram* histogram = histogramShown(state);
    REQUIRE(histogram);
    CAPTURE(value);
    CHECK(histogram->bars.size() == kHistogramBars);
    CHECK(*std::ranges::max_element(histogram->bars) == 1);
    CHECK(histogramShown(state) == histogram);
    const double middle = (histogram->low + histogram->high) / 2;
    state.edit.range_before = nullptr;
    chooseRange(state, histogram->high, middle);
    const auto expected = std::ranges::count_if(histogram->values, [&](float v) { return double{v} >= middle; });
    CHECK((state.edit.selection ? state.edit.selection->count : 0) == static_cast<std::size_t>(expected));
  }
}

TEST_CASE("a range of the histogram is marked while it says what is selected") {
  ViewerState state = sampleState();
  frame(state);
  const Histogram* histogram = histogramShown(state);
  REQUIRE(histogram);
  CHECK_FALSE(rangeHolds(state.edit));
  state.edit.range_before = nullptr;
  chooseRange(state, histogram->low, (histogram->low + histogram->high) / 2);
  REQUIRE(state.edit.selection);
  state.edit.range_before.reset();
  frame(state);
  CHECK(rangeHolds(state.edit));
  press(state, kKeyDelete);
  frame(state);
  CHECK_FALSE(rangeHolds(state.edit));
  press(state, kUndo);
  CHECK(rangeHolds(state.edit));
  chooseAll(state);
  CHECK_FALSE(rangeHolds(state.edit));
  chooseNone(state);
  CHECK_FALSE(rangeHolds(state.edit));
}

TEST_CASE("a histogram has a place for sigmas that doubles cannot hold") {
  GaussianModel model = tinyModel(20, 0);
  model.log_scale[3] = glm::vec3(800.0f);
  model.log_scale[4] = {800.0f, 0.0f, -800.0f};
  const auto shared = std::make_shared<const GaussianModel>(std::move(model));
  for (std::size_t value = 0; value < selectValues().size(); ++value) {
    CAPTURE(value);
    const Histogram histogram = histogramOf(shared, value);
    CHECK(std::ranges::all_of(histogram.values, [](float v) { return std::isfinite(v); }));
    CHECK(std::ranges::all_of(histogram.bars, [](float bar) { return bar >= 0 && bar <= 1; }));
    const std::vector<std::uint8_t> all = insideRange(histogram, histogram.low, histogram.high);
    CHECK(std::ranges::count(all, 1) == 20);
  }
}

TEST_CASE("deleting, undoing and redoing go through the models and selections in turn") {
  ViewerState state = sampleState();
  const ModelPtr whole = state.scene.model;
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  frame(state);
  CHECK(undoName(state) == "Select 134");
  press(state, kKeyDelete);
  CHECK(state.scene.gaussians == 266);
  CHECK(state.scene.model->size() == 266);
  CHECK_FALSE(state.edit.selection);
  CHECK(undoName(state) == "Delete 134");
  frame(state);
  CHECK(unsavedModels(state).size() == 1);
  press(state, kUndo);
  CHECK(*state.scene.model == *whole);
  REQUIRE(state.edit.selection);
  CHECK(state.edit.selection->count == 134);
  CHECK(unsavedModels(state).empty());
  frame(state);
  press(state, kUndo);
  CHECK_FALSE(state.edit.selection);
  CHECK(redoName(state) == "Select 134");
  press(state, kRedo);
  press(state, kControl | 'Z', true);
  CHECK(state.scene.model->size() == 266);
  CHECK(redoName(state).empty());
  press(state, kUndo);
  state.display.output = Output::depth;
  frame(state);
  CHECK(redoName(state).empty());  // another way was taken
}

TEST_CASE("a model keeps at least one Gaussian, and deleting nothing says so and closes nothing") {
  ViewerState state = sampleState();
  press(state, kControl | 'A');
  press(state, kKeyDelete);
  CHECK(state.scene.model->size() == 400);
  press(state, kControl | 'A', true);
  press(state, kKeyDelete);
  CHECK_FALSE(state.documents.close_request);
  CHECK(state.scene.model->size() == 400);
}

TEST_CASE("without a selection the whole model moves with its cameras, with one they stay") {
  ViewerState state = sampleState();
  const GaussianModel before = *state.scene.model;
  const std::vector<Camera> cameras = state.scene.cameras;
  const Similarity similarity = someSimilarity();
  transformChosen(state, similarity);
  GaussianModel expected = before;
  transformModel(expected, similarity);
  CHECK(*state.scene.model == expected);
  std::vector<Camera> moved = cameras;
  transformCameras(moved, similarity);
  CHECK(state.scene.cameras[0] == moved[0]);
  CHECK(state.camera.index == -1);
  undo(state);
  CHECK(*state.scene.model == before);
  CHECK(glm::distance(state.scene.cameras[0].translation, cameras[0].translation) < 1e-12);
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  transformChosen(state, similarity);
  CHECK(state.scene.cameras[0].rotation == cameras[0].rotation);
  CHECK(state.scene.model->mean[1] == before.mean[1]);
  CHECK(state.scene.model->mean[3] == expected.mean[3]);
  REQUIRE(state.edit.selection);
  CHECK(state.edit.selection->count == 134);
}

TEST_CASE("every kind of click is a step that can be undone and redone") {
  ViewerState state = sampleState();
  state.documents.open.emplace_back().path = "other.tgz";
  const auto check = [&](const std::string& expected, const auto& act, const auto& value) {
    CAPTURE(expected);
    const auto before = value();
    act();
    frame(state);
    const auto after = value();
    CHECK_FALSE(before == after);
    CHECK(undoName(state) == expected);
    undo(state);
    frame(state);
    CHECK(value() == before);
    CHECK(redoName(state) == expected);
    redo(state);
    frame(state);
    CHECK(value() == after);
  };
  auto& [output, settings, held, crop, box, scale, scaled, resolution] = state.display;
  check("Show depth", [&] { press(state, '5'); }, [&, &o = output] { return o; });
  check("Textures", [&] { press(state, 'T'); }, [&, &s = settings] { return s; });
  check("Exposure", [&, &s = settings] { s.exposure = 1; }, [&, &s = settings] { return s; });
  check("Crop box on", [&] { press(state, 'J'); }, [&, &c = crop] { return c; });
  check("Crop box", [&] { fitCrop(state); }, [&, &b = box] { return b; });
  check("Resolution", [&, &r = resolution] { r = 0.5; }, [&, &r = resolution] { return r; });
  check(
      "Camera",
      [&] {
        orbit(state.camera.pose, 0.5, 0);
        state.camera.index = -1;
      },
      [&] { return state.camera.pose; });
  check("Camera 0", [&] { press(state, ' '); }, [&] { return state.camera.index; });
  check("Up +x", [&] { press(state, 'U'); }, [&] { return state.camera.up; });
  check("Add bookmark", [&] { press(state, 'B', true); }, [&] { return state.camera.bookmarks.size(); });
  check("Remove bookmark", [&] { removeBookmark(state, 0); }, [&] { return state.camera.bookmarks.size(); });
  check("Add key", [&] { press(state, 'K'); }, [&] { return state.path.path; });
  check("Change key", [&] { changeKeySeconds(state, 0, 3); }, [&] { return state.path.path; });
  press(state, 'K');
  frame(state);
  check("Remove key", [&] { deleteKey(state, 1); }, [&] { return state.path.path; });
  check("Compare: side", [&] { press(state, 'V'); }, [&] { return state.compare.how; });
  check("Compare", [&] { state.compare.how.gain = 4; }, [&] { return state.compare.how; });
  check("Select 400", [&] { chooseAll(state); }, [&] { return state.edit.selection != nullptr; });
  check("Select none", [&] { chooseNone(state); }, [&] { return state.edit.selection != nullptr; });
}

TEST_CASE("a drag is one step, and so is what the wheel does without a pause") {
  ViewerState state = sampleState();
  const ViewPose start = state.camera.pose;
  for (int i = 0; i < 20; ++i) {
    orbit(state.camera.pose, 0.02, 0);
    frame(state, true);
  }
  frame(state);
  CHECK(state.history.steps.size() == 1);
  undo(state);
  CHECK(state.camera.pose == start);
  redo(state);
  for (int i = 0; i < 5; ++i) {
    dolly(state.camera.pose, 0.9);
    state.time += 0.1;
    recordChanges(state, false, true);
  }
  CHECK(state.history.steps.size() == 2);
  state.time += 5;
  dolly(state.camera.pose, 0.9);
  recordChanges(state, false, true);
  CHECK(state.history.steps.size() == 3);
}

TEST_CASE("the window's shape and another model are no steps, and the history is bounded") {
  ViewerState state = sampleState();
  REQUIRE(state.camera.index == 0);
  state.camera.lens.fov_y *= 1.1;
  forgetLens(state);
  frame(state);
  CHECK(undoName(state).empty());
  press(state, kControl | 'A');
  frame(state);
  press(state, '5');
  frame(state);
  Scene next = state.scene;
  next.model = std::make_shared<GaussianModel>(test::trainedLikeModel(3, 50));
  replaceScene(state, next);
  CHECK_FALSE(state.edit.selection);
  CHECK(undoName(state) == "Show depth");
  CHECK(state.history.steps.size() == 1);
  for (std::size_t i = 0; i < kMostHistorySteps + 20; ++i) {
    state.display.settings.exposure = static_cast<float>(i + 1);
    frame(state);
  }
  CHECK(state.history.steps.size() == kMostHistorySteps);
  setScene(state, next);
  CHECK(undoName(state).empty());
}

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
    chooseRange(state, histogram->low, middle);
    press(state, kUndo);
    CHECK_FALSE(state.edit.range_before);
    CHECK(state.edit.selection == before);
    state.edit.range_before = before;
    chooseRange(state, middle, histogram->high);
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

TEST_CASE("cameras that replaced those of a moved model stay where they are when the move is undone") {
  ViewerState state = sampleState();
  transformChosen(state, similarityOf(state, {5, 0, 0}, glm::dvec3(0.0), 1));
  Camera other = test::trainedLikeCamera(96, 72);
  other.translation = {1, 2, 3};
  replaceCameras(state, {other});
  CHECK(state.camera.index == 0);
  frame(state);
  press(state, kUndo);
  press(state, kUndo);
  CHECK(undoName(state).empty());
  CHECK(state.scene.cameras.front() == other);
  press(state, kRedo);
  CHECK(state.scene.cameras.front() == other);
  // They move with the model from now on.
  transformChosen(state, similarityOf(state, {5, 0, 0}, glm::dvec3(0.0), 1));
  CHECK(glm::distance(state.scene.cameras.front().position(), other.position() + glm::dvec3(5, 0, 0)) < 1e-12);
  press(state, kUndo);
  CHECK(glm::distance(state.scene.cameras.front().position(), other.position()) < 1e-12);
}

TEST_CASE("a file that was saved before the model was read again says nothing about the new one") {
  ViewerState state = sampleState();
  transformChosen(state, someSimilarity());
  const std::uint64_t saved = state.edit.revision;
  replaceScene(state, state.scene);
  noteModelKept(state, "sample.tgz", saved);
  CHECK_FALSE(hasUnsavedEdits(state, 0));
  transformChosen(state, someSimilarity());
  noteModelKept(state, "sample.tgz", saved);
  CHECK(hasUnsavedEdits(state, 0));
  noteModelKept(state, "sample.tgz", state.edit.revision);
  CHECK_FALSE(hasUnsavedEdits(state, 0));
}

TEST_CASE("what would lose edits is asked first") {
  ViewerState state = sampleState();
  askToQuit(state);
  CHECK(state.quit);  // nothing to lose
  state.quit = false;
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  const std::uint64_t revision = state.edit.revision;
  press(state, kControl | 'Q');
  CHECK_FALSE(state.quit);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::edits);
  CHECK(state.desktop.question->model == "sample.tgz");
  keepUnsaved(state);
  askToQuit(state);
  saveUnsaved(state);
  CHECK(state.desktop.wanted == FileUse::saveModel);
  REQUIRE(state.desktop.after_saving);
  noteModelKept(state, "sample.tgz", revision);
  goOnClosing(state, *state.desktop.after_saving);
  CHECK(state.quit);

  // Edited once more: what was saved is another revision.
  state.quit = false;
  state.desktop = {};
  undo(state);
  CHECK(hasUnsavedEdits(state, 0));
  press(state, kControl | 'W');
  CHECK_FALSE(state.documents.close_request);
  REQUIRE(state.desktop.question);
  discardUnsaved(state);
  CHECK(state.documents.close_request == 0);
  CHECK(hasUnsavedEdits(state, 0));  // until it is closed
}

TEST_CASE("a file that is read again asks for the edits of its model, other files are opened at once") {
  ViewerState state = sampleState();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  using Paths = std::vector<std::filesystem::path>;
  state.documents.open_requests = {"sample.tgz", "another.tgz"};
  CHECK(guardEdits(state));
  CHECK(state.documents.open_requests == Paths{"another.tgz"});
  REQUIRE(state.desktop.question);
  keepUnsaved(state);
  CHECK_FALSE(guardEdits(state));
  CHECK_FALSE(state.desktop.question);

  state.documents.open_requests = {"sample.tgz"};
  askToQuit(state);
  CHECK_FALSE(guardEdits(state));  // one question at a time
  CHECK(state.documents.open_requests.empty());
  keepUnsaved(state);
  CHECK(guardEdits(state));
  discardUnsaved(state);
  CHECK_FALSE(guardEdits(state));
  CHECK(state.documents.open_requests == Paths{"sample.tgz"});
  CHECK_FALSE(state.desktop.question);
  CHECK(hasUnsavedEdits(state, 0));  // until it has been read
}

TEST_CASE("of several edited models each is asked for, in view, and a change of mind keeps them all") {
  ViewerState state = sampleState();
  Document& hidden = state.documents.open.emplace_back();
  hidden.path = "hidden.tgz";
  hidden.edit.revision = newRevision();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  deleteChosen(state);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "sample.tgz");
  CHECK_FALSE(state.documents.show_request);
  discardUnsaved(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "hidden.tgz");
  CHECK(state.documents.show_request == 1);
  keepUnsaved(state);
  CHECK(unsavedModels(state).size() == 2);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "sample.tgz");
  keepUnsaved(state);
  askToClose(state, 1);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->model == "hidden.tgz");
  discardUnsaved(state);
  CHECK(state.documents.close_request == 1);
}

TEST_CASE("an edited model goes to its own file, or to a bundle beside it where that would lose something") {
  ViewerState state = sampleState();
  CHECK(saveTarget(state) == "sample.tgz");
  state.scene.path = "scene.splat";
  CHECK(saveTarget(state) == "scene.splat");  // it came from one
  CHECK_FALSE(holdsModel("a.ply", state.scene));
  CHECK(holdsModel("a.glb", state.scene));
  state.scene.path = "scene.gltf-of-another-kind";
  CHECK(saveTarget(state) == "scene.tgz");
}

TEST_CASE("what training reached is said to be before edits as long as there are any") {
  ViewerState state = sampleState();
  CHECK(trainingText(state).empty());
  state.scene.training = "finished, 31.09 dB held out";
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
  chooseAll(state);
  frame(state);
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
  transformChosen(state, someSimilarity());
  frame(state);
  CHECK(trainingText(state) == "finished, 31.09 dB held out before edits");
  noteModelKept(state, state.scene.path, state.edit.revision);
  CHECK(trainingText(state) == "finished, 31.09 dB held out before edits");
  press(state, kUndo);
  CHECK(trainingText(state) == "finished, 31.09 dB held out");
}

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

TEST_CASE("without a model the menus offer what opens one, what shows the window, and the keys") {
  const ViewerState state;
  std::vector<std::string> offered;
  for (const KeyBinding& binding : keyBindings()) {
    if (binding.menu != Menu::none && canRun(state, binding)) offered.emplace_back(binding.text);
  }
  CHECK(offered == std::vector<std::string>{"Open a file", "Save the whole window as PNG", "Quit",
                                            "Hide or show the panel", "Full screen", "Keys and mouse"});
}

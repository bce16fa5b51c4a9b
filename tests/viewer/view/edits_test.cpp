// SPDX-License-Identifier: Apache-2.0
// Choosing, changing and taking back.
#include "viewer/view/edits.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "core/model/verbs.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/edited_state.h"
#include "viewer/view/path_editor.h"

using namespace tg;
using test::everyThird;
using test::frame;
using test::kRedo;
using test::kUndo;
using test::press;
using test::sampleState;
using test::someSimilarity;

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
    chooseRange(state, histogram->high, middle, state.edit.mode);
    const auto expected = std::ranges::count_if(histogram->values, [&](float v) { return double{v} >= middle; });
    CHECK((state.edit.selection ? state.edit.selection->count : 0) == static_cast<std::size_t>(expected));
    state.edit.range_before = state.edit.selection;
    chooseRange(state, histogram->low, histogram->high, heldMode(state.edit, false, true));
    CHECK_FALSE(state.edit.selection);
    chooseRange(state, histogram->low, histogram->high, heldMode(state.edit, true, false));
    REQUIRE(state.edit.selection);
    CHECK(state.edit.selection->count == histogram->values.size());
  }
}

TEST_CASE("a range of the histogram is marked while it says what is selected") {
  ViewerState state = sampleState();
  frame(state);
  const Histogram* histogram = histogramShown(state);
  REQUIRE(histogram);
  CHECK_FALSE(rangeHolds(state.edit));
  state.edit.range_before = nullptr;
  chooseRange(state, histogram->low, (histogram->low + histogram->high) / 2, state.edit.mode);
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

TEST_CASE("without a selection the whole model moves with its cameras and named views, with one they stay") {
  ViewerState state = sampleState();
  state.scene.views = {state.scene.cameras[0]};
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
  CHECK(state.scene.views[0] == moved[0]);
  CHECK(state.camera.index == -1);
  undo(state);
  CHECK(*state.scene.model == before);
  CHECK(glm::distance(state.scene.cameras[0].translation, cameras[0].translation) < 1e-12);
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  transformChosen(state, similarity);
  CHECK(state.scene.cameras[0].rotation == cameras[0].rotation);
  CHECK(glm::distance(state.scene.views[0].translation, cameras[0].translation) < 1e-12);
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
  check("Size", [&, &s = settings] { s.splat_scale = 2; }, [&, &s = settings] { return s; });
  check("SH degree", [&, &s = settings] { s.max_sh_degree = 1; }, [&, &s = settings] { return s; });
  check("Texture filter", [&] { press(state, 'Y'); }, [&, &s = settings] { return s; });
  check("Outside", [&, &s = settings] { s.outside = TextureOutside::clip; }, [&, &s = settings] { return s; });
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
  check(
      "Load bookmarks",
      [&] {
        for (int i = 0; i < 2; ++i) addBookmark(state);
      },
      [&] { return state.camera.bookmarks.size(); });
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

TEST_CASE("undo and redo while the camera moves by itself are of what was done, not of where it went") {
  ViewerState state = sampleState();
  const bool plays = GENERATE(false, true);
  CAPTURE(plays);
  if (plays) {
    for (const double yaw : {0.5, 0.0}) {
      addKey(state);
      orbit(state.camera.pose, yaw, 0);
    }
    frame(state);
  }
  const auto go = [&] {
    REQUIRE(advance(state, 0.1));
    frame(state, movesByItself(state));
  };
  plays ? togglePlaying(state) : press(state, 'R');
  go();
  choose(state, everyThird(400), SelectMode::replace, nullptr);
  go();
  deleteChosen(state);
  CHECK(state.scene.gaussians == 266);
  go();
  const ViewPose pose = state.camera.pose;
  undo(state);
  CHECK(state.scene.gaussians == 400);
  CHECK(state.camera.pose == pose);
  CHECK(movesByItself(state));
  go();
  CHECK(redoName(state) == "Delete 134");
  redo(state);
  CHECK(state.scene.gaussians == 266);
  undo(state);
  // It stops, and starts again.
  plays ? togglePlaying(state) : press(state, 'R');
  CHECK_FALSE(movesByItself(state));
  plays ? togglePlaying(state) : press(state, 'R');
  redo(state);
  CHECK(state.scene.gaussians == 266);
  go();
  // At its end all of the way is one step.
  plays ? togglePlaying(state) : press(state, 'R');
  const ViewPose end = state.camera.pose;
  frame(state);
  CHECK(undoName(state) == "Camera");
  undo(state);
  CHECK(state.camera.pose != end);
  CHECK(state.scene.gaussians == 266);
}

TEST_CASE("what was framed stays as large in a window that is turned, and so does a view that an undo brings back") {
  ViewerState state = sampleState();
  state.scene.cameras.clear();
  const auto focal = [&](glm::ivec2 size) {
    return toCamera(state.camera.pose, state.camera.lens, size.x, size.y).focal.y;
  };
  const glm::ivec2 upright(390, 844), turned(844, 390);
  for (const bool first_upright : {true, false}) {
    const glm::ivec2 first = first_upright ? upright : turned, then = first_upright ? turned : upright;
    state.camera.aspect = static_cast<double>(first.x) / first.y;
    resetView(state);
    frame(state);
    const ViewPose pose = state.camera.pose;
    const double before = focal(first);
    reshape(state, static_cast<double>(then.x) / then.y);
    frame(state);
    CHECK(state.camera.pose == pose);
    CHECK(focal(then) == Approx(before));
    // An undo of what was done in the other shape.
    reshape(state, static_cast<double>(first.x) / first.y);
    frame(state);
    dolly(state.camera.pose, 0.5);
    frame(state);
    reshape(state, static_cast<double>(then.x) / then.y);
    frame(state);
    undo(state);
    frame(state);
    CHECK(state.camera.pose == pose);
    CHECK(focal(then) == Approx(before));
    CHECK(state.camera.aspect == static_cast<double>(then.x) / then.y);
  }
}

TEST_CASE("the window's shape and another model are no steps, and the history is bounded") {
  ViewerState state = sampleState();
  REQUIRE(state.camera.index == 0);
  const Lens lens = state.camera.lens;
  reshape(state, 0.5);
  frame(state);
  CHECK(state.camera.lens.fov_y > lens.fov_y);
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

TEST_CASE("undo and redo leave alone what was changed while another model was shown") {
  ViewerState state = sampleState();
  DisplayState& display = state.display;
  display.settings.exposure = 1;
  frame(state);
  state.compare.how.mode = CompareMode::side;
  frame(state);
  const History first = std::exchange(state.history, {});
  display.settings.opacity_scale = 0.3f;
  display.settings.background = {0, 1, 0};
  display.settings.intersection = IntersectionModel::plane;
  display.output = Output::depth;
  state.compare.how.gain = 4;
  frame(state);
  state.history = first;
  state.history.last.reset();
  for (int i = 0; i < 2; ++i) {
    const auto go = i == 0 ? undo : redo;
    go(state);
    go(state);
    frame(state);
    CHECK(display.settings.exposure == (i == 0 ? 0.0f : 1.0f));
    CHECK(state.compare.how.mode == (i == 0 ? CompareMode::off : CompareMode::side));
    CHECK(display.settings.opacity_scale == 0.3f);
    CHECK(display.settings.background == glm::vec3(0, 1, 0));
    CHECK(display.settings.intersection == IntersectionModel::plane);
    CHECK(display.output == Output::depth);
    CHECK(state.compare.how.gain == 4);
  }
}

TEST_CASE("keys added while another model was shown outlive undo and redo") {
  ViewerState state = sampleState();
  press(state, 'K');
  frame(state);
  const History first = std::exchange(state.history, {});
  for (int i = 0; i < 2; ++i) {
    orbit(state.camera.pose, 0.5, 0);
    press(state, 'K');
    frame(state);
  }
  REQUIRE(state.path.path.keys.size() == 3);
  state.history = first;
  state.history.last.reset();
  press(state, kUndo);
  CHECK(state.path.path.keys.size() == 3);
  press(state, kRedo);
  CHECK(state.path.path.keys.size() == 3);
  CHECK(state.path.key == 2);
}

TEST_CASE("undo takes the view back with its own lens when the cameras were replaced since") {
  ViewerState state = sampleState();
  const ViewPose pose = state.camera.pose;
  const Lens lens = state.camera.lens;
  REQUIRE(state.camera.index == 0);
  Camera other = lookAt({3, 1, -6}, {0, 0, 0}, {0, -1, 0}, 0.3, 96, 72);
  replaceCameras(state, {other, other});
  frame(state);
  const Lens others = state.camera.lens;
  REQUIRE(others != lens);
  press(state, kUndo);
  CHECK(state.camera.pose == pose);
  CHECK(state.camera.lens == lens);
  CHECK(state.camera.index == -1);
  frame(state);
  press(state, kRedo);
  CHECK(state.camera.lens == others);
  CHECK(state.camera.index == 0);

  // Likewise where the file was read again.
  Scene again = state.scene;
  again.camera_lists = 0;
  again.cameras = {test::trainedLikeCamera(96, 72), test::trainedLikeCamera(96, 72)};
  replaceScene(state, again);
  frame(state);
  press(state, kUndo);
  CHECK(state.camera.lens == lens);
  CHECK(state.camera.index == -1);
}

// SPDX-License-Identifier: Apache-2.0
// Several models at once: opening, switching, closing, and what goes wrong on the way.
#include "viewer/model/open_models.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <functional>
#include <thread>

#include "core/bundle/bundle.h"
#include "core/bundle/ply.h"
#include "core/run/live.h"
#include "core/system/error.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/keys.h"
#include "viewer/view/bookmarks.h"
#include "viewer/view/desktop.h"
#include "viewer/view/edits.h"
#include "viewer/view/state.h"

using namespace tg;
using test::press;

namespace {

void writeModel(const std::filesystem::path& path, std::size_t gaussians, const std::vector<std::string>& cameras,
                glm::vec3 background = glm::vec3(0.0f), glm::dvec3 moved = glm::dvec3(0.0)) {
  Bundle bundle;
  bundle.model = tinyTexturedModel(gaussians);
  bundle.background = background;
  for (const std::string& name : cameras) {
    bundle.cameras.push_back(
        lookAt(moved + glm::dvec3(bundle.cameras.size(), 0.5, -4), moved, {0, -1, 0}, 0.8, 64, 48));
    bundle.cameras.back().name = name;
  }
  writeBundle(path, bundle);
}

// A reader that shows a part of its file and waits until it may read the rest.
struct SlowReader {
  std::atomic<bool> go_on{false};
  void finish() {
    go_on = true;
    go_on.notify_all();
  }
  ModelReader reader() {
    return [this](const std::filesystem::path& path, const ReadOptions& read) {
      if (read.progress && read.progress->preview) read.progress->preview(tinyTexturedModel(2));
      go_on.wait(false);
      return readModel(path, read);
    };
  }
};

// The window's part: a state and its open models, turned until nothing is left to do.
struct Window {
  explicit Window(const ViewOptions& options, ModelReader read = {})
      : open_models(
            options, [] {}, [](ViewerState& s, Scene scene) { setScene(s, std::move(scene)); }, std::move(read)) {}
  void settle() {
    for (int i = 0; i < 30000; ++i) {
      state.loading.part_owed = false;  // a part is on screen at once
      open_models.update(state);
      const DocumentState& documents = state.documents;
      if (!state.loading.active && documents.open_requests.empty() && !documents.show_request &&
          !documents.close_request) {
        return;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    FAIL("loading does not end");
  }
  void followUntil(const std::function<bool()>& arrived) {
    for (int i = 0; i < 12000 && !arrived(); ++i) {
      open_models.update(state);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    REQUIRE(arrived());
  }
  void open(const std::filesystem::path& path) {
    state.documents.open_requests.push_back(path);
    settle();
  }
  ViewerState state;
  OpenModels open_models;
};

ViewOptions optionsFor(const std::filesystem::path& path) {
  ViewOptions options;
  options.model = path;
  return options;
}

// Files of that name, "": all, are read once `go_on` is true.
auto readingLate(const std::atomic<bool>& go_on, const std::string& late = "") {
  return [&go_on, late](const std::filesystem::path& path, const ReadOptions& read) {
    if (late.empty() || path.filename() == late) go_on.wait(false);
    return readModel(path, read);
  };
}

}  // namespace

TEST_CASE("several models open in their order, the last one is shown, and keys go round them") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  writeModel(folder / "c.tgz", 5, {});
  ViewOptions options = optionsFor(folder / "a.tgz");
  options.more_models = {folder / "b.tgz", folder / "c.tgz"};
  Window window(options);
  window.settle();
  ViewerState& state = window.state;
  REQUIRE(state.documents.open.size() == 3);
  CHECK(state.scene.gaussians == 5);
  press(state, kKeyPageDown);
  window.settle();
  CHECK(state.scene.gaussians == 3);
  CHECK(state.scene.model->size() == 3);
  press(state, kKeyPageUp);
  window.settle();
  CHECK(state.scene.gaussians == 5);
}

TEST_CASE("each model keeps its own edits and history, and a model that is read again forgets them") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  writeModel(folder / "b.tgz", 7, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  recordChanges(state, false, false);
  choose(state, {1, 1, 0, 0, 0, 0, 0, 0, 0}, SelectMode::replace, nullptr);
  deleteChosen(state);
  CHECK(state.scene.gaussians == 7);
  window.open(folder / "b.tgz");
  CHECK(undoName(state).empty());
  CHECK(unsavedModels(state) == std::vector<std::filesystem::path>{folder / "a.tgz"});
  state.documents.show_request = 0;
  window.settle();
  CHECK(undoName(state) == "Delete 2");
  undo(state);
  CHECK(state.scene.model->size() == 9);
  redo(state);
  writeModel(folder / "a.tgz", 8, {});
  state.desktop.agreed.emplace_back(folder / "a.tgz", state.edit.revision);
  window.open(folder / "a.tgz");
  CHECK(state.scene.gaussians == 8);
  CHECK(undoName(state).empty());
  CHECK(unsavedModels(state).empty());
  CHECK(state.desktop.agreed.empty());
}

TEST_CASE("a file that is open already, by whatever name, is brought to front and keeps its edits") {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "sub");
  std::filesystem::create_directory_symlink(folder.path, folder / "link");
  writeModel(folder / "a.tgz", 9, {});
  writeModel(folder / "b.tgz", 7, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  transformChosen(state, similarityOf(state, {1, 0, 0}, glm::dvec3(0.0), 1));
  for (const std::string name : {"a.tgz", "sub/../a.tgz", "link/a.tgz"}) {
    INFO(name);
    window.open(folder / "b.tgz");
    CHECK(state.documents.shown == 1);
    window.open(folder / name);
    CHECK(state.documents.open.size() == 2);
    CHECK(state.documents.shown == 0);
    CHECK(hasUnsavedEdits(state, 0));
    CHECK_THAT(state.messages.notice, Contains("a.tgz is open already"));
  }
}

TEST_CASE("a file that is written again is said to be, and read again where one wants it") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  writeModel(folder / "b.tgz", 7, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  window.open(folder / "b.tgz");
  const auto isRewritten = [&](std::size_t i) { return state.documents.open[i].rewritten; };
  writeModel(folder / "a.tgz", 5, {});
  window.followUntil([&] { return isRewritten(0); });
  CHECK_FALSE(isRewritten(1));
  CHECK(state.scene.gaussians == 7);
  press(state, kKeyPageUp);
  window.settle();
  CHECK(state.scene.gaussians == 9);
  press(state, kControl | 'R');
  window.settle();
  CHECK(state.scene.gaussians == 5);
  CHECK_FALSE(isRewritten(0));
  // A file that is back as it was read is no other one.
  std::filesystem::rename(folder / "a.tgz", folder / "kept.tgz");
  writeModel(folder / "a.tgz", 4, {});
  window.followUntil([&] { return isRewritten(0); });
  std::filesystem::rename(folder / "kept.tgz", folder / "a.tgz");
  window.followUntil([&] { return !isRewritten(0); });
  // Once for each time: who keeps what is shown is not asked again.
  writeModel(folder / "a.tgz", 6, {});
  window.followUntil([&] { return isRewritten(0); });
  state.documents.open[0].rewritten = false;
  press(state, kKeyPageDown);
  window.settle();
  std::this_thread::sleep_for(std::chrono::milliseconds(600));  // two looks at the files
  window.open_models.update(state);
  CHECK_FALSE(isRewritten(0));
}

TEST_CASE("edits that are made while the file is read again are asked for, and those given up are not") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  std::atomic<bool> go_on{true};
  Window window(optionsFor(folder / "a.tgz"), readingLate(go_on));
  window.settle();
  ViewerState& state = window.state;
  const auto edit = [&] { transformChosen(state, similarityOf(state, {1, 0, 0}, glm::dvec3(0.0), 1)); };
  const auto readMeanwhile = [&](const auto& act) {
    go_on = false;
    CHECK_FALSE(guardEdits(state));
    window.open_models.update(state);
    act();
    go_on = true;
    go_on.notify_all();
    window.settle();
  };
  writeModel(folder / "a.tgz", 5, {});
  state.documents.open_requests = {folder / "a.tgz"};
  readMeanwhile(edit);
  CHECK(state.scene.gaussians == 9);
  CHECK(guardEdits(state));
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->closing.way == Closing::Way::reading);
  discardUnsaved(state);
  readMeanwhile(edit);  // one more, which nobody has given up
  CHECK(state.scene.gaussians == 9);
  CHECK(guardEdits(state));
  discardUnsaved(state);
  readMeanwhile([] {});
  CHECK(state.scene.gaussians == 5);
  CHECK_FALSE(hasUnsavedEdits(state, 0));
}

TEST_CASE("what is chosen in a followed model stays until nothing is chosen") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  ViewOptions options = optionsFor(folder / "a.tgz");
  options.follow = true;
  Window window(options);
  ViewerState& state = window.state;
  window.followUntil([&] { return state.scene.model != nullptr; });
  choose(state, {1, 1, 0, 0, 0, 0, 0, 0, 0}, SelectMode::replace, nullptr);
  writeModel(folder / "a.tgz", 5, {});
  std::this_thread::sleep_for(std::chrono::milliseconds(600));  // two looks at the file
  window.open_models.update(state);
  CHECK(state.scene.gaussians == 9);
  CHECK(state.edit.selection);
  CHECK(state.follow.waits);
  choose(state, std::vector<std::uint8_t>(9, 0), SelectMode::replace, nullptr);
  window.followUntil([&] { return state.scene.gaussians == 5; });
  CHECK_FALSE(state.follow.waits);
}

TEST_CASE("an edit ends the following, and nobody watches the run any more") {
  const TemporaryFolder folder;
  writeModel(folder / "model.tgz", 9, {});
  std::ofstream(folder / "metrics.jsonl").flush();
  const int lines = ::open((folder / "metrics.jsonl").c_str(), O_RDONLY | O_CLOEXEC);
  REQUIRE(lines >= 0);
  ViewOptions options = optionsFor(folder / "model.tgz");
  options.follow = true;
  Window window(options);
  window.state.follow.active = true;
  window.followUntil([&] { return window.state.scene.model && isWatched(lines); });
  transformChosen(window.state, similarityOf(window.state, {1, 0, 0}, glm::dvec3(0.0), 1));
  writeModel(folder / "model.tgz", 5, {});
  window.open_models.update(window.state);
  CHECK_FALSE(window.state.follow.active);
  CHECK(window.state.scene.gaussians == 9);
  CHECK_FALSE(isWatched(lines));
  ::close(lines);
}

TEST_CASE("each model keeps its own bookmarks, and what of them no file holds") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  writeModel(folder / "b.tgz", 7, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  addBookmark(state);
  window.open(folder / "b.tgz");
  CHECK(state.camera.bookmarks.empty());
  press(state, kKeyPageDown);
  window.settle();
  CHECK(state.camera.bookmarks.size() == 1);
  askToQuit(state);
  REQUIRE(state.desktop.question);
  CHECK(state.desktop.question->what == Unsaved::bookmarks);
}

TEST_CASE("a drag ends when another model has been read meanwhile") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 9, {});
  writeModel(folder / "b.tgz", 7, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  setTool(state, EditTool::move);
  state.edit.moving = GizmoDrag{};
  state.edit.moving->similarity.translation = {1, 0, 0};
  window.open(folder / "b.tgz");
  press(state, kKeyPageUp);
  window.settle();
  CHECK(state.scene.gaussians == 9);
  CHECK_FALSE(state.edit.moving);
}

TEST_CASE("each model keeps its own view, models of one data set share theirs") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"});
  writeModel(folder / "b.tgz", 4, {"x.png", "y.png"});
  writeModel(folder / "c.tgz", 5, {"other.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  goToCamera(state, 1);
  const glm::dvec3 seen = state.camera.pose.position;
  window.open(folder / "c.tgz");
  CHECK(state.camera.index == 0);
  window.open(folder / "b.tgz");
  state.documents.show_request = 0;
  window.settle();
  // From b's first camera: b and a belong together.
  CHECK(state.camera.index == 0);
  goToCamera(state, 1);
  state.documents.show_request = 1;
  window.settle();
  CHECK(state.scene.gaussians == 5);
  CHECK(state.camera.index == 0);
  state.documents.show_request = 0;
  window.settle();
  CHECK(state.camera.index == 1);
  CHECK(state.camera.pose.position == seen);
}

TEST_CASE("a second model of the command line changes neither its camera nor its background") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png", "z.png"}, glm::vec3(1.0f));
  writeModel(folder / "c.tgz", 4, {"x.png", "y.png", "z.png"}, glm::vec3(0.25f));
  for (const bool compared : {true, false}) {
    for (const bool in_parts : {true, false}) {
      CAPTURE(compared, in_parts);
      ViewOptions options = optionsFor(folder / "a.tgz");
      if (compared) options.compare = folder / "c.tgz";
      if (!compared) options.more_models = {folder / "c.tgz"};
      options.camera = std::to_string(2);
      options.background = glm::vec3(0.5f);
      Window window(options, [&](const std::filesystem::path& path, const ReadOptions& read) {
        if (in_parts) read.progress->preview(tinyTexturedModel(2));
        return readModel(path, read);
      });
      window.settle();
      REQUIRE(window.state.documents.open.size() == 2);
      CHECK(window.state.documents.shown == (compared ? 0 : 1));
      CHECK(window.state.camera.pose.position.x == Approx(2));
      CHECK(window.state.display.settings.background == glm::vec3(0.5f));
      press(window.state, kKeyPageDown);
      window.settle();
      CHECK(window.state.camera.pose.position.x == Approx(2));
      CHECK(window.state.display.settings.background == glm::vec3(0.5f));
    }
  }
}

TEST_CASE("a model that opens beside one of its data set is seen from the view that is there, and leaves it alone") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"});
  writeModel(folder / "b.tgz", 4, {"x.png", "y.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  goToCamera(state, 1);
  orbit(state.camera.pose, 0.5, 0.1);
  state.camera.index = -1;
  state.camera.lens.fov_y *= 0.5;
  const CameraState view = state.camera;
  for (const int document : {1, 0}) {
    document == 1 ? window.open(folder / "b.tgz") : press(state, kKeyPageUp);
    window.settle();
    CHECK(state.documents.shown == document);
    CHECK(state.camera.pose == view.pose);
    CHECK(state.camera.lens == view.lens);
    CHECK(state.camera.index == -1);
  }
}

TEST_CASE("a moved copy has cameras of the same names at other places, and its own view") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"});
  writeModel(folder / "moved.tgz", 3, {"x.png", "y.png"}, glm::vec3(0.0f), {5, 0, 0});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  goToCamera(state, 1);
  window.open(folder / "moved.tgz");
  CHECK(state.camera.index == 0);
  CHECK(state.camera.pose.position.x == Approx(5));
  press(state, kKeyPageUp);
  window.settle();
  CHECK(state.camera.index == 1);
  CHECK(state.camera.pose.position.x == Approx(1));
  press(state, kKeyPageDown);
  window.settle();
  CHECK(state.camera.index == 0);
  CHECK(state.camera.pose.position.x == Approx(5));
}

TEST_CASE("a model's camera is wholly in view also where the window has got another shape meanwhile") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png"});
  writeModel(folder / "b.tgz", 4, {"other.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  const Lens wide = state.camera.lens;
  window.open(folder / "b.tgz");
  state.camera.aspect = 0.5;
  press(state, kKeyPageUp);
  window.settle();
  REQUIRE(state.camera.index == 0);
  CHECK(state.camera.lens == lensOf(state.scene.cameras[0], 0.5));
  CHECK(state.camera.lens.fov_y > wide.fov_y);
}

TEST_CASE("a free view of a model is as large where the window has got another shape meanwhile") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png"});
  writeModel(folder / "b.tgz", 4, {"other.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  leaveCamera(state.camera);
  dolly(state.camera.pose, 0.5);
  const Lens wide = state.camera.lens;
  const double aspect = state.camera.aspect;
  window.open(folder / "b.tgz");
  reshape(state, 0.5);
  press(state, kKeyPageUp);
  window.settle();
  REQUIRE(state.camera.index < 0);
  CHECK(state.camera.lens == reshaped(wide, aspect, 0.5));
  CHECK(state.camera.lens.fov_y > wide.fov_y);
}

TEST_CASE("each model keeps its own crop box, on or off") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png"});
  writeModel(folder / "b.tgz", 4, {"x.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  const CropBox box{{-1, -2, -3}, {1, 2, 3}};
  state.display.box = box;
  state.display.crop = true;
  window.open(folder / "b.tgz");
  CHECK_FALSE(state.display.crop);
  CHECK(state.display.box != box);
  press(state, kKeyPageUp);
  window.settle();
  CHECK(state.display.crop);
  CHECK(state.display.box == box);
  press(state, kKeyPageDown);
  window.settle();
  CHECK_FALSE(state.display.crop);
  CHECK(state.display.box != box);
}

TEST_CASE("closing shows a neighbour, closing the last one leaves nothing to draw") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  window.open(folder / "b.tgz");
  ViewerState& state = window.state;
  press(state, kControl | 'W');
  window.settle();
  REQUIRE(state.documents.open.size() == 1);
  CHECK(state.documents.shown == 0);
  CHECK(state.scene.gaussians == 3);
  press(state, kControl | 'W');
  window.settle();
  CHECK(state.documents.open.empty());
  CHECK_FALSE(state.scene.model);
  window.open(folder / "b.tgz");
  CHECK(state.scene.gaussians == 4);
}

TEST_CASE("no camera is the view's when the model that had it is closed, or read again with fewer") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"});
  writeModel(folder / "b.tgz", 4, {"other.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  goToCamera(window.state, 1);
  window.open(folder / "b.tgz");
  writeModel(folder / "a.tgz", 5, {"x.png"});
  window.open(folder / "a.tgz");
  REQUIRE(window.state.scene.gaussians == 5);
  CHECK(window.state.camera.index == -1);
  goToCamera(window.state, 0);
  for (int i = 0; i < 2; ++i) {
    press(window.state, kControl | 'W');
    window.settle();
  }
  CHECK_FALSE(window.state.scene.model);
  CHECK(window.state.camera.index == -1);
}

TEST_CASE("the state says which file is read, how far it is, and how many wait") {
  const TemporaryFolder folder;
  for (const char* name : {"a.tgz", "b.tgz", "c.tgz"}) writeModel(folder / name, 3, {});
  std::atomic<bool> half{false}, go_on{false};
  ViewOptions options = optionsFor(folder / "a.tgz");
  options.more_models = {folder / "b.tgz", folder / "c.tgz"};
  Window window(options, [&](const std::filesystem::path& path, const ReadOptions& read) {
    read.progress->total = 80;
    read.progress->done = 30;
    half = true;
    half.notify_all();
    go_on.wait(false);
    return readModel(path, read);
  });
  half.wait(false);
  window.open_models.update(window.state);
  const LoadState& loading = window.state.loading;
  CHECK(loading.active);
  CHECK(loading.path == folder / "a.tgz");
  CHECK(loading.done == 30);
  CHECK(loading.total == 80);
  CHECK(loading.waiting == 2);
  go_on = true;
  go_on.notify_all();
  window.settle();
  CHECK_FALSE(loading.active);
  CHECK(loading.waiting == 0);
  CHECK(window.state.documents.open.size() == 3);
}

TEST_CASE("a model that is closed while its rest is read stays closed until it is opened again") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  SlowReader slow;
  Window window(optionsFor(folder / "a.tgz"), slow.reader());
  ViewerState& state = window.state;
  window.followUntil([&] { return state.scene.partial; });
  CHECK(state.scene.gaussians == 2);
  press(state, kControl | 'W');
  window.followUntil([&] { return state.documents.open.empty(); });
  slow.finish();
  window.settle();
  CHECK(state.documents.open.empty());
  CHECK_FALSE(state.scene.model);
  window.open(folder / "a.tgz");
  CHECK(state.scene.gaussians == 3);
}

TEST_CASE("a model that is closed while it waits behind another file to be read again stays closed") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  std::atomic<bool> go_on{false};
  Window window(optionsFor(folder / "a.tgz"), readingLate(go_on, "b.tgz"));
  window.settle();
  ViewerState& state = window.state;
  writeModel(folder / "a.tgz", 7, {});
  // Twice, and closed before either has come.
  state.documents.open_requests = {folder / "b.tgz", folder / "a.tgz", folder / "a.tgz"};
  window.open_models.update(state);
  CHECK(state.loading.waiting == 2);
  state.documents.close_request = 0;
  window.open_models.update(state);
  CHECK(state.documents.open.empty());
  go_on = true;
  go_on.notify_all();
  window.settle();
  REQUIRE(state.documents.open.size() == 1);
  CHECK(state.documents.open[0].path == folder / "b.tgz");
  window.open(folder / "a.tgz");
  CHECK(state.scene.gaussians == 7);
}

TEST_CASE("a model that is closed while it waits by another name stays closed") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  std::atomic<bool> go_on{false};
  Window window(optionsFor(folder / "a.tgz"), readingLate(go_on, "b.tgz"));
  ViewerState& state = window.state;
  state.documents.open_requests = {folder / "b.tgz", folder / "./a.tgz"};
  window.open_models.update(state);
  window.followUntil([&] { return !state.documents.open.empty(); });
  state.documents.close_request = 0;
  window.open_models.update(state);
  go_on = true;
  go_on.notify_all();
  window.settle();
  REQUIRE(state.documents.open.size() == 1);
  CHECK(state.documents.open[0].path == folder / "b.tgz");
  window.open(folder / "./a.tgz");
  CHECK(state.scene.gaussians == 3);
}

TEST_CASE("a part lacks the background of its model, which comes with the rest unless another was chosen") {
  const TemporaryFolder folder;
  const glm::vec3 white(1.0f), red(1.0f, 0.0f, 0.0f);
  writeModel(folder / "a.tgz", 3, {"x.png"}, white);
  const bool chosen = GENERATE(false, true);
  SlowReader slow;
  Window window(optionsFor(folder / "a.tgz"), slow.reader());
  ViewerState& state = window.state;
  window.followUntil([&] { return state.scene.partial; });
  CHECK(state.display.settings.background == glm::vec3(0.0f));
  if (chosen) state.display.settings.background = red;
  slow.finish();
  window.settle();
  REQUIRE(state.scene.gaussians == 3);
  CHECK(state.display.settings.background == (chosen ? red : white));
}

TEST_CASE("whoever has looked about in a part of a model goes on from there when all of it has come") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png"});
  const int change = GENERATE(0, 1, 2, 3, 4);
  const bool moved = change > 0 && change < 4;
  CAPTURE(change);
  SlowReader slow;
  Window window(optionsFor(folder / "a.tgz"), slow.reader());
  ViewerState& state = window.state;
  window.followUntil([&] { return state.scene.partial; });
  if (change == 1) look(state.camera.pose, 0, 0.2);
  if (change == 2) state.camera.pose.roll = 0.1;
  if (change == 3) state.camera.lens.fov_y *= 0.5;
  if (change == 4) reshape(state, 0.37);  // the window alone
  const CameraState seen = state.camera;
  slow.finish();
  window.settle();
  REQUIRE(state.scene.gaussians == 3);
  CHECK(state.camera.index == (moved ? -1 : 0));
  CHECK((state.camera.pose == seen.pose && state.camera.lens == seen.lens) == moved);
}

TEST_CASE("a comparison ends with the model that it was with") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  writeModel(folder / "c.tgz", 5, {});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  window.open(folder / "b.tgz");
  window.open(folder / "c.tgz");
  ViewerState& state = window.state;
  state.compare.how.mode = CompareMode::side;
  press(state, kControl | 'W');
  window.settle();
  CHECK(state.compare.how.mode == CompareMode::side);  // another is left
  press(state, kControl | 'W');
  window.settle();
  CHECK(state.documents.open.size() == 1);
  CHECK(state.compare.how.mode == CompareMode::off);
}

TEST_CASE("a file that is open and has changed is read again in its place, under the same view") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"});
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  goToCamera(window.state, 1);
  writeModel(folder / "a.tgz", 7, {"x.png", "y.png"});
  window.open(folder / "a.tgz");
  CHECK(window.state.documents.open.size() == 1);
  CHECK(window.state.scene.gaussians == 7);
  CHECK(window.state.camera.index == 1);
}

TEST_CASE("cameras that are dropped together with a model are the new model's, not the one's that is shown") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  std::ofstream(folder / "broken.tgz") << "nothing";
  const std::filesystem::path cameras = folder / "cameras.json", path = folder / "path.json";
  std::ofstream(cameras) << "[]";
  std::ofstream(path) << "{}";
  using Files = std::vector<std::filesystem::path>;
  Window window(optionsFor(folder / "a.tgz"));
  window.settle();
  ViewerState& state = window.state;
  Files& requests = state.documents.open_requests;
  requests = {cameras};
  CHECK(takeCameraFiles(state) == Files{cameras});
  CHECK(requests.empty());
  requests = {cameras, folder / "b.tgz"};
  CHECK(takeCameraFiles(state).empty());
  CHECK(requests == Files{folder / "b.tgz"});
  window.open_models.update(state);
  if (state.loading.active) CHECK(takeCameraFiles(state).empty());
  window.settle();
  CHECK(state.scene.gaussians == 4);
  CHECK(takeCameraFiles(state) == Files{cameras});
  CHECK(takeCameraFiles(state).empty());
  // Another one's failure takes them away from nobody, nor do they go to a model that is shown before; a path is
  // none's.
  writeModel(folder / "c.tgz", 5, {});
  requests = {folder / "broken.tgz"};
  window.open_models.update(state);
  requests = {folder / "c.tgz", cameras, path};
  CHECK(takeCameraFiles(state) == Files{path});
  window.settle();
  CHECK(state.scene.gaussians == 5);
  state.documents.show_request = 0;
  window.settle();
  CHECK(takeCameraFiles(state).empty());
  CHECK_FALSE(hasCamerasDue(state));  // a script does not wait for them
  state.documents.show_request = 2;
  window.settle();
  CHECK(hasCamerasDue(state));
  CHECK(takeCameraFiles(state) == Files{cameras});
  // Where that model does not come they are nobody's.
  requests = {folder / "broken.tgz", cameras};
  CHECK(takeCameraFiles(state).empty());
  window.settle();
  CHECK_THAT(state.messages.error, Contains("broken.tgz"));
  CHECK(takeCameraFiles(state).empty());
  CHECK(state.documents.camera_files.empty());
}

TEST_CASE("of JSON files that are dropped a tileset and the meta.json of a SOG are models whatever their names") {
  const TemporaryFolder folder;
  using Files = std::vector<std::filesystem::path>;
  const Files models = {folder / "meta.json", folder / "tiles.json", folder / "lod-meta.json"};
  std::ofstream(models[0]) << R"({"version": 2, "means": {}, "scales": {}})";
  std::ofstream(models[1]) << R"({"asset": {"version": "1.1"}, "geometricError": 1})";
  const std::filesystem::path cameras = folder / "cameras.json";
  std::ofstream(cameras) << "[]";
  ViewerState state;
  state.documents.open_requests = {models[0], models[1], cameras, models[2]};
  CHECK(takeCameraFiles(state).empty());  // they wait for the models
  CHECK(state.documents.open_requests == models);
}

TEST_CASE("what cannot be read is an error at the start, and a message later") {
  const TemporaryFolder folder;
  std::ofstream(folder / "broken.tgz") << "no archive";
  writeModel(folder / "a.tgz", 3, {});
  {
    Window window(optionsFor(folder / "broken.tgz"));
    CHECK_THROWS_AS(window.settle(), Error);
  }
  ViewOptions options = optionsFor(folder / "broken.tgz");
  options.more_models = {folder / "a.tgz"};
  Window window(options);
  window.settle();
  CHECK(window.state.scene.gaussians == 3);
  CHECK_THAT(window.state.messages.error, Contains("broken.tgz"));
  window.open(folder / "missing.ply");
  CHECK_THAT(window.state.messages.error, Contains("missing.ply"));
  CHECK(window.state.scene.gaussians == 3);
}

TEST_CASE("the command line's camera is the first model's alone, its background every model's") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {"x.png", "y.png"}, glm::vec3(1.0f));
  writeModel(folder / "b.tgz", 4, {"z.png", "w.png"}, glm::vec3(0.25f));
  ViewOptions options = optionsFor(folder / "a.tgz");
  options.camera = std::to_string(1);
  options.background = glm::vec3(0.5f);
  Window window(options);
  window.settle();
  CHECK(window.state.camera.pose.position.x == Approx(1));
  CHECK(window.state.display.settings.background == glm::vec3(0.5f));
  window.open(folder / "b.tgz");
  CHECK(window.state.camera.index == 0);
  CHECK(window.state.display.settings.background == glm::vec3(0.5f));
  options.camera = std::to_string(7);
  Window wrong(options);
  CHECK_THROWS_AS(wrong.settle(), Error);
  options.model.clear();  // a window was asked for, and goes on
  Window later(options);
  later.open(folder / "b.tgz");
  CHECK(later.state.documents.open.size() == 1);
  CHECK(later.state.messages.error.find("--camera") != std::string::npos);
}

TEST_CASE("Esc stops loading before it ends the viewer, and what was there stays") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  writeModel(folder / "b.tgz", 4, {});
  std::atomic<bool> go_on{true};
  Window window(optionsFor(folder / "a.tgz"), readingLate(go_on));
  window.settle();
  ViewerState& state = window.state;
  state.loading.active = true;
  press(state, kKeyEscape);
  CHECK(state.loading.cancel);
  CHECK_FALSE(state.quit);
  // A list of files is dropped as a whole, but for the one that is being read.
  go_on = false;
  for (int i = 0; i < 20; ++i) state.documents.open_requests.push_back(folder / "b.tgz");
  state.documents.open_requests.push_back(folder / "c.tgz");
  window.open_models.update(state);
  go_on = true;
  go_on.notify_all();
  window.settle();
  CHECK(state.scene.gaussians <= 4);
  CHECK(state.messages.error.empty());
  press(state, kKeyEscape);
  press(state, kKeyEscape);
  CHECK(state.quit);
}

TEST_CASE("after Esc a file that cannot be read is a message, though nothing has opened yet") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  std::ofstream(folder / "broken.tgz") << "nothing";
  std::atomic<bool> go_on{false};
  Window window(optionsFor(folder / "a.tgz"), readingLate(go_on));
  window.state.loading.cancel = true;
  window.open_models.update(window.state);
  go_on = true;
  go_on.notify_all();
  window.settle();
  CHECK(window.state.documents.open.empty());
  window.open(folder / "broken.tgz");
  CHECK_THAT(window.state.messages.error, Contains("broken.tgz"));
  window.open(folder / "a.tgz");
  CHECK(window.state.scene.gaussians == 3);
}

TEST_CASE("a window without a file stays empty until one is opened, and says what cannot be") {
  const TemporaryFolder folder;
  writeModel(folder / "a.tgz", 3, {});
  std::ofstream(folder / "broken.tgz") << "nothing";
  Window window(ViewOptions{});
  window.settle();
  ViewerState& state = window.state;
  CHECK(state.documents.open.empty());
  window.open(folder / "broken.tgz");
  CHECK_THAT(state.messages.error, Contains("broken.tgz"));
  window.open(folder / "a.tgz");
  CHECK(state.scene.gaussians == 3);
  state.documents.close_request = 0;
  window.settle();
  CHECK(state.documents.open.empty());
  CHECK(state.documents.shown == -1);
  CHECK(state.scene.path.empty());
  CHECK_FALSE(state.scene.model);
}

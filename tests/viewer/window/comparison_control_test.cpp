// SPDX-License-Identifier: Apache-2.0
// Whose figures stand in the panel.
#include "viewer/window/comparison_control.h"

#include <chrono>
#include <memory>
#include <optional>
#include <semaphore>
#include <thread>

#include "render/renderer.h"
#include "support/catch.h"
#include "support/scenes.h"
#include "support/temporary_folder.h"
#include "viewer/view/camera_controller.h"

using namespace tg;

namespace {

std::shared_ptr<const GaussianModel> modelOf(unsigned seed) {
  return std::make_shared<GaussianModel>(test::trainedLikeModel(seed, 20));
}

// A model against photographs, or against another one, and what the picture thread would have drawn.
struct Bench {
  const TemporaryFolder folder;
  std::counting_semaphore<> results{0};
  ViewerState state;
  std::shared_ptr<const GaussianModel> model = modelOf(1), other = modelOf(2);
  std::optional<ComparisonControl> control;

  explicit Bench(bool photographs) {
    ViewOptions options;
    for (const char* name : {"a.png", "b.png"}) {
      Camera camera = test::trainedLikeCamera(48, 36);
      camera.name = name;
      state.scene.cameras.push_back(camera);
      if (photographs) writeImage(folder / name, test::noise(48, 36, name[0] == 'a' ? 1u : 2u));
    }
    if (photographs) options.photographs = state.compare.photographs = folder.path;
    control.emplace(options, [this] { results.release(); });
    state.scene.model = model;
    state.scene.path = "shown.tgz";
    state.scene.bounds.radius = 1;
    state.camera.index = 0;
    state.documents.open.resize(2);
    state.documents.open[0].path = state.scene.path;
    state.documents.open[1].path = "other.tgz";
    state.documents.open[1].scene.model = other;
    state.documents.shown = 0;
    state.compare.with_photographs = photographs;
    state.compare.how.mode = CompareMode::wipe;
  }

  Picture picture(glm::ivec2 size, unsigned seed = 1) const {
    Picture result;
    ComparisonControl::Problem problem;
    result.request = {state.scene.model, fitted(test::trainedLikeCamera(48, 36), size.x, size.y),
                      state.display.settings, state.display.output, control->other(state, problem)};
    REQUIRE(result.request.other);
    if (state.compare.with_photographs) {
      result.photograph = std::make_shared<Image>(readImage(result.request.other->photograph));
    }
    result.pair = std::make_shared<PicturePair>(
        PicturePair{test::noise(size.x, size.y, seed), test::noise(size.x, size.y, seed + 9), {}});
    return result;
  }
  // A frame of the window. With `result`, one has come before.
  void frame(const Picture& picture, bool complete = true, bool result = false) {
    if (result) REQUIRE(results.try_acquire_for(std::chrono::seconds(60)));
    control->update(state, &picture, complete);
    said = state.compare.metrics;
    current = state.compare.measured;
    control->measure(state, &picture, complete);
  }
  std::optional<PictureMetrics> said;  // by the panel
  bool current = false;
};

}  // namespace

TEST_CASE("figures of the model before are said where a newer one came faster than they did") {
  Bench bench(false);
  const Picture before = bench.picture({32, 24}, 1);
  bench.frame(before);
  CHECK_FALSE(bench.said);
  bench.state.scene.model = modelOf(3);
  const Picture newer = bench.picture({32, 24}, 5);
  bench.frame(newer, false, true);  // is on screen before its turn
  REQUIRE(bench.said);
  CHECK_FALSE(bench.current);
  CHECK(bench.said->psnr == metricsOf(before.pair->first, before.pair->other, {})->psnr);
  bench.frame(newer);
  CHECK(bench.said);
  CHECK_FALSE(bench.current);
  bench.frame(newer, true, true);
  CHECK(bench.current);
  CHECK(bench.said->psnr == metricsOf(newer.pair->first, newer.pair->other, {})->psnr);
}

TEST_CASE("figures of another place are not said, those of other settings only while they are measured anew") {
  for (const bool measured : {false, true}) {  // before it moves
    Bench bench(false);
    const Picture before = bench.picture({32, 24}, 1);
    bench.frame(before);
    bench.frame(before, true, true);
    CHECK(bench.current);
    bench.state.display.settings.textures = TextureMode::none;
    const Picture plain = bench.picture({32, 24}, 2);
    bench.frame(plain);
    bench.frame(plain, true, measured);
    CHECK(bench.said);
    if (measured) CHECK(bench.current);
    Picture moved = bench.picture({32, 24}, 3);
    moved.request.camera.translation.z += 1;
    bench.frame(moved);
    CHECK_FALSE(bench.current);
    CHECK_FALSE(bench.state.compare.metrics);           // at once, before the thread can have answered
    for (int i = 0; i < 60000 && !bench.current; ++i) {  // those of the one between them may come first
      bench.frame(moved);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    REQUIRE(bench.said);
    CHECK(bench.said->psnr == metricsOf(moved.pair->first, moved.pair->other, {})->psnr);
  }
}

TEST_CASE("below the name of the next photograph no figures of the one before are said") {
  Bench bench(true);
  const Picture first = bench.picture({32, 24});
  bench.frame(first);
  bench.frame(first, true, true);
  CHECK(bench.current);
  bench.state.camera.index = 1;  // and its picture is not there yet
  bench.frame(first, false);
  CHECK(bench.state.compare.photograph == "b.png");
  CHECK_FALSE(bench.said);
  CHECK_FALSE(bench.current);
  bench.state.camera.index = 0;  // back: they are known
  bench.frame(first);
  bench.frame(first);
  CHECK(bench.said);
  CHECK(bench.current);
}

TEST_CASE("of one Gaussian alone there are no figures, and those of the whole come back with it") {
  const bool photographs = GENERATE(false, true);
  Bench bench(photographs);
  const Picture whole = bench.picture({32, 24});
  bench.frame(whole);
  bench.frame(whole, true, true);
  CHECK(bench.current);
  bench.state.inspect.hits.resize(1);
  bench.state.inspect.picked = 0;
  bench.state.inspect.isolated = true;
  Picture alone = bench.picture({32, 24}, 2);
  alone.request.settings = effectiveSettings(bench.state);
  CHECK_FALSE(hasFigures(alone));
  for (int i = 0; i < 2; ++i) bench.frame(alone);
  CHECK_FALSE(bench.said);
  CHECK_FALSE(bench.current);
  bench.state.inspect.isolated = false;
  bench.frame(whole);
  bench.frame(whole, true, true);
  CHECK(bench.said);
  CHECK(bench.current);
}

TEST_CASE("beside one Gaussian alone the other model is compared as it is, in the crop box") {
  Bench bench(false);
  bench.state.inspect.hits.resize(1);
  bench.state.inspect.picked = 0;
  bench.state.inspect.isolated = true;
  REQUIRE(effectiveSettings(bench.state).crop);
  CHECK_FALSE(bench.picture({32, 24}).request.other->crop);
  bench.state.display.crop = true;
  bench.state.display.box = {glm::vec3(-1), glm::vec3(2)};
  CHECK(bench.picture({32, 24}).request.other->crop == bench.state.display.box);
}

TEST_CASE("a photograph is measured at its own size and brightness whatever the window shows") {
  for (const Output output : {Output::final, Output::base, Output::depth}) {
    Bench bench(true);
    bench.state.display.output = output;
    const Camera& taken = bench.state.scene.cameras[0];
    RenderSettings settings;
    settings.outputs = {output};
    const std::unique_ptr<Renderer> renderer = makeCpuRenderer();
    renderer->setModel(bench.model);
    const Image seen = visualize(renderer->render(taken, settings), output, settings);
    const PictureMetrics expected = *metricsOf(seen, readImage(bench.folder / "a.png"), {});
    for (const glm::ivec2 size : {glm::ivec2(32, 24), glm::ivec2(90, 30)}) {
      for (const float exposure : {0.0f, 1.0f}) {
        bench.state.display.settings.exposure = exposure;
        const Picture picture = bench.picture(size);
        const bool first = size.x == 32 && exposure == 0;
        bench.frame(picture);
        if (output == Output::depth) {
          CHECK_FALSE(hasFigures(picture));
          bench.frame(picture);
          CHECK_FALSE(bench.said);
          continue;
        }
        bench.frame(picture, true, first);  // the others are known
        CHECK(bench.current);
        REQUIRE(bench.said);
        CHECK(bench.said->psnr == Approx(expected.psnr).epsilon(1e-6));
        CHECK(bench.said->ssim == Approx(expected.ssim).epsilon(1e-6));
        CHECK(bench.state.compare.measured_size == taken.size);
      }
    }
  }
}

TEST_CASE("a run whose photographs cannot be shown is followed without them, and why is said") {
  const TemporaryFolder folder;
  ViewOptions options;
  options.photographs = folder.path;
  CHECK_THROWS_WITH(ComparisonControl(options, [] {}), Contains("holds no photographs"));
  options.follow = true;
  const ComparisonControl control(options, [] {});
  CHECK_FALSE(control.photographs());
  CHECK_THAT(control.withoutPhotographs(), Contains("holds no photographs"));
}

TEST_CASE("without a photograph of the view the way to one is said, and that a model without cameras has none") {
  Bench bench(true);
  const auto said = [&] {
    bench.control->update(bench.state, nullptr, false);
    return bench.state.compare.problem + " | " + bench.state.compare.way_out;
  };
  CHECK(said() == " | ");
  leaveCamera(bench.state.camera);
  bench.state.camera.pose.position.x += 1;
  CHECK(said() == "No photograph was taken from here | Go to a camera of the model (Space, or . and ,)");
  bench.state.scene.cameras.clear();
  bench.state.camera.index = bench.state.camera.visited = -1;
  CHECK(said() == "This model has no cameras | Photographs are found by theirs");
}

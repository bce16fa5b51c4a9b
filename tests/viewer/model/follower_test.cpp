// SPDX-License-Identifier: Apache-2.0
// A followed file: missing, broken, replaced; and how far its training says it is.
#include "viewer/model/follower.h"

#include <fcntl.h>
#include <unistd.h>

#include <atomic>
#include <fstream>

#include "core/bundle/bundle.h"
#include "core/tiny_model.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "viewer/model/run_watch.h"
#include "viewer/model/scene_of.h"
#include "viewer/view/state.h"

using namespace tg;

namespace {

void writeModel(const std::filesystem::path& path, std::size_t gaussians, const std::string& training = "") {
  Bundle bundle;
  bundle.model = tinyTexturedModel(gaussians);
  bundle.training_json = training;
  writeBundle(path, bundle);
}

const std::string kPlain =
    R"({"interrupted": true, "settings": {"iterations": 700, "texture-iterations": 300},
        "stages": {"plain": {"iterations": 120, "train_psnr": 24.305}}})";

}  // namespace

TEST_CASE("a run folder stands for its model, there or not yet") {
  const TemporaryFolder folder;
  CHECK(followedFile(folder.path) == folder / "model.tgz");
  CHECK(followedFile("no/such/run") == "no/such/run/model.tgz");
  CHECK(followedFile("no/such/run/") == "no/such/run/model.tgz");
  CHECK(followedFile("a/scene.glb") == "a/scene.glb");
  std::filesystem::create_directory(folder / "run.1");
  CHECK(followedFile(folder / "run.1") == folder / "run.1/model.tgz");
}

TEST_CASE("training.json says how far the run is, and strange ones say nothing") {
  const TrainingProgress plain = trainingProgress(kPlain);
  CHECK(formatProgress(plain) == "plain 120 / 700");
  CHECK(plain.psnr == Approx(24.305));
  CHECK_FALSE(plain.finished);
  const TrainingProgress counting = trainingProgress(
      R"({"interrupted": true, "settings": {"iterations": 700},
          "stages": {"count": {"iterations": 5}, "plain": {"iterations": 0}}})");
  CHECK(formatProgress(counting) == "count 5 / 700");
  const TrainingProgress done = trainingProgress(
      R"({"interrupted": false, "settings": {"texture-iterations": 300},
          "stages": {"plain": {"iterations": 700}, "textured": {"iterations": 300}, "untextured": {"iterations": 9}}})");
  CHECK(formatProgress(done) == "textured 300 / 300");
  CHECK(done.finished);
  const TrainingProgress for_file = trainingProgress(
      R"({"interrupted": false, "settings": {"iterations": 700, "quantize-iterations": 70},
          "stages": {"plain": {"iterations": 700, "test_psnr": 16.68},
                     "quantized": {"iterations": 70, "test_psnr": 16.39}}})");
  CHECK(formatProgress(for_file) == "quantized 70 / 70");
  CHECK(for_file.held_out == Approx(16.39));
  CHECK(formatProgress(trainingProgress(R"({"interrupted": true, "settings": {"quantize-iterations": 70},
                                            "stages": {"quantized": {"iterations": 3}}})")) == "quantized 3 / 70");
  for (const char* strange : {"", "{", "[]", "{}", R"({"stages": 3})", R"({"stages": {"plain": 3}})",
                              R"({"stages": {}, "interrupted": "maybe"})"}) {
    INFO(strange);
    CHECK(formatProgress(trainingProgress(strange)).empty());
    CHECK(trainingProgress(strange).finished);
  }
  CHECK(formatProgress(trainingProgress(R"({"stages": {"plain": {"iterations": -7, "train_psnr": []}}})")) ==
        "plain 0");
}

TEST_CASE("a followed file is waited for, read again when replaced, and missed when it is gone") {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "model.tgz";
  std::atomic<int> woken{0};
  ModelFollower follower(file, [&] { ++woken; });
  ModelFollower::News news = follower.wait();
  CHECK_FALSE(news.model);
  CHECK(news.problem == "waiting for " + file.string());
  CHECK(news.missing);

  std::ofstream(file) << "half a model";
  news = follower.wait();
  CHECK_FALSE(news.model);
  CHECK_FALSE(news.missing);
  CHECK_THAT(news.problem, Contains(file.string()));

  writeModel(file, 3, kPlain);
  news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.problem.empty());
  CHECK(news.model->model.size() == 3);
  CHECK(sceneOf(*news.model, file).training == "plain 120 / 700, 24.30 dB in training");

  writeModel(file, 5);
  news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.model->model.size() == 5);
  CHECK_FALSE(follower.take());

  std::filesystem::remove(file);
  CHECK_THAT(follower.wait().problem, Contains("waiting for"));
  // The news may be taken just before its wake-up call.
  for (int i = 0; i < 6000 && woken < 5; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CHECK(woken == 5);
}

TEST_CASE("a model that was not taken outlives the news that its file is gone") {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder / "model.tgz";
  writeModel(file, 4);
  std::atomic<int> woken{0};
  ModelFollower follower(file, [&] {
    // Gone as soon as it has been read.
    std::error_code ignored;
    if (woken++ == 0) std::filesystem::remove(file, ignored);
  });
  for (int i = 0; i < 6000 && woken < 2; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const ModelFollower::News news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.model->model.size() == 4);
  CHECK_THAT(news.problem, Contains("waiting for"));
}

TEST_CASE("a further trained model changes the scene but neither camera nor background") {
  ViewerState state;
  Scene scene;
  scene.background = glm::vec3(1.0f);
  for (int i = 0; i < 3; ++i) scene.cameras.push_back(lookAt({i - 1.0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 64, 48));
  setScene(state, scene);
  goToCamera(state, 2);
  state.display.settings.background = glm::vec3(0.5f);
  const glm::dvec3 position = state.camera.pose.position;
  scene.gaussians = 7;
  replaceScene(state, scene);
  CHECK(state.scene.gaussians == 7);
  CHECK(state.camera.index == 2);
  CHECK(state.camera.pose.position == position);
  CHECK(state.display.settings.background == glm::vec3(0.5f));
  scene.cameras.pop_back();
  replaceScene(state, scene);
  CHECK(state.camera.index == -1);
  CHECK(state.camera.pose.position == position);
}

TEST_CASE("of a run that is watched the live model is followed, and its last one when that is gone") {
  const TemporaryFolder folder;
  writeModel(folder / "model.tgz", 3);
  writeModel(folder / "live.tgz", 4);
  ModelFollower follower(folder / "model.tgz", [] {});
  ModelFollower::News news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.model->model.size() == 4);
  std::filesystem::remove(folder / "live.tgz");
  news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.model->model.size() == 3);
  writeModel(folder / "live.tgz", 5);
  news = follower.wait();
  REQUIRE(news.model);
  CHECK(news.model->model.size() == 5);
}

TEST_CASE("watching a run brings its curves and status, tells it so, and gives it orders") {
  const TemporaryFolder folder;
  const std::filesystem::path metrics = folder / "metrics.jsonl";
  RunMetrics line;
  line.stage = "plain";
  line.iteration = 10;
  std::ofstream(metrics) << formatMetrics(line);
  const int descriptor = ::open(metrics.c_str(), O_WRONLY | O_CLOEXEC);
  REQUIRE(descriptor >= 0);
  const auto soon = [](auto&& condition) {
    for (int i = 0; i < 6000; ++i) {
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  };
  {
    RunWatch watch(folder.path, [] {});
    RunWatch::News news;
    const auto brings = [&](auto&& wanted) {
      return soon([&] {
        if (auto fresh = watch.take()) news = std::move(*fresh);
        return news.lines && wanted(news);
      });
    };
    CHECK(brings([](const RunWatch::News& n) { return n.lines->size() == 1 && !n.status; }));
    CHECK(soon([&] { return isWatched(descriptor); }));
    std::ofstream(folder / "live.json") << formatStatus({RunPhase::paused, "scene", line});
    CHECK(brings([](const RunWatch::News& n) { return n.status && n.status->phase == RunPhase::paused; }));
    std::ofstream(metrics, std::ios::app) << formatMetrics(line);
    CHECK(brings([](const RunWatch::News& n) { return n.lines->size() == 2; }));
    watch.order({RunCommand::step, 5});
    std::ifstream stream(folder / "control");
    std::string order;
    std::getline(stream, order);
    CHECK(order == "step 5");
    std::filesystem::remove(folder / "live.json");
    CHECK(brings([](const RunWatch::News& n) { return !n.status; }));
  }
  CHECK_FALSE(isWatched(descriptor));
  ::close(descriptor);
}

// SPDX-License-Identifier: Apache-2.0
// A run that is watched: by a lock on its folder, by browsers, and afterwards by its curves.
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "core/bundle/bundle.h"
#include "core/run/live.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/child.h"

using namespace tg::test;

namespace {

const std::string kLong =
    "scene --iterations 1000000 --densification none --threads 1 --eval-every 50 --texture-mode none ";

// A run of the sample that goes on for ever, with its first checkpoint.
struct LongRun {
  explicit LongRun(const tg::TemporaryFolder& folder, const std::string& name = "run")
      : run(folder / name), child(folder, kLong + "--run " + name) {
    child.until([&] { return fs::exists(run / "model.tgz"); });
  }
  const fs::path run;
  Child child;
};

std::optional<tg::RunStatus> statusOf(const fs::path& run) { return tg::parseStatus(contents(run / "live.json")); }

}  // namespace

TEST_CASE("a run that is watched leaves its newest model, is paused, stepped and stopped, and cleans up", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  LongRun long_run(folder);
  const fs::path& run = long_run.run;
  Child& child = long_run.child;
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  CHECK_FALSE(fs::exists(run / "live.tgz"));  // nobody watches
  CHECK_FALSE(fs::exists(run / "live.json"));

  const tg::WatchLock lock(run);
  REQUIRE(lock.holds(run));
  child.until([&] { return fs::exists(run / "live.tgz") && statusOf(run); });
  CHECK(statusOf(run)->phase == tg::RunPhase::training);
  CHECK(statusOf(run)->name == "scene");
  CHECK(tg::readBundle(run / "live.tgz").model.size() > 100);
  // Newer ones come, and the checkpoint is not what they wait for.
  const auto before = fs::last_write_time(run / "live.tgz"), saved = fs::last_write_time(run / "model.tgz");
  child.until([&] { return fs::last_write_time(run / "live.tgz") != before; });
  CHECK(fs::last_write_time(run / "model.tgz") == saved);

  tg::giveOrder(run, {tg::RunCommand::pause});
  child.until([&] { return statusOf(run) && statusOf(run)->phase == tg::RunPhase::paused; });
  CHECK_FALSE(fs::exists(run / "control"));
  const int paused = statusOf(run)->now.iteration;
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  CHECK(statusOf(run)->now.iteration == paused);
  tg::giveOrder(run, {tg::RunCommand::step, 7});
  child.until([&] { return statusOf(run) && statusOf(run)->now.iteration == paused + 7; });
  child.until([&] { return statusOf(run) && statusOf(run)->phase == tg::RunPhase::paused; });
  std::this_thread::sleep_for(std::chrono::milliseconds(400));
  CHECK(statusOf(run)->now.iteration == paused + 7);
  // The model that is shown is that of the step at which it stands.
  child.until([&] {
    return tg::readBundle(run / "live.tgz").training_json.find("\"iterations\": " + std::to_string(paused + 7)) !=
           std::string::npos;
  });

  std::ofstream(run / "control") << "faster\n";
  child.until(
      [&] { return child.output().find("is no order (expected pause, go, step N or stop)") != std::string::npos; });
  std::ofstream(run / "control") << "go";
  child.until([&] { return child.output().find("is no whole line (expected its end") != std::string::npos; });
  CHECK(statusOf(run)->phase == tg::RunPhase::paused);
  tg::giveOrder(run, {tg::RunCommand::go});
  child.until(
      [&] { return statusOf(run) && statusOf(run)->now.iteration > paused + 60 && statusOf(run)->now.test_psnr; });

  tg::giveOrder(run, {tg::RunCommand::stop});
  CHECK(child.end() == 128 + SIGINT);
  CHECK_THAT(child.output(), Contains("interrupted; wrote"));
  for (const char* gone : {"live.tgz", "live.json", "control", ".tg-control"}) CHECK_FALSE(fs::exists(run / gone));
}

TEST_CASE("what a killed run left of being watched is gone when it goes on", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const fs::path run = folder / "run";
  {
    LongRun killed(folder);
    const tg::WatchLock lock(run);
    killed.child.until([&] { return fs::exists(run / "live.tgz"); });
    killed.child.send(SIGKILL);
    killed.child.end();
  }
  CHECK(fs::exists(run / "live.tgz"));
  std::ofstream(run / "control") << "pause\n";
  Child child(folder, kLong + "--run run --resume");
  child.until([&] { return !fs::exists(run / "live.tgz") && !fs::exists(run / "control"); });
}

TEST_CASE("a pause is told of a run folder without its control characters", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  LongRun long_run(folder, "\x1brun");
  const tg::WatchLock lock(long_run.run);
  tg::giveOrder(long_run.run, {tg::RunCommand::pause});
  long_run.child.until([&] { return long_run.child.output().find("paused by ?run/control (go") != std::string::npos; });
}

TEST_CASE("a page shows a run and changes none of its bytes", "[watch]") {
  TG_SKIP_IF(std::system("curl --version >/dev/null 2>&1") == 0 ? "" : "no curl");
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string command = kBase + "--iterations 1000 --reproducible --threads 1 -o ";
  REQUIRE(tgtrain(folder, command + "alone.tgz").code == 0);
  Child child(folder, command + "served.tgz --run run --serve 0 --eval-every 100");
  child.until([&] { return child.output().find("serving http://127.0.0.1:") != std::string::npos; });
  const std::string output = child.output();
  const std::size_t at = output.find("http://");
  const std::string url = output.substr(at, output.find('\n', at) - at);
  const tg::TemporaryFolder browser;
  bool model = false, curves = false, held_out = false, finished = false;
  while (child.running()) {
    const Outcome state = run(browser, "curl -s --max-time 5 " + url + "state.json");
    if (state.code != 0) continue;
    const nlohmann::json json = nlohmann::json::parse(state.output);
    curves = curves || json["metrics"]["rows"].size() > 2;
    held_out = held_out || json["held_out"]["number"] > 0;
    finished = finished || (json["run"].is_object() && json["run"]["phase"] == "finished");
    if (json["model"] == 0) continue;
    const Outcome glb = run(browser, "curl -s --max-time 5 -o model.glb " + url + "model.glb && head -c 4 model.glb");
    if (glb.code != 0) continue;  // it may have ended meanwhile
    model = true;
    CHECK(glb.output == "glTF");
  }
  CHECK(child.end() == 0);
  CHECK(model);
  CHECK(curves);
  CHECK(held_out);
  CHECK(finished);
  CHECK(bytesOf(folder / "served.tgz") == bytesOf(folder / "alone.tgz"));
}

TEST_CASE("a page without a run folder has its title and its test scores, and no last look keeps a file back",
          "[watch]") {
  TG_SKIP_IF(std::system("curl --version >/dev/null 2>&1") == 0 ? "" : "no curl");
  const tg::TemporaryFolder folder, browser;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child child(
      folder,
      "scene/ --texture-mode none --densification none --iterations 2000 -o model.tgz --json run.json --serve 0 "
      "--eval-every 100");
  child.until([&] { return child.output().find("serving http://127.0.0.1:") != std::string::npos; });
  const std::string output = child.output();
  const std::size_t at = output.find("http://");
  const std::string url = output.substr(at, output.find('\n', at) - at);
  nlohmann::json json;
  const auto ask = [&] {
    const Outcome state = run(browser, "curl -s --max-time 5 " + url + "state.json");
    if (state.code == 0) json = nlohmann::json::parse(state.output);
  };
  // The model is not asked for, so that the program waits for it at the end.
  child.until([&] {
    ask();
    return json["run"].is_object() && json["run"]["phase"] == "finished";
  });
  CHECK(json["title"] == "scene");
  int scores = 0;
  for (const nlohmann::json& row : json["metrics"]["rows"]) scores += !row[4].is_null();
  CHECK(scores == 2000 / 100);
  CHECK(fs::exists(folder / "run.json"));
  CHECK_THAT(child.output(), Contains("wrote model.tgz"));
  const auto start = std::chrono::steady_clock::now();
  child.send(SIGINT);
  CHECK(child.end() == 0);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(4));
}

TEST_CASE("a page that cannot be served is one line before training", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Outcome outcome = tgtrain(folder, "scene -o model.tgz --serve nowhere");
  CHECK(outcome.code == 1);
  CHECK_THAT(outcome.output, Contains("--serve: expected [ADDRESS:]PORT"));
  outcome = tgtrain(folder, "scene -o model.tgz --serve-token 0123456789");
  CHECK(outcome.code == 1);
  CHECK_THAT(outcome.output, Contains("(expected --serve with it)"));
  outcome = tgtrain(folder, "scene -o model.tgz --serve 192.0.2.1:8080");
  CHECK(outcome.code == 5);
  CHECK_THAT(outcome.output, Contains("192.0.2.1:8080: cannot listen here"));
}

TEST_CASE("plot draws the curves of runs, each with its name, and refuses what is no run", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, kBase + "--iterations 40 --run a<b -q").code == 0);
  REQUIRE(tgtrain(folder, kBase + "--iterations 60 --run other -q").code == 0);
  Outcome outcome = tgtrain(folder, "plot a<b other/metrics.jsonl -o curves.svg");
  CHECK(outcome.code == 0);
  CHECK_THAT(outcome.output, Contains("wrote curves.svg: 2 runs"));
  const std::string svg = contents(folder / "curves.svg");
  CHECK_THAT(svg, Contains("<svg xmlns=") && Contains("a&lt;b, ") && Contains(">other, ") && Contains("PSNR [dB]"));
  CHECK_THAT(svg, Contains("dB held out after untextured") && Contains("600 Gaussians"));
  CHECK_THAT(svg, !Contains("nan"));
  CHECK_THAT(svg, !Contains("inf"));
  fs::create_directory(folder / "more");
  fs::copy(folder / "other", folder / "more/other", fs::copy_options::recursive);
  REQUIRE(tgtrain(folder, "plot other more/other -o alike.svg").code == 0);
  CHECK_THAT(contents(folder / "alike.svg"), Contains(">other, ") && Contains(">more/other, "));
  CHECK(tgtrain(folder, "plot other -o curves.html").code == 0);
  CHECK_THAT(contents(folder / "curves.html"), Contains("<!doctype html>") && Contains("<svg"));
  outcome = tgtrain(folder, "plot other -o curves.html");
  CHECK(outcome.code == 4);
  outcome = tgtrain(folder, "plot other -o curves.png");
  CHECK(outcome.code == 1);
  CHECK_THAT(outcome.output, Contains("expected .svg or .html, found .png"));
  outcome = tgtrain(folder, "plot scene -o new.svg");
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.output, Contains("scene: is no run (expected a folder with metrics.jsonl"));
  std::ofstream(folder / "strange.jsonl")
      << R"({"stage": "plain", "iteration": 1, "loss": 1e16, "train_psnr": 1e308, "seconds": 1e300})" << '\n'
      << R"({"stage": "plain", "iteration": 2, "loss": 10000000000000002, "train_psnr": -1e308, "seconds": 1e300})"
      << '\n'
      << R"({"stage": "<b>\u0001", "iteration": 3, "loss": 1e16, "test_psnr": 20})" << '\n';
  CHECK(tgtrain(folder, "plot strange.jsonl -o strange.svg").code == 0);
  const std::string strange = contents(folder / "strange.svg");
  CHECK_THAT(strange, Contains("20.00 dB held out after &lt;b") && !Contains("<b>") && !Contains("\x01"));
  CHECK_THAT(strange, !Contains("nan") && !Contains("inf"));
  std::ofstream(folder / "empty.jsonl") << "{}\n";
  outcome = tgtrain(folder, "plot empty.jsonl -o new.svg");
  CHECK(outcome.code == 3);
  CHECK_FALSE(fs::exists(folder / "new.svg"));
}

TEST_CASE("a training of hours on the CPU says once what is quicker where it may say something", "[watch]") {
  const tg::TemporaryFolder folder;
  REQUIRE(
      tgtrain(folder, "make-sample scene --size 96 --views 2 --test-views 1 --points 2000 --supersampling 1").code ==
      0);
  const auto said = [&](const std::string& flags) {
    fs::remove_all(folder / "run");
    Child child(folder, "scene --device cpu --densification none --run run --metrics-every 50 " + flags);
    child.until([&] { return contents(folder / "run/metrics.jsonl").find("\"iteration\":150") != std::string::npos; });
    child.send(SIGTERM);
    CHECK(child.end() == 128 + SIGTERM);
    return child.output();
  };
  const std::string large = "--texture-size 256 ", long_plain = "--iterations 10000000 ";
  const std::string plain = said(large);
  CHECK_THAT(plain,
             Contains("tgtrain: an hour or more on the CPU (--preset quick or --downscale 2 for a first look)\n"));
  CHECK(plain.find("first look") == plain.rfind("first look"));
  CHECK_THAT(said(large + "--downscale 2"),
             Contains(" an hour or more on the CPU (--preset quick for a first look)\n"));
  for (const char* flags : {"", "--preset quick"}) {  // the preset would leave the iterations as they are
    CHECK_THAT(said(long_plain + flags), Contains(" an hour or more on the CPU (--downscale 2 for a first look)\n"));
  }
  CHECK_THAT(said("--texture-iterations 10000000 --downscale 2"), !Contains("first look"));
  CHECK_THAT(said(large + "-q"), !Contains("first look"));
}

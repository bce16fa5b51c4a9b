// SPDX-License-Identifier: Apache-2.0
// One of all who try gets a job, one result of all stays, and nobody is taken for dead by a clock.
#include "training/farm/claims.h"

#include <atomic>
#include <fstream>
#include <thread>

#include "core/file/file.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace fs = std::filesystem;
using tg::AttemptEnd;
using tg::FarmFolder;
using tg::FarmJob;
using tg::JobState;
using namespace std::chrono_literals;

namespace {

const std::vector<FarmJob> kJobs = {{"a", "d", "model.tgz", {}}, {"b", "d", "model.tgz", {"--seed", "2"}}};

void write(const fs::path& path, const std::string& text) {
  fs::create_directories(path.parent_path());
  std::ofstream(path) << text;
}
std::string textOf(const fs::path& path) {
  const std::vector<std::uint8_t> bytes = tg::readFile(path, 1 << 20);
  return {bytes.begin(), bytes.end()};
}

}  // namespace

TEST_CASE("of many who want an attempt at a job one gets it", "[farm]") {
  const tg::TemporaryFolder folder;
  const FarmFolder farm(folder / "farm", kJobs, "1", false);
  for (int number = 1; number <= 20; ++number) {
    std::atomic<int> winners = 0;
    {
      std::vector<std::jthread> workers;
      for (int i = 0; i < 8; ++i) workers.emplace_back([&] { winners += farm.claim("a", number, "w"); });
    }
    CHECK(winners == 1);
  }
  const tg::JobView view = farm.look("a");
  CHECK(view.state == JobState::taken);
  CHECK(view.attempts == 20);
  CHECK(view.deaths == 19);
  CHECK(view.worker == "w");
  CHECK(farm.look("b").state == JobState::open);
}

TEST_CASE("what becomes of an attempt decides what becomes of its job", "[farm]") {
  const tg::TemporaryFolder folder;
  const FarmFolder farm(folder / "farm", kJobs, "1", false);
  REQUIRE(farm.claim("a", 1, "w"));
  farm.end("a", 1, AttemptEnd::released, {143, "stopped"});
  CHECK(farm.look("a").state == JobState::open);
  CHECK(farm.look("a").failures == 0);
  REQUIRE(farm.claim("a", 2, "w"));
  CHECK_FALSE(farm.isOvertaken("a", 2));
  CHECK(farm.isOvertaken("a", 1));
  farm.end("a", 2, AttemptEnd::failed, {2, "cannot read"});
  CHECK(farm.look("a").state == JobState::open);
  CHECK(farm.look("a").failures == 1);
  CHECK(farm.look("a").deaths == 0);
  farm.fail("a", {2, "cannot read", "w"});
  REQUIRE(farm.look("a").state == JobState::failed);
  CHECK(farm.look("a").failure->code == 2);
  CHECK(farm.look("a").failure->words == "cannot read");
  CHECK(farm.look("a").failure->worker == "w");

  // Killed between any two calls: folders without files, files without an end.
  fs::create_directories(folder / "farm/jobs/b/0001");
  CHECK(farm.look("b").state == JobState::taken);
  write(folder / "farm/jobs/b/0001/worker.json", "{\"work");
  CHECK(farm.look("b").state == JobState::taken);
  write(folder / "farm/jobs/b/notes.txt", "not an attempt");
  write(folder / "farm/jobs/b/2/run", "nor this");
  CHECK(farm.look("b").attempts == 1);
}

TEST_CASE("an attempt goes on from the newest checkpoint, and what the dead still write does not reach it", "[farm]") {
  const tg::TemporaryFolder folder;
  const FarmFolder farm(folder / "farm", kJobs, "1", false);
  REQUIRE(farm.claim("a", 1, "w"));
  CHECK_FALSE(farm.carryOver("a", 1));
  write(farm.attempt("a", 1) / "run/checkpoint", "one");
  write(farm.attempt("a", 1) / "run/metrics.jsonl", "line\n");
  std::ofstream late(farm.attempt("a", 1) / "run/metrics.jsonl", std::ios::app);
  REQUIRE(farm.claim("a", 2, "w"));
  REQUIRE(farm.claim("a", 3, "w"));  // the second died before it had a checkpoint
  REQUIRE(farm.carryOver("a", 3));
  late << "late\n" << std::flush;
  CHECK(textOf(farm.attempt("a", 3) / "run/checkpoint") == "one");
  CHECK(textOf(farm.attempt("a", 3) / "run/metrics.jsonl") == "line\n");
  CHECK_FALSE(fs::exists(farm.attempt("a", 1) / "run"));
  CHECK_THROWS_AS(tg::writeTextAtomically(farm.attempt("a", 1) / "run/checkpoint", "zombie"), tg::Error);
}

TEST_CASE("the first result stays", "[farm]") {
  const tg::TemporaryFolder folder;
  const FarmFolder farm(folder / "farm", kJobs, "1", false);
  REQUIRE(farm.claim("a", 1, "w"));
  REQUIRE(farm.claim("a", 2, "w"));
  write(farm.attempt("a", 1) / "result/model.tgz", "first");
  write(farm.attempt("a", 2) / "result/model.tgz", "second");
  CHECK(farm.publish("a", 2));
  CHECK_FALSE(farm.publish("a", 1));
  CHECK(textOf(farm.result("a") / "model.tgz") == "second");
  CHECK(farm.look("a").state == JobState::done);
  CHECK_FALSE(farm.claim("a", 3, "w"));
  CHECK(farm.look("a").state == JobState::done);
  write(farm.attempt("a", 1) / "run/checkpoint", "large");
  farm.sweep("a");
  CHECK_FALSE(fs::exists(farm.attempt("a", 1) / "run"));
  CHECK_FALSE(fs::exists(farm.attempt("a", 1) / "result"));
}

TEST_CASE("results that are gone stop a farm before it does all again", "[farm]") {
  const tg::TemporaryFolder folder;
  const FarmFolder farm(folder / "farm", kJobs, "1", false);
  REQUIRE(farm.claim("a", 1, "w"));
  fs::create_directory(farm.attempt("a", 1) / "result");
  fs::rename(folder / "farm/results", folder / "kept");
  const std::string gone = (folder / "farm/results").string() + ": is gone, and with it what is done";
  CHECK_THAT(tg::test::messageOf([&] { farm.publish("a", 1); }, tg::ErrorKind::cannotWrite), Contains(gone));
  CHECK_THAT(tg::test::messageOf([&] { farm.claim("b", 1, "w"); }, tg::ErrorKind::cannotWrite), Contains(gone));
  CHECK_FALSE(fs::exists(farm.attempt("b", 1)));
  CHECK_THAT(tg::test::messageOf([&] { const FarmFolder status(folder / "farm"); }, tg::ErrorKind::cannotRead),
             Contains(gone));
  for (const bool join : {false, true}) {
    CHECK_THAT(tg::test::messageOf([&] { const FarmFolder worker(folder / "farm", kJobs, "1", join); },
                                   tg::ErrorKind::cannotWrite),
               Contains(gone));
  }
  fs::rename(folder / "kept", folder / "farm/results");
  CHECK(farm.publish("a", 1));
}

TEST_CASE("a worker is dead when nothing changes for whoever looks, however long that one slept", "[farm]") {
  tg::BeatWatch watch(10s, 2s);
  const tg::BeatWatch::Clock::time_point start{};
  tg::JobView view;
  view.attempts = 1;
  view.beat = "1";
  CHECK_FALSE(watch.isDead("a", view, start));
  CHECK_FALSE(watch.isDead("a", view, start + 1000s));  // it slept: counts 2 s
  for (int i = 1; i <= 3; ++i) CHECK_FALSE(watch.isDead("a", view, start + 1000s + i * 2s));
  view.beat = "2";
  CHECK_FALSE(watch.isDead("a", view, start + 1008s));
  for (int i = 1; i <= 4; ++i) CHECK_FALSE(watch.isDead("a", view, start + 1008s + i * 2s));
  CHECK_FALSE(watch.isDead("b", view, start + 1018s));  // seen for the first time
  CHECK(watch.isDead("a", view, start + 1018s));
  view.attempts = 2;  // somebody else has it now
  CHECK_FALSE(watch.isDead("a", view, start + 1020s));
}

TEST_CASE("a folder of other jobs, of another version, of other files or without a farm is refused", "[farm]") {
  const tg::TemporaryFolder folder;
  const auto join = [&](const std::vector<FarmJob>& jobs, const char* version, bool must_be, tg::ErrorKind kind) {
    return tg::test::messageOf([&] { const FarmFolder farm(folder / "farm", jobs, version, must_be); }, kind);
  };
  const std::string path = (folder / "farm").string();
  CHECK(join(kJobs, "1", true, tg::ErrorKind::cannotRead) ==
        path + ": holds no farm (expected the share to be there, and --prepare before --join)");
  CHECK_FALSE(fs::exists(folder / "farm"));
  CHECK(join(kJobs, "1", false, tg::ErrorKind::usage) == "accepted");
  CHECK(join(kJobs, "1", true, tg::ErrorKind::usage) == "accepted");
  CHECK(join(kJobs, "2", true, tg::ErrorKind::usage) ==
        path + "/farm.json: is of workers of another version (expected 1, found 2)");
  std::vector<FarmJob> other = kJobs;
  other[1].dataset = "e";
  CHECK_THAT(join(other, "1", false, tg::ErrorKind::usage),
             Contains("farm: is the folder of other jobs: job 2 differs (expected {\"name\":\"b\""));
  other.resize(1);
  CHECK_THAT(join({kJobs[0]}, "1", false, tg::ErrorKind::usage), Contains("found none)"));
  for (const char* text : {"", "{", "[]", "{\"format\": \"tgtrain-farm\", \"version\": 9, \"jobs\": []}",
                           "{\"format\": \"tgtrain-farm\", \"version\": 1, \"tgtrain\": \"1\", \"jobs\": [7]}"}) {
    write(folder / "farm/farm.json", text);
    CHECK_THAT(join(kJobs, "1", false, tg::ErrorKind::badData), Contains("farm.json"));
  }
  write(folder / "thesis/text.txt", "years of work");
  CHECK(tg::test::messageOf([&] { const FarmFolder farm(folder / "thesis", kJobs, "1", false); },
                            tg::ErrorKind::cannotWrite) ==
        (folder / "thesis").string() + ": holds other files (expected a farm's folder, or an empty one)");
}

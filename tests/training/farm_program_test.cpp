// SPDX-License-Identifier: Apache-2.0
// tgtrain farm: workers that are killed, stopped, too many, too late, and without room.
#include <unistd.h>

#include <fstream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/system/random.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/child.h"

namespace fs = std::filesystem;
using namespace tg::test;

namespace {

constexpr int kJobs = 6;
const std::string kWorker = "farm jobs.jsonl --heartbeat 0.05 --stale 0.4 --threads 1 --takeovers 1000 ";

// `every` [s] a checkpoint.
void writeJobs(const tg::TemporaryFolder& folder, const std::string& iterations, int count, const std::string& every) {
  std::ofstream jobs(folder / "jobs.jsonl");
  for (int i = 0; i < count; ++i) {
    jobs << "{\"name\": \"job" << i << "\", \"dataset\": \"scene\", \"flags\": [\"--iterations\", \"" << iterations
         << "\", \"--texture-iterations\", \"6\", \"--gaussians\", \"300\", \"--seed\", \"" << i
         << "\", \"--checkpoint-every\", \"" << every << "\"]}\n";
  }
}

std::vector<std::string> namesIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

}  // namespace

TEST_CASE("workers that are killed again and again leave every result once, with the bytes of one that is not",
          "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "14", kJobs, "0");
  const auto finish = [&](const std::string& out) {
    Child beside(folder, kWorker + "--out " + out);
    const Outcome outcome = tgtrain(folder, kWorker + "--out " + out);
    INFO(outcome.output);
    REQUIRE(outcome.code == 0);
    REQUIRE(beside.end() == 0);
  };
  const auto start = std::chrono::steady_clock::now();
  finish("calm");
  const auto calm = std::chrono::steady_clock::now() - start;

  std::map<std::string, fs::file_time_type> first_seen;
  const auto look = [&] {  // a result that is there never changes
    if (!fs::exists(folder / "wild/results")) return;
    for (const std::string& name : namesIn(folder / "wild/results")) {
      const fs::path result = folder / "wild/results" / name;
      CHECK(namesIn(result) == std::vector<std::string>{"job.json", "metrics.jsonl", "model.tgz"});
      CHECK(bytesOf(result / "model.tgz") == bytesOf(folder / "calm/results" / name / "model.tgz"));
      const fs::file_time_type written = fs::last_write_time(result / "model.tgz");
      CHECK(first_seen.try_emplace(name, written).first->second == written);
    }
  };
  tg::Random random(static_cast<std::uint64_t>(::getpid()));
  std::array<std::unique_ptr<Child>, 2> workers;
  int kills = 0;
  for (bool ended = false; kills < 10 && !ended; ++kills) {
    for (auto& worker : workers) {
      if (!worker) worker = std::make_unique<Child>(folder, kWorker + "--out wild");
    }
    std::this_thread::sleep_for(calm / 40 + random.below(20) * calm / 160);  // a sixth of it at most
    auto& victim = workers[random.below(2)];
    victim->send(SIGKILL);
    const int code = victim->end();
    ended = code == 0;  // all was done before
    if (!ended) CHECK(code == 128 + SIGKILL);
    victim.reset();
    look();
  }
  for (auto& worker : workers) worker.reset();
  finish("wild");
  CHECK(kills > 1);
  look();
  CHECK(first_seen.size() == kJobs);
  for (int i = 0; i < kJobs; ++i) {
    const std::string job = "job" + std::to_string(i);
    CHECK(bytesOf(folder / "wild/results" / job / "job.json") == bytesOf(folder / "calm/results" / job / "job.json"));
    for (const auto& attempt : fs::directory_iterator(folder / "wild/jobs" / job)) {
      CHECK_FALSE(fs::exists(attempt.path() / "run"));
    }
  }
  // Nothing is left to do, and nothing is done.
  const Outcome again = tgtrain(folder, kWorker + "--out wild --join");
  CHECK(again.code == 0);
  CHECK(again.output == "6 of 6 jobs done\n");
}

TEST_CASE("a worker that is asked to stop leaves its job with a checkpoint to the next, who need not wait", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "3000", 1, "60");
  const std::string command = "farm jobs.jsonl --out farm --threads 1";  // 60 s until somebody is dead
  {
    Child child(folder, command);
    child.until([&] { return contents(folder / "farm/jobs/job0/0001/run/metrics.jsonl").ends_with('\n'); });
    child.sendToChildren(SIGSTOP);  // lest it ends before it is asked to
    const Outcome taken = run(folder, "'" TG_TGTRAIN "' farm --status farm");
    CHECK_THAT(taken.output, Contains("0 of 1 done, 1 taken") && Contains("plain"));
    child.send(SIGTERM);
    child.sendToChildren(SIGCONT);
    CHECK(child.end() == 128 + SIGTERM);
  }
  CHECK_THAT(contents(folder / "farm/jobs/job0/0001/end.json"), Contains("released"));
  const Outcome next = tgtrain(folder, command);
  CHECK(next.code == 0);
  CHECK_THAT(next.output, Contains("job0: attempt 2, from a checkpoint") && Contains("job0: done"));
}

TEST_CASE("a training that alone is sent SIGTERM, again and again, is given up", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "6000", 1, "60");
  Child worker(folder, "farm jobs.jsonl --out farm --threads 1 --retries 1 --no-wait");
  worker.until([&] {
    worker.sendToChildren(SIGTERM);
    return worker.output().find("given up") != std::string::npos;
  });
  CHECK(worker.end() == 5);
  CHECK_THAT(worker.output(),
             Contains("job0: attempt 1 failed with exit code 143, tried again: the training alone was") &&
                 Contains("job0: attempt 2 failed with exit code 143; given up"));
}

TEST_CASE("jobs that cannot be trained are tried as often as asked, and named at the end", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "2", 1, "60");
  fs::copy(folder / "scene", folder / "photos", fs::copy_options::recursive);  // as a command is called
  std::ofstream(folder / "jobs.jsonl", std::ios::app)
      << "{\"name\": \"fails\", \"dataset\": \"scene\", \"flags\": [\"--start-model\", \"absent.ply\"]}\n"
      << "{\"name\": \"wrong\", \"dataset\": \"scene\", \"flags\": [\"--gausians\", \"3\"]}\n"
      << "{\"name\": \"command\", \"dataset\": \"photos\", \"flags\": [\"--iterations\", \"2\", "
         "\"--texture-iterations\", \"0\"]}\n"
      << "{\"name\": \"lacks\", \"dataset\": \"scene\", \"flags\": [\"--context\"]}\n"
      << "{\"name\": \"prints\", \"dataset\": \"scene\", \"flags\": [\"--print-config\"]}\n";
  const Outcome worker = tgtrain(folder, "farm jobs.jsonl --out farm --retries 1");
  INFO(worker.output);
  CHECK(worker.code == 2);
  CHECK_THAT(
      worker.output,
      Contains("fails: attempt 1 failed with exit code 2, tried again: absent.ply: ") &&
          Contains("fails: attempt 2 failed with exit code 2; given up: absent.ply: ") &&
          Contains("wrong: attempt 1 failed with exit code 1; given up: no such option") &&
          Contains("lacks: attempt 1 failed with exit code 1; given up: --context: expected a value, found none") &&
          Contains("prints: attempt 1 failed with exit code 1; given up: ended without a model") &&
          Contains("2 of 6 jobs done, 4 given up"));
  const Outcome status = tgtrain(folder, "farm --status farm --html farm.html");
  CHECK(status.code == 0);
  CHECK_THAT(status.output, Contains("2 of 6 done, 4 failed") && Contains("2, 2 failed"));
  CHECK_THAT(contents(folder / "farm.html"), Contains("<td>wrong</td><td>failed</td>"));
  const std::string at = nlohmann::json::parse(contents(folder / "farm/jobs/wrong/0001/end.json"))["worker"];
  CHECK(at.find(':') < at.size() - 1);  // HOST:PROCESS
  CHECK(nlohmann::json::parse(contents(folder / "farm/jobs/wrong/failed.json"))["worker"] == at);
  CHECK_THAT(status.output, Contains(at + ", exit code 1: no such option"));
  CHECK(tgtrain(folder, "farm --status farm --html farm.html").code == 4);
}

TEST_CASE("jobs whose data set is not on a machine are left to others", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, "split scene blocks --blocks 1x1 --gaussians 50 -q").code == 0);
  fs::create_directories(folder / "copied/block_0_0");
  fs::copy(folder / "blocks/block_0_0", folder / "copied/block_0_0");
  fs::create_directory(folder / "mount");
  std::ofstream(folder / "jobs.jsonl") << "{\"name\": \"a\", \"dataset\": \"nowhere\"}\n"
                                       << "{\"name\": \"b\", \"dataset\": \"mount\"}\n"
                                       << "{\"name\": \"c\", \"dataset\": \"copied/block_0_0\"}\n";
  fs::rename(folder / "scene", folder / "copied/scene");  // a block of it is as before
  std::ofstream(folder / "jobs.jsonl", std::ios::app)
      << "{\"name\": \"d\", \"dataset\": \"copied/scene\", \"flags\": [\"--iterations\", \"2\", "
         "\"--texture-iterations\", \"0\"]}\n";
  fs::create_directory(folder / "scene");  // of whose blocks one is elsewhere: not mounted
  std::ofstream(folder / "jobs.jsonl", std::ios::app) << "{\"name\": \"e\", \"dataset\": \"blocks/block_0_0\"}\n";
  const Outcome worker = tgtrain(folder, "farm jobs.jsonl --out farm");
  INFO(worker.output);
  CHECK(worker.code == 2);
  CHECK_THAT(worker.output,
             Contains("a: its data set nowhere is not on this machine; left to others") &&
                 Contains("b: its data set mount is not") && Contains("c: its data set copied/block_0_0 is not") &&
                 Contains("e: its data set blocks/block_0_0 is not") && Contains("1 of 5 jobs done, 4 left to others"));
  for (const char* name : {"a", "b", "c", "e"}) CHECK_FALSE(fs::exists(folder / "farm/jobs" / name));
  // Another is at one of them: there is no waiting for what cannot be done here.
  fs::create_directories(folder / "farm/jobs/a/0001");
  const Outcome beside = tgtrain(folder, "farm jobs.jsonl --out farm");
  CHECK(beside.code == 2);
  CHECK_THAT(beside.output, Contains("1 of 5 jobs done, 3 left to others, others are at 1"));
}

TEST_CASE("a data set that vanishes from a machine during a training leaves the job to others", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(
      tgtrain(folder, "make-sample scene --size 512 --views 4 --test-views 1 --points 200 --supersampling 1").code ==
      0);
  std::ofstream(folder / "jobs.jsonl")  // of four photographs one is in memory
      << R"({"name": "a", "dataset": "scene", "flags": ["--image-memory", "1", "--iterations", "1000000"]})";
  Child worker(folder, "farm jobs.jsonl --out farm --retries 0");
  worker.until([&] { return contents(folder / "farm/jobs/a/0001/run/metrics.jsonl").ends_with('\n'); });
  fs::rename(folder / "scene", folder / "gone");
  CHECK(worker.end() == 2);
  INFO(worker.output());
  CHECK_THAT(worker.output(), Contains("a: its data set is gone from this machine; open for others: ") &&
                                  Contains("0 of 1 jobs done, 1 left to others"));
  CHECK_THAT(contents(folder / "farm/jobs/a/0001/end.json"), Contains("released"));
}

TEST_CASE("what failed on a machine is left to others while they are at work", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string there = GENERATE("scene", "nowhere");  // data that this machine has, and has not
  std::ofstream(folder / "jobs.jsonl")
      << "{\"name\": \"job0\", \"dataset\": \"" + there + "\", \"flags\": [\"--iterations\", \"2\"]}\n"
      << "{\"name\": \"fails\", \"dataset\": \"scene\", \"flags\": [\"--start-model\", \"absent.ply\"]}\n";
  REQUIRE(tgtrain(folder, "farm jobs.jsonl --out farm --prepare").code == 0);
  const fs::path other = folder / "farm/jobs/job0/0001";
  fs::create_directories(other);
  std::ofstream(other / "worker.json") << R"({"worker": "elsewhere:1"})";
  const Outcome beside = tgtrain(folder, "farm jobs.jsonl --out farm --no-wait");
  INFO(beside.output);
  CHECK(beside.code == 0);
  CHECK_THAT(beside.output, Contains("fails: attempt 1 failed") && Contains("0 of 2 jobs done, 1 left to others"));
  CHECK_FALSE(fs::exists(folder / "farm/jobs/fails/0002"));
  std::ofstream(other / "end.json") << R"({"end": "released"})";
  const Outcome alone = tgtrain(folder, "farm jobs.jsonl --out farm --no-wait");
  INFO(alone.output);
  CHECK(alone.code == 2);
  CHECK_THAT(alone.output, Contains("fails: attempt 3 failed with exit code 2; given up") &&
                               Contains(there == "scene" ? "1 of 2 jobs done, 1 given up"
                                                         : "0 of 2 jobs done, 1 given up, 1 left to others"));
}

TEST_CASE("a job that another worker took over does not fail because its run is gone", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "6000", 1, "0.05");
  // As one that slept: it looks at the farm no sooner than its training fails, for want of a last checkpoint.
  Child worker(folder, "farm jobs.jsonl --heartbeat 60 --stale 180 --threads 1 --retries 0 --out farm");
  const fs::path job = folder / "farm/jobs/job0";
  worker.until([&] { return fs::exists(job / "0001/run/checkpoint"); });
  fs::create_directory(job / "0002");
  fs::rename(job / "0001/run", folder / "moved");
  worker.until([&] { return worker.output().find("another worker has taken over") != std::string::npos; });
  CHECK_FALSE(fs::exists(job / "failed.json"));
  worker.send(SIGTERM);
  worker.end();
}

TEST_CASE("a job that killed its workers is tried once more where failed.json is removed", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "6", 1, "60");
  const std::string worker = "farm jobs.jsonl --heartbeat 0.05 --stale 0.4 --threads 1 --takeovers 1 --out farm";
  REQUIRE(tgtrain(folder, worker + " --prepare").code == 0);
  const fs::path job = folder / "farm/jobs/job0";
  for (const char* attempt : {"0001", "0002"}) fs::create_directories(job / attempt);  // nobody ended them
  const Outcome given_up = tgtrain(folder, worker);
  CHECK(given_up.code != 0);
  CHECK_THAT(given_up.output, Contains("job0: given up: 2 workers died at it"));
  REQUIRE(fs::remove(job / "failed.json"));
  const Outcome again = tgtrain(folder, worker);
  INFO(again.output);
  CHECK(again.code == 0);
  CHECK(fs::exists(folder / "farm/results/job0"));
}

TEST_CASE("a farm's folder that is another's, gone or full is one line and the right code", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "1000000", 1, "60");
  const auto refused = [&](const std::string& arguments, int code, const std::string& words) {
    const Outcome outcome = tgtrain(folder, arguments);
    INFO(arguments << '\n' << outcome.output);
    CHECK(outcome.code == code);
    CHECK_THAT(outcome.output, Contains(words));
    CHECK(std::ranges::count(outcome.output, '\n') == 1);
  };
  refused("farm jobs.jsonl", 1, "expected JOBS.jsonl and --out FOLDER");
  refused("farm jobs.jsonl --out farm --status farm", 1, "--status stands alone");
  refused("farm jobs.jsonl --out farm --stale 1 --heartbeat 1", 1, "three heartbeats or more");
  refused("farm jobs.jsonl --out farm --join", 2, "farm: holds no farm");
  refused("farm absent.jsonl --out farm", 2, "absent.jsonl: cannot open");
  refused("farm jobs.jsonl --out absent/farm", 4, "absent/farm: cannot make this folder");
  refused("farm --status farm", 2, "farm/farm.json: cannot open");
  CHECK_FALSE(fs::exists(folder / "farm"));
  refused("farm jobs.jsonl --out farm --prepare", 0, "farm: 1 jobs");
  {
    Child child(folder, kWorker + "--out farm --join");
    child.until([&] { return fs::exists(folder / "farm/jobs/job0/0001/run/checkpoint"); });
    fs::rename(folder / "farm", folder / "lost");
    CHECK(child.end() == 4);
    CHECK_THAT(child.output(), Contains("tgtrain: " + (folder / "farm").string()) && Contains("cannot "));
  }
  fs::rename(folder / "lost", folder / "farm");
  writeJobs(folder, "2", 1, "60");
  refused("farm jobs.jsonl --out farm", 1, "farm: is the folder of other jobs: job 1 differs");
  fs::remove_all(folder / "farm");
  REQUIRE(tgtrain(folder, "farm jobs.jsonl --out farm --prepare").code == 0);
  nlohmann::json farm = nlohmann::json::parse(contents(folder / "farm/farm.json"));
  farm["tgtrain"] = "0.0.1";
  std::ofstream(folder / "farm/farm.json") << farm.dump();
  refused("farm jobs.jsonl --out farm", 1, "farm/farm.json: is of workers of another version (expected 0.0.1, found ");
}

TEST_CASE("the script for MPI does what a lost machine left", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "2", 1, "60");
  fs::create_directory(folder / "bin");
  const auto program = [&](const char* name, const std::string& line) {
    std::ofstream(folder / "bin" / name) << "#!/bin/sh\n" << line << '\n';
    fs::permissions(folder / "bin" / name, fs::perms::owner_all);
  };
  program("tgtrain", "echo \"$@\"; exec '" TG_TGTRAIN "' \"$@\" --heartbeat 0.05 --stale 0.4");
  const std::string script = "PATH=\"$PWD/bin:$PATH\" bash '" + fs::absolute("scripts/farm/mpi.sh").string() +
                             "' jobs.jsonl farm 2 --map-by node";
  program("mpirun", "mkdir -p farm/jobs/job0/0001; exit 137");
  const Outcome outcome = run(folder, script);
  INFO(outcome.output);
  CHECK(outcome.code == 0);
  CHECK_THAT(outcome.output, Contains("mpirun ended with exit code 137") &&
                                 Contains("farm jobs.jsonl --out farm --join --threads 2\n") &&
                                 Contains("1 of 1 jobs done"));
  program("mpirun", "echo not enough slots; exit 3");  // no worker: this machine is not for all of it
  CHECK(run(folder, script).code == 3);
  fs::remove_all(folder / "farm");
  program("mpirun", "exit 3");
  CHECK(run(folder, script).code == 3);
  CHECK(fs::is_empty(folder / "farm/results"));
  program("mpirun", "kill -INT $PPID; exit 1");
  CHECK(run(folder, script).code == 130);
  CHECK(fs::is_empty(folder / "farm/results"));
}

TEST_CASE("how a farm stands says which workers are dead", "[farm]") {
  const tg::TemporaryFolder folder;
  writeJobs(folder, "2", 2, "60");
  REQUIRE(tgtrain(folder, "farm jobs.jsonl --out farm --prepare").code == 0);
  for (const std::string job : {"job0", "job1"}) {
    fs::create_directories(folder / "farm/jobs" / job / "0001");
    std::ofstream(folder / "farm/jobs" / job / "0001/worker.json") << R"({"worker": "node:)" + job + R"("})";
    std::ofstream(folder / "farm/jobs" / job / "0001/beat") << "1\n";
  }
  fs::last_write_time(folder / "farm/jobs/job1/0001/beat", fs::file_time_type::clock::now() - std::chrono::hours(2));
  const std::string status = tgtrain(folder, "farm --status farm").output;
  CHECK_THAT(status, Contains("node:job0\n") && Contains("node:job1, no sign of life for 2 h") &&
                         Contains("0 of 2 done, 2 taken (1 by the dead)\n"));
  CHECK_THAT(tgtrain(folder, "farm --status farm --stale 9000").output, Contains("node:job1\n"));
}

TEST_CASE("a full disk ends a worker, and with room again the next goes on", "[farm]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  writeJobs(folder, "20", 1, "60");
  TG_SKIP_IF(missingMount(folder));
  const std::string mount = mountOf("96k");
  const Outcome outcome =
      run(folder, "TMPDIR=\"$PWD\" unshare -rm sh -c '" + mount +
                      " && \"" TG_TGTRAIN
                      "\" farm jobs.jsonl --out disk/farm; code=$?; cat disk/farm/jobs/job0/0001/end.json; "
                      "mount -o remount,size=32m disk && \"" TG_TGTRAIN
                      "\" farm jobs.jsonl --out disk/farm --stale 0.3 --heartbeat 0.1 && exit $code'");
  INFO(outcome.output);
  CHECK(outcome.code == 4);
  CHECK_THAT(outcome.output, Contains("No space left on device") && Contains("job0: done"));
}

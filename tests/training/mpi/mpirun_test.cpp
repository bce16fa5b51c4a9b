// SPDX-License-Identifier: Apache-2.0
// tgtrain as mpirun starts it: the same bytes, one line for what is wrong, and runs that go on with another number of
// processes. Needs Open MPI and the module of a build with MPI.
#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <string>

#include "support/catch.h"
#include "training/child.h"

namespace fs = std::filesystem;
using namespace tg::test;

namespace {

const std::string kTrain =
    "scene --reproducible -q --threads 1 --texture-iterations 20 --densify-every 5 "
    "--densify-from 4 --gaussians 600 ";

// Why there is none; "": there is.
std::string noMpi() {
  const fs::path module = fs::path(TG_TGTRAIN).parent_path().parent_path() / "lib/textured-gaussians/tg_mpi.so";
  if (!fs::exists(module)) return "built without MPI";
  return std::system("mpirun --version 2>/dev/null | grep -q 'Open MPI'") == 0 ? "" : "no mpirun of Open MPI";
}

// The first of its version's numbers. Later ones than 4 have no -q, and add a page of their own to a process's error.
int versionOfOpenMpi() {
  static const int version =
      WEXITSTATUS(std::system("exit $(mpirun --version | sed -n 's/.*(Open MPI) \\([0-9]*\\).*/\\1/p')"));
  return version;
}

// As root, on fewer cores than processes and without a network.
std::string mpirun(int processes) {
  return std::string("OMPI_ALLOW_RUN_AS_ROOT=1 OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_btl=^tcp mpirun ") +
         (versionOfOpenMpi() > 4 ? "" : "-q ") + "--oversubscribe -np " + std::to_string(processes) + " " + TG_TGTRAIN +
         " ";
}

std::ptrdiff_t linesIn(const std::string& text) { return std::ranges::count(text, '\n'); }

// Those of tgtrain.
std::ptrdiff_t linesSaid(const std::string& text) {
  std::ptrdiff_t lines = 0;
  std::istringstream stream(text);
  for (std::string line; std::getline(stream, line);) lines += line.starts_with("tgtrain: ") ? 1 : 0;
  return lines;
}

// Until the run has its checkpoint, or mpirun, in $p, is gone.
const std::string kUntilCheckpoint = "while [ ! -e run/checkpoint ] && kill -0 $p; do sleep 0.02; done; ";

}  // namespace

TEST_CASE("processes that mpirun started train one model, with the bytes that one process gives it") {
  TG_SKIP_IF(noMpi());
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, "make-sample scene --size 96 --views 4 --test-views 2 --points 200 --supersampling 1").code ==
          0);
  REQUIRE(tgtrain(folder, kTrain + "--iterations 40 -o alone.tgz").code == 0);
  for (const int processes : {2, 3}) {
    const Outcome outcome = run(folder, mpirun(processes) + kTrain + "--iterations 40 --overwrite -o together.tgz");
    INFO(outcome.output);
    REQUIRE(outcome.code == 0);
    CHECK(outcome.output.empty());
    CHECK(bytesOf(folder / "together.tgz") == bytesOf(folder / "alone.tgz"));
  }
}

TEST_CASE("a run of two processes that is stopped goes on with three, and with one, to the same bytes") {
  TG_SKIP_IF(noMpi());
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string settings = kTrain + "--iterations 300 ";
  REQUIRE(tgtrain(folder, settings + "-o alone.tgz").code == 0);
  const std::string command = settings + "-o model.tgz --run run --resume --checkpoint-every 0.1";
  // All get the signal, which mpirun passes on, and end in their own time, after their last common step.
  const std::string stopped = kUntilCheckpoint + "kill -USR1 $p; wait $p";
  const Outcome first = run(folder, mpirun(2) + command + " & p=$!; " + stopped);
  INFO(first.output);
  CHECK(first.code == 128 + SIGUSR1);
  // Killed soon after.
  const Outcome second = run(folder, mpirun(3) + command + " & p=$!; sleep 1; kill -TERM $p; wait $p");
  CHECK(fs::exists(folder / "run/checkpoint"));
  REQUIRE(tgtrain(folder, command).code == 0);
  CHECK(bytesOf(folder / "model.tgz") == bytesOf(folder / "alone.tgz"));
}

TEST_CASE("what is wrong with a training over several processes is said in one line, with its code") {
  TG_SKIP_IF(noMpi());
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const auto check = [&](const std::string& arguments, int code, const std::string& text) {
    const Outcome outcome = run(folder, mpirun(2) + arguments);
    INFO(arguments << "\n" << outcome.output);
    CHECK(outcome.code == code);
    CHECK(linesSaid(outcome.output) == 1);
    CHECK_THAT(outcome.output, Contains(text));
  };
  check("missing -o model.tgz", 2, "tgtrain: missing: no such folder");
  check("scene -o model.tgz --iteratoins 5", 1, "did you mean --iterations?");
  check("scene -o model.tgz --device cuda", 1, "--device cuda is for one process");
  check("photos scene -o model.tgz", 1, "photos: expected one process");
  if (versionOfOpenMpi() < 5)  // 5.0.7 dies of every ":"
    check("scene -o model.tgz : -np 1 " TG_TGTRAIN " scene -o other.tgz", 1, "process 2: has another command line");
  check("scene -q --iterations 3 --densification none --texture-iterations 0 -o nowhere/model.tgz", 4, "nowhere");
  CHECK(!fs::exists(folder / "model.tgz"));
}

TEST_CASE("a photograph that a process cannot read any more ends all of them with its line and code") {
  TG_SKIP_IF(noMpi());
  const tg::TemporaryFolder folder;
  REQUIRE(
      tgtrain(folder, "make-sample scene --size 256 --views 12 --test-views 0 --points 100 --supersampling 1").code ==
      0);
  const std::string command =
      mpirun(2) + "scene -q --threads 1 --iterations 100000 --densification none --image-memory 1 --run run & p=$!; ";
  const Outcome outcome = run(folder, command + kUntilCheckpoint + "rm scene/train/*; wait $p");
  INFO(outcome.output);
  CHECK(outcome.code == 2);
  CHECK_THAT(outcome.output, Contains("cannot open: No such file or directory"));
  CHECK(fs::exists(folder / "run/checkpoint"));
}

TEST_CASE("workers of a farm that mpirun has started train alone, each its jobs") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string job =
      R"({"name": "a", "dataset": "scene", "flags": ["--iterations", "3", "--texture-mode", "none"]})";
  const Outcome outcome =
      run(folder, "echo '" + job + "' > jobs.jsonl && OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=0 " + TG_TGTRAIN +
                      " farm jobs.jsonl --out farm");
  INFO(outcome.output);
  CHECK(outcome.code == 0);
  CHECK(fs::exists(folder / "farm/results/a/model.tgz"));
}

TEST_CASE("a program without the module says so where mpirun has started it several times, the first of them alone") {
  const tg::TemporaryFolder folder;
  fs::create_directory(folder / "bin");
  fs::copy_file(TG_TGTRAIN, folder / "bin/tgtrain");
  const std::string as = "OMPI_COMM_WORLD_SIZE=2 OMPI_COMM_WORLD_RANK=";
  const Outcome first = run(folder, as + "0 bin/tgtrain scene -o model.tgz");
  CHECK(first.code == 1);
  CHECK_THAT(first.output, Contains("a build with MPI"));
  CHECK(linesIn(first.output) == 1);
  // Of another process only where nobody has ended it a while after the first.
  const Outcome ended = run(folder, as + "1 timeout 0.5 bin/tgtrain scene -o model.tgz");
  CHECK(ended.code == 124);
  CHECK(ended.output.empty());
  const Outcome second = run(folder, as + "1 bin/tgtrain scene -o model.tgz");
  CHECK(second.code == 1);
  CHECK_THAT(second.output, Contains("a build with MPI"));
}

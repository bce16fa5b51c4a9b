// SPDX-License-Identifier: Apache-2.0
// tgtrain --run: stopped, killed and broken in every way, a run goes on to the same bytes or says why it cannot.
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>

#include "core/bundle/bundle.h"
#include "core/file/file.h"
#include "core/image/drawn.h"
#include "core/image/image.h"
#include "core/system/random.h"
#include "support/catch.h"
#include "support/temporary_folder.h"
#include "training/child.h"
#include "training/run/checkpoint.h"

namespace fs = std::filesystem;
using namespace tg::test;

namespace {

const std::string kRun = kBase + "--iterations 40 --metrics-every 1 ";
const std::string kForever = "scene --iterations 1000000 --densification none --threads 1 ";

}  // namespace

TEST_CASE("a run that is killed again and again ends in the bytes of one that is not", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string often = kRun + "--resume --checkpoint-every 0 ";
  REQUIRE(tgtrain(folder, kBase + "--iterations 40 -o whole.tgz --untextured-output plain.tgz").code == 0);
  const auto start = std::chrono::steady_clock::now();
  REQUIRE(tgtrain(folder, often + "-o calm.tgz --untextured-output calm_plain.tgz --run calm").code == 0);
  const auto calm = std::chrono::steady_clock::now() - start;
  const std::string command = often + "-o model.tgz --untextured-output twin.tgz --run run";
  tg::Random random(static_cast<std::uint64_t>(::getpid()));
  int kills = 0;
  for (; kills < 12; ++kills) {
    Child child(folder, command);
    std::this_thread::sleep_for(calm / 20 + random.below(20) * calm / 100);  // a quarter of it at most
    child.send(SIGKILL);
    const int code = child.end();
    if (code == 0) break;  // all was done before
    CHECK(code == 128 + SIGKILL);
    // Whatever was going on, what is there is whole.
    if (fs::exists(folder / "run/checkpoint")) CHECK_NOTHROW(tg::readCheckpoint(folder / "run/checkpoint"));
    if (fs::exists(folder / "run/model.tgz")) CHECK_NOTHROW(tg::readBundle(folder / "run/model.tgz"));
  }
  const Outcome last = tgtrain(folder, command);
  INFO(last.output << kills << " kills");
  REQUIRE(last.code == 0);
  CHECK(kills > 1);
  CHECK(bytesOf(folder / "model.tgz") == bytesOf(folder / "whole.tgz"));
  CHECK(bytesOf(folder / "run/model.tgz") == bytesOf(folder / "whole.tgz"));
  CHECK(bytesOf(folder / "twin.tgz") == bytesOf(folder / "plain.tgz"));

  // Every iteration once, and the score of each stage once.
  std::set<std::string> keys;
  int scores = 0;
  for (const nlohmann::json& line : linesOf(folder / "run/metrics.jsonl")) {
    const bool score = !line["test_psnr"].is_null();
    scores += score;
    CHECK(keys.insert(line["stage"].dump() + line["iteration"].dump() + (score ? "score" : "")).second);
  }
  CHECK(keys.size() == 40 + 20 + 20 + 3);
  CHECK(scores == 3);
  for (const auto& entry : fs::directory_iterator(folder / "run")) {
    const std::string name = entry.path().filename().string();
    CHECK((name == "checkpoint" || name == "model.tgz" || name == "metrics.jsonl" || name == "outputs.json"));
  }
}

TEST_CASE("Ctrl-C or SIGUSR1 leaves a checkpoint and a model, says how to go on, to the same bytes", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string settings = kBase + "--iterations 1000 ";
  const int signal = GENERATE(SIGINT, SIGUSR1);
  REQUIRE(tgtrain(folder, settings + "-o whole.tgz").code == 0);
  {
    Child child(folder, settings + "-o model.tgz --run run");
    child.until([&] { return fs::exists(folder / "run/model.tgz"); });
    child.send(signal);
    CHECK(child.end() == 128 + signal);
    CHECK_THAT(child.output(), Contains("interrupted; wrote model.tgz") && Contains("--resume goes on from"));
  }
  const tg::Checkpoint checkpoint = tg::readCheckpoint(folder / "run/checkpoint");
  CHECK(checkpoint.state.iteration >= 1);
  CHECK(checkpoint.header.seconds > 0);
  const tg::Bundle stopped = tg::readBundle(folder / "model.tgz");
  const nlohmann::json json = nlohmann::json::parse(stopped.training_json);
  CHECK(json["interrupted"] == true);
  CHECK(json["stages"]["plain"]["iterations"] == checkpoint.state.iteration);
  CHECK(bytesOf(folder / "run/model.tgz") == bytesOf(folder / "model.tgz"));
  CHECK_THAT(tg::test::run(folder, "'" TG_TGEVAL "' model.tgz scene").output,
             Contains("model.tgz: its training was interrupted"));

  // The same command again is refused; with --resume it goes on, and may replace what it wrote itself.
  const Outcome again = tgtrain(folder, settings + "-o other.tgz --run run");
  CHECK(again.code == 4);
  CHECK_THAT(again.output, Contains("run: exists already (add --resume to go on with it, or --overwrite"));
  const Outcome resumed = tgtrain(folder, settings + "-o model.tgz --run run --resume");
  INFO(resumed.output);
  REQUIRE(resumed.code == 0);
  CHECK(bytesOf(folder / "model.tgz") == bytesOf(folder / "whole.tgz"));
  CHECK(tg::readCheckpoint(folder / "run/checkpoint").header.seconds > checkpoint.header.seconds);

  // A finished run has nothing left to do, and says the same again.
  REQUIRE(tgtrain(folder, settings + "-o late.tgz --run run --resume").code == 0);
  CHECK(bytesOf(folder / "late.tgz") == bytesOf(folder / "whole.tgz"));
}

TEST_CASE("a second signal ends the program at once, with nothing half written", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child child(folder, kForever + "--run run --checkpoint-every 0");
  child.until([&] { return fs::exists(folder / "run/model.tgz"); });
  child.send(SIGINT);
  child.send(SIGTERM);  // another one: two of the same that wait count once
  const int code = child.end();
  CHECK((code == 128 + SIGTERM || code == 128 + SIGINT));
  CHECK_NOTHROW(tg::readCheckpoint(folder / "run/checkpoint"));
  CHECK_NOTHROW(tg::readBundle(folder / "run/model.tgz"));
  for (const auto& entry : fs::directory_iterator(folder / "run")) {
    CHECK(entry.path().filename().string().front() != '.');
  }
}

TEST_CASE("what does not fit a run folder is refused by name", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, kRun + "--run run -q").code == 0);
  const Bytes checkpoint = bytesOf(folder / "run/checkpoint");
  const auto refused = [&](const std::string& arguments, int code, const std::string& message) {
    const Outcome outcome = tgtrain(folder, arguments);
    INFO(arguments << '\n' << outcome.output);
    CHECK(outcome.code == code);
    CHECK_THAT(outcome.output, Contains(message));
    CHECK(bytesOf(folder / "run/checkpoint") == checkpoint);
  };
  refused(kRun + "--run run --resume --seed 2", 1,
          "run/checkpoint: is of a run with other settings: --seed (expected 1, found 2)");
  refused(kRun + "--run run --resume --downscale 2", 1, "other data: image-size (expected 32x32, found 16x16)");
  refused(kRun + "--run run --resume --background black", 1, "other data: background (expected 1,1,1, found 0,0,0)");
  refused(kRun + "--run run --resume --normalize", 1, "other data: ");
  refused(kRun + "--run new --normalize --context run/model.tgz", 1, "(expected no --normalize)");
  refused("undistort scene straight --normalize", 1, "--normalize");
  refused("split scene blocks --blocks 2x1 --normalize", 1, "--normalize");
  refused(kBase + "-o x.tgz --resume", 1, "--resume expects a run folder");
  refused(kRun + "--run new --watch", 5, "--watch: no");
  refused(kRun + "--run scene", 4, "scene: exists already");
  refused(kRun + "--run scene --resume", 4, "scene: holds files but no checkpoint to resume");
  refused(kRun + "--run log.txt", 4, "log.txt: cannot make this folder");
  CHECK_FALSE(fs::exists(folder / "new"));

  for (const std::size_t size : {std::size_t{0}, std::size_t{100}, checkpoint.size() / 2, checkpoint.size() - 1}) {
    fs::resize_file(folder / "run/checkpoint", size);
    const Outcome cut = tgtrain(folder, kRun + "--run run --resume");
    CHECK(cut.code == 3);
    CHECK_THAT(cut.output, Contains("run/checkpoint: "));
    tg::writeFileAtomically(folder / "run/checkpoint", checkpoint);
  }

  // Anew: without a checkpoint, and over an old run.
  const Outcome fresh = tgtrain(folder, kRun + "--run fresh --resume");
  CHECK(fresh.code == 0);
  CHECK_THAT(fresh.output, Contains("fresh: no checkpoint yet: training starts anew"));
  CHECK_THAT(tgtrain(folder, kRun + "--run \x1bnew --resume").output, Contains("?new: no checkpoint yet"));
  // So too after a kill before the first checkpoint; what it left is gone.
  fs::create_directory(folder / "early");
  std::ofstream(folder / "early/metrics.jsonl") << "{\"stage\":\"plain\",\"iteration\":1}\n";
  std::ofstream(folder / "early/.tg-123-0") << "half a checkpoint";
  CHECK(tgtrain(folder, kRun + "--run early").code == 4);
  REQUIRE(tgtrain(folder, kRun + "--run early --resume -q").code == 0);
  CHECK(bytesOf(folder / "early/model.tgz") == bytesOf(folder / "fresh/model.tgz"));
  CHECK(linesOf(folder / "early/metrics.jsonl").size() == linesOf(folder / "fresh/metrics.jsonl").size());
  CHECK_FALSE(fs::exists(folder / "early/.tg-123-0"));
  REQUIRE(tgtrain(folder, kRun + "--run run --overwrite --seed 2 -q").code == 0);
  CHECK(bytesOf(folder / "run/model.tgz") != bytesOf(folder / "fresh/model.tgz"));
  CHECK(linesOf(folder / "run/metrics.jsonl").size() == linesOf(folder / "fresh/metrics.jsonl").size());
}

TEST_CASE("a run that was trained for a file goes on for that one alone", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string train = "scene --iterations 20 --texture-mode none --gaussians 100 --run run --resume -q ";
  REQUIRE(tgtrain(folder, train + "-o a.sog --steps 4").code == 0);
  const Outcome other = tgtrain(folder, train + "-o b.sog --steps 8");
  CHECK(other.code == 1);
  CHECK_THAT(other.output, Contains("run/checkpoint: is of a run with other settings: --steps (expected 4, found 8)"));
  CHECK_THAT(tgtrain(folder, train + "-o b.glb --steps 4").output, Contains("--output (expected .sog, found .glb)"));
  CHECK(tgtrain(folder, train + "-o b.sog --steps 4").code == 0);
  // A size decides the count, which nobody named.
  const std::string sized = "scene --iterations 20 --texture-mode none --run sized --resume -q -o c.sog --target-size ";
  REQUIRE(tgtrain(folder, sized + "9KB").code == 0);
  CHECK_THAT(tgtrain(folder, sized + "12KB").output, Contains("--target-size (expected 9000, found 12000)"));
  CHECK_THAT(tgtrain(folder, "scene --iterations 20 --texture-mode none --run sized --resume -q").output,
             Contains("--target-size (expected 9000, found none)"));
  CHECK(bytesOf(folder / "a.sog") == bytesOf(folder / "b.sog"));
}

TEST_CASE("a run goes on to write what it wrote, by a name that is no UTF-8, too", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string settings = kBase + "--iterations 2 --run run -o ";
  const std::string own = "own\xff.tgz", other = "own\xfe.tgz";
  REQUIRE(tgtrain(folder, settings + own).code == 0);
  const nlohmann::json listed = nlohmann::json::parse(contents(folder / "run/outputs.json"));
  CHECK(listed["outputs"].at(0).size() == ("../" + own).size());
  fs::copy(folder / own, folder / other);
  const Outcome again = tgtrain(folder, settings + own + " --resume");
  INFO(again.output);
  CHECK(again.code == 0);
  CHECK_THAT(tgtrain(folder, settings + other + " --resume").output, Contains("exists already"));
}

TEST_CASE("a run folder belongs to one process at a time", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child first(folder, kForever + "--run run");
  first.until([&] { return fs::exists(folder / "run/model.tgz"); });
  const Outcome second = tgtrain(folder, kForever + "--run run --resume");
  CHECK(second.code == 4);
  CHECK_THAT(second.output, Contains("run: another tgtrain is at work in this folder"));
}

TEST_CASE("training outlives a checkpoint that cannot be written, but does not end well without one", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child child(folder, kForever + "--run run --checkpoint-every 0.05");
  child.until([&] { return fs::exists(folder / "run/model.tgz"); });
  // Between two writes, so that no rename comes between.
  while (fs::is_regular_file(folder / "run/checkpoint")) {
    std::error_code ignored;
    fs::remove(folder / "run/checkpoint", ignored);
    fs::create_directory(folder / "run/checkpoint", ignored);
  }
  const std::string goes_on = "(training goes on; the last checkpoint is of plain ";
  child.until([&] { return child.output().find(goes_on) != std::string::npos; });
  std::this_thread::sleep_for(std::chrono::milliseconds(500));  // in which it is tried again, and not told again
  CHECK(child.running());
  child.send(SIGHUP);
  CHECK(child.end() == 4);
  const std::string said = child.output();
  CHECK(said.find(goes_on) == said.rfind(goes_on));
  CHECK_THAT(said, Contains("run/checkpoint: exists and is not a regular file; the last checkpoint is of plain ") &&
                       Contains("the same command with --resume goes on (the model is kept as run/model-2.tgz)"));
  CHECK(tg::readBundle(folder / "run/model-2.tgz").model.size() > 0);
}

TEST_CASE("a preview that cannot be written keeps no checkpoint back", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child child(folder, kForever + "--run run --checkpoint-every 0.05 --preview-every 1");
  child.until([&] { return fs::exists(folder / "run/model.tgz"); });  // the first one is there, or it ends
  while (fs::is_directory(folder / "run/previews")) {
    std::error_code ignored;
    fs::remove_all(folder / "run/previews", ignored);
    std::ofstream(folder / "run/previews") << "a file";
  }
  child.until([&] { return child.output().find("(training goes on)") != std::string::npos; });
  fs::remove(folder / "run/checkpoint");
  child.until([&] { return fs::exists(folder / "run/checkpoint"); });
  child.send(SIGHUP);
  CHECK(child.end() == 128 + SIGHUP);
}

TEST_CASE("training outlives who reads what it says", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  run(folder, std::string(TG_TGTRAIN) + " " + kBase + "--iterations 300 -o piped.tgz 2>&1 | :");
  CHECK(fs::exists(folder / "piped.tgz"));
}

TEST_CASE("metrics and previews come as often as asked", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  REQUIRE(tgtrain(folder, kBase + "--iterations 40 --run run --metrics-every 15 --eval-every 10 --preview-every 16 -q")
              .code == 0);
  std::vector<std::string> found;
  for (const nlohmann::json& line : linesOf(folder / "run/metrics.jsonl")) {
    if (line["stage"] != "plain") continue;
    CHECK(line.size() == 14);
    found.push_back(line["iteration"].dump() + (line["seconds_left"].is_number() ? "" : " without time left") +
                    (line["test_ssim"].is_null() ? "" : " test"));
    CHECK(line["gaussians"].get<int>() > 0);
    CHECK(line["seconds"].get<double>() >= 0);
  }
  CHECK(found == std::vector<std::string>{"10 test", "15", "20 test", "30 test", "40", "40 test"});
  const tg::Image preview = tg::readImage(folder / "run/previews/plain_0000016.png");
  CHECK(preview.width == 64);
  CHECK(preview.height == 32);
  CHECK(tg::isDrawn(tg::readFile(folder / "run/previews/plain_0000016.png", 1 << 20)));
  CHECK(fs::exists(folder / "run/previews/textured_0000016.png"));
  CHECK_FALSE(fs::exists(folder / "run/previews/textured_0000032.png"));
  const tg::Image truth = tg::readImage(folder / "scene/test/r_0.png");
  const float white[3] = {1, 1, 1};
  const tg::Image expected = tg::compositeOver(truth, white);
  double worst = 0;
  for (int y = 0; y < 32; ++y) {
    for (int x = 0; x < 32; ++x) {
      worst = std::max(worst, std::abs(double{preview.at(x, y, 1)} - expected.at(x, y, 1)));
    }
  }
  CHECK(worst < 1.5 / 255);
}

TEST_CASE("a model that came while another was trained stays, and the other is kept beside it", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const auto meanwhile = [&](const std::string& arguments, const std::string& name) {
    fs::remove(folder / name);
    Child child(folder, kBase + "--iterations 500 " + arguments);
    child.until([&] { return child.output().find("train and 2 test views") != std::string::npos; });
    child.send(SIGSTOP);  // lest it ends before there is a file
    std::ofstream(folder / name) << "somebody's";
    child.send(SIGCONT);
    const int code = child.end();
    INFO(child.output());
    CHECK(code == 4);
    CHECK(contents(folder / name) == "somebody's");
    return child.output();
  };
  const std::string came = ": came while the model was trained, which is kept as ";
  CHECK_THAT(meanwhile("-o twin.tgz", "twin.tgz"), Contains("tgtrain: twin.tgz" + came + "twin-2.tgz (--overwrite"));
  CHECK_THAT(meanwhile("-o twin.tgz", "twin.tgz"), Contains(came + "twin-3.tgz"));
  CHECK_THAT(meanwhile("-o twin.ply", "twin.ply"), Contains(came + "twin.ply.tgz"));
  CHECK_THAT(meanwhile("-o run.tgz --run run", "run.tgz"), Contains("run.tgz" + came + "run/model.tgz"));
  CHECK_THAT(meanwhile("-o a.tgz --json a.json", "a.json"), Contains("a.json: exists already"));
  const Bytes model = bytesOf(folder / "twin-2.tgz");
  for (const std::string kept : {"twin-3.tgz", "twin.ply.tgz", "run/model.tgz", "a.tgz"}) {
    CHECK(bytesOf(folder / kept) == model);
  }
  // Whoever asks for it replaces, and a run its own.
  const std::string again = kBase + "--iterations 500 --run run --resume -o ";
  const Outcome refused = tgtrain(folder, again + "run.tgz");
  CHECK(refused.code == 4);
  CHECK_THAT(refused.output, Contains("run.tgz: exists already (add --overwrite to replace it)"));
  CHECK(contents(folder / "run.tgz") == "somebody's");
  CHECK(tgtrain(folder, again + "run.tgz --overwrite").code == 0);
  CHECK(bytesOf(folder / "run.tgz") == model);
  for (int time = 0; time < 2; ++time) {
    CHECK(tgtrain(folder, again + "own.tgz --json own.json").code == 0);
    CHECK(bytesOf(folder / "own.tgz") == model);
  }
  CHECK_THAT(tgtrain(folder, again + "run/../run/model.tgz").output, Contains("is written in any case"));
  CHECK(tgtrain(folder, kBase + "--iterations 500 --run other -o other/model.tgz").code == 1);
  // Both may be moved together.
  fs::create_directory(folder / "elsewhere");
  fs::rename(folder / "run", folder / "elsewhere/run");
  fs::rename(folder / "own.tgz", folder / "elsewhere/own.tgz");
  CHECK(tgtrain(folder, kBase + "--iterations 500 --run elsewhere/run --resume -o elsewhere/own.tgz").code == 0);
  CHECK(bytesOf(folder / "elsewhere/own.tgz") == model);
}

TEST_CASE("a run replaces what it wrote itself but not what was edited since", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string command = kRun + "--run run --resume -q -o model.tgz";
  REQUIRE(tgtrain(folder, command).code == 0);
  const Bytes model = bytesOf(folder / "model.tgz");
  const std::string outputs = contents(folder / "run/outputs.json");
  std::ofstream(folder / "model.tgz") << "edited";
  for (int time = 0; time < 2; ++time) {
    const Outcome refused = tgtrain(folder, command);
    CHECK(refused.code == 4);
    CHECK(refused.output ==
          "tgtrain: model.tgz: has changed since this run wrote it (add --overwrite to replace it, or name another "
          "output)\n");
    CHECK(contents(folder / "model.tgz") == "edited");
  }
  CHECK(tgtrain(folder, command + " --overwrite").code == 0);
  CHECK(bytesOf(folder / "model.tgz") == model);
  CHECK(contents(folder / "run/outputs.json") == outputs);
  // One that was killed while it wrote has no sum, as those have that older programs wrote: it is found again.
  for (const std::string sums : {"", ",\"sha256\":[\"\"]"}) {
    std::ofstream(folder / "run/outputs.json") << "{\"outputs\":[\"../model.tgz\"]" << sums << "}";
    std::ofstream(folder / "model.tgz") << "half a model";
    CHECK(tgtrain(folder, command).code == 0);
    CHECK(bytesOf(folder / "model.tgz") == model);
    CHECK(contents(folder / "run/outputs.json") == outputs);
  }
  fs::remove(folder / "model.tgz");
  CHECK(tgtrain(folder, command).code == 0);
  CHECK(bytesOf(folder / "model.tgz") == model);
}

TEST_CASE("what tgtrain says reaches a file or a pipe while it trains", "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  Child child(folder, kForever + "--run run --resume");
  const std::string anew = "run: no checkpoint yet: training starts anew\n";
  child.until([&] { return child.output().find(anew) != std::string::npos; });
  child.send(SIGINT);
  CHECK(child.end() == 128 + SIGINT);
}

TEST_CASE("a training that is stopped with more Gaussians than its size has room for keeps the model and goes on",
          "[resume]") {
  const tg::TemporaryFolder folder;
  REQUIRE(tgtrain(folder, kSample).code == 0);
  const std::string sized =
      "scene -o scene.sog --target-size 6KB --start random --init-count 5000 --iterations 1000000";
  const auto stopped = [&](const std::string& run) {
    Child child(folder, sized + run);
    child.until([&] { return child.output().find("plain 1/") != std::string::npos; });
    child.send(SIGINT);
    CHECK(child.end() == 128 + SIGINT);
    CHECK_THAT(child.output(), Contains("scene.sog: --target-size is out of reach") &&
                                   Contains("interrupted; scene.sog is not written"));
    CHECK_FALSE(fs::exists(folder / "scene.sog"));
    return child.output();
  };
  CHECK_THAT(stopped(""), Contains("(the model is kept as scene.sog.tgz)"));
  CHECK(tg::readBundle(folder / "scene.sog.tgz").model.size() == 5000);
  CHECK_THAT(stopped(" --run run"), Contains("the same command with --resume goes on from"));
}

// SPDX-License-Identifier: Apache-2.0
// What a run says of itself, and what it is told: lines, curves, status, orders, the lock of watchers.
#include <fcntl.h>
#include <unistd.h>

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/run/curves.h"
#include "core/run/live.h"
#include "core/run/metrics.h"
#include "support/catch.h"
#include "support/temporary_folder.h"

using namespace tg;

namespace {

RunMetrics lineOf(const std::string& stage, int iteration) {
  RunMetrics line;
  line.stage = stage;
  line.iteration = iteration;
  line.iterations = 700;
  line.loss = 0.25;
  line.train_psnr = 20 + iteration * 0.01;
  line.gaussians = 1000;
  line.seconds = iteration * 0.5;
  return line;
}

void append(const std::filesystem::path& path, const std::string& text) {
  std::ofstream(path, std::ios::app | std::ios::binary) << text;
}

}  // namespace

TEST_CASE("every line of the metrics has the same members in the same order, null where nothing is known", "[run]") {
  RunMetrics line = lineOf("plain", 30);
  line.loss = 0.12345678;
  CHECK(formatMetrics(line) ==
        R"({"format":"tgtrain-metrics","version":1,"stage":"plain","iteration":30,"iterations":700,"loss":0.123457,)"
        R"("train_psnr":20.3,"gaussians":1000,"per_second":null,"seconds":15.0,"seconds_left":null,"test_psnr":null,)"
        R"("test_ssim":null,"test_views":null})"
        "\n");
  line.test_psnr = 30.5512345;
  line.test_ssim = 0.9;
  line.test_views = 12;
  line.per_second = std::numeric_limits<double>::infinity();
  const std::optional<RunMetrics> read = parseMetrics(formatMetrics(line));
  REQUIRE(read);
  CHECK(read->stage == "plain");
  CHECK(read->iteration == 30);
  CHECK(read->iterations == 700);
  CHECK(read->test_psnr == 30.5512);
  CHECK(read->test_views == 12u);
  CHECK_FALSE(read->per_second);
}

TEST_CASE("lines of older runs are read, strange ones are not", "[run]") {
  const std::optional<RunMetrics> old =
      parseMetrics(R"({"stage":"plain","iteration":7,"gaussians":5,"test_psnr":30.5,"seconds":1.5})");
  REQUIRE(old);
  CHECK(old->iterations == 0);
  CHECK_FALSE(old->loss);
  CHECK(old->seconds == 1.5);
  for (const char* strange : {"", "{", "[]", "{}", R"({"stage":3})", "null",
                              R"({"stage":"a name that is far too long to be one of a stage"})"}) {
    INFO(strange);
    CHECK_FALSE(parseMetrics(strange));
  }
  const std::optional<RunMetrics> wild = parseMetrics(R"({"stage":"plain","iteration":-7,"gaussians":1e300})");
  REQUIRE(wild);
  CHECK(wild->iteration == 0);
  CHECK(wild->gaussians == 0);
}

TEST_CASE("curves span what was measured but for the worst hundredth, axes a little more", "[run]") {
  std::vector<double> losses(1000, 0.02);
  losses[0] = 5;
  losses[500] = 0.01;
  const auto range = rangeOfCurves(losses, std::vector<double>{0.03});
  REQUIRE(range);
  CHECK(*range == std::pair(0.02, 0.03));
  CHECK(withRoom({20, 30}) == std::pair(19.5, 30.5));
  CHECK(withRoom({30, 30}) == std::pair(27.0, 33.0));
  CHECK_FALSE(rangeOfCurves({}, {}));
}

TEST_CASE("curves grow with their file, and begin anew where it was cut or replaced", "[run]") {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder / "metrics.jsonl";
  MetricsFile file(path);
  CHECK_FALSE(file.update());
  append(path, formatMetrics(lineOf("plain", 10)));
  CHECK(file.update());
  CHECK_FALSE(file.update());
  const std::string second = formatMetrics(lineOf("plain", 20));
  append(path, second.substr(0, 40));  // a writer at work
  CHECK_FALSE(file.update());
  append(path,
         second.substr(40) + "no line\n" + std::string(10'000, 'x') + "\n" + formatMetrics(lineOf("textured", 10)));
  CHECK(file.update());
  REQUIRE(file.lines().size() == 3);
  CHECK(iterationsOfRun(file.lines()) == std::vector<double>{10, 20, 30});

  std::filesystem::resize_file(path, second.size());
  CHECK(file.update());
  CHECK(file.lines().size() == 1);
  std::filesystem::remove(path);
  CHECK(file.update());
  CHECK(file.lines().empty());
}

TEST_CASE("a long run's curves are thinned and keep their test scores", "[run]") {
  std::vector<RunMetrics> lines;
  for (int i = 1; i <= 30'000; ++i) {
    RunMetrics line = lineOf("plain", i);
    if (i % 1000 == 0) line.test_psnr = 30;
    addThinned(lines, std::move(line));
  }
  CHECK(lines.size() <= kMaxCurveLines);
  CHECK(lines.size() > kMaxCurveLines / 4);
  std::size_t scores = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    scores += lines[i].test_psnr.has_value();
    if (i > 0 && lines[i].iteration <= lines[i - 1].iteration) FAIL("out of order at " << i);
  }
  CHECK(scores == 30);
  lines.clear();
  for (int i = 1; i <= 30'000; ++i) {
    RunMetrics line = lineOf("plain", i);
    line.test_psnr = 30;
    addThinned(lines, std::move(line));
  }
  CHECK(lines.size() <= kMaxCurveLines);
}

TEST_CASE("a status survives its file, in words it says what matters", "[run]") {
  RunStatus status{RunPhase::paused, "fox", lineOf("plain", 120)};
  status.now.seconds_left = 185.4;
  const std::optional<RunStatus> read = parseStatus(formatStatus(status));
  REQUIRE(read);
  CHECK(read->phase == RunPhase::paused);
  CHECK(read->name == "fox");
  CHECK(describe(*read) == "paused: plain 120 / 700, 21.20 dB, 3 min 05 s left");
  status.phase = RunPhase::finished;
  status.now.test_psnr = 30.55;
  CHECK(describe(status) == "finished, 30.55 dB held out");
  status.phase = RunPhase::interrupted;
  CHECK(describe(status) == "interrupted at plain 120 / 700, 30.55 dB held out");
  for (const char* strange :
       {"", "{}", "[1]", R"({"format":"tgtrain-live","stage":"plain","phase":"asleep","name":""})",
        R"({"format":"other","stage":"plain","phase":"paused","name":""})",
        R"({"format":"tgtrain-live","stage":"plain","phase":"paused"})"}) {
    INFO(strange);
    CHECK_FALSE(parseStatus(strange));
  }
}

TEST_CASE("orders are four words, one of them with a number", "[run]") {
  for (const RunOrder order :
       {RunOrder{RunCommand::pause}, {RunCommand::go}, {RunCommand::step, 25}, {RunCommand::stop}}) {
    const std::optional<RunOrder> read = parseOrder(formatOrder(order));
    REQUIRE(read);
    CHECK(read->command == order.command);
    CHECK(read->steps == order.steps);
  }
  CHECK(parseOrder("step\n")->steps == 1);
  for (const char* strange :
       {"", "\n", "halt\n", "step 0\n", "step -1\n", "step 2.5\n", "step 10000000\n", "pause 3\n"}) {
    INFO(strange);
    CHECK_FALSE(parseOrder(strange));
  }
  const TemporaryFolder folder;
  giveOrder(folder.path, {RunCommand::step, 3});
  std::ifstream stream(folder / "control");
  std::string line;
  std::getline(stream, line);
  CHECK(line == "step 3");
}

TEST_CASE("a run knows that somebody watches, until nobody does", "[run]") {
  const TemporaryFolder folder;
  CHECK_FALSE(WatchLock(folder.path).holds(folder.path));
  const int metrics = ::open((folder / "metrics.jsonl").c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0666);
  REQUIRE(metrics >= 0);
  CHECK_FALSE(isWatched(metrics));
  {
    const WatchLock one(folder.path), two(folder.path);
    CHECK(one.holds(folder.path));
    CHECK(two.holds(folder.path));
    CHECK(isWatched(metrics));
    std::filesystem::rename(folder / "metrics.jsonl", folder / "old");
    CHECK_FALSE(one.holds(folder.path));
  }
  CHECK_FALSE(isWatched(metrics));
  ::close(metrics);
}

TEST_CASE("seconds are told, however many a file says") {
  CHECK(formatSeconds(59.4) == "59 s");
  CHECK(formatSeconds(185) == "3 min 05 s");
  CHECK(formatSeconds(7620) == "2 h 07 min");
  CHECK(formatSeconds(-1e300) == "0 s");
  CHECK(formatSeconds(1e300) == "277777777 h 46 min");
}

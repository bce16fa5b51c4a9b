// SPDX-License-Identifier: Apache-2.0
// Lines that are jobs, and lines that are none.
#include "training/farm/jobs.h"

#include <nlohmann/json.hpp>

#include "support/catch.h"
#include "support/message_of.h"

using tg::FarmJob;

TEST_CASE("a line is a job, with a model and no flags where it names none", "[farm]") {
  const std::vector<FarmJob> jobs = tg::parseJobs(
      "{\"name\": \"a.1\", \"dataset\": \"/data/a b\"}\r\n\n"
      "{\"name\": \"b\", \"dataset\": \"b\", \"output\": \"b.sog\", \"flags\": [\"--preset\", \"quick\"]}",
      "jobs");
  REQUIRE(jobs.size() == 2);
  CHECK(jobs[0] == FarmJob{"a.1", "/data/a b", "model.tgz", {}});
  CHECK(jobs[1] == FarmJob{"b", "b", "b.sog", {"--preset", "quick"}});
  CHECK(tg::parseJobs(tg::jsonOf(jobs[1]).dump(), "again").front() == jobs[1]);
}

TEST_CASE("what is no job is named with its line", "[farm]") {
  const auto message = [](const std::string& text) {
    return tg::test::messageOf([&] { tg::parseJobs(text, "jobs"); });
  };
  const std::string good = "{\"name\": \"a\", \"dataset\": \"d\"}\n";
  CHECK(message("") == "jobs: holds no job (expected one a line)");
  CHECK_THAT(message(good + "{"), Catch::Matchers::StartsWith("jobs: line 2: not valid JSON"));
  CHECK_THAT(message("[]"), Catch::Matchers::StartsWith("jobs: line 1: expected an object"));
  CHECK(message(good + "\n" + good) == "jobs: line 3: name \"a\" is another job's already");
  CHECK_THAT(message("{\"name\": \"a\"}"), Contains("dataset"));
  CHECK_THAT(message("{\"name\": \"a\", \"dataset\": \"d\", \"flag\": []}"),
             Contains("unknown member \"flag\" (expected name, dataset, output and flags)"));
  for (const char* name : {"", ".", "..", ".hidden", "-o", "a/b", "a b", "\\u0000", "\\u00e9"}) {
    INFO(name);
    CHECK(message("{\"name\": \"" + std::string(name) + "\", \"dataset\": \"d\"}") != "accepted");
  }
  CHECK(message("{\"name\": \"" + std::string(101, 'a') + "\", \"dataset\": \"d\"}") != "accepted");
  for (const char* output : {"job.json", "metrics.jsonl", "../x.tgz", ""}) {
    CHECK(message("{\"name\": \"a\", \"dataset\": \"d\", \"output\": \"" + std::string(output) + "\"}") != "accepted");
  }
  for (const char* flag : {"--run", "--run=x", "-o", "-omodel.tgz", "--output=x", "--resume", "--threads=2"}) {
    INFO(flag);
    CHECK_THAT(message("{\"name\": \"a\", \"dataset\": \"d\", \"flags\": [\"" + std::string(flag) + "\"]}"),
               Contains("is the farm's own"));
  }
  CHECK(message("{\"name\": \"a\", \"dataset\": \"--help\"}") == "jobs: line 1: dataset \"--help\" is a flag");
}

// SPDX-License-Identifier: Apache-2.0
// Medians, and the JSON they end in.
#include "viewer/picture/benchmark.h"

#include <nlohmann/json.hpp>

#include "core/file/json.h"
#include "support/catch.h"

using namespace tg;

TEST_CASE("median, 95th percentile and extremes of known values") {
  std::vector<double> values;
  for (int i = 100; i >= 1; --i) values.push_back(i);
  const Spread spread = spreadOf(values);
  CHECK(spread.median == 50.5);
  CHECK(spread.p95 == 95);
  CHECK(spread.min == 1);
  CHECK(spread.max == 100);
  CHECK(spread.mean == 50.5);
  CHECK(spreadOf({3, 1, 2}).median == 2);
  CHECK(spreadOf({7}).p95 == 7);
}

TEST_CASE("a benchmark's JSON has every number of the schema") {
  Benchmark benchmark;
  benchmark.where = "headless";
  benchmark.backend = "cpu";
  benchmark.model = "a.tgz";
  benchmark.model_bytes = 3'000'000;
  benchmark.read_ms = 1;
  benchmark.upload_ms = 2;
  benchmark.load_ms = 6;
  for (double ms : {4.0, 8.0, 6.0}) {
    benchmark.frames.push_back({ms, 2 * ms, {{"project", ms / 4}, {"sort", 0.5}, {"sort", 1.0}}});
  }
  benchmark.frames[1].passes.push_back({"rare", 9});
  const nlohmann::json json = parseJson(formatBenchmark(benchmark), "benchmark");
  CHECK(json["format"] == "tgview-benchmark");
  CHECK(json["version"] == 1);
  CHECK(json["frame_ms"]["median"] == 6.0);
  CHECK(json["frame_ms"]["p95"] == 8.0);
  CHECK(json["cpu_ms"]["min"] == 8.0);
  CHECK(json["passes_ms"]["project"] == 1.5);
  CHECK(json["passes_ms"]["sort"] == 1.5);
  CHECK(json["passes_ms"]["rare"] == 0.0);
  CHECK(json["load"]["total_ms"] == 6.0);
  CHECK(json["load"]["read_ms"] == 1.0);
  CHECK(json["load"]["first_frame_ms"].is_null());
  CHECK(json["load"]["gb_per_s"].get<double>() == Approx(0.5));
  CHECK(json["path"]["frames"] == 3);
  CHECK(json["settings"]["intersection"].is_null());
}

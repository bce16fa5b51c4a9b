// SPDX-License-Identifier: Apache-2.0
// Medians of what frames cost.
#include "viewer/picture/benchmark.h"

#include <algorithm>
#include <cmath>
#include <ctime>
#include <nlohmann/json.hpp>
#include <numeric>

#include "converter/registry/file_format.h"
#include "core/file/file.h"
#include "core/file/json.h"
#include "core/system/assert.h"
#include "viewer/view/parse.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

constexpr int kBenchmarkVersion = 1;

double rounded(double milliseconds) { return std::round(milliseconds * 1e4) / 1e4; }

nlohmann::ordered_json toJson(const Spread& spread) {
  return {{"median", rounded(spread.median)},
          {"p95", rounded(spread.p95)},
          {"min", rounded(spread.min)},
          {"max", rounded(spread.max)},
          {"mean", rounded(spread.mean)}};
}

template <typename Value>
Spread spreadOver(const std::vector<BenchmarkFrame>& frames, const Value& value) {
  std::vector<double> values;
  values.reserve(frames.size());
  for (const BenchmarkFrame& frame : frames) values.push_back(value(frame));
  return spreadOf(std::move(values));
}

// Medians by name, in the order of the first frame; a pass that a frame does not have counts as 0 there. Passes that
// run several times a frame are summed.
nlohmann::ordered_json passMedians(const std::vector<BenchmarkFrame>& frames) {
  nlohmann::ordered_json result = nlohmann::ordered_json::object();
  for (const BenchmarkFrame& first : frames) {
    for (const PassTime& pass : first.passes) {
      if (result.contains(pass.name)) continue;
      const auto sum = [&pass](const BenchmarkFrame& frame) {
        return std::accumulate(frame.passes.begin(), frame.passes.end(), 0.0, [&pass](double all, const PassTime& p) {
          return p.name == pass.name ? all + p.milliseconds : all;
        });
      };
      result[pass.name] = rounded(spreadOver(frames, sum).median);
    }
  }
  return result;
}

}  // namespace

double processMilliseconds() {
  timespec time{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

Spread spreadOf(std::vector<double> values) {
  TG_ASSERT(!values.empty(), "a value at least");
  std::sort(values.begin(), values.end());
  const std::size_t count = values.size();
  Spread spread;
  spread.median = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
  spread.p95 = values[static_cast<std::size_t>(std::ceil(0.95 * static_cast<double>(count))) - 1];
  spread.min = values.front();
  spread.max = values.back();
  spread.mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(count);
  return spread;
}

Benchmark benchmarkOf(const ViewOptions& options, const Scene& scene) {
  Benchmark benchmark;
  benchmark.model = options.model.string();
  benchmark.model_bytes = isFile(options.model) ? storedBytes(detectFormat(options.model), options.model) : 0;
  benchmark.gaussians = scene.gaussians;
  benchmark.textured = scene.textured;
  benchmark.texels = scene.texels;
  benchmark.sh_degree = scene.sh_degree;
  benchmark.path = options.path.string();
  benchmark.output = options.show;
  benchmark.settings = settingsFor(options, scene.background);
  return benchmark;
}

std::string formatBenchmark(const Benchmark& benchmark) {
  TG_ASSERT(!benchmark.frames.empty(), "a frame at least");
  using nlohmann::ordered_json;
  const RenderSettings& settings = benchmark.settings;
  ordered_json json = {{"format", "tgview-benchmark"},
                       {"version", kBenchmarkVersion},
                       {"where", benchmark.where},
                       {"backend", benchmark.backend},
                       {"device", benchmark.device}};
  json["model"] = {{"file", benchmark.model},          {"bytes", benchmark.model_bytes},
                   {"gaussians", benchmark.gaussians}, {"textured", benchmark.textured},
                   {"texels", benchmark.texels},       {"sh_degree", benchmark.sh_degree}};
  json["path"] = {{"file", benchmark.path}, {"frames", benchmark.frames.size()}};
  json["image"] = {{"width", benchmark.width}, {"height", benchmark.height}, {"output", name(benchmark.output)}};
  json["settings"] = {
      {"textures", texturesName(settings.textures)},
      {"exposure", settings.exposure},
      {"intersection", settings.intersection ? ordered_json(name(*settings.intersection)) : ordered_json(nullptr)}};
  const auto known = [](const std::optional<double>& ms) {
    return ms ? ordered_json(rounded(*ms)) : ordered_json(nullptr);
  };
  json["load"] = {{"read_ms", known(benchmark.read_ms)},
                  {"upload_ms", known(benchmark.upload_ms)},
                  {"first_frame_ms", known(benchmark.first_frame_ms)},
                  {"total_ms", rounded(benchmark.load_ms)},
                  {"gb_per_s", static_cast<double>(benchmark.model_bytes) / 1e6 / std::max(benchmark.load_ms, 1e-6)}};
  json["frame_ms"] = toJson(spreadOver(benchmark.frames, [](const BenchmarkFrame& f) { return f.wall_ms; }));
  json["cpu_ms"] = toJson(spreadOver(benchmark.frames, [](const BenchmarkFrame& f) { return f.cpu_ms; }));
  json["passes_ms"] = passMedians(benchmark.frames);
  return dumpJson(json, 2) + "\n";
}

}  // namespace tg

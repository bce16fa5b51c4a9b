// SPDX-License-Identifier: Apache-2.0
// --benchmark: what the frames of a camera path cost, as JSON for other programs.
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "viewer/view/options.h"
#include "viewer/view/scene.h"

namespace tg {

struct BenchmarkFrame {
  double wall_ms = 0;            // from the request to the finished picture
  double cpu_ms = 0;             // process time, user and system, all threads
  std::vector<PassTime> passes;  // as the backend measures them
};

struct Benchmark {
  std::string where;    // "headless" or "window"
  std::string backend;  // "vulkan", "opengl" or "cpu"
  std::string device;
  std::string model;  // file
  std::uint64_t model_bytes = 0;
  std::size_t gaussians = 0, textured = 0, texels = 0;
  int sh_degree = 0;
  std::string path;
  int width = 0, height = 0;  // [px]
  Output output = Output::final;
  RenderSettings settings;
  // Of the file, to the renderer, and of the first picture, which compiles shaders and sizes buffers; not known apart
  // where these overlap.
  std::optional<double> read_ms, upload_ms, first_frame_ms;
  double load_ms = 0;  // from the start to the first picture
  std::vector<BenchmarkFrame> frames;
};

// What is known before a frame is drawn: of the options and the model.
Benchmark benchmarkOf(const ViewOptions& options, const Scene& scene);
// docs/viewer.md has the schema. Needs a frame or more.
std::string formatBenchmark(const Benchmark& benchmark);

struct Spread {
  double median = 0, p95 = 0, min = 0, max = 0, mean = 0;
};
// Median of an even number of values: the mean of the middle two. p95: nearest rank. Needs a value or more.
Spread spreadOf(std::vector<double> values);

double processMilliseconds();  // CPU time of the process so far, user and system

}  // namespace tg

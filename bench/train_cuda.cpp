// SPDX-License-Identifier: Apache-2.0
// Traffic is counted, not measured: every array that a kernel needs, once. What it really moves is more where splats
// are read again in other tiles, less where they are still in the cache.
#include "train_cuda.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdio>
#include <memory>
#include <optional>
#include <string_view>

#include "core/model/verbs.h"
#include "cuda_peak.h"
#include "training/cuda/frame.h"
#include "training/cuda/memory.h"
#include "training/cuda/timing.h"
#include "training/step/engine.h"

namespace tg::bench {
namespace {

// Operations of a blended pair by counting, as for the CPU.
constexpr double kForwardFlops = 34;
constexpr double kBackwardFlops = 69;
constexpr int kWarmUp = 5;  // iterations

struct Counts {
  double gaussians, floats, texels, pairs, tiles, pixels, blended, samples;
  bool textured, statistics;
};

// Bytes that all launches of a kernel in one iteration read and write; none: not counted.
std::optional<double> bytesOf(std::string_view kernel, const Counts& c) {
  const double splat = sizeof(cuda::BlendSplat) + (c.textured ? sizeof(cuda::LocalFrame) : 0.0);
  const double sums = 4.0 * cuda::pairSums(c.textured, c.statistics) + 1;
  const double base_floats = c.floats - 4 * c.texels;  // of parameters but texels
  const int tile_passes = (std::bit_width(static_cast<unsigned>(c.tiles)) + 7) / 8;
  if (kernel == "project") return 4 * base_floats + c.gaussians * (splat + 36);
  if (kernel == "sort") return 16 * (4 * c.gaussians + tile_passes * c.pairs);  // passes over 8 bits
  if (kernel == "emit") return c.gaussians * (36 + sizeof(cuda::BlendSplat)) + 12 * c.pairs;
  if (kernel == "blend forward") return c.pairs * (8 + splat) + 16 * c.texels + 20 * c.pixels;
  if (kernel == "loss") return 3 * c.pixels * (4 + 1 + 12);
  if (kernel == "loss backward") return 3 * c.pixels * (12 + 4 + 1 + 4);
  if (kernel == "blend backward") return c.pairs * (8 + splat + sums) + c.texels * (16 + 64) + 32 * c.pixels;
  if (kernel == "finish") return c.pairs * sums + 8 * base_floats + c.gaussians * (sizeof(cuda::BlendSplat) + 16);
  if (kernel == "Adam") return 28 * base_floats;  // value and two moments read and written, gradient read
  if (kernel == "move texels") return c.texels * (64 + 96);
  return std::nullopt;
}
std::optional<double> flopsOf(std::string_view kernel, const Counts& c) {
  if (kernel == "blend forward") return kForwardFlops * c.blended;
  if (kernel == "blend backward") return kBackwardFlops * c.blended;
  return std::nullopt;
}

// Steps through the cameras as training does, photographs on the device.
class Run {
 public:
  Run(DifferentiableRenderer& renderer, GaussianModel model, const CudaBench& bench)
      : bench_(bench), engine_(renderer.makeTrainingEngine(0.2f)) {
    state_.training.model = std::move(model);
    resetMoments(state_.training);
    state_.statistics.reset(state_.training.model.size());
    for (std::size_t i = 0; i < bench.cameras.size(); ++i) {
      auto pixels = std::make_shared<ViewPixels>();
      pixels->width = bench.cameras[i].size.x;
      pixels->height = bench.cameras[i].size.y;
      pixels->rgb = bench.photographs[i];
      photographs_.push_back(std::move(pixels));
    }
    if (bench.dictionary > 0) {
      for (std::size_t i = 0; i < state_.training.model.size(); ++i) {
        groups_.push_back(static_cast<std::uint32_t>(i % static_cast<std::size_t>(bench.dictionary)));
      }
    }
    rates_.mean = static_cast<float>(1.6e-4 * bench.extent);
  }

  void step() {
    const std::size_t view = static_cast<std::size_t>(iteration_) * 7 % bench_.cameras.size();
    StepInput input{{.view = view,
                     .background = glm::vec3(0.0f),
                     .background_varies = false,
                     .iteration = ++iteration_,
                     .gradient = {},
                     .gather_statistics = bench_.statistics,
                     .rates = rates_,
                     .mcmc = false,
                     .opacity_weight = 0,
                     .scale_weight = 0,
                     .noise = 0,
                     .noise_seed = 0,
                     .clamp_colors = false},
                    bench_.cameras[view],
                    photographs_[view],
                    groups_};
    input.gradient.statistics = bench_.statistics;
    engine_->step(state_, input);
  }
  // Waits for the steps; of the last of them.
  double loss() { return engine_->losses(state_, true).back().total; }

 private:
  const CudaBench& bench_;
  const std::unique_ptr<TrainingEngine> engine_;
  RunState state_;
  std::vector<std::shared_ptr<const ViewPixels>> photographs_;
  std::vector<std::uint32_t> groups_;  // of textures
  LearningRates rates_;
  int iteration_ = 0;
};

void printKernels(const std::vector<cuda::KernelTime>& times, const Counts& counts, int iterations,
                  const std::optional<CudaPeak>& peak) {
  std::printf("%-16s %9s %11s %18s %18s\n", "kernel", "launches", "ms", "GB/s (of copy)", "GFLOP/s (of FMA)");
  const auto rate = [](std::optional<double> amount, double seconds, double most) {
    if (!amount || !(seconds > 0)) return std::string("-");
    char text[48];
    const double per_second = *amount / seconds;
    if (most > 0) {
      std::snprintf(text, sizeof text, "%.1f (%.0f %%)", per_second * 1e-9, 100 * per_second / most);
    } else {
      std::snprintf(text, sizeof text, "%.1f", per_second * 1e-9);
    }
    return std::string(text);
  };
  double sum = 0;
  for (const cuda::KernelTime& time : times) {
    const double milliseconds = time.milliseconds / iterations;
    sum += milliseconds;
    std::printf("%-16s %9.1f %11.4f %18s %18s\n", time.name.c_str(), static_cast<double>(time.launches) / iterations,
                milliseconds, rate(bytesOf(time.name, counts), milliseconds * 1e-3, peak ? peak->bytes : 0).c_str(),
                rate(flopsOf(time.name, counts), milliseconds * 1e-3, peak ? peak->flops : 0).c_str());
  }
  std::printf("%-16s %9s %11.4f\n", "all kernels", "", sum);
}

}  // namespace

void benchCuda(DifferentiableRenderer& renderer, GaussianModel model, const CudaBench& bench) {
  const Camera& camera = bench.cameras[0];
  Counts counts{};
  counts.gaussians = static_cast<double>(model.size());
  counts.texels = static_cast<double>(model.atlas.texels.size());
  counts.floats = static_cast<double>(bytesOf(model) / sizeof(float));
  if (bench.dictionary > 0) {
    const double once = counts.texels * std::min(1.0, bench.dictionary / counts.gaussians);
    counts.floats -= 4 * (counts.texels - once);
    counts.texels = once;
  }
  counts.pixels = static_cast<double>(camera.size.x) * camera.size.y;
  counts.tiles = ((camera.size.x + 15) / 16) * ((camera.size.y + 15) / 16);
  counts.blended = bench.blended;
  counts.textured = counts.texels > 0;
  counts.statistics = bench.statistics;
  counts.pairs = static_cast<double>(cuda::countPairs(model, camera));
  std::printf("%s\n", renderer.deviceName().c_str());
  std::printf("%d x %d px, %.0f Gaussians, %.0f texels, %.2f M (tile, splat) pairs, %.2f M blended\n", camera.size.x,
              camera.size.y, counts.gaussians, counts.texels, counts.pairs * 1e-6, counts.blended * 1e-6);

  std::optional<CudaPeak> peak;
  if (bench.measure_peak) {
    peak = cudaPeak(std::size_t{256} << 20, 132 * 16, 4096);
    std::printf("measured: copy %.0f GB/s, FMA %.0f GFLOP/s\n", peak->bytes * 1e-9, peak->flops * 1e-9);
  }
  const std::size_t free_before = cuda::deviceMemory().free;
  Run run(renderer, std::move(model), bench);
  run.step();
  const double first = run.loss();
  for (int i = 1; i < kWarmUp; ++i) run.step();
  run.loss();
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < bench.iterations; ++i) run.step();
  const double last = run.loss();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
  const double used = static_cast<double>(free_before - cuda::deviceMemory().free);
  std::printf("%.1f it/s over %d iterations; loss %.5f -> %.5f\n", bench.iterations / elapsed.count(), bench.iterations,
              first, last);
  double images = 0;
  for (const auto& photograph : bench.photographs) images += static_cast<double>(photograph.size());
  const double needed = 3 * 4 * counts.floats + images;
  std::printf(
      "device memory %.0f MiB; parameters, optimiser and images %.0f MiB; bar 1.2 times that and 1 GiB: %.0f MiB\n",
      used / (1 << 20), needed / (1 << 20), 1.2 * needed / (1 << 20) + 1024);

  cuda::timeKernels(true);
  for (int i = 0; i < bench.iterations; ++i) run.step();
  run.loss();
  const std::vector<cuda::KernelTime> times = cuda::kernelTimes();
  cuda::timeKernels(false);
  printKernels(times, counts, bench.iterations, peak);
}

}  // namespace tg::bench

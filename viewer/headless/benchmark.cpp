// SPDX-License-Identifier: Apache-2.0
// Times frames one after the other.
#include "viewer/headless/headless.h"

#include <chrono>
#include <cstdio>
#include <utility>
#include <vector>

#include "viewer/headless/renderer.h"
#include "viewer/picture/benchmark.h"
#include "viewer/picture/picture.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

struct Stopwatch {
  const std::chrono::steady_clock::time_point start = std::chrono::steady_clock::now();
  double read() const { return milliseconds(std::chrono::steady_clock::now() - start); }
};

// Draws one picture and waits for it.
class FrameRunner {
 public:
  FrameRunner(const HeadlessRenderer& backend, const Benchmark& benchmark)
      : renderer_(*backend.renderer), gpu_(dynamic_cast<GpuRenderer*>(backend.renderer.get())) {
    request_.output = benchmark.output;
    request_.settings = benchmark.settings;
  }

  void draw(const Camera& camera) {
    if (!gpu_) {
      (void)visualize(renderer_.render(camera, request_.settings), request_.output, request_.settings);
      return;
    }
    request_.camera = camera;
    drawWhole([this] { return gpu_->draw(request_); });
  }

 private:
  Renderer& renderer_;
  GpuRenderer* const gpu_;
  FrameRequest request_;
};

}  // namespace

void benchmarkHeadless(const ViewOptions& options) {
  const HeadlessRenderer backend = makeHeadlessRenderer(options);
  const Stopwatch reading;
  Bundle loaded = readModel(options.model);
  const double read_ms = reading.read();
  const Scene scene = sceneFor(options, std::move(loaded));
  const std::vector<Camera> cameras = shotCameras(options, scene, false);
  Benchmark benchmark = benchmarkOf(options, scene);
  benchmark.where = "headless";
  benchmark.read_ms = read_ms;
  benchmark.width = cameras.front().size.x;
  benchmark.height = cameras.front().size.y;

  const Stopwatch uploading;
  backend.renderer->setModel(scene.model);
  benchmark.upload_ms = uploading.read();
  benchmark.device = backend.renderer->deviceName();
  FrameRunner runner(backend, benchmark);
  benchmark.backend = backend.backend;
  const Stopwatch first;
  runner.draw(cameras.front());
  benchmark.first_frame_ms = first.read();
  benchmark.load_ms = *benchmark.read_ms + *benchmark.upload_ms + *benchmark.first_frame_ms;
  for (const Camera& camera : cameras) {
    BenchmarkFrame frame;
    const Stopwatch wall;
    const double cpu = processMilliseconds();
    runner.draw(camera);
    frame.wall_ms = wall.read();
    frame.cpu_ms = processMilliseconds() - cpu;
    frame.passes = backend.renderer->passTimes();
    benchmark.frames.push_back(std::move(frame));
  }
  requireNoValidationMessages(backend);
  std::fputs(formatBenchmark(benchmark).c_str(), stdout);
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// What does a training step cost, phase by phase, and how near do its kernels come to the machine's peak?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "core/model/verbs.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "fma_peak.h"
#include "measure.h"
#include "render/renderer.h"
#include "support/scenes.h"
#include "training/data/dataset.h"
#include "training/run/init.h"
#include "training/step/gradient.h"
#include "training/step/loss.h"
#include "training/step/optimizer.h"
#ifdef TG_HAVE_CUDA
#include "train_cuda.h"
#include "training/cuda/renderer.h"
#endif

namespace {

using namespace tg;

// Floating-point operations per blended pair by counting, whatever the kernels really execute: 2 offsets, 7 conic, 14
// exponential, 3 alpha, 8 blending; backward 26 to evaluate again, 5 reciprocal, 38 gradients.
constexpr double kForwardFlops = 34;
constexpr double kBackwardFlops = 69;

struct Options {
  std::string data;
  std::string device = "cpu";
  int width = 640, height = 360, gaussians = 16000, iterations = 40, threads = 0, texels = 0, dictionary = 0,
      sh_degree = 3;
  double splats = 60.0;
  bool statistics = true, peak = true;
};

// Semi-transparent ellipsoids of 1 : 3 : 10 in random directions before a camera, sized so that about sixty of them
// blend in a pixel: what a scene looks like early in training.
GaussianModel cloud(const Options& options, const Camera& camera) {
  test::Random random(1);
  GaussianModel model;
  model.sh_degree = options.sh_degree;
  // A splat of opacity 0.1 shows out to radius 2.55 sigma; its area on screen is about 8 sigma_1 sigma_2 pixels.
  const double pixels = options.splats * camera.size.x * camera.size.y / options.gaussians;
  const double sigma = std::sqrt(pixels / 14.0) / camera.focal.x * 4.0;
  for (int i = 0; i < options.gaussians; ++i) {
    const double z = random.uniform(2.0, 6.0);
    const glm::dvec3 mean((random.uniform(0.0, 1.0) * camera.size.x - camera.center.x) / camera.focal.x * z,
                          (random.uniform(0.0, 1.0) * camera.size.y - camera.center.y) / camera.focal.y * z, z);
    model.mean.push_back(glm::vec3(mean));
    model.rotation.push_back(glm::vec4(random.quaternion()));
    model.log_scale.push_back(glm::vec3(glm::log(sigma * z / 4.0 * glm::dvec3(1.8, 0.6, 0.18))));
    model.opacity_logit.push_back(static_cast<float>(random.uniform(-3.5, -1.0)));
    for (std::size_t k = 0; k < model.shCount(); ++k) {
      model.sh.push_back(glm::vec3(random.uniformVec3(-0.5, 0.5)) * (k == 0 ? 2.0f : 0.2f));
    }
  }
  return model;
}

// What is trained on: cameras and the photographs that they took.
struct Scene {
  std::vector<Camera> cameras;
  std::vector<std::vector<std::uint8_t>> photographs;  // [height * width * 3]
  GaussianModel model;
  double extent = 1.0;
};

Scene seededScene(const Options& options) {
  Scene scene;
  scene.cameras.push_back(lookAt({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.8, options.width, options.height));
  scene.model = cloud(options, scene.cameras[0]);
  GaussianModel truth = scene.model;
  test::Random random(2);
  for (auto& sh : truth.sh) sh += glm::vec3(random.uniformVec3(-0.1, 0.1));
  const auto renderer = makeCpuRenderer();
  renderer->setModel(truth);
  const Frame frame = renderer->render(scene.cameras[0], {});
  std::vector<std::uint8_t> photograph;
  for (std::size_t pixel = 0; pixel < frame.base.size(); ++pixel) {
    const glm::vec3 color = glm::clamp(frame.color(pixel), 0.0f, 1.0f) * 255.0f;
    for (int ch = 0; ch < 3; ++ch) photograph.push_back(static_cast<std::uint8_t>(std::lround(color[ch])));
  }
  scene.photographs.push_back(std::move(photograph));
  if (options.texels > 0) addTextures(scene.model, options.texels, options.texels);
  return scene;
}

Scene loadScene(const Options& options) {
  const Dataset dataset = loadDataset(options.data);
  if (dataset.points.position.empty()) {
    throw Error(ErrorKind::badData, options.data, "no points to start from (expected a data set with a point cloud)");
  }
  Scene scene;
  for (const std::size_t index : dataset.indices(false)) {
    scene.cameras.push_back(dataset.views[index]);
    scene.photographs.push_back(dataset.pixels(index)->rgb);
  }
  scene.extent = cameraExtent(dataset);
  scene.model = gaussiansFromPoints(dataset.points);
  setShDegree(scene.model, options.sh_degree);
  if (options.texels > 0) addTextures(scene.model, options.texels, options.texels);
  return scene;
}

// Per camera.
std::vector<double> blendedPairs(const GaussianModel& model, const std::vector<Camera>& cameras) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(model);
  std::vector<double> pairs;
  for (const Camera& camera : cameras) {
    const Frame frame = renderer->render(camera, {});
    pairs.push_back(std::accumulate(frame.count.begin(), frame.count.end(), 0.0));
  }
  return pairs;
}

// The times of one phase over all iterations. On a shared machine the best processor time says more than the mean.
struct Phase {
  std::string name;
  std::vector<double> wall, processor;  // [ms]
};
class Phases {
 public:
  void add(const PhaseTime& time) {
    auto at = std::find_if(phases_.begin(), phases_.end(), [&](const Phase& p) { return p.name == time.name; });
    if (at == phases_.end()) at = phases_.insert(phases_.end(), Phase{time.name, {}, {}});
    at->wall.push_back(time.wall);
    at->processor.push_back(time.processor);
  }
  template <typename Body>
  void measure(const char* name, const Body& body) {
    const auto wall = std::chrono::steady_clock::now();
    const std::clock_t processor = std::clock();
    body();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - wall;
    add({name, elapsed.count(), 1e3 * static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC});
  }
  std::vector<Phase>& all() { return phases_; }

 private:
  std::vector<Phase> phases_;
};

double best(const std::vector<double>& values) { return *std::min_element(values.begin(), values.end()); }

// [bytes] Most memory held since the last forgetPeak(), of Linux.
void forgetPeak() { std::ofstream("/proc/self/clear_refs") << 5; }
double peakMemory() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return 1024.0 * std::strtod(line.c_str() + 6, nullptr);
  }
  return 0.0;
}

double mebibytes(double bytes) { return bytes / (1 << 20); }

std::size_t viewOf(int iteration, const Scene& scene) {
  return static_cast<std::size_t>(iteration) * 7 % scene.cameras.size();
}

// On the device that --device names: before the scene is made, which takes a while.
std::unique_ptr<DifferentiableRenderer> openRenderer(const Options& options) {
  if (options.device == "cpu") return makeCpuDifferentiableRenderer();
#ifdef TG_HAVE_CUDA
  return makeCudaDifferentiableRenderer();
#else
  throw Error(ErrorKind::device, "CUDA", "this program was built without it (no nvcc when it was configured)");
#endif
}

void run(const Options& options) {
  if (options.dictionary > 0 && (options.device != "cuda" || options.texels == 0)) {
    throw Error(ErrorKind::usage, "--dictionary is for textures on a GPU (expected --device cuda and --texels)");
  }
  const auto renderer = openRenderer(options);
  Scene scene = options.data.empty() ? seededScene(options) : loadScene(options);
#ifdef TG_HAVE_CUDA
  if (options.device == "cuda") {
    const double blended = blendedPairs(scene.model, {scene.cameras[0]})[0];
    bench::benchCuda(*renderer, std::move(scene.model),
                     {scene.cameras, scene.photographs, scene.extent, blended, options.iterations, options.statistics,
                      options.peak, options.dictionary});
    return;
  }
#endif
  TrainingState state;
  state.model = std::move(scene.model);
  resetMoments(state);
  PhotometricLoss loss;
  ModelGradient gradient;
  GradientOptions gradient_options;
  gradient_options.statistics = options.statistics;
  LearningRates rates;
  rates.mean = static_cast<float>(1.6e-4 * scene.extent);
  std::vector<glm::vec3> v_picture;

  const std::vector<double> pairs_before = blendedPairs(state.model, scene.cameras);
  const double peak = bench::fmaPeak();
  Phases phases;
  LossValue first, last;
  forgetPeak();  // counting the pairs takes a renderer of its own
  for (int i = 0; i < options.iterations; ++i) {
    const std::size_t view = viewOf(i, scene);
    const Camera& camera = scene.cameras[view];
    phases.measure("step", [&] {
      const auto& picture = renderer->forward(state.model, camera, {});
      v_picture.resize(picture.size());
      phases.measure("loss", [&] {
        last = loss.evaluate(camera.size.x, camera.size.y, picture, scene.photographs[view], v_picture);
      });
      renderer->backward(v_picture, gradient, gradient_options);
      phases.measure("adam", [&] { adamStep(state, gradient, rates); });
    });
    if (i == 0) first = last;
    for (const PhaseTime& time : renderer->phaseTimes()) phases.add(time);
  }
  const double used = peakMemory();
  // Of each iteration: its camera's, between the first and the last model.
  const std::vector<double> pairs_after = blendedPairs(state.model, scene.cameras);
  std::vector<double> pairs_of;
  for (int i = 0; i < options.iterations; ++i) {
    const std::size_t view = viewOf(i, scene);
    pairs_of.push_back(std::lerp(pairs_before[view], pairs_after[view], i / std::max(1.0, options.iterations - 1.0)));
  }
  const double pairs = std::accumulate(pairs_of.begin(), pairs_of.end(), 0.0) / options.iterations;
  const double pixels = static_cast<double>(scene.cameras[0].size.x) * scene.cameras[0].size.y;

  std::printf("%s, %d lanes; FMA peak of one thread %.1f GFLOP/s\n", makeCpuRenderer()->deviceName().c_str(),
              bench::vectorLanes(), peak * 1e-9);
  std::printf("%d x %d px, %zu Gaussians, %d x %d texels, %.2f M blended pairs (%.1f a pixel), %d iterations\n",
              scene.cameras[0].size.x, scene.cameras[0].size.y, state.model.size(), options.texels, options.texels,
              pairs * 1e-6, pairs / pixels, options.iterations);
  std::printf("%-15s %10s %10s %16s\n", "phase", "best wall", "median", "best processor");
  double step_wall = 0.0;
  for (const Phase& phase : phases.all()) {
    std::printf("%-15s %7.2f ms %7.2f ms %13.2f ms", phase.name.c_str(), best(phase.wall), median(phase.wall),
                best(phase.processor));
    const double flops = phase.name == "blend forward"    ? kForwardFlops
                         : phase.name == "blend backward" ? kBackwardFlops
                                                          : 0.0;
    if (flops > 0.0) {
      std::vector<double> nanoseconds;
      for (int i = 0; i < options.iterations; ++i) nanoseconds.push_back(phase.processor[i] * 1e6 / pairs_of[i]);
      const double each = best(nanoseconds);
      std::printf("   %.3f ns a pair (median %.3f), %.1f %% of the FMA peak", each, median(nanoseconds),
                  100.0 * flops / (each * 1e-9) / peak);
    }
    std::printf("\n");
    if (phase.name == "step") step_wall = median(phase.wall);
  }
  const double floor = pairs * (kForwardFlops + kBackwardFlops) / (peak * threadCount()) * 1e3;
  std::printf("%.1f it/s (median); floor of the blending by counted flops on %d threads %.2f ms = %.1f it/s\n",
              1e3 / step_wall, threadCount(), floor, 1e3 / floor);
  std::printf("loss %.5f -> %.5f\n", first.total, last.total);

  const auto floats = static_cast<double>(bytesOf(state.model) / sizeof(float));
  double images = 0.0;
  for (const auto& photograph : scene.photographs) images += static_cast<double>(photograph.size());
  const double needed = 3 * 4 * floats + images;  // a parameter and two moments
  std::printf("peak memory %.1f MiB; parameters, optimiser and images %.1f MiB: ratio %.2f\n", mebibytes(used),
              mebibytes(needed), used / needed);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Times training steps, phase by phase, with a fixed number of Gaussians");
  Options options;
  app.add_option("--data", options.data, "data set with a point cloud (default: a seeded scene)");
  app.add_option("--device", options.device)->check(CLI::IsMember({"cpu", "cuda"}))->capture_default_str();
  app.add_option("--width", options.width, "[px]")->check(within(1, 8192));
  app.add_option("--height", options.height, "[px]")->check(within(1, 8192));
  app.add_option("--gaussians", options.gaussians)->check(within(1, 10000000));
  app.add_option("--splats", options.splats, "blended splats per pixel to aim at")->check(within(0.1, 1000.0));
  app.add_option("--texels", options.texels, "texture side, 0 = none")->check(within(0, 64));
  app.add_option("--dictionary", options.dictionary, "cuda: textures that Gaussians share, 0 = one each")
      ->check(within(0, 65536));
  app.add_option("--sh-degree", options.sh_degree)->check(within(0, 3));
  app.add_option("--iterations", options.iterations)->check(within(1, 100000));
  app.add_option("--threads", options.threads, "0 = all")->check(within(0, 1024));
  app.add_flag("!--no-statistics", options.statistics, "as after densification");
  app.add_flag("!--no-peak", options.peak, "cuda: times without shares of the measured peak");
  CLI11_PARSE(app, argc, argv);
  setThreadCount(options.threads);
  try {
    run(options);
  } catch (const Error& error) {
    std::fprintf(stderr, "train_bench: %s\n", error.what());
    return static_cast<int>(error.kind);
  }
  return 0;
}

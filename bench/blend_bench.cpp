// SPDX-License-Identifier: Apache-2.0
// How long does a training step's picture and gradient take on the CPU, per iteration and per blended splat?
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <numeric>
#include <vector>

#include "core/parallel.h"
#include "render/renderer.h"
#include "support/scenes.h"
#include "training/gradient.h"

namespace {

using namespace tg;

// Semi-transparent ellipsoids of 1 : 3 : 10 in random directions before a camera, sized so that about sixty of them
// blend in a pixel: what a scene looks like early in training.
GaussianModel cloud(int gaussians, double splats_per_pixel, int texels, const Camera& camera) {
  test::Random random(1);
  GaussianModel model;
  model.sh_degree = 3;
  model.texture_mode = texels > 0 ? TextureMode::rgba : TextureMode::none;
  // A splat of opacity 0.1 shows out to radius 2.55 sigma; its area on screen is about 8 sigma_1 sigma_2 pixels.
  const double pixels = splats_per_pixel * camera.width * camera.height / gaussians;
  const double sigma = std::sqrt(pixels / 14.0) / camera.fx * 4.0;
  for (int i = 0; i < gaussians; ++i) {
    const double z = random.uniform(2.0, 6.0);
    const glm::dvec3 mean((random.uniform(0.0, 1.0) * camera.width - camera.cx) / camera.fx * z,
                          (random.uniform(0.0, 1.0) * camera.height - camera.cy) / camera.fy * z, z);
    model.mean.push_back(glm::vec3(mean));
    model.rotation.push_back(glm::vec4(random.quaternion()));
    model.log_scale.push_back(glm::vec3(glm::log(sigma * z / 4.0 * glm::dvec3(1.8, 0.6, 0.18))));
    model.opacity_logit.push_back(static_cast<float>(random.uniform(-3.5, -1.0)));
    for (int k = 0; k < model.shCount(); ++k) {
      model.sh.push_back(glm::vec3(random.uniformVec3(-0.5, 0.5)) * (k == 0 ? 2.0f : 0.2f));
    }
  }
  if (texels > 0) {
    model.atlas = makeUniformAtlas(model.size(), texels, texels);
    for (auto& texel : model.atlas.texels) {
      texel = glm::vec4(glm::vec3(random.uniformVec3(-0.2, 0.2)), random.uniform(0.5, 1.0));
    }
  }
  return model;
}

// Wall and processor time of every run. On a shared machine the best processor time says more than the wall time.
struct Timing {
  std::vector<double> wall, processor;  // [ms]

  template <typename Body>
  void measure(const Body& body) {
    const auto wall_start = std::chrono::steady_clock::now();
    const std::clock_t processor_start = std::clock();
    body();
    processor.push_back(1e3 * static_cast<double>(std::clock() - processor_start) / CLOCKS_PER_SEC);
    wall.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - wall_start).count());
  }
};

void print(const char* what, Timing timing, double pairs) {
  std::sort(timing.wall.begin(), timing.wall.end());
  std::sort(timing.processor.begin(), timing.processor.end());
  std::printf("%-12s wall best %7.2f ms, median %7.2f ms; processor best %7.2f ms, %6.3f ns per pair\n", what,
              timing.wall.front(), timing.wall[timing.wall.size() / 2], timing.processor.front(),
              timing.processor.front() * 1e6 / pairs);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Times the CPU renderer's forward and backward pass on a seeded scene");
  int width = 640, height = 360, gaussians = 16000, runs = 9, threads = 0, texels = 0;
  double splats = 60.0;
  app.add_option("--width", width, "[px]")->check(CLI::Range(1, 8192));
  app.add_option("--height", height, "[px]")->check(CLI::Range(1, 8192));
  app.add_option("--gaussians", gaussians)->check(CLI::Range(1, 10000000));
  app.add_option("--splats", splats, "blended splats per pixel to aim at")->check(CLI::Range(0.1, 1000.0));
  app.add_option("--texels", texels, "texture side, 0 = none")->check(CLI::Range(0, 64));
  app.add_option("--runs", runs)->check(CLI::Range(1, 1000));
  app.add_option("--threads", threads, "0 = all")->check(CLI::Range(0, 1024));
  CLI11_PARSE(app, argc, argv);
  setThreadCount(threads);

  const Camera camera = lookAt({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, 0.8, width, height);
  const GaussianModel model = cloud(gaussians, splats, texels, camera);
  RenderSettings settings;

  const auto renderer = makeCpuRenderer();
  renderer->setModel(model);
  const Frame frame = renderer->render(camera, settings);
  const double pairs = std::accumulate(frame.count.begin(), frame.count.end(), 0.0);
  Timing render;
  for (int i = 0; i < runs; ++i) render.measure([&] { renderer->render(camera, settings); });

  const auto differentiable = makeCpuDifferentiableRenderer();
  std::vector<glm::vec3> v_color(frame.base.size());
  test::Random random(2);
  for (auto& v : v_color) v = glm::vec3(random.uniformVec3(-1.0, 1.0));
  ModelGradient gradient;
  differentiable->forward(model, camera, settings);
  differentiable->backward(v_color, gradient);
  Timing forward, backward;
  for (int i = 0; i < runs; ++i) {
    forward.measure([&] { differentiable->forward(model, camera, settings); });
    backward.measure([&] { differentiable->backward(v_color, gradient); });
  }

  std::printf("%s\n%d x %d px, %d Gaussians, %d x %d texels, %.1f blended splats per pixel, %.2f M pairs, %d runs\n",
              renderer->deviceName().c_str(), width, height, gaussians, texels, texels,
              pairs / static_cast<double>(frame.count.size()), pairs * 1e-6, runs);
  print("render, all", render, pairs);
  for (const PassTime& pass : renderer->passTimes())
    std::printf("  %-10s %7.2f ms\n", pass.name.c_str(), pass.milliseconds);
  print("forward", forward, pairs);
  print("backward", backward, pairs);
  return 0;
}

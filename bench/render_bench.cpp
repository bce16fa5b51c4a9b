// SPDX-License-Identifier: Apache-2.0
// What does a frame cost, pass by pass, and how near is its picture to the float64 reference?
//
//     render_bench MODEL [--backend vulkan] [--size 1280x720] [--frames 9] [--textures 4x4]
//
// Processor time of the whole process (user + system, all threads, software drivers included) is what compares on a
// loaded machine; wall time and the driver's time stamps are printed beside it. The frame of a GPU backend is that of a
// window: passes that end in an RGBA8 picture. The CPU frame is Renderer::render() for the output that is asked for.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "converter/registry/file_format.h"
#include "core/bundle/camera_file.h"
#include "core/system/error.h"
#include "core/system/parallel.h"
#include "core/system/program.h"
#include "measure.h"
#include "picture_rate.h"
#include "render/devices/devices.h"
#include "render/reference/splat.h"
#include "support/scenes.h"

namespace {

using namespace tg;

struct Options {
  std::string model, backend = "vulkan", size, output = "final", textures, cameras, device, json, picture;
  std::string mode = "rgba", intersection, order = "global";
  bool exact = false, frames_only = false;
  int frames = 9, threads = 0, reference_pixels = 1000, camera = 0;
};

[[noreturn]] void usage(const std::string& message) { throw Error(ErrorKind::usage, message); }

std::pair<int, int> parseSize(const std::string& text, const char* flag) {
  int width = 0, height = 0;
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2 || width < 1 || height < 1) {
    usage(std::string(flag) + ": not a size (expected WIDTHxHEIGHT, found \"" + text + "\")");
  }
  return {width, height};
}

// The same horizontal field of view with the same shape of pixels: what the peers of a comparison are given, too.
Camera sized(const Camera& camera, int width, int height) {
  return scaled(camera, static_cast<double>(width) / camera.size.x, width, height);
}

Camera chooseCamera(const Options& options, const Bundle& loaded) {
  std::vector<Camera> cameras = loaded.cameras;
  const std::filesystem::path beside = std::filesystem::path(options.model).replace_extension(".cameras.json");
  if (!options.cameras.empty()) {
    cameras = readCameras(options.cameras);
  } else if (cameras.empty() && std::filesystem::exists(beside)) {
    cameras = readCameras(beside);
  }
  if (options.camera < 0 || static_cast<std::size_t>(options.camera) >= cameras.size()) {
    usage(options.model + ": no camera " + std::to_string(options.camera) + " (" + std::to_string(cameras.size()) +
          " with it; --cameras FILE names others)");
  }
  const Camera& camera = cameras[static_cast<std::size_t>(options.camera)];
  if (options.size.empty()) return camera;
  const auto [width, height] = parseSize(options.size, "--size");
  return sized(camera, width, height);
}

// Random texels in the range that training leaves: colours around 0, alpha from half to one.
struct Times {
  std::vector<double> processor, wall;                              // [ms] of each frame
  std::vector<std::pair<std::string, std::vector<double>>> passes;  // [ms] wall, in order
  void add(const std::vector<PassTime>& frame) {
    for (std::size_t i = 0; i < frame.size(); ++i) {
      if (passes.size() <= i) passes.emplace_back(frame[i].name, std::vector<double>{});
      passes[i].second.push_back(frame[i].milliseconds);
    }
  }
};

// Two frames that do not count: drivers compile at the first, and the first may find too little room for its pairs.
template <typename DrawFrame>
Times measure(const Renderer& renderer, int frames, const DrawFrame& draw) {
  constexpr int kWarmUp = 2;
  Times times;
  for (int i = 0; i < kWarmUp + frames; ++i) {
    const double processor = processorMilliseconds();
    const auto wall = std::chrono::steady_clock::now();
    draw();
    const std::chrono::duration<double, std::milli> elapsed = std::chrono::steady_clock::now() - wall;
    if (i < kWarmUp) continue;
    times.processor.push_back(processorMilliseconds() - processor);
    times.wall.push_back(elapsed.count());
    times.add(renderer.passTimes());
  }
  return times;
}

// A ray in the order of a GPU's blend.comp: the hits come in the order of the means, as many as `kept` wait, and the
// nearest of these and the next one is blended. As reference::blend().
template <typename Visit>
double blendKeeping(const reference::Scene& scene, glm::dvec3 direction, std::size_t kept, const Visit& visit) {
  double transmittance = 1.0;
  std::vector<ReferenceHit> waiting;  // nearest first
  const auto blendNearest = [&] {
    ReferenceHit hit = waiting.front();
    waiting.erase(waiting.begin());
    const double next = transmittance * (1.0 - hit.alpha);
    if (next < kTransmittanceStop) return false;
    hit.transmittance = transmittance;
    visit(hit);
    transmittance = next;
    return true;
  };
  for (const reference::Splat& splat : scene.splats) {
    const auto hit = reference::hitSplat(scene, splat, direction);
    if (!hit) continue;
    const auto place = std::upper_bound(waiting.begin(), waiting.end(), *hit,
                                        [](const ReferenceHit& a, const ReferenceHit& b) { return a.t < b.t; });
    waiting.insert(place, *hit);
    if (waiting.size() > kept && !blendNearest()) return transmittance;
  }
  while (!waiting.empty() && blendNearest()) {
  }
  return transmittance;
}

// PSNR [dB] of the final picture against the float64 reference at seeded random pixels, both clamped to [0, 1]. kept:
// blendKeeping() so many, 0: in the order of the settings.
double psnrAtPixels(const Image& picture, const GaussianModel& model, const Camera& camera,
                    const RenderSettings& settings, int count, std::size_t kept = 0) {
  const ReferenceModel exact(model);
  const reference::Scene scene = reference::makeScene(exact, camera, settings, {});
  test::Random random(17);
  std::vector<glm::ivec2> pixels;
  for (int i = 0; i < count; ++i) {
    pixels.emplace_back(static_cast<int>(random.uniform(0, camera.size.x)),
                        static_cast<int>(random.uniform(0, camera.size.y)));
  }
  std::vector<double> errors(pixels.size());
  parallelFor(count, 1, [&](std::int64_t i) {
    const glm::ivec2 at = pixels[static_cast<std::size_t>(i)];
    glm::dvec3 color(0.0);
    const auto add = [&](const ReferenceHit& hit) {
      color += hit.transmittance * hit.alpha * (hit.base + hit.texture);
    };
    const glm::dvec3 direction = reference::rayDirection(camera, at.x + 0.5, at.y + 0.5);
    const double transmittance =
        kept > 0
            ? blendKeeping(scene, direction, kept, add)
            : reference::blend(scene, direction, [&](const reference::Splat&, const ReferenceHit& hit) { add(hit); });
    color = glm::clamp(color + transmittance * scene.background, 0.0, 1.0);
    for (int c = 0; c < 3; ++c) {
      const double difference = std::clamp(picture.at(at.x, at.y, c), 0.0f, 1.0f) - color[c];
      errors[static_cast<std::size_t>(i)] += difference * difference / 3.0;
    }
  });
  double sum = 0.0;
  for (const double error : errors) sum += error;
  return sum > 0.0 ? -10.0 * std::log10(sum / count) : std::numeric_limits<double>::infinity();
}

void report(const Options& options, const nlohmann::ordered_json& result) {
  std::printf("%s on %s\n", options.model.c_str(), result["device"].get<std::string>().c_str());
  std::printf("%s Gaussians, %d x %d px, %s, textures %s, %d frames\n", result["gaussians"].dump().c_str(),
              result["width"].get<int>(), result["height"].get<int>(), options.output.c_str(),
              result["textures"].get<std::string>().c_str(), options.frames);
  if (result.contains("pairs")) {
    std::printf("%s visible, %s pairs of tile and splat\n", result["visible"].dump().c_str(),
                result["pairs"].dump().c_str());
  }
  std::printf("%-16s %9.1f ms processor %9.1f ms wall\n", "frame (median)", result["processor_ms"].get<double>(),
              result["wall_ms"].get<double>());
  for (const auto& pass : result["passes"]) {
    std::printf("  %-14s %34.1f ms wall\n", pass["name"].get<std::string>().c_str(), pass["wall_ms"].get<double>());
  }
  if (result.contains("pixel_splats")) {
    const double rate = result["pixel_splats_per_second"].get<double>(), peak = result["peak"].get<double>();
    const double together = result["peak_together"].get<double>();
    std::printf(
        "%.1f M pixel-splats evaluated, %.3f G/s a core: %.0f %% of the loop's own %.3f G/s on one core,\n"
        "%.0f %% of its %.3f G/s a core on all\n",
        1e-6 * result["pixel_splats"].get<double>(), 1e-9 * rate, 100.0 * rate / peak, 1e-9 * peak,
        100.0 * rate / together, 1e-9 * together);
  }
  if (result.contains("psnr_db")) {
    std::printf("PSNR %.2f dB against the float64 reference at %d random pixels\n", result["psnr_db"].get<double>(),
                options.reference_pixels);
  }
  if (result.contains("psnr_same_order_db")) {
    std::printf("PSNR %.2f dB against it where it keeps back %u hits, too; the line above also holds what that costs\n",
                result["psnr_same_order_db"].get<double>(), kKeptPerPixel);
  }
}

void run(const Options& options) {
  const Output output = parse<Output>(options.output, "--output");
  Bundle loaded = readModel(options.model);
  const Camera camera = chooseCamera(options, loaded);
  if (!options.textures.empty()) {
    const auto [width, height] = parseSize(options.textures, "--textures");
    addTextures(loaded.model, width, height);
  }
  RenderSettings settings;
  settings.background = loaded.background;
  settings.outputs = {output};
  settings.textures = parse<TextureMode>(options.mode, "--mode");
  settings.order = parse<SplatOrder>(options.order, "--sort");
  if (!options.intersection.empty()) {
    settings.intersection = parse<IntersectionModel>(options.intersection, "--intersection");
  }

  nlohmann::ordered_json result;
  Times times;
  Image picture;
  std::string device_name;
  if (options.backend == "cpu") {
    const std::unique_ptr<Renderer> renderer = makeCpuRenderer();
    renderer->setModel(loaded.model);
    Frame frame;
    times = measure(*renderer, options.frames, [&] { frame = renderer->render(camera, settings); });
    picture = visualize(frame, output);
    device_name = renderer->deviceName();
  } else {
    const auto* api =
        std::find_if(std::begin(kApis), std::end(kApis), [&](Api a) { return options.backend == name(a); });
    if (api == std::end(kApis)) {
      usage("--backend: expected cpu, vulkan or opengl, found \"" + options.backend + "\"");
    }
    const std::unique_ptr<OpenDevice> device = openDevice(*api, {pickDevice(options.device), false});
    const std::unique_ptr<GpuRenderer> renderer = device->makeRenderer();
    renderer->setPrecision(options.exact ? ModelPrecision::exact : ModelPrecision::compact);
    renderer->setModel(loaded.model);
    times = measure(*renderer, options.frames, [&] {
      while (!renderer->draw({camera, settings, output})) {
      }
    });
    picture = renderer->picture();
    device_name = renderer->deviceName();
    const FrameCounts counts = renderer->counts();
    result["visible"] = counts.visible;
    result["pairs"] = counts.pairs;
  }

  result["model"] = options.model;
  result["device"] = device_name;
  result["backend"] = options.backend;
  result["gaussians"] = loaded.model.size();
  result["width"] = camera.size.x;
  result["height"] = camera.size.y;
  result["output"] = options.output;
  result["textures"] = loaded.model.texture_mode == TextureMode::none || settings.textures == TextureMode::none ? "off"
                       : options.textures.empty() ? "the model's"
                                                  : options.textures;
  result["processor_ms"] = median(times.processor);
  result["wall_ms"] = median(times.wall);
  result["processor_ms_of_frames"] = times.processor;
  result["wall_ms_of_frames"] = times.wall;
  result["passes"] = nlohmann::ordered_json::array();
  for (const auto& [name, milliseconds] : times.passes) {
    result["passes"].push_back({{"name", name}, {"wall_ms", median(milliseconds)}});
  }
  if (options.backend == "cpu" && output == Output::final && !options.frames_only) {
    const PictureRate rate = pictureRate(loaded.model, camera, settings, options.frames);
    result["pixel_splats"] = rate.pixel_splats;
    result["pixel_splats_per_second"] = rate.pixel_splats / rate.seconds;
    result["peak"] = picturePeak(result["textures"] != "off");
    result["peak_together"] = picturePeakTogether(result["textures"] != "off");
  }
  if (output == Output::final && options.reference_pixels > 0 && !options.frames_only) {
    result["psnr_db"] = psnrAtPixels(picture, loaded.model, camera, settings, options.reference_pixels);
    result["psnr_pixels"] = options.reference_pixels;
    if (settings.order == SplatOrder::perPixel && options.backend != "cpu") {
      result["psnr_same_order_db"] =
          psnrAtPixels(picture, loaded.model, camera, settings, options.reference_pixels, kKeptPerPixel);
    }
  }
  report(options, result);
  if (!options.picture.empty()) writeImage(options.picture, picture);
  if (!options.json.empty()) {
    std::ofstream file(options.json);
    file << result.dump(1) << "\n";
    if (!file) throw Error(ErrorKind::cannotWrite, options.json, "cannot write");
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Times frames of a renderer and compares the picture with the float64 reference");
  Options options;
  app.add_option("model", options.model, "any file that tgview opens")->required();
  app.add_option("--backend", options.backend, "cpu, vulkan or opengl");
  app.add_option("--device", options.device, "part of a device's name, or its number in tgview --list-devices");
  app.add_option("--cameras", options.cameras, "cameras.json (default: the model's, or MODEL.cameras.json beside it)");
  app.add_option("--camera", options.camera, "number of the camera");
  app.add_option("--size", options.size, "WIDTHxHEIGHT [px] (default: the camera's)");
  app.add_option("--frames", options.frames, "frames to time, after two that warm up")->check(within(1, 10000));
  app.add_option("--output", options.output, "the output to show, as tgview --show");
  app.add_option("--textures", options.textures, "give every Gaussian random RGBA textures of WIDTHxHEIGHT texels");
  app.add_flag("--exact", options.exact, "on a GPU, the model in full precision instead of the window's");
  app.add_option("--sort", options.order, "order of splats: global or per-pixel");
  app.add_option("--mode", options.mode, "texture terms to apply: none, alpha, rgb, rgba");
  app.add_option("--intersection", options.intersection, "plane or maxResponse (default: the model's)");
  app.add_option("--reference-pixels", options.reference_pixels, "pixels to compare with the reference, 0 = none")
      ->check(within(0, 10000000));
  app.add_flag("--frames-only", options.frames_only, "neither the reference nor the rate of the CPU renderer's loop");
  app.add_option("--threads", options.threads, "of the CPU renderer, 0 = all")->check(within(0, 1024));
  app.add_option("--json", options.json, "write the numbers to this file");
  app.add_option("--picture", options.picture, "write the picture to this file");
  CLI11_PARSE(app, argc, argv);
  setThreadCount(options.threads);
  try {
    run(options);
  } catch (const Error& error) {
    std::fprintf(stderr, "render_bench: %s\n", error.what());
    return exitCode(error);
  }
  return 0;
}

// SPDX-License-Identifier: Apache-2.0
// What moves in a picture that should not? A camera that zooms out, for the texture filter and screen antialiasing; a
// camera that turns, for the order of splats.
//
//     motion_bench MODEL.tgz [DATASET] [--frames 24] [--camera 0] [--farthest 8] [--turn 4]
//
// Zoom: the camera draws back from camera 0 along its axis until the model's mean depth there has grown `farthest`
// times. Truth is the average of 4 x 4 pictures' worth of rays, bilinear. `error` is the picture's distance to it,
// `flicker` that of the changes from frame to frame, both root mean square over pixels and frames in 1/255.
// Turn: the camera turns about its own centre by `turn` degrees in equal steps. `jumps` is the share of pixels that
// change by more than 16/255 in a step although they do not in the per-pixel order's own pictures, and the other way
// round for the per-pixel order against the global one.
// With a data set: PSNR against its test photographs. Processor time is that of the whole process, per frame.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "core/bundle/bundle.h"
#include "core/image/metrics.h"
#include "core/system/error.h"
#include "core/system/program.h"
#include "measure.h"
#include "render/renderer.h"
#include "training/data/dataset.h"
#include "training/score/evaluate.h"

namespace {

using namespace tg;

struct Options {
  std::string model, dataset;
  int frames = 24, camera = 0;
  double farthest = 8, turn = 4;
};

Image picture(Renderer& renderer, const Camera& camera, RenderSettings settings) {
  settings.outputs = {Output::final};
  Image image = extract(renderer.render(camera, settings), Output::final);
  clampToUnit(image);
  return image;
}

double squaredDifference(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) sum += (a.data[i] - b.data[i]) * (a.data[i] - b.data[i]);
  return sum / static_cast<double>(a.data.size());
}

// Of the changes b0 -> b1 and a0 -> a1.
double squaredFlicker(const Image& a0, const Image& a1, const Image& b0, const Image& b1) {
  double sum = 0;
  for (std::size_t i = 0; i < a0.data.size(); ++i) {
    const double d = (a1.data[i] - a0.data[i]) - (b1.data[i] - b0.data[i]);
    sum += d * d;
  }
  return sum / static_cast<double>(a0.data.size());
}

double meanDepth(Renderer& renderer, const Camera& camera) {
  RenderSettings settings;
  settings.outputs = {Output::depth};
  double sum = 0, count = 0;
  for (const float z : renderer.render(camera, settings).depth) {
    sum += z;
    count += z > 0.0f;
  }
  return count > 0 ? sum / count : 1.0;
}

Camera drawnBack(Camera camera, double distance) {
  camera.translation.z += distance;
  return camera;
}

Camera turned(Camera camera, double radians) {
  const glm::dvec3 eye = camera.position();
  const double c = std::cos(radians), s = std::sin(radians);
  const glm::dmat3 about_y(glm::dvec3(c, 0, -s), glm::dvec3(0, 1, 0), glm::dvec3(s, 0, c));
  camera.rotation = about_y * camera.rotation;
  camera.translation = -(camera.rotation * eye);
  return camera;
}

struct Choice {
  const char* name;
  TextureFilter filter;
  Antialiasing antialiasing;
};
constexpr Choice kChoices[] = {
    {"bilinear", TextureFilter::bilinear, Antialiasing::off},
    {"footprint", TextureFilter::footprint, Antialiasing::off},
    {"bilinear, screen", TextureFilter::bilinear, Antialiasing::screen},
    {"footprint, screen", TextureFilter::footprint, Antialiasing::screen},
};

RenderSettings settingsOf(const Choice& choice, glm::vec3 background) {
  RenderSettings settings;
  settings.background = background;
  settings.texture_filter = choice.filter;
  settings.antialiasing = choice.antialiasing;
  return settings;
}

void zoom(Renderer& renderer, const Camera& start, const Options& options, glm::vec3 background) {
  constexpr int kSupersampling = 4;
  RenderSettings plain;
  plain.background = background;
  const double depth = meanDepth(renderer, start);
  std::vector<Camera> cameras;
  std::vector<Image> truth;
  for (int i = 0; i < options.frames; ++i) {
    const double far = std::pow(options.farthest, static_cast<double>(i) / std::max(options.frames - 1, 1));
    cameras.push_back(drawnBack(start, depth * (far - 1.0)));
    const Camera fine = resized(cameras.back(), start.size.x * kSupersampling, start.size.y * kSupersampling);
    truth.push_back(downsample(picture(renderer, fine, plain), kSupersampling));
  }
  std::printf("zoom out %g x in %d frames of %d x %d: error, flicker [1/255], processor time\n", options.farthest,
              options.frames, start.size.x, start.size.y);
  for (const Choice& choice : kChoices) {
    double error = 0, flicker = 0, ms = 0;
    Image before;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const double begin = processorMilliseconds();
      Image image = picture(renderer, cameras[i], settingsOf(choice, background));
      ms += processorMilliseconds() - begin;
      error += squaredDifference(image, truth[i]);
      if (i > 0) flicker += squaredFlicker(before, image, truth[i - 1], truth[i]);
      before = std::move(image);
    }
    const auto count = static_cast<double>(cameras.size());
    std::printf("  %-18s %6.3f %6.3f %8.1f ms\n", choice.name, 255 * std::sqrt(error / count),
                255 * std::sqrt(flicker / std::max(count - 1, 1.0)), ms / count);
  }
}

// The pixels of `image`, seen by `from`, as `to` sees them: cameras at one place, whose rays correspond one to one.
// Bilinear; pixels that `from` does not see are left as `fallback` has them.
Image rotated(const Image& image, const Camera& from, const Camera& to, const Image& fallback) {
  const glm::dmat3 from_to = from.rotation * glm::transpose(to.rotation);
  Image out = fallback;
  for (int y = 0; y < to.size.y; ++y) {
    for (int x = 0; x < to.size.x; ++x) {
      const glm::dvec3 along = from_to * ray(to, {x + 0.5, y + 0.5});
      const glm::dvec2 pixel = project(from, along) - 0.5;
      const double u = pixel.x, v = pixel.y;
      if (!(along.z > 0 && u >= 0 && v >= 0 && u < from.size.x - 1 && v < from.size.y - 1)) continue;
      const int u0 = static_cast<int>(u), v0 = static_cast<int>(v);
      const auto fu = static_cast<float>(u - u0), fv = static_cast<float>(v - v0);
      for (int k = 0; k < 3; ++k) {
        const auto at = [&](int px, int py) {
          return image.data[(static_cast<std::size_t>(py) * image.width + px) * 3 + k];
        };
        out.data[(static_cast<std::size_t>(y) * to.size.x + x) * 3 + k] =
            glm::mix(glm::mix(at(u0, v0), at(u0 + 1, v0), fu), glm::mix(at(u0, v0 + 1), at(u0 + 1, v0 + 1), fu), fv);
      }
    }
  }
  return out;
}

// A turn about the camera's own centre moves every ray's colour to another pixel and changes none: what differs between
// a frame and the one before, turned likewise, popped. Averages of many rays, so that resampling does not count.
void turn(Renderer& renderer, const Camera& start, const Options& options, glm::vec3 background) {
  constexpr int kSupersampling = 8;
  constexpr double kPop = 4.0 / 255;
  std::printf("turn by %g degrees in %d frames: popping [1/255], pixels that pop by 4/255, processor time\n",
              options.turn, options.frames);
  for (const auto& [name, order] :
       {std::pair("global", SplatOrder::global), std::pair("per-pixel", SplatOrder::perPixel)}) {
    RenderSettings settings;
    settings.background = background;
    settings.order = order;
    double ms = 0, squares = 0, pops = 0, pixels = 0;
    Image before;
    Camera camera_before;
    for (int i = 0; i < options.frames; ++i) {
      const double radians = options.turn * std::acos(-1.0) / 180 * i / std::max(options.frames - 1, 1);
      const Camera camera = turned(start, radians);
      const double begin = processorMilliseconds();
      (void)picture(renderer, camera, settings);
      ms += processorMilliseconds() - begin;
      const Camera fine = resized(camera, start.size.x * kSupersampling, start.size.y * kSupersampling);
      Image image = picture(renderer, fine, settings);
      if (i > 0) {
        const Image now = downsample(image, kSupersampling);
        const Image then = downsample(rotated(before, camera_before, fine, image), kSupersampling);
        squares += squaredDifference(now, then);
        for (std::size_t pixel = 0; pixel < now.data.size() / 3; ++pixel) {
          double most = 0;
          for (std::size_t k = 3 * pixel; k < 3 * pixel + 3; ++k) {
            most = std::max(most, std::abs(static_cast<double>(now.data[k]) - then.data[k]));
          }
          pops += most > kPop;
          ++pixels;
        }
      }
      before = std::move(image);
      camera_before = fine;
    }
    std::printf("  %-18s %6.3f %8.4f %% %8.1f ms\n", name, 255 * std::sqrt(squares / (options.frames - 1)),
                100 * pops / std::max(pixels, 1.0), ms / options.frames);
  }
}

void photographs(Renderer& renderer, const Options& options, glm::vec3 background) {
  DatasetOptions data;
  data.background = background;
  data.only_test = true;
  const Dataset dataset = loadDataset(options.dataset, data);
  std::printf("%zu test photographs of %s: PSNR [dB]\n", dataset.views.size(), options.dataset.c_str());
  for (const Choice& choice : kChoices) {
    double sum = 0;
    for (std::size_t i = 0; i < dataset.views.size(); ++i) {
      sum += psnr(picture(renderer, dataset.views[i], settingsOf(choice, background)), dataset.pixels(i)->image());
    }
    std::printf("  %-18s %7.3f\n", choice.name, sum / static_cast<double>(dataset.views.size()));
  }
}

void run(const Options& options) {
  const Bundle bundle = readBundle(options.model);
  if (options.camera < 0 || static_cast<std::size_t>(options.camera) >= bundle.cameras.size()) {
    throw Error(ErrorKind::usage, options.model, "no camera " + std::to_string(options.camera));
  }
  const Camera& camera = bundle.cameras[static_cast<std::size_t>(options.camera)];
  const auto renderer = makeCpuRenderer();
  renderer->setModel(bundle.model);
  const glm::vec3 background = bundle.background;
  zoom(*renderer, camera, options, background);
  turn(*renderer, camera, options, background);
  if (!options.dataset.empty()) photographs(*renderer, options, background);
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  CLI::App app("What moves in a picture that should not?");
  app.add_option("model", options.model, "bundle with cameras")->required();
  app.add_option("dataset", options.dataset, "its photographs");
  app.add_option("--frames", options.frames, "of each motion")->check(within(2, 1000));
  app.add_option("--camera", options.camera, "of the bundle, where the motions start");
  app.add_option("--farthest", options.farthest, "growth of the mean depth")->check(within(1.0, 1e3));
  app.add_option("--turn", options.turn, "[degrees]");
  CLI11_PARSE(app, argc, argv);
  try {
    run(options);
  } catch (const Error& error) {
    std::fprintf(stderr, "motion_bench: %s\n", error.what());
    return exitCode(error);
  }
  return 0;
}

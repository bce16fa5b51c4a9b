// SPDX-License-Identifier: Apache-2.0
// Comparisons without a window.
#include "viewer/headless/headless.h"

#include <cstdio>
#include <utility>

#include "core/system/error.h"
#include "viewer/headless/renderer.h"
#include "viewer/picture/photographs.h"
#include "viewer/view/compare.h"
#include "viewer/view/legend.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

Image pictureOf(Renderer& renderer, const Scene& scene, const Camera& camera, const ViewOptions& options,
                glm::vec3 background) {
  const RenderSettings settings = settingsFor(options, background);
  renderer.setModel(scene.model);
  return visualize(renderer.render(camera, settings), options.show, settings);
}

// The view's photograph, and what it is called.
std::pair<ResampledPhotograph, std::string> photographOf(const ViewOptions& options, const Scene& scene,
                                                         const Camera& view, glm::vec3 background) {
  if (options.camera.empty() && scene.cameras.empty()) {
    throw Error(ErrorKind::usage, "--photos", options.model.string() + " has no cameras (expected --camera FILE.json)");
  }
  const Photographs photographs(options.photographs);
  ViewOptions as_taken = options;
  as_taken.size.reset();
  const Camera taken = cameraFor(as_taken, scene);
  const std::filesystem::path file = photographs.find(taken);
  if (file.empty()) {
    throw Error(ErrorKind::cannotRead, options.photographs.string(), "holds no photograph \"" + taken.name + "\"");
  }
  return {resampled(readImage(file), taken, view, background), file.filename().string()};
}

}  // namespace

void compareToFile(const ViewOptions& options) {
  const std::string extension = options.out.extension().string();
  if (extension != ".png" && extension != ".jpg") {
    throw Error(ErrorKind::usage, options.out.string(),
                "a comparison is a picture (expected .png or .jpg, found \"" + extension + "\")");
  }
  Comparison how;
  how.mode = options.compare_mode;
  how.gain = options.difference_gain;
  if (how.mode == CompareMode::off || how.mode == CompareMode::flicker) {
    throw Error(ErrorKind::usage, "--compare-mode",
                "expected side, wipe, difference or flip with --render, found \"" + std::string(name(how.mode)) + "\"");
  }

  const Scene scene = readScene(options);
  Camera camera = cameraFor(options, scene);
  if (how.mode == CompareMode::side) camera = fitted(camera, sideWidth(camera.size.x), camera.size.y);
  const glm::vec3 background = options.background.value_or(scene.background);

  const HeadlessRenderer backend = makeHeadlessRenderer(options);
  const Image first = pictureOf(*backend.renderer, scene, camera, options, background);
  Image other;
  std::vector<std::uint8_t> mask;
  std::string against = options.compare.string();
  if (!options.compare.empty()) {
    const Scene second = sceneOf(readModel(options.compare), options.compare);
    other = pictureOf(*backend.renderer, second, camera, options, background);
  } else {
    auto [photograph, file] = photographOf(options, scene, camera, background);
    other = std::move(photograph.image);
    mask = std::move(photograph.mask);
    against = file;
  }
  requireNoValidationMessages(backend);
  Image picture = composed(first, other, mask, how);
  if (options.legend) picture = withLegend(std::move(picture), *legendOf(how));
  writeImage(options.out, picture);
  const std::optional<PictureMetrics> metrics = metricsOf(first, other, mask);
  std::printf("%s: %dx%d, %s of %s, %s and %s: %s\n", options.out.c_str(), picture.width, picture.height,
              std::string(name(how.mode)).c_str(), std::string(name(options.show)).c_str(), options.model.c_str(),
              against.c_str(), metrics ? formatMetrics(*metrics).c_str() : "no pixel in common");
}

}  // namespace tg

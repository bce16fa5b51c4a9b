// SPDX-License-Identifier: Apache-2.0
// Comparisons without a window.
#include "viewer/headless/headless.h"

#include <array>
#include <cstdio>
#include <utility>

#include "core/image/drawn.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "render/visualize.h"
#include "viewer/headless/renderer.h"
#include "viewer/picture/photographs.h"
#include "viewer/view/compare.h"
#include "viewer/view/legend.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

Frame frameOf(Renderer& renderer, ViewedScene& viewed, const Camera& camera, const RenderSettings& settings) {
  renderer.setModel(viewed.modelFor(camera));
  return renderer.render(camera, settings);
}

// Each half of a picture of two beside each other has its camera fitted into it once; where nobody says how large it is
// to be, both are whole.
ViewOptions viewOf(const ViewOptions& options, CompareMode mode, const Scene& scene) {
  ViewOptions view = options;
  if (mode != CompareMode::side || !options.size) return view;
  const glm::ivec2 size = cameraFor(options, scene).size;
  view.size = glm::ivec2(sideWidth(size.x), size.y);
  return view;
}

// The view's photograph, and what it is called.
std::pair<ResampledPhotograph, std::string> photographOf(const ViewOptions& options, const Scene& scene,
                                                         const Camera& view, glm::vec3 background) {
  if (options.camera.empty() && scene.cameras.empty()) {
    throw Error(ErrorKind::usage, "--photos", options.model.string() + " has no cameras (expected --camera FILE.json)");
  }
  const Photographs photographs(options.photographs);
  if (photographs.haveLens() && !options.quiet) {
    std::fprintf(stderr, "%s\n", printable(options.photographs.string() + ": warning: " + kLensNote).c_str());
  }
  ViewOptions as_taken = options;
  as_taken.size.reset();
  const Camera taken = cameraFor(as_taken, scene);
  const std::filesystem::path file = photographs.find(taken);
  if (file.empty()) {
    throw Error(ErrorKind::cannotRead, options.photographs.string(), "holds no photograph \"" + taken.name + "\"");
  }
  return {resampled(readForComparison(file), taken, view, background), file.string()};
}

}  // namespace

void compareToFile(const ViewOptions& options) {
  const std::string extension = lowerExtension(options.out);
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

  ViewedScene viewed(options, options.model);
  const Scene& scene = viewed.scene();
  const Camera camera = cameraFor(viewOf(options, how.mode, scene), scene);
  const glm::vec3 background = options.background.value_or(scene.background);

  const HeadlessRenderer backend = makeHeadlessRenderer(options);
  const RenderSettings settings = settingsFor(options, background);
  const Frame frame = frameOf(*backend.renderer, viewed, camera, settings);
  Image first = visualize(frame, options.show, settings), other;
  std::vector<std::uint8_t> mask;
  std::string against = options.compare.string(), figures;
  const auto measure = [&](const Image& seen, const Image& reference) {
    if (options.quiet) return;
    const std::optional<PictureMetrics> metrics = metricsOf(seen, reference, mask);
    figures = metrics ? formatMetrics(*metrics) : "no pixel in common";
  };
  if (!options.compare.empty()) {
    ViewOptions unwarned = options;
    unwarned.quiet = true;
    ViewedScene second(unwarned, options.compare);
    const Frame second_frame = frameOf(*backend.renderer, second, camera, settings);
    if (kNumberOutputs.has(options.show)) {
      ValueScale scale;
      std::array<Image, 2> both = visualizeBoth(frame, second_frame, options.show, settings, scale);
      first = std::move(both[0]);
      other = std::move(both[1]);
    } else {
      other = visualize(second_frame, options.show, settings);
    }
    measure(first, other);
    if (kNumberOutputs.has(options.show)) figures += " of the colours";
  } else {
    auto [photograph, file] = photographOf(options, scene, camera, background);
    mask = std::move(photograph.mask);
    against = file;
    RenderSettings as_taken = settings;
    as_taken.exposure = 0;
    if (kPhotographOutputs.has(options.show)) measure(visualize(frame, options.show, as_taken), photograph.image);
    other = exposedLike(std::move(photograph.image), options.show, settings);
  }
  requireNoValidationMessages(backend);
  Image picture = composed(first, other, mask, how);
  if (options.legend) picture = withLegend(std::move(picture), *legendOf(how));
  writeDrawn(options.out, picture);
  if (options.quiet) return;
  std::printf("%s: %dx%d, %s of %s, %s and %s%s%s\n", options.out.c_str(), picture.width, picture.height,
              std::string(name(how.mode)).c_str(), std::string(name(options.show)).c_str(), options.model.c_str(),
              against.c_str(), figures.empty() ? "" : ": ", figures.c_str());
}

}  // namespace tg

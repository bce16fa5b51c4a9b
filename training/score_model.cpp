// SPDX-License-Identifier: Apache-2.0
// Files in, pictures out.
#include "training/score_model.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include "converter/registry/file_format.h"
#include "core/bundle/training_json.h"
#include "core/system/error.h"
#include "training/run/report.h"

namespace tg {

EvalScene readEvalScene(const std::string& path, bool quiet) {
  Bundle bundle = readModel(path);
  if (!quiet) {
    for (const std::string& warning : bundle.warnings) std::fprintf(stderr, "tgeval: %s\n", warning.c_str());
    if (wasInterrupted(bundle.training_json)) {
      std::fprintf(stderr, "tgeval: %s: %s\n", path.c_str(), kInterruptedTraining);
    }
  }
  EvalScene scene{std::make_shared<const GaussianModel>(std::move(bundle.model)),
                  bundle.background,
                  storedBytes(*findFormat(bundle.format), path),
                  {}};
  scene.knows_split = !bundle.training_json.empty();
  // Other formats round them.
  if (bundle.format == "tgz" && !wasForValidation(bundle.training_json)) scene.cameras = std::move(bundle.cameras);
  // What was trained elsewhere, or went through a format that lacks it, has a background that nobody chose; cameras are
  // lost on the same ways.
  if (bundle.format != "tgz" && bundle.cameras.empty()) scene.background.reset();
  return scene;
}

void warnOfOtherViews(const std::string& path, const EvalScene& scene, const Dataset& dataset) {
  if (scene.cameras.empty()) return;
  // Edited models' cameras move with them, by computation.
  constexpr double kSame = 1e-6;
  const auto same = [](const Camera& a, const Camera& b) {
    double turned = 0;
    for (int axis = 0; axis < 3; ++axis) turned += glm::distance(a.rotation[axis], b.rotation[axis]);
    return turned < kSame && glm::distance(a.translation, b.translation) < kSame * (1 + glm::length(a.translation));
  };
  const auto trained = [&](const Camera& view) {
    return std::ranges::find_if(scene.cameras, [&](const Camera& camera) { return same(camera, view); });
  };
  const auto held_out = [](const Camera& view) { return view.test; };
  const auto seen = std::ranges::count_if(dataset.views, [&](const Camera& view) {
    const auto camera = trained(view);
    return view.test && camera != scene.cameras.end() && !camera->test;
  });
  if (scene.knows_split && seen > 0) {
    std::fprintf(stderr, "tgeval: %s: was trained on %td of the %td test views (--test-every)\n", path.c_str(), seen,
                 std::ranges::count_if(dataset.views, held_out));
  }
  for (const Camera& view : dataset.views) {
    const auto camera = trained(view);
    if (camera == scene.cameras.end()) continue;
    if (camera->size != view.size) {
      std::fprintf(stderr,
                   "tgeval: %s: was trained on photographs of %d x %d, and is scored on %d x %d (--downscale)\n",
                   path.c_str(), camera->size.x, camera->size.y, view.size.x, view.size.y);
    }
    return;
  }
  std::fprintf(stderr, "tgeval: %s: none of its %zu cameras is among the views of %s: was it trained on others?\n",
               path.c_str(), scene.cameras.size(), dataset.name.c_str());
}

Dataset readEvalViews(const EvalOptions& options, const std::string& folder,
                      const std::optional<glm::vec3>& background) {
  DatasetOptions data = datasetOptions(options.data);
  if (data.random_background) {
    throw Error(ErrorKind::usage, "--background: scores need one colour (expected white, black or r,g,b)");
  }
  if (!data.background) data.background = background;
  if (options.split != "all") data.only_test = options.split == "test";
  ProgressLine line;
  if (!options.quiet) {
    data.decoded = [&](std::size_t done, std::size_t count) { line.show("decoding photographs", done, count); };
  }
  Dataset dataset = loadDataset(folder, data);
  printNotes(folder, dataset);
  if (dataset.views.empty()) {
    throw Error(ErrorKind::usage, dataset.name, "has no " + options.split + " views (try --split all)");
  }
  return dataset;
}

ScoreOptions scoreOptions(const EvalOptions& options, const std::optional<Lpips>& lpips) {
  return {true, options.pixels_per_degree, lpips ? &*lpips : nullptr, options.lpips_range};
}

EvalPictures::EvalPictures(const std::string& device, std::shared_ptr<const GaussianModel> model,
                           const RenderSettings& settings)
    : model_(std::move(model)), settings_(settings) {
  std::string ignored;
  cuda_ = openCuda(device, ignored);
  if (cuda_) {
    cuda_->setModel(*model_);
  } else {
    (void)cpu();
  }
}

Renderer& EvalPictures::cpu() {
  if (!cpu_) {
    cpu_ = makeCpuRenderer();
    cpu_->setModel(model_);
  }
  return *cpu_;
}

Image EvalPictures::draw(const Camera& camera) {
  settings_.outputs = {Output::final};
  Image picture = cuda_ ? imageOf(cuda_->forward(camera, settings_), camera)
                        : extract(cpu().render(camera, settings_), Output::final);
  clampToUnit(picture);
  return picture;
}

EvalPictures::Parts EvalPictures::drawParts(const Camera& camera) {
  settings_.outputs = {Output::base, Output::texture};
  const Frame frame = cpu().render(camera, settings_);
  Parts parts{extract(frame, Output::base), extract(frame, Output::texture)};
  clampToUnit(parts.base);
  clampToUnit(parts.texture);
  return parts;
}

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// Files in, pictures out.
#include "training/score_model.h"

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
    for (const std::string& warning : bundle.warnings) std::fprintf(stderr, "tgeval: %s\n", printable(warning).c_str());
    if (wasInterrupted(bundle.training_json)) {
      std::fprintf(stderr, "tgeval: %s: %s\n", printable(path).c_str(), kInterruptedTraining);
    }
  }
  EvalScene scene;
  scene.trained = trainedOn(bundle);
  scene.bytes = storedBytes(*findFormat(bundle.format), path);
  scene.model = std::make_shared<const GaussianModel>(std::move(bundle.model));
  return scene;
}

void warnOfOtherViews(const std::string& path, const EvalScene& scene, const Dataset& dataset) {
  for (const std::string& note :
       notesOnViews(scene.trained, dataset.name, dataset.normalized.has_value(), "--normalize", dataset.views)) {
    std::fprintf(stderr, "tgeval: %s\n", printable(path + ": " + note).c_str());
  }
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

// SPDX-License-Identifier: Apache-2.0
// What tgeval shares between one model and several: its options, a model with its background, the pictures it draws.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "render/renderer.h"
#include "training/cli.h"
#include "training/score/evaluate.h"
#include "training/score/trained_on.h"

namespace tg {

struct EvalOptions {
  std::string json, images, side_by_side;
  std::string lpips;
  LpipsRange lpips_range = LpipsRange::symmetric;
  std::string split = "test";
  std::string device = "cpu";
  RenderSettings render;
  double pixels_per_degree = kFlipPixelsPerDegree;
  int threads = 0;
  bool effective_rank = false;
  bool overwrite = false;
  bool quiet = false;                                               // neither tables nor progress
  bool talks() const { return !quiet && json != kStandardOutput; }  // on standard output
  DatasetFlags data;
  std::string blocks;  // folder of tgtrain split: how the seams are
  std::string whole;   // the same scene, trained unsplit

  std::string report;               // a folder; empty: none
  std::vector<std::string> labels;  // one a model, or none
  std::vector<std::string> crops;   // x,y,w,h or x,y,w,h@VIEW
  int found_crops = 3;              // a data set
};

struct EvalScene {
  std::shared_ptr<const GaussianModel> model;
  TrainedOn trained;
  std::uintmax_t bytes = 0;  // of the file
};
// Warnings go to stderr. Throws what readModel() throws.
EvalScene readEvalScene(const std::string& path, bool quiet);

// notesOnViews() of the model at `path`, on stderr.
void warnOfOtherViews(const std::string& path, const EvalScene& scene, const Dataset& dataset);

// The views of options.split and no others, over options.data.background or else `background`. Throws Error(usage)
// where there are none, and what loadDataset() throws.
Dataset readEvalViews(const EvalOptions& options, const std::string& folder,
                      const std::optional<glm::vec3>& background);
ScoreOptions scoreOptions(const EvalOptions& options, const std::optional<Lpips>& lpips);

// A model's pictures, drawn by the renderer that --device names. The model goes to it once.
class EvalPictures {
 public:
  EvalPictures(const std::string& device, std::shared_ptr<const GaussianModel> model, const RenderSettings& settings);
  std::string device() const { return cuda_ ? cuda_->deviceName() : cpu_->deviceName(); }
  Image draw(const Camera& camera);  // clamped to [0, 1], as the next
  // The base colour alone and the textures' alone, by the CPU.
  struct Parts {
    Image base, texture;
  };
  Parts drawParts(const Camera& camera);

 private:
  Renderer& cpu();

  std::shared_ptr<const GaussianModel> model_;
  std::unique_ptr<DifferentiableRenderer> cuda_;
  std::unique_ptr<Renderer> cpu_;
  RenderSettings settings_;
};

}  // namespace tg

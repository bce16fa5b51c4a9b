// SPDX-License-Identifier: Apache-2.0
// Model, cameras, preview and report in one bundle.
#include "training/run/trained_bundle.h"

#include <algorithm>
#include <memory>
#include <utility>

#include "core/system/assert.h"
#include "render/renderer.h"

namespace tg {
namespace {

constexpr int kPreviewSide = 512;  // [px]

}  // namespace

std::size_t previewView(const Dataset& dataset) {
  TG_ASSERT(!dataset.views.empty(), "the data set has a view");
  const std::vector<std::size_t> test = dataset.indices(true);
  return test.empty() ? 0 : test.front();
}

Bundle makeTrainedBundle(const Dataset& dataset, const TrainSettings& settings, const TrainReport& report,
                         GaussianModel model, const TrainingJsonOptions& options) {
  Camera camera = dataset.views[previewView(dataset)];
  const int side = std::max(camera.size.x, camera.size.y);
  if (side > kPreviewSide) {
    camera = resized(camera, std::max(1, camera.size.x * kPreviewSide / side),
                     std::max(1, camera.size.y * kPreviewSide / side));
  }
  Bundle bundle;
  const auto drawn = std::make_shared<GaussianModel>(std::move(model));
  {
    const std::unique_ptr<Renderer> renderer = makeCpuRenderer();
    renderer->setModel(drawn);
    RenderSettings how;
    how.background = dataset.background;
    how.outputs = {Output::final};
    bundle.preview = extract(renderer->render(camera, how), Output::final);
  }
  bundle.model = std::move(*drawn);
  bundle.background = dataset.background;
  bundle.cameras = dataset.views;
  bundle.training_json = formatTrainingJson(dataset, settings, report, bundle.model, options);
  return bundle;
}

}  // namespace tg

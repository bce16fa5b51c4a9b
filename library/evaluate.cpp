// SPDX-License-Identifier: Apache-2.0
// Scores, as tgeval takes them.
#include "textured_gaussians/evaluate.h"

#include "library/access.h"
#include "render/renderer.h"
#include "training/score/evaluate.h"

namespace textured_gaussians {
namespace {

ViewScore scoreOf(const tg::ViewScore& score) { return {score.name, score.psnr, score.ssim, score.flip}; }

}  // namespace

Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options) {
  return guarded([&] {
    const std::shared_ptr<const tg::Dataset> own = Access::dataset(dataset);
    const std::shared_ptr<const tg::Bundle> bundle = Access::bundle(model);
    const std::unique_ptr<tg::Renderer> renderer = tg::makeCpuRenderer();
    renderer->setModel({bundle, &bundle->model});
    tg::RenderSettings settings;
    settings.textures = modeOf(options.textures);
    settings.background = own->background;
    settings.outputs = {tg::Output::final};
    tg::ScoreOptions score_options;
    score_options.flip = options.flip;
    std::vector<tg::ViewScore> scores;
    for (std::size_t view = 0; view < own->views.size(); ++view) {
      const tg::Camera& camera = own->views[view];
      if (options.split != Split::all && camera.test != (options.split == Split::test)) continue;
      tg::Image picture = tg::extract(renderer->render(camera, settings), tg::Output::final);
      tg::clampToUnit(picture);
      scores.push_back(tg::scoreView(camera.name, *own->pixels(view), picture, score_options));
    }
    if (scores.empty()) throw tg::Error(tg::ErrorKind::usage, own->name, "has no photographs of this split");
    Evaluation evaluation;
    for (const tg::ViewScore& score : scores) evaluation.views.push_back(scoreOf(score));
    evaluation.mean = scoreOf(tg::meanView(scores));
    evaluation.mean.name.clear();
    return evaluation;
  });
}

}  // namespace textured_gaussians

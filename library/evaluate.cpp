// SPDX-License-Identifier: Apache-2.0
// Scores, as tgeval takes them.
#include "textured_gaussians/evaluate.h"

#include "library/access.h"
#include "render/renderer.h"
#include "training/score/evaluate.h"
#include "training/score/trained_on.h"

namespace textured_gaussians {
namespace {

ViewScore scoreOf(const tg::ViewScore& score) { return {score.name, score.psnr, score.ssim, score.flip}; }

}  // namespace

Evaluation evaluate(const Model& model, const Dataset& dataset, const EvaluateOptions& options) {
  const std::shared_ptr<const tg::Dataset> own = Access::dataset(dataset);
  const std::shared_ptr<const tg::Bundle> bundle = Access::bundle(model);
  std::unique_ptr<tg::Renderer> renderer;
  tg::RenderSettings settings;
  tg::ScoreOptions score_options;
  std::vector<std::size_t> chosen;
  Evaluation evaluation;
  guarded([&] {
    renderer = tg::makeCpuRenderer();
    renderer->setModel({bundle, &bundle->model});
    settings.textures = modeOf(options.textures);
    const auto split = enumOf<Split>(options.split, Split::all, "split");
    const tg::TrainedOn trained = tg::trainedOn(*bundle);
    settings.background = own->background;
    if (trained.background && !Access::choseBackground(dataset)) settings.background = *trained.background;
    evaluation.background = colorOf(settings.background);
    settings.outputs = {tg::Output::final};
    score_options.flip = options.flip;
    for (std::size_t view = 0; view < own->views.size(); ++view) {
      if (split == Split::all || own->views[view].test == (split == Split::test)) chosen.push_back(view);
    }
    if (chosen.empty()) throw tg::Error(tg::ErrorKind::usage, own->name, "has no photographs of this split");
    std::vector<tg::Camera> views;
    for (const std::size_t view : chosen) views.push_back(own->views[view]);
    evaluation.warnings = tg::notesOnViews(trained, own->name, own->normalized.has_value(), "normalize", views);
  });
  std::vector<tg::ViewScore> scores;
  for (const std::size_t view : chosen) {
    guarded([&] {
      const tg::Camera& camera = own->views[view];
      tg::Image picture = tg::extract(renderer->render(camera, settings), tg::Output::final);
      tg::clampToUnit(picture);
      scores.push_back(tg::scoreView(camera.name, *own->reloaded(view, settings.background), picture, score_options));
    });
    if (options.progress) options.progress(scores.size(), chosen.size());  // what it throws is the caller's own
  }
  for (const tg::ViewScore& score : scores) evaluation.views.push_back(scoreOf(score));
  evaluation.mean = scoreOf(tg::meanView(scores));
  evaluation.mean.name.clear();
  return evaluation;
}

}  // namespace textured_gaussians

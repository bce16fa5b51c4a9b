// SPDX-License-Identifier: Apache-2.0
// --render: model in, one image out.
#include "viewer/headless/headless.h"

#include <cstdio>
#include <memory>

#include "core/image/drawn.h"
#include "core/system/error.h"
#include "core/system/lower_case.h"
#include "viewer/headless/renderer.h"
#include "viewer/model/follower.h"
#include "viewer/view/shot.h"

namespace tg {
namespace {

// Before any work: a wrong name must not cost a rendering. True for numbers, false for a picture.
bool writesNumbers(const std::filesystem::path& path) {
  const std::string extension = lowerExtension(path);
  if (extension == ".exr") return true;
  if (extension == ".png" || extension == ".jpg") return false;
  throw Error(ErrorKind::usage, path.string(),
              "unknown image format (expected .png, .jpg or .exr, found \"" + extension + "\")");
}

void render(const Scene& scene, const Camera& camera, const std::shared_ptr<const GaussianModel>& model,
            const ViewOptions& options, bool numbers, const HeadlessRenderer& backend) {
  const RenderSettings settings = settingsFor(options, scene.background);

  backend.renderer->setModel(model);
  const Frame frame = backend.renderer->render(camera, settings);
  requireNoValidationMessages(backend);
  writeDrawn(options.out, numbers ? extract(frame, options.show) : shownPicture(frame, options, settings));

  if (options.quiet) return;
  double milliseconds = 0;
  for (const PassTime& pass : backend.renderer->passTimes()) milliseconds += pass.milliseconds;
  std::printf("%s: %dx%d, %s, textures %s, %zu Gaussians, %.1f ms on %s%s\n", options.out.c_str(), frame.width,
              frame.height, std::string(name(options.show)).c_str(), drawnTextures(*model, settings).c_str(),
              model->size(), milliseconds, backend.renderer->deviceName().c_str(),
              options.follow && !scene.training.empty() ? (", " + scene.training).c_str() : "");
}

// Every model that comes, until one is the last of its training.
void followToFile(const ViewOptions& options, bool numbers) {
  ModelFollower follower(options.model, [] {});
  const HeadlessRenderer backend = makeHeadlessRenderer(options);
  for (;;) {
    ModelFollower::News news = follower.wait();
    const bool said = !news.problem.empty() && !(options.quiet && news.missing);
    if (said) std::fprintf(stderr, "tgview: %s\n", news.problem.c_str());
    if (!news.model) continue;
    const bool finished = trainingProgress(news.model->training_json).finished;
    const Scene scene = sceneFor(options, std::move(*news.model));
    render(scene, cameraFor(options, scene), scene.model, options, numbers, backend);
    std::fflush(stdout);
    if (finished) return;
  }
}

}  // namespace

void renderToFile(const ViewOptions& options) {
  const bool numbers = writesNumbers(options.out);
  if (options.follow) return followToFile(options, numbers);
  ViewedScene viewed(options, options.model);
  const Camera camera = cameraFor(options, viewed.scene());
  render(viewed.scene(), camera, viewed.modelFor(camera), options, numbers, makeHeadlessRenderer(options));
}

}  // namespace tg

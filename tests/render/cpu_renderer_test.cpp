// SPDX-License-Identifier: Apache-2.0
// The CPU renderer against the float64 reference.
#include <hwy/targets.h>

#include "core/error.h"
#include "core/parallel.h"
#include "render/reference/reference.h"
#include "render/renderer.h"
#include "support/catch.h"
#include "support/compare.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

Frame renderCpu(const TestScene& scene, const RenderSettings& settings) {
  const auto renderer = makeCpuRenderer();
  renderer->setModel(scene.model);
  return renderer->render(scene.camera, settings);
}

void checkAgainstReference(SceneKind kind, const TestScene& scene, const RenderSettings& settings) {
  const Tolerance allowed = tolerance(kind, *settings.intersection);
  const auto reference = renderReference(ReferenceModel(scene.model), scene.camera, settings);
  const FrameDifference difference = compareFrames(renderCpu(scene, settings), reference, allowed);
  INFO(name(kind) << ", " << name(*settings.intersection) << ", textures " << name(settings.textures) << "\n"
                  << report(difference));
  CHECK(violations(difference, allowed) == "");
}

}  // namespace

TEST_CASE("every output equals the reference's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      checkAgainstReference(kind, makeScene(kind, 1), settings);
    }
  }
}

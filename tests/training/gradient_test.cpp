// SPDX-License-Identifier: Apache-2.0
// The CPU's gradients against the float64 reference, and that they do not depend on the number of threads.
#include "training/gradient.h"

#include <cstring>

#include "core/parallel.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

// A loss that weighs every pixel and channel by another number: L = sum v_color . picture.
std::vector<glm::dvec3> randomWeights(const Camera& camera, unsigned seed) {
  Random random(seed);
  std::vector<glm::dvec3> weights(static_cast<std::size_t>(camera.width) * camera.height);
  for (auto& w : weights) w = glm::dvec3(glm::vec3(random.uniformVec3(-1.0, 1.0)));
  return weights;
}

ModelGradient gradientCpu(const GaussianModel& model, const Camera& camera, const RenderSettings& settings,
                          const std::vector<glm::dvec3>& weights) {
  const auto renderer = makeCpuDifferentiableRenderer();
  renderer->forward(model, camera, settings);
  ModelGradient gradient;
  const std::vector<glm::vec3> v_color(weights.begin(), weights.end());
  renderer->backward(v_color, gradient);
  return gradient;
}

// |a - b| / |b| over all components of two arrays.
template <typename A, typename B>
double relativeError(const std::vector<A>& a, const std::vector<B>& b) {
  REQUIRE(a.size() == b.size());
  double difference = 0.0, size = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if constexpr (std::is_arithmetic_v<A>) {
      difference += (a[i] - b[i]) * (a[i] - b[i]);
      size += b[i] * b[i];
    } else {
      const B d = B(a[i]) - b[i];
      difference += glm::dot(d, d);
      size += glm::dot(b[i], b[i]);
    }
  }
  return size > 0.0 ? std::sqrt(difference / size) : std::sqrt(difference);
}

struct BlockErrors {
  double mean, rotation, log_scale, opacity_logit, sh, texels, screen, screen_abs;
};
BlockErrors compare(const ModelGradient& g, const ReferenceGradient& r) {
  std::vector<double> screen;
  for (const auto& e : r.screen) screen.push_back(glm::length(e));
  return {relativeError(g.v_mean, r.mean),
          relativeError(g.v_rotation, r.rotation),
          relativeError(g.v_log_scale, r.log_scale),
          relativeError(g.v_opacity_logit, r.opacity_logit),
          relativeError(g.v_sh, r.sh),
          relativeError(g.v_texels, r.texels),
          relativeError(g.screen_gradient, screen),
          relativeError(g.screen_gradient_abs, r.screen_abs)};
}

}  // namespace

TEST_CASE("gradients equal the reference's on every kind of scene, in both models") {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      const TestScene scene = makeScene(kind, 1);
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      const auto weights = randomWeights(scene.camera, 2);
      const auto g = gradientCpu(scene.model, scene.camera, settings, weights);
      const auto r = backwardReference(ReferenceModel(scene.model), scene.camera, settings, weights);
      const BlockErrors e = compare(g, r);
      INFO(name(kind) << ", " << name(intersection));
      CHECK(e.mean < 1e-4);
      CHECK(e.rotation < 1e-4);
      CHECK(e.log_scale < 1e-4);
      CHECK(e.opacity_logit < 1e-4);
      CHECK(e.sh < 1e-4);
      CHECK(e.texels < 1e-4);
      CHECK(e.screen < 1e-4);
      CHECK(e.screen_abs < 1e-4);
    }
  }
}

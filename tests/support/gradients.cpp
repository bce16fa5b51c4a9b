// SPDX-License-Identifier: Apache-2.0
// Runs both and compares every array.
#include "support/gradients.h"

#include <cmath>
#include <cstring>
#include <type_traits>

#include "support/catch.h"
#include "support/scenes.h"

namespace tg::test {
namespace {

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

template <typename T>
bool same(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

}  // namespace

std::vector<glm::dvec3> randomWeights(const Camera& camera, unsigned seed) {
  Random random(seed);
  std::vector<glm::dvec3> weights(static_cast<std::size_t>(camera.size.x) * camera.size.y);
  for (auto& w : weights) w = glm::dvec3(glm::vec3(random.uniformVec3(-1.0, 1.0)));
  return weights;
}

ModelGradient gradientOf(DifferentiableRenderer& renderer, const GaussianModel& model, const Camera& camera,
                         const RenderSettings& settings, const std::vector<glm::dvec3>& weights,
                         const GradientOptions& options) {
  renderer.forward(model, camera, settings);
  ModelGradient gradient;
  renderer.backward(std::vector<glm::vec3>(weights.begin(), weights.end()), gradient, options);
  return gradient;
}

BlockErrors compare(const ModelGradient& g, const ReferenceGradient& r) {
  std::vector<double> screen;
  for (const auto& e : r.screen) screen.push_back(glm::length(e));
  BlockErrors errors;
  forEachParameter([](const Field&, double& error, const auto& a, const auto& b) { error = relativeError(a, b); },
                   errors, g, r);
  errors.screen = relativeError(g.screen_gradient, screen);
  errors.screen_abs = relativeError(g.screen_gradient_abs, r.screen_abs);
  return errors;
}

void checkAgainstReference(const ModelGradient& gradient, const GaussianModel& model, const Camera& camera,
                           const RenderSettings& settings, const std::vector<glm::dvec3>& weights,
                           const ReferenceOptions& options, double allowed) {
  const BlockErrors e = compare(gradient, backwardReference(ReferenceModel(model), camera, settings, weights, options));
  forEachParameter(
      [&](const Field& field, double error) {
        INFO(field.name);
        CHECK(error < allowed);
      },
      e);
  CHECK(e.screen < allowed);
  CHECK(e.screen_abs < allowed);
}

namespace {

void checkRenderer(DifferentiableRenderer& renderer, const TestScene& scene, const RenderSettings& settings,
                   double allowed = 1e-4) {
  const auto weights = randomWeights(scene.camera, 2);
  checkAgainstReference(gradientOf(renderer, scene.model, scene.camera, settings, weights), scene.model, scene.camera,
                        settings, weights, {}, allowed);
}

}  // namespace

void checkEveryScene(MakeRenderer make) {
  for (const SceneKind kind : kSceneKinds) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      RenderSettings settings;
      settings.intersection = intersection;
      settings.background = {0.3f, 0.1f, 0.8f};
      INFO(name(kind) << ", " << name(intersection));
      checkRenderer(*make(), makeScene(kind, 1), settings);
    }
  }
}

void checkEveryTextureMode(MakeRenderer make) {
  const TestScene scene = makeScene(SceneKind::mixed, 2);
  for (const auto mode : {TextureMode::none, TextureMode::alpha, TextureMode::rgb, TextureMode::rgba}) {
    RenderSettings settings;
    settings.textures = mode;
    INFO(name(mode));
    checkRenderer(*make(), scene, settings);
  }
}

void checkClippedTextures(MakeRenderer make) {
  for (const SceneKind kind : {SceneKind::edgeOn, SceneKind::flat, SceneKind::oddTextures, SceneKind::mixed}) {
    for (const auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      TestScene scene = makeScene(kind, 1);
      RenderSettings settings;
      settings.intersection = intersection;
      scene.model.outside = TextureOutside::clip;
      INFO(name(kind) << ", " << name(intersection));
      checkRenderer(*make(), scene, settings);
    }
  }
}

void checkRaysInPlane(MakeRenderer make) {
  for (const int side : {0, 4, 8}) {
    INFO(side);
    checkRenderer(*make(), raysInPlaneScene(side), {}, 5e-2);
  }
}

bool sameBytes(const ModelGradient& a, const ModelGradient& b) {
  bool equal = same(a.screen_gradient, b.screen_gradient) && same(a.screen_gradient_abs, b.screen_gradient_abs) &&
               same(a.screen_radius, b.screen_radius);
  forEachParameter([&](const Field&, const auto& x, const auto& y) { equal = equal && same(x, y); }, a, b);
  return equal;
}

}  // namespace tg::test

// SPDX-License-Identifier: Apache-2.0
// The reference's analytic gradient against central differences of its own forward pass, for every parameter.
#include <cmath>
#include <utility>

#include "core/system/parallel.h"
#include "render/reference/reference.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

constexpr int kSide = 14;
constexpr ReferenceOptions kSmooth{.cutoffs = false};  // the cuts are steps, and steps have no derivative

Camera smallCamera() {
  Camera camera = lookAt({0.3, -0.2, -4.0}, {0.0, 0.1, 0.0}, {0.1, -1.0, 0.0}, 0.6, kSide, kSide);
  camera.focal.x *= 1.1;
  camera.center.x += 0.4;
  return camera;
}

// Six textured splats that overlap, textures of several shapes.
ReferenceModel smallModel(TextureMode mode, IntersectionModel intersection) {
  ReferenceModel model;
  model.sh_degree = 3;
  model.texture_mode = mode;
  model.intersection = intersection;
  Random random(3);
  constexpr std::uint16_t kSizes[6][2] = {{4, 4}, {3, 5}, {1, 1}, {2, 7}, {1, 4}, {0, 0}};
  for (const auto& size : kSizes) {
    model.mean.push_back(random.uniformVec3(-0.6, 0.6));
    model.rotation.push_back(random.quaternion() * random.uniform(0.5, 2.0));
    model.log_scale.push_back(glm::log(random.uniformVec3(0.15, 0.7)));
    model.opacity_logit.push_back(random.uniform(-1.5, 1.5));
    for (int k = 0; k < 16; ++k) model.sh.push_back(random.uniformVec3(-0.3, 0.3) + (k == 0 ? 0.3 : 0.0));
    model.rects.push_back({static_cast<std::uint32_t>(model.texels.size()), size[0], size[1]});
    for (int k = 0; k < size[0] * size[1]; ++k) {
      const glm::dvec3 rgb = random.uniformVec3(-0.3, 0.3);
      model.texels.push_back(glm::dvec4(rgb, random.uniform(0.2, 1.0)));
    }
  }
  return model;
}

RenderSettings grey() {
  RenderSettings settings;
  settings.background = {0.3f, 0.5f, 0.7f};
  return settings;
}

std::vector<glm::dvec3> randomPictureGradient(std::size_t pixels) {
  Random random(5);
  std::vector<glm::dvec3> v_color(pixels);
  for (glm::dvec3& v : v_color) v = random.uniformVec3(-1.0, 1.0);
  return v_color;
}

double loss(const ReferenceModel& model, const Camera& camera, const std::vector<glm::dvec3>& v_color) {
  const auto frame = renderReference(model, camera, grey(), kSmooth);
  double sum = 0.0;
  for (std::size_t i = 0; i < v_color.size(); ++i) sum += glm::dot(v_color[i], frame.color(i));
  return sum;
}

// Largest difference between `gradient` and central differences over all `count` numbers that start at `values`,
// relative to the largest gradient of this kind of parameter.
double worstRelativeError(ReferenceModel& model, double* values, const double* gradient, std::size_t count,
                          const Camera& camera, const std::vector<glm::dvec3>& v_color) {
  constexpr double h = 1e-7;  // a splat seen edge-on in the plane model has third derivatives of 1e7
  double worst = 0.0, largest = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double value = values[i];
    values[i] = value + h;
    const double above = loss(model, camera, v_color);
    values[i] = value - h;
    const double below = loss(model, camera, v_color);
    values[i] = value;
    worst = std::max(worst, std::abs((above - below) / (2 * h) - gradient[i]));
    largest = std::max(largest, std::abs(gradient[i]));
  }
  return largest > 0.0 ? worst / largest : worst;
}

}  // namespace

TEST_CASE("analytic gradients match central differences for every parameter, mode and intersection") {
  const Camera camera = smallCamera();
  const auto v_color = randomPictureGradient(kSide * kSide);
  for (auto intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
    for (auto [mode, outside] :
         {std::pair{TextureMode::none, TextureOutside::base}, std::pair{TextureMode::alpha, TextureOutside::base},
          std::pair{TextureMode::rgb, TextureOutside::base}, std::pair{TextureMode::rgba, TextureOutside::base},
          std::pair{TextureMode::rgba, TextureOutside::clip}}) {
      ReferenceModel model = smallModel(mode, intersection);
      model.outside = outside;
      const auto g = backwardReference(model, camera, grey(), v_color, kSmooth);
      const auto error = [&](auto& values, const auto& gradient) {
        REQUIRE(values.size() == gradient.size());
        const std::size_t components = sizeof(values[0]) / sizeof(double);
        return worstRelativeError(model, reinterpret_cast<double*>(values.data()),
                                  reinterpret_cast<const double*>(gradient.data()), values.size() * components, camera,
                                  v_color);
      };
      INFO(name(intersection) << ", " << name(mode) << ", " << name(outside));
      CHECK(error(model.mean, g.mean) < 1e-6);
      CHECK(error(model.rotation, g.rotation) < 1e-6);
      CHECK(error(model.log_scale, g.log_scale) < 1e-6);
      CHECK(error(model.opacity_logit, g.opacity_logit) < 1e-6);
      CHECK(error(model.sh, g.sh) < 1e-6);
      CHECK(error(model.texels, g.texels) < 1e-6);
    }
  }
}

TEST_CASE("a mode without a term gives its texels no gradient") {
  const auto v_color = randomPictureGradient(kSide * kSide);
  for (auto mode : {TextureMode::none, TextureMode::alpha, TextureMode::rgb}) {
    const auto g = backwardReference(smallModel(mode, IntersectionModel::maxResponse), smallCamera(), grey(), v_color);
    double rgb = 0, alpha = 0;
    for (const glm::dvec4& texel : g.texels) {
      rgb = std::max(rgb, glm::length(glm::dvec3(texel)));
      alpha = std::max(alpha, std::abs(texel.a));
    }
    CHECK((rgb > 0) == (mode == TextureMode::rgb));
    CHECK((alpha > 0) == (mode == TextureMode::alpha));
  }
}

TEST_CASE("the screen gradient is the mean's gradient through the projection alone") {
  // Without view-dependent colour all of the mean's gradient is geometric.
  ReferenceModel model = smallModel(TextureMode::rgba, IntersectionModel::maxResponse);
  const Camera camera = smallCamera();
  for (std::size_t i = 0; i < model.size(); ++i) model.sh[i] = model.sh[i * 16];
  model.sh.resize(model.size());
  model.sh_degree = 0;
  const auto g = backwardReference(model, camera, grey(), randomPictureGradient(kSide * kSide));
  for (std::size_t i = 0; i < model.size(); ++i) {
    const glm::dvec3 v_mean_c = camera.rotation * g.mean[i];
    const double z = (camera.rotation * model.mean[i] + camera.translation).z;
    CHECK(g.screen[i].x == Approx(v_mean_c.x * z / camera.focal.x * kSide / 2).epsilon(1e-10));
    CHECK(g.screen[i].y == Approx(v_mean_c.y * z / camera.focal.y * kSide / 2).epsilon(1e-10));
    CHECK(g.screen_abs[i] > glm::length(g.screen[i]));
  }
}

TEST_CASE("there is no gradient where textures go on with their border") {
  const test::TestScene scene = test::makeScene(test::SceneKind::ordinary, 5, 10, 8, 6);
  ReferenceModel model(scene.model);
  model.outside = TextureOutside::edge;
  const std::vector<glm::dvec3> v_color(48);
  CHECK_THROWS_WITH(backwardReference(model, scene.camera, {}, v_color),
                    "outside edge: not supported by the backward pass");
}

TEST_CASE("frames and gradients are the same bytes for any number of threads") {
  const TestScene scene = makeScene(SceneKind::mixed, 4, 60, 24, 20);
  const ReferenceModel model(scene.model);
  const auto v_color = randomPictureGradient(24 * 20);
  setThreadCount(1);
  const auto frame = renderReference(model, scene.camera, grey());
  const auto gradient = backwardReference(model, scene.camera, grey(), v_color);
  for (int threads : {2, 3, 7}) {
    setThreadCount(threads);
    const auto other = renderReference(model, scene.camera, grey());
    const auto other_gradient = backwardReference(model, scene.camera, grey(), v_color);
    CHECK(frame.base == other.base);
    CHECK(frame.depth == other.depth);
    CHECK(gradient.mean == other_gradient.mean);
    CHECK(gradient.rotation == other_gradient.rotation);
    CHECK(gradient.sh == other_gradient.sh);
    CHECK(gradient.texels == other_gradient.texels);
    CHECK(gradient.screen_abs == other_gradient.screen_abs);
  }
  setThreadCount(0);
}

// SPDX-License-Identifier: Apache-2.0
// Pixel sizes against cameras by hand, effective parameters by formula, their gradient by finite differences.
#include "training/step/filter_3d.h"

#include <cmath>

#include "support/catch.h"

namespace {

tg::Camera cameraAt(double z, double focal) {
  tg::Camera camera;
  camera.size = {100, 50};
  camera.focal.x = camera.focal.y = focal;
  camera.center = {50, 25};
  camera.translation = {0, 0, z};  // the world's origin lies z before it
  return camera;
}

tg::Dataset twoViews() {
  tg::Dataset dataset;
  dataset.views.resize(3);
  dataset.views[0] = cameraAt(4, 100);
  dataset.views[1] = cameraAt(6, 300);
  dataset.views[2] = cameraAt(1, 1000);  // held out: does not count
  dataset.views[2].test = true;
  return dataset;
}

tg::GaussianModel oneGaussian() {
  tg::GaussianModel model;
  model.mean = {{0, 0, 0}};
  model.rotation = {{1, 0, 0, 0}};
  model.log_scale = {{std::log(0.02f), std::log(0.001f), std::log(0.03f)}};
  model.opacity_logit = {0.4f};
  return model;
}

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

}  // namespace

TEST_CASE("the pixel size is that of the training view that sees the Gaussian largest", "[filter3d]") {
  tg::GaussianModel model;
  model.mean = {{0, 0, 0}, {0, 0, -5}, {2.1f, 0, 0}, {0, 0, -100}};
  const std::vector<float> sizes = tg::pixelSizes(tg::filterCameras(twoViews()), model);
  CHECK(sizes[0] == Approx(6.0 / 300));
  CHECK(sizes[1] == Approx(1.0 / 300));  // behind the first
  CHECK(sizes[2] == Approx(4.0 / 100));  // 2.1 / 6 * 300 px leaves the second by more than 15 %
  CHECK(sizes[3] == Approx(4.0 / 100));  // nobody sees it: the largest of the others
  CHECK(tg::minSigmas(tg::filterCameras(twoViews()), model)[0] == Approx(std::sqrt(0.2) * 6.0 / 300));
}

TEST_CASE("effective sigmas add variances, opacity pays on the texture axes only", "[filter3d]") {
  const tg::GaussianModel model = oneGaussian();
  tg::EffectiveParameters effective;
  const float f[] = {0.01f};
  tg::applyFilter(model, f, effective);
  CHECK(std::exp(effective.log_scale[0].x) == Approx(std::hypot(0.02, 0.01)));
  CHECK(std::exp(effective.log_scale[0].y) == Approx(std::hypot(0.001, 0.01)));
  CHECK(std::exp(effective.log_scale[0].z) == Approx(std::hypot(0.03, 0.01)));
  const double factor = 0.02 / std::hypot(0.02, 0.01) * 0.03 / std::hypot(0.03, 0.01);
  CHECK(sigmoid(effective.opacity_logit[0]) == Approx(sigmoid(0.4) * factor));
}

TEST_CASE("a vanishing filter changes nothing, and an extreme one stays finite", "[filter3d]") {
  tg::GaussianModel model = oneGaussian();
  tg::EffectiveParameters effective;
  const float none[] = {0.0f};
  tg::applyFilter(model, none, effective);
  CHECK(effective.log_scale[0] == model.log_scale[0]);
  CHECK(effective.opacity_logit[0] == Approx(model.opacity_logit[0]));
  model.log_scale[0] = glm::vec3(-80.0f);
  const float wide[] = {1e3f};
  tg::applyFilter(model, wide, effective);
  CHECK(std::isfinite(effective.log_scale[0].x));
  CHECK(std::isfinite(effective.opacity_logit[0]));
}

TEST_CASE("the filter's gradient agrees with finite differences", "[filter3d]") {
  const tg::GaussianModel model = oneGaussian();
  const float f[] = {0.012f};
  const glm::vec3 v_scale(0.7f, -1.1f, 0.4f);
  const float v_opacity = 0.9f;
  // Any function of the effective parameters: here linear, in doubles.
  const auto loss = [&](const tg::GaussianModel& at) {
    tg::EffectiveParameters effective;
    tg::applyFilter(at, f, effective);
    return glm::dot(glm::dvec3(v_scale), glm::dvec3(effective.log_scale[0])) +
           double{v_opacity} * effective.opacity_logit[0];
  };
  tg::ModelGradient gradient;
  gradient.log_scale = {v_scale};
  gradient.opacity_logit = {v_opacity};
  tg::filterGradient(model, f, gradient);
  constexpr float kStep = 1.0f / 64;
  for (const int axis : {0, 1, 2}) {
    tg::GaussianModel up = model, down = model;
    up.log_scale[0][axis] += kStep;
    down.log_scale[0][axis] -= kStep;
    CHECK(gradient.log_scale[0][axis] == Approx((loss(up) - loss(down)) / (2 * kStep)).epsilon(2e-3).margin(1e-4));
  }
  tg::GaussianModel up = model, down = model;
  up.opacity_logit[0] += kStep;
  down.opacity_logit[0] -= kStep;
  CHECK(gradient.opacity_logit[0] == Approx((loss(up) - loss(down)) / (2 * kStep)).epsilon(2e-3));
}

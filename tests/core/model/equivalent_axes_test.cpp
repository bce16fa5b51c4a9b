// SPDX-License-Identifier: Apache-2.0
// What renaming a Gaussian's axes leaves as it was, and how near it brings rotations.
#include "core/model/equivalent_axes.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "core/model/verbs.h"
#include "core/system/random.h"
#include "support/catch.h"

using namespace tg;

namespace {

GaussianModel randomModel(std::size_t count) {
  Random random(5);
  GaussianModel model;
  for (std::size_t i = 0; i < count; ++i) {
    model.mean.push_back(glm::vec3(0));
    model.rotation.push_back(glm::vec4(random.normal(), random.normal(), random.normal(), random.normal()));
    model.log_scale.push_back(glm::vec3(random.normal(), random.normal(), random.normal()));
    model.opacity_logit.push_back(0.5f);
    model.sh.push_back(glm::vec3(0.1f));
  }
  return model;
}

glm::dmat3 covarianceOf(const GaussianModel& model, std::size_t i) {
  const glm::vec4 q = model.rotation[i];
  const glm::dmat3 axes = glm::mat3_cast(glm::normalize(glm::dquat(q.x, q.y, q.z, q.w)));
  const glm::dvec3 scale = glm::exp(glm::dvec3(model.log_scale[i]));
  const glm::dmat3 half(axes[0] * scale.x, axes[1] * scale.y, axes[2] * scale.z);
  return half * glm::transpose(half);
}

double nearness(glm::vec4 a, glm::vec4 b) {
  return std::abs(glm::dot(glm::normalize(glm::dvec4(a)), glm::normalize(glm::dvec4(b))));
}

const glm::vec4 kNone(1, 0, 0, 0);

}  // namespace

TEST_CASE("renamed axes are the same Gaussian's", "[axes]") {
  const GaussianModel model = randomModel(500);
  GaussianModel renamed = model;
  renameAxesForCoding(renamed);
  std::size_t changed = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    changed += renamed.log_scale[i] != model.log_scale[i];
    const glm::dmat3 was = covarianceOf(model, i), is = covarianceOf(renamed, i);
    for (int k = 0; k < 3; ++k) REQUIRE(glm::length(is[k] - was[k]) < 1e-5 * glm::length(was[k]) + 1e-9);
  }
  CHECK(changed > 300);
}

TEST_CASE("no rotation is left beyond what a cube's have, and one that is none stays", "[axes]") {
  GaussianModel model = randomModel(3000);
  model.rotation[7] = {-2, 0, 0, 0};
  GaussianModel renamed = model;
  renameAxesForCoding(renamed);
  const double furthest = std::cos(62.7995 / 2 * std::acos(-1.0) / 180);  // between two cubes in one place
  for (std::size_t i = 0; i < model.size(); ++i) {
    REQUIRE(nearness(renamed.rotation[i], kNone) >= furthest - 1e-6);
    REQUIRE(nearness(renamed.rotation[i], kNone) >= nearness(model.rotation[i], kNone) - 1e-6);
  }
  CHECK(renamed.rotation[7] == model.rotation[7]);
  CHECK(renamed.log_scale[7] == model.log_scale[7]);
}

TEST_CASE("axes renamed towards what a model was are the model's again", "[axes]") {
  const GaussianModel model = randomModel(500);
  GaussianModel renamed = model;
  renameAxesForCoding(renamed);
  renameAxesTowards(renamed, model.rotation);
  CHECK(renamed.log_scale == model.log_scale);
  for (std::size_t i = 0; i < model.size(); ++i) {
    REQUIRE(nearness(renamed.rotation[i], model.rotation[i]) == Approx(1).epsilon(1e-6));
  }
}

TEST_CASE("axes that a texture hangs on keep their names", "[axes]") {
  const GaussianModel bare = randomModel(100);
  GaussianModel model = bare;
  model.texture_mode = TextureMode::rgba;
  model.atlas.texels.assign(4, glm::vec4(1));
  for (std::size_t i = 0; i < model.size(); ++i) {
    model.atlas.rects.push_back(i < 50 ? TextureRect{0, 2, 2} : TextureRect{0, 0, 0});
  }
  renameAxesForCoding(model);
  CHECK(std::equal(model.rotation.begin(), model.rotation.begin() + 50, bare.rotation.begin()));
  CHECK_FALSE(std::equal(model.rotation.begin() + 50, model.rotation.end(), bare.rotation.begin() + 50));
}

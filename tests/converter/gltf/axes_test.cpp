// SPDX-License-Identifier: Apache-2.0
// Axis conventions and rotated spherical harmonics.
#include "converter/gltf/axes.h"

#include <vector>

#include "shared/sh.h"
#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using tg::test::Random;

namespace {

glm::dvec3 evaluate(const std::vector<glm::vec3>& sh, glm::dvec3 direction) {
  glm::vec4 b[4];
  shBasis(glm::vec3(direction), b[0], b[1], b[2], b[3]);
  glm::dvec3 sum(0.0);
  for (std::size_t k = 0; k < sh.size(); ++k) sum += double{b[k / 4][k % 4]} * glm::dvec3(sh[k]);
  return sum;
}

std::vector<glm::vec3> randomSh(Random& random) {
  std::vector<glm::vec3> sh(16);
  for (glm::vec3& c : sh) c = glm::vec3(random.uniformVec3(-1, 1));
  return sh;
}

}  // namespace

TEST_CASE("the half turn of axes turns spherical harmonics and quaternions alike") {
  Random random(1);
  for (int n = 0; n < 20; ++n) {
    const std::vector<glm::vec3> sh = randomSh(random);
    std::vector<glm::vec3> turned = sh;
    turnShAxes(turned);
    const glm::dvec3 direction = random.direction();
    CHECK(glm::length(evaluate(turned, turnAxes(direction)) - evaluate(sh, direction)) < 1e-5);

    const glm::vec4 q(random.quaternion());
    const glm::vec4 gltf = gltfFromModelRotation(q);
    for (int axis = 0; axis < 3; ++axis) {
      const glm::dvec3 expected = turnAxes(matrixFromQuaternion(glm::dvec4(q))[axis]);
      CHECK(glm::length(matrixFromQuaternion(glm::dvec4(gltf))[axis] - expected) < 1e-6);
    }
    CHECK(modelFromGltfRotation(gltf) == q);
  }
}

TEST_CASE("a rotated function has at R d the value it had at d") {
  Random random(2);
  for (int n = 0; n < 20; ++n) {
    const glm::dmat3 rotation = matrixFromQuaternion(random.quaternion());
    const std::vector<glm::vec3> sh = randomSh(random);
    std::vector<glm::vec3> rotated = sh;
    ShRotation(rotation).apply(rotated);
    for (int k = 0; k < 10; ++k) {
      const glm::dvec3 direction = random.direction();
      CHECK(glm::length(evaluate(rotated, rotation * direction) - evaluate(sh, direction)) < 1e-5);
    }
  }
}

TEST_CASE("a matrix comes back from its quaternion for turns of every angle") {
  Random random(3);
  for (int n = 0; n < 50; ++n) {
    const glm::dvec3 axis = random.direction();
    const double angle = n < 10 ? M_PI : random.uniform(0, 2 * M_PI);  // half turns: w = 0
    const glm::dvec4 q(std::cos(angle / 2), std::sin(angle / 2) * axis);
    const glm::dmat3 m = matrixFromQuaternion(q);
    const glm::dmat3 back = matrixFromQuaternion(quaternionFromMatrix(m));
    for (int k = 0; k < 3; ++k) CHECK(glm::length(m[k] - back[k]) < 1e-14);
  }
}

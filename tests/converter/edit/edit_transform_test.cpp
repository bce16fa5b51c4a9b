// SPDX-License-Identifier: Apache-2.0
// A model that moves together with its cameras gives the picture that it gave, by the float64 reference.
#include "converter/edit/transform.h"

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "converter/edit/edit.h"
#include "converter/edits.h"
#include "converter/gltf/axes.h"
#include "core/system/error.h"
#include "support/catch.h"
#include "support/message_of.h"
#include "support/scenes.h"

using namespace tg;
using tg::test::Random;
using tg::test::SceneKind;

namespace {

glm::dmat4 matrixOf(const Similarity& s) {
  glm::dmat4 m(s.scale * s.rotation);
  m[3] = glm::dvec4(s.translation, 1.0);
  return m;
}

std::string refusalOf(const glm::dmat4& matrix) {
  return test::messageOf([&] { similarityFrom(matrix); }, ErrorKind::usage);
}

}  // namespace

TEST_CASE("a turned, scaled and moved model gives the same picture through its moved cameras") {
  Random random(21);
  for (const SceneKind kind : {SceneKind::ordinary, SceneKind::needles, SceneKind::flat, SceneKind::oddTextures,
                               SceneKind::mixed, SceneKind::stacked}) {
    for (const IntersectionModel intersection : {IntersectionModel::plane, IntersectionModel::maxResponse}) {
      test::TestScene scene = test::makeScene(kind, 22, 80, 48, 36);
      scene.model.intersection = intersection;
      const FrameT<double> before = referenceFrame(scene.model, scene.camera);
      Similarity move;
      move.rotation = matrixFromQuaternion(random.quaternion());
      move.scale = random.uniform(1.1, 3.0);  // not below 1: the near plane would cut more
      move.translation = random.uniformVec3(-5, 5);
      std::vector<Camera> cameras = {scene.camera};
      transformModel(scene.model, move);
      transformCameras(cameras, move);
      CAPTURE(test::name(kind), name(intersection));
      // 6e-8 is a float's step: positions grow by 5 units, pixels move by some 1e-5.
      CHECK(framePsnr(before, referenceFrame(scene.model, cameras[0])) > 75.0);
      CHECK(glm::distance(cameras[0].position(),
                          glm::dvec3(matrixOf(move) * glm::dvec4(scene.camera.position(), 1.0))) < 1e-9);
    }
  }
}

TEST_CASE("a model that is turned without its SH would show it") {
  test::TestScene scene = test::makeScene(SceneKind::ordinary, 23, 80, 48, 36);
  const FrameT<double> before = referenceFrame(scene.model, scene.camera);
  const std::vector<glm::vec3> sh = scene.model.sh;
  Similarity turn;
  turn.rotation = matrixFromQuaternion({0.5, 0.5, -0.5, 0.5});
  std::vector<Camera> cameras = {scene.camera};
  transformModel(scene.model, turn);
  transformCameras(cameras, turn);
  CHECK(framePsnr(before, referenceFrame(scene.model, cameras[0])) > 75.0);
  scene.model.sh = sh;
  CHECK(framePsnr(before, referenceFrame(scene.model, cameras[0])) < 50.0);
}

TEST_CASE("textures stay on their axes when scaling makes two scales equal") {
  Random random(24);
  const Camera camera = lookAt({0.3, -0.4, -4}, {0, 0, 0}, {0, -1, 0}, 0.8, 48, 48);
  // Neighbouring floats around -1 that round to one number when ln(20) is added.
  const float a = -0.9f, b = std::nextafter(a, -1.0f);
  for (const glm::vec3& log_scale : {glm::vec3(a, b, 0.1f), glm::vec3(a, 0.1f, b), glm::vec3(0.1f, a, b),
                                     glm::vec3(b, a, 0.1f), glm::vec3(a, a, b), glm::vec3(b, b, b)}) {
    GaussianModel model;
    model.mean = {glm::vec3(0.0f)};
    model.rotation = {glm::vec4(random.quaternion())};
    model.log_scale = {log_scale};
    model.opacity_logit = {3.0f};
    model.sh = {glm::vec3(0.2f)};
    model.texture_mode = TextureMode::rgba;
    model.atlas = makeUniformAtlas(1, 4, 3);
    for (glm::vec4& texel : model.atlas.texels) {
      texel = glm::vec4(glm::vec3(random.uniformVec3(-0.4, 0.4)), random.uniform());
    }
    const FrameT<double> before = referenceFrame(model, camera);
    Similarity grow;
    grow.scale = 20.0;
    std::vector<Camera> cameras = {camera};
    transformModel(model, grow);
    transformCameras(cameras, grow);
    CAPTURE(log_scale.x, log_scale.y, log_scale.z);
    CHECK(framePsnr(before, referenceFrame(model, cameras[0])) > 80.0);
  }
}

TEST_CASE("transforms that splats cannot follow are refused by name") {
  const glm::dmat4 one(1.0);
  CHECK(refusalOf(glm::scale(one, {-1, 1, 1})).find("mirrors") != std::string::npos);
  CHECK(refusalOf(glm::scale(one, {-2, -2, -2})).find("mirrors") != std::string::npos);
  CHECK(refusalOf(glm::scale(one, {1, 1, 0})).find("flattens space") != std::string::npos);
  CHECK(refusalOf(glm::scale(one, {1, 2, 1})).find("scales axes differently") != std::string::npos);
  glm::dmat4 shear = one;
  shear[1][0] = 0.01;
  CHECK(refusalOf(shear).find("the transform s") != std::string::npos);
  glm::dmat4 perspective = one;
  perspective[2][3] = 0.5;
  CHECK(refusalOf(perspective).find("has a perspective") != std::string::npos);
  CHECK(refusalOf(glm::scale(one, {NAN, 1, 1})).find("is not finite") != std::string::npos);
  CHECK(refusalOf(glm::scale(one, glm::dvec3(1e200))).find("is too large") != std::string::npos);
  CHECK(refusalOf(glm::translate(glm::rotate(glm::scale(one, {2, 2, 2}), 1.0, {1, 2, 3}), {1, 2, 3})) == "accepted");
}

TEST_CASE("the transforms of the command line are what they say") {
  const test::TestScene scene = test::makeScene(SceneKind::ordinary, 25, 20);
  const auto edited = [&](const std::vector<Edit>& edits) {
    Bundle loaded;
    loaded.model = scene.model;
    loaded.cameras = {scene.camera};
    applyEdits(loaded, edits, false);
    return loaded;
  };
  const glm::vec3 p = scene.model.mean[3];
  const auto at = [&](const std::vector<Edit>& edits) { return edited(edits).model.mean[3]; };
  CHECK(glm::distance(at({{"--translate", "1,-2,0.5"}}), p + glm::vec3(1, -2, 0.5)) < 1e-6f);
  for (const char* axis : {"0,0,2,90", "0,0,1e300,90", "0,0,1e-300,90"}) {
    CHECK(glm::distance(at({{"--rotate", axis}}), glm::vec3(-p.y, p.x, p.z)) < 1e-6f);
  }
  for (const char* turn : {"1e300,0,0,1e300", "1e-300,0,0,1e-300"}) {
    CHECK(glm::distance(at({{"--rotate-quaternion", turn}}), glm::vec3(-p.y, p.x, p.z)) < 1e-6f);
  }
  CHECK(glm::distance(at({{"--rotate-quaternion", "0,0,0,-3"}}), glm::vec3(-p.x, -p.y, p.z)) < 1e-6f);
  CHECK(glm::distance(at({{"--scale", "3"}}), 3.0f * p) < 1e-5f);
  CHECK(glm::distance(at({{"--matrix", "0,-2,0,1,2,0,0,2,0,0,2,3"}}),
                      glm::vec3(1, 2, 3) + 2.0f * glm::vec3(-p.y, p.x, p.z)) < 1e-5f);
  // In the order they stand.
  CHECK(glm::distance(at({{"--translate", "1,0,0"}, {"--scale", "2"}}), 2.0f * (p + glm::vec3(1, 0, 0))) < 1e-5f);
  CHECK(glm::distance(at({{"--scale", "2"}, {"--translate", "1,0,0"}}), 2.0f * p + glm::vec3(1, 0, 0)) < 1e-5f);
  // The whole of a turn: nothing is left of it but rounding.
  const Bundle around = edited({{"--rotate", "1,2,3,120"}, {"--rotate", "1,2,3,240"}});
  CHECK(framePsnr(referenceFrame(scene.model, scene.camera), referenceFrame(around.model, around.cameras[0])) > 80.0);
  for (const Edit& wrong : {Edit{"--translate", "1,2"}, Edit{"--translate", "1,2,3,4"}, Edit{"--translate", "1,2,x"},
                            Edit{"--rotate", "0,0,0,90"}, Edit{"--rotate-quaternion", "0,0,0,0"}, Edit{"--scale", "0"},
                            Edit{"--scale", "nan"}, Edit{"--matrix", "1,2,3"}, Edit{"--scale", ""}}) {
    CAPTURE(wrong.option, wrong.value);
    CHECK(usageErrorOf(scene.model, wrong).find(wrong.option) == 0);
  }
}

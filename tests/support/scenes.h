// SPDX-License-Identifier: Apache-2.0
// Seeded scenes that every renderer is tested on: the ordinary ones and each kind of hard one. Same seed, same scene,
// on every machine.
#pragma once
#include <array>
#include <string_view>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"
#include "core/model/model.h"
#include "support/compare.h"

namespace tg::test {

enum class SceneKind {
  ordinary,      // ellipsoids of moderate shape, 4 x 4 textures
  needles,       // one long axis, two that are 20 to 200 times shorter
  flat,          // one axis 50 to 1000 times shorter than the others, as training makes them
  edgeOn,        // flat ones whose plane nearly holds the camera
  nearPlane,     // means around camera z = 0.2, extents that cross it
  oddTextures,   // 1 x 1, 37 x 5, 1 x 9 and 2 x 2 textures
  mixed,         // every size up to 8 x 8, a third without texture
  aroundCamera,  // some Gaussians so large that the camera is inside them
  stacked,       // opaque layers, so that every ray ends at the transmittance stop
};
constexpr std::array<SceneKind, 9> kSceneKinds = {SceneKind::ordinary, SceneKind::needles,      SceneKind::flat,
                                                  SceneKind::edgeOn,   SceneKind::nearPlane,    SceneKind::oddTextures,
                                                  SceneKind::mixed,    SceneKind::aroundCamera, SceneKind::stacked};
std::string_view name(SceneKind kind);

struct TestScene {
  GaussianModel model;  // SH degree 3, textures rgba, maxResponse; a few Gaussians too faint or behind the camera
  Camera camera;        // turned and off centre, fx != fy
};
TestScene makeScene(SceneKind kind, unsigned seed, int gaussians = 200, int width = 64, int height = 48);

// What a float32 renderer that uses the formulas of shaders/shared may differ from the reference by, on makeScene's
// default size: two to four times what a plain float loop over all Gaussians does (tests/render/shared_math_test.cpp).
Tolerance tolerance(SceneKind kind, IntersectionModel intersection);

// A scene such as training leaves behind: flat Gaussians with 4 x 4 textures on a floor, a box and a ball, SH degree 3,
// mostly opaque. And a camera that sees it.
GaussianModel trainedLikeModel(unsigned seed, int gaussians);
Camera trainedLikeCamera(int width, int height);

// One flat Gaussian with a 4 x 4 texture, turned by `degrees` about the image's vertical axis: 0 faces the camera, at
// 90 the texture plane holds the camera and the ray of pixel (width / 2, height / 2) through the mean lies in it.
TestScene grazingScene(double degrees, int width = 32, int height = 24);

// Of the plane model: the rays of a column of pixels lie, to the last bit, in the plane of a Gaussian between two that
// face the camera. 32 x 32 pixels; textures of side x side texels, 0: none.
TestScene raysInPlaneScene(int side);
Tolerance raysInPlaneTolerance();  // the next columns see it from 2e-3 rad, where the rounding of 1 / sigma shows

// A red disc before a green one, both opaque at pixel (16, 16) of 32 x 32: the transmittance behind both lies below the
// stop by two parts in a million.
TestScene opaqueDiscsScene();

// A disc, `thinness` times as thick as wide, that faces the camera or is turned away a little. 32 x 32 pixels.
TestScene thinDiscScene(float thinness, bool turned);
// A Gaussian of the longest axis that is drawn, 0.01 units before a camera, which is for near planes that are nearer.
// Its plane is turned by 1e-13 rad. 16 x 16 pixels.
TestScene vastScene();
// The same scene where a unit of length is so many; near planes stay.
TestScene scaledScene(TestScene scene, float unit);

// Uniform numbers that are the same with every standard library.
class Random {
 public:
  explicit Random(unsigned seed) : state_(0x9E3779B97F4A7C15ull * (seed + 1ull)) {}
  double uniform(double low = 0.0, double high = 1.0);
  double normal();
  glm::dvec3 uniformVec3(double low, double high);
  glm::dvec3 direction();
  glm::dvec4 quaternion();  // unit, uniform over rotations

 private:
  std::uint64_t state_;
};

// Every value uniform in [0,1].
Image noise(int width, int height, unsigned seed, int channels = 3);

}  // namespace tg::test

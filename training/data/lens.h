// SPDX-License-Identifier: Apache-2.0
// Lenses that bend straight lines, and photographs without the bending: the pinhole cameras that splats are made for.
#pragma once
#include <array>
#include <cstdint>
#include <glm/glm.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/image/image.h"
#include "core/model/camera.h"

namespace tg {

// Where a lens puts the point (x, y) = (X/Z, Y/Z) of a pinhole's image plane: OpenCV's and COLMAP's models in one. With
// r^2 = x^2 + y^2, after scaling (x, y) by atan(r) / r where `fisheye` is set,
//   s  = (1 + k0 r^2 + k1 r^4 + k2 r^6 + k3 r^8) / (1 + d0 r^2 + d1 r^4 + d2 r^6)
//   x' = x s + 2 p0 x y + p1 (r^2 + 2 x^2) + t0 r^2,    y' = y s + p0 (r^2 + 2 y^2) + 2 p1 x y + t1 r^2.
// `fov` other than 0 is the FOV model (Devernay and Faugeras 2001): s = atan(2 r tan(fov / 2)) / (r fov).
struct Lens {
  std::string model;                       // COLMAP's name, for messages
  bool fisheye = false;                    // equidistant projection first
  std::array<double, 4> radial{};          // k
  std::array<double, 3> radial_divisor{};  // d
  std::array<double, 2> tangential{};      // p
  std::array<double, 2> thin_prism{};      // t
  double fov = 0;                          // [rad]

  // All zero: the photograph is a pinhole's already.
  bool isPinhole() const;
  // Both planes without unit: pixels less the principal point, over the focal length.
  glm::dvec2 distort(glm::dvec2 plane) const;
  // Up to which r the lens puts points farther out the farther out they are: beyond it, a polynomial folds back.
  double validRadius() const;
  // The inverse, by Newton's method; none where it does not converge, or only beyond `valid_radius`.
  std::optional<glm::dvec2> undistort(glm::dvec2 distorted, double valid_radius) const;
};

// A photograph's camera with its lens, and the pinhole that sees nearly the same: same pose and focal lengths, whole
// pixels cut or added at the borders so that the largest rectangle without blank corners remains, at most half a
// picture more on each side.
struct Undistortion {
  Lens lens;
  Camera distorted;
  Camera pinhole;
  glm::ivec2 origin{0};  // the pinhole's first pixel among the photograph's
  double valid_radius = 0;

  // Throws Error(badData), `label` in front, where less than a fifth of the width or height would remain.
  Undistortion(Lens of, const Camera& camera, const std::string& label);

  // The photograph, of the distorted camera's size, as the pinhole sees it: Catmull-Rom, alpha premultiplied meanwhile,
  // values kept in [0, 1]. `mask` is [pinhole.size.y, pinhole.size.x] of 0 and 255: 0 where a pixel lies outside the
  // photograph or touches (among the four nearest) a 0 of `photograph_mask` [height, width], empty: none.
  struct Result {
    Image image;
    std::vector<std::uint8_t> mask;
  };
  Result apply(const Image& photograph, const std::vector<std::uint8_t>& photograph_mask) const;
};

}  // namespace tg

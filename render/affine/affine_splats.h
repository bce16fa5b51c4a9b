// SPDX-License-Identifier: Apache-2.0
// Untextured Gaussians as a viewer keeps them, and seen from a camera: ellipses on the screen.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/glm.hpp>
#include <span>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/affine/splat_viewer.h"

namespace tg {

// A symmetric matrix of three rows: xx, xy, xz, yy, yz, zz.
using Covariance = std::array<float, 6>;

// Splats that a viewer sorts among themselves.
struct SplatPart {
  std::size_t end = 0;            // its splats are those before, from the end of the part before it on
  glm::vec3 sphere_center{0.0f};  // around all of them as the viewer has it, for its order
  float sphere_radius = 0;
};

// In the model's axes.
struct KeptSplats {
  std::vector<glm::vec3> mean;
  std::vector<Covariance> covariance;  // [world units^2]
  std::vector<float> opacity;          // 0 to 1
  std::vector<glm::vec3> sh;           // as the model's, degree 0 included
  int sh_degree = 0;
  std::vector<SplatPart> parts;  // drawn one after the other, one at least

  std::size_t size() const { return mean.size(); }
};

// Without rounding, or with the viewer's own: bytes, halves, codes. The model's textures do not count. `parts`: where
// each of the file's primitives but the last ends, ascending.
KeptSplats keepSplats(const GaussianModel& model, SplatViewer viewer, bool rounded,
                      std::span<const std::size_t> parts = {});

// How the screen moves with a place in space, at the mean: rows are d(x [px]) / d(world) and d(y [px]) / d(world).
using ScreenFromWorld = glm::mat2x3;  // two columns of three: row r of the derivative is [r]

struct AffineSplat {
  std::uint32_t gaussian = 0;
  std::uint32_t part = 0;
  float depth = 0;         // what the viewer sorts by
  glm::vec2 center{0.0f};  // [px]
  glm::vec2 axis_u{0.0f};  // of an offset [px]: u = axis_u . offset, 1 at the cut
  glm::vec2 axis_v{0.0f};
  glm::vec3 color{0.0f};  // after the viewer's clamps
  glm::bvec3 color_clamped{false};
  float opacity = 0;  // after compensation
  float compensation = 1;
  glm::vec3 covariance{0.0f};  // [px^2] xx, xy, yy, before the blur
  glm::ivec4 box{0};           // pixels x0 <= x < x1, y0 <= y < y1
};

struct AffineView {
  const Pinhole& camera;
  float blur_scale = 1;  // [1] of the profile's px^2, for a picture that stands for a larger one
};

ScreenFromWorld screenFromWorld(const Pinhole& camera, glm::vec3 mean);
// Those that are drawn, farthest first.
std::vector<AffineSplat> seenSplats(const KeptSplats& splats, SplatViewer viewer, const AffineView& view);

}  // namespace tg

// SPDX-License-Identifier: Apache-2.0
// First stage of the CPU backend: the Gaussians that a camera sees, front to back, in the form that pixel loops read.
#pragma once
#include <cstdint>
#include <glm/glm.hpp>
#include <vector>

#include "core/model/camera.h"
#include "core/model/model.h"
#include "render/cpu/sort.h"
#include "render/renderer.h"

namespace tg::cpu {

// One frame's view, with the switches resolved.
struct View : Pinhole {
  glm::dvec3 eye{0.0};  // world space
  glm::vec3 background{0.0f};
  bool texture_rgb = false;
  bool texture_alpha = false;
  IntersectionModel intersection = IntersectionModel::maxResponse;
  IntersectionModel antialias_for = IntersectionModel::maxResponse;  // whose opacity goes with antialiasing
  TextureOutside outside = TextureOutside::base;
  // docs/math.md 1.4 and 3.1
  SplatOrder order = SplatOrder::global;
  bool antialias = false;
  bool footprint = false;      // filter by it
  bool texel_density = false;  // needed: for the filter or as an output
  float opacity_scale = 1.0f;
  float splat_scale = 1.0f;
  int max_sh_degree = 3;
  float near = kNear;
  std::optional<CropBox> crop{};
  float fixed_radius = 0.0f;  // [sigma] of the screen boxes; 0: what can be seen

  bool textured() const { return texture_rgb || texture_alpha; }
};
View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings);

// The pyramid of the image in camera space, and how far from its mean a Gaussian reaches.
struct Frustum {
  glm::dvec3 planes[4];  // unit normals, inwards
  double reach;          // [sigma]
  // Added per unit of camera z: antialiasing widens by a third of a pixel in sigma, a dot at the mean has
  // kCenterRadius.
  double pixel;
};
Frustum makeFrustum(const View& view);

constexpr double kExponentScale = 0.84932180028801904272;  // sqrt(log2(e) / 2): exp(-p^2 / 2) = 2^-(kExponentScale p)^2

// What blending one splat needs. (x, y) = pixel - center [px]. Names are those of Geometry in geometry-inl.h.
struct Splat {
  float center_x, center_y;  // [px]
  float depth, opacity, log2_opacity;
  float radius2;           // beyond q = |W|^2 / |D|^2 = radius2 alpha < kAlphaMin
  float margin;            // [px] slack of row spans
  float w_xx, w_xy, w_yy;  // Geometry's times kExponentScale: alpha = 2^(log2_opacity - q)
  float d_xx, d_xy, d_x1, d_yy, d_y1, d_11;
  float t_x, t_y, t_1;  // t |D|^2 = t_x x + t_y y + t_1
  glm::vec3 base;
  glm::vec3 normal;              // camera space, turned to the camera
  glm::vec3 wx, wy, dx, dy, d0;  // Geometry::power_w and power_d
  glm::vec3 kappa;               // Geometry's, and its products with w_first and w_second, scaled like w and w^2
  float kappa_first, kappa_second;
  std::int32_t x0, y0, x1, y1;  // [px] screen box clipped to the image, x1 and y1 exclusive; empty = not visible
  std::uint32_t gaussian;
  std::uint32_t texel_offset;
  std::uint16_t texture_width, texture_height;  // 0 = no texture applies
  float near;                                   // camera z that hits must lie behind; 0 where all do
  float texel_density;                          // [texels / px] at the mean; 0 unless View::texel_density
};

// The splats of some Gaussians, in the Gaussians' order. Those off screen have an empty box.
struct ScreenSplats {
  std::vector<Splat> splats;
  std::vector<float> screen_radius;  // [px] half the longer side of the unclipped screen box
};

// Gaussians before the camera and not too faint. Their parameters and records are walked through in the Gaussians'
// order, as one stream; only the tile lists jump.
struct DepthOrder {
  std::vector<std::uint32_t> gaussians;  // ascending
  std::vector<std::uint32_t> order;      // positions in `gaussians` by ascending camera z of the mean, ties by position
};
void findDepthOrder(const View& view, const GaussianModel& model, DepthOrder& out);
// The two halves of it. keys: [as gaussians] the means' depths, with the positions in `gaussians`.
void findVisible(const View& view, const GaussianModel& model, std::vector<std::uint32_t>& gaussians,
                 std::vector<DepthKey>& keys);
void sortByDepth(std::vector<DepthKey>& keys, std::vector<std::uint32_t>& order);
void projectSplats(const View& view, const GaussianModel& model, const std::vector<std::uint32_t>& gaussians,
                   ScreenSplats& out);

}  // namespace tg::cpu

// SPDX-License-Identifier: Apache-2.0
// Camera, spherical harmonics and screen boxes, one Gaussian at a time on all threads.
#include "render/cpu/project.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <string>
#include <utility>

#include "core/error.h"
#include "core/parallel.h"
#include "render/cpu/sort.h"
#include "shared/sh.h"
#include "shared/splat.h"

namespace tg::cpu {
namespace {

constexpr int kGrain = 256;  // Gaussians per grab: some ten microseconds

glm::dvec3 cameraFromWorld(const View& view, glm::dvec3 x) {
  return view.camera_from_world_rotation * x + view.camera_from_world_translation;
}

// v / |v|, zero for the zero vector.
glm::dvec3 unitOrZero(glm::dvec3 v) {
  const double length = glm::length(v);
  return length > 0.0 ? v / length : glm::dvec3(0.0);
}

glm::vec3 baseColor(const View& view, const GaussianModel& model, std::uint32_t i) {
  const glm::vec3 direction(glm::normalize(glm::dvec3(model.mean[i]) - view.position));
  glm::vec4 basis[4];
  shBasis(direction, basis[0], basis[1], basis[2], basis[3]);
  const int count = model.shCount();
  const glm::vec3* sh = model.sh.data() + static_cast<std::size_t>(i) * count;
  glm::vec3 color(0.5f);
  for (int k = 0; k < count; ++k) color += basis[k / 4][k % 4] * sh[k];
  return glm::max(color, glm::vec3(0.0f));
}

// First and one past the last pixel whose centre lies in [low, high], within [0, size). The slack covers float
// rounding.
void pixelRange(float low, float high, int size, std::int32_t& begin, std::int32_t& end) {
  const float slack = 0.01f;
  const float limit = static_cast<float>(size);
  begin = static_cast<std::int32_t>(std::ceil(std::clamp(low - 0.5f - slack, 0.0f, limit)));
  end = static_cast<std::int32_t>(std::floor(std::clamp(high + 0.5f + slack, 0.0f, limit)));
}

bool finite(const Splat& s) {
  const float sum = s.center_x + s.center_y + s.depth + s.opacity + s.radius2 + s.w_xx + s.w_xy + s.w_yy + s.d_xx +
                    s.d_xy + s.d_x1 + s.d_yy + s.d_y1 + s.d_11 + s.t_x + s.t_y + s.t_1 + s.base.x + s.base.y + s.base.z;
  return std::isfinite(sum);
}

Splat makeSplat(const View& view, const GaussianModel& model, std::uint32_t i, float& screen_radius) {
  const Geometry g = makeGeometry(view, model, i);
  const bool plane = view.intersection == IntersectionModel::plane;
  Splat s{};
  s.gaussian = i;
  s.depth = static_cast<float>(g.mean_c.z);
  s.opacity = opacity(model.opacity_logit[i]);
  s.log2_opacity = std::log2(s.opacity);
  const glm::dvec2 focal(view.focal_center.x, view.focal_center.y);
  const glm::dvec2 center(view.focal_center.z, view.focal_center.w);
  s.center_x = static_cast<float>(g.mean_c.x / g.mean_c.z * focal.x + center.x);
  s.center_y = static_cast<float>(g.mean_c.y / g.mean_c.z * focal.y + center.y);
  s.w_xx = static_cast<float>(kExponentScale * g.w_xx);
  s.w_xy = static_cast<float>(kExponentScale * g.w_xy);
  s.w_yy = static_cast<float>(kExponentScale * g.w_yy);
  s.d_xx = static_cast<float>(g.d_xx);
  s.d_xy = static_cast<float>(g.d_xy);
  s.d_x1 = static_cast<float>(g.d_x1);
  s.d_yy = static_cast<float>(g.d_yy);
  s.d_y1 = static_cast<float>(g.d_y1);
  s.d_11 = static_cast<float>(g.d_11);
  const glm::dvec3 t_direction = g.mean_c.z * g.power_d[2];
  s.t_x = static_cast<float>(glm::dot(t_direction, g.power_d[0]));
  s.t_y = static_cast<float>(glm::dot(t_direction, g.power_d[1]));
  s.t_1 = static_cast<float>(glm::dot(t_direction, g.power_d[2]));
  s.base = baseColor(view, model, i);
  const glm::dvec3 normal = g.axes_c[2];
  s.normal = glm::vec3(glm::dot(normal, g.mean_c) > 0.0 ? -normal : normal);
  s.wx = glm::vec3(g.power_w[0]);
  s.wy = glm::vec3(g.power_w[1]);
  s.dx = glm::vec3(g.power_d[0]);
  s.dy = glm::vec3(g.power_d[1]);
  s.d0 = glm::vec3(g.power_d[2]);
  s.kappa = glm::vec3(g.kappa);
  s.kappa_first = static_cast<float>(kExponentScale * glm::dot(g.kappa, g.w_first));
  s.kappa_second = static_cast<float>(kExponentScale * kExponentScale * glm::dot(g.kappa, g.w_second));
  if (!model.atlas.rects.empty() && view.textured()) {
    const TextureRect& rect = model.atlas.rects[i];
    s.texel_offset = rect.offset;
    s.texture_width = rect.texelCount() > 0 ? rect.width : 0;
    s.texture_height = rect.texelCount() > 0 ? rect.height : 0;
  }

  const float radius = visibleRadius(s.opacity);
  s.radius2 = static_cast<float>(kExponentScale * kExponentScale) * radius * radius;
  screen_radius = 0.0f;
  if (radius <= 0.0f || !finite(s)) return s;  // the box stays empty
  glm::dvec3 extent = static_cast<double>(radius) * g.scale;
  if (plane) extent.z = 0.0;
  const glm::dvec3 extent_z(extent.x * g.axes_c[0].z, extent.y * g.axes_c[1].z, extent.z * g.axes_c[2].z);
  s.near_plane = g.mean_c.z - glm::length(extent_z) <= kNear * 1.001;
  glm::vec4 box;
  const bool bounded = splatBox(glm::vec3(g.mean_c), glm::mat3(g.axes_c), glm::vec3(g.scale), radius, plane,
                                glm::vec4(view.focal_center), box) &&
                       std::isfinite(box.x + box.y + box.z + box.w);
  if (!bounded) box = glm::vec4(0.0f, 0.0f, view.width, view.height);
  s.margin = 0.05f + 1e-3f * (box.z - box.x);
  pixelRange(box.x, box.z, view.width, s.x0, s.x1);
  pixelRange(box.y, box.w, view.height, s.y0, s.y1);
  if (s.x0 < s.x1 && s.y0 < s.y1) screen_radius = 0.5f * std::max(box.z - box.x, box.w - box.y);
  return s;
}

}  // namespace

float opacity(float logit) { return 1.0f / (1.0f + std::exp(-logit)); }

View makeView(const GaussianModel& model, const Camera& camera, const RenderSettings& settings) {
  if (camera.width <= 0 || camera.height <= 0 || !(camera.fx > 0.0) || !(camera.fy > 0.0)) {
    throw Error(ErrorKind::usage, "camera " + camera.name,
                "empty image or focal length (expected sizes above 0, found " + std::to_string(camera.width) + " x " +
                    std::to_string(camera.height) + ", fx " + std::to_string(camera.fx) + ", fy " +
                    std::to_string(camera.fy) + ")");
  }
  const unsigned mode = static_cast<unsigned>(model.texture_mode) & static_cast<unsigned>(settings.textures);
  View view;
  view.camera_from_world_rotation = camera.camera_from_world_rotation;
  view.camera_from_world_translation = camera.camera_from_world_translation;
  view.position = camera.position();
  view.focal_center = {camera.fx, camera.fy, camera.cx, camera.cy};
  view.background = settings.background;
  view.width = camera.width;
  view.height = camera.height;
  view.texture_rgb = (mode & kModeRgb) != 0u;
  view.texture_alpha = (mode & kModeAlpha) != 0u;
  view.intersection = settings.intersection.value_or(model.intersection);
  return view;
}

Geometry makeGeometry(const View& view, const GaussianModel& model, std::uint32_t i) {
  Geometry g;
  const glm::dvec3 stored_scale = glm::exp(glm::dvec3(model.log_scale[i]));
  const int c = shortestAxis(model.log_scale[i]);
  g.axes = {axisU(c), axisV(c), c};
  const glm::dvec4 q(model.rotation[i]);
  const glm::dmat3 rotation = glm::mat3_cast(glm::normalize(glm::dquat(q[0], q[1], q[2], q[3])));
  g.mean_c = cameraFromWorld(view, model.mean[i]);
  for (int k = 0; k < 3; ++k) {
    g.scale[k] = stored_scale[g.axes[k]];
    g.axes_c[k] = view.camera_from_world_rotation * rotation[g.axes[k]];
    for (int j = 0; j < 3; ++j) g.m[j][k] = g.axes_c[k][j] / g.scale[k];
  }
  g.dx = g.m[0] / view.focal_center.x;
  g.dy = g.m[1] / view.focal_center.y;
  g.d0 = g.m * (g.mean_c / g.mean_c.z);
  g.o = -g.mean_c.z * g.d0;
  g.wx = glm::cross(g.o, g.dx);
  g.wy = glm::cross(g.o, g.dy);

  g.unit = 1.0 / glm::length(g.d0);
  g.power_d = glm::dmat3(g.unit * g.dx, g.unit * g.dy, g.unit * g.d0);
  g.power_w = glm::dmat2x3(g.unit * g.wx, g.unit * g.wy);
  g.kappa = g.unit * g.mean_c.z * glm::cross(g.dx, g.dy);
  if (view.intersection == IntersectionModel::plane) {
    for (int j = 0; j < 3; ++j) g.power_d[j].x = g.power_d[j].y = 0.0;
    for (int j = 0; j < 2; ++j) g.power_w[j].z = 0.0;
    g.kappa.z = 0.0;
  }
  g.w_first = unitOrZero(g.power_w[0]);
  g.w_xx = glm::length(g.power_w[0]);
  g.w_xy = glm::dot(g.w_first, g.power_w[1]);
  g.w_second = g.power_w[1] - g.w_xy * g.w_first;
  g.w_yy = glm::length(g.w_second);
  const glm::dvec3 first = unitOrZero(g.power_d[0]);
  g.d_xx = glm::length(g.power_d[0]);
  g.d_xy = glm::dot(first, g.power_d[1]);
  g.d_x1 = glm::dot(first, g.power_d[2]);
  const glm::dvec3 rest_y = g.power_d[1] - g.d_xy * first;
  const glm::dvec3 rest_1 = g.power_d[2] - g.d_x1 * first;
  // In the plane model all of D but its first row is rounding noise of the subtraction; it must not outweigh D_c = 0.
  const bool flat = view.intersection == IntersectionModel::plane;
  const glm::dvec3 second = flat ? glm::dvec3(0.0) : unitOrZero(rest_y);
  g.d_yy = flat ? 0.0 : glm::length(rest_y);
  g.d_y1 = glm::dot(second, rest_1);
  g.d_11 = flat ? 0.0 : glm::length(rest_1 - g.d_y1 * second);
  return g;
}

std::vector<std::uint32_t> depthOrder(const View& view, const GaussianModel& model) {
  constexpr std::size_t kChunk = 4096;
  const std::size_t chunks = (model.size() + kChunk - 1) / kChunk;
  std::vector<DepthKey> keys(model.size());
  std::vector<std::size_t> counts(chunks, 0);
  const auto range = [&](std::size_t chunk) {
    return std::pair(chunk * kChunk, std::min(model.size(), (chunk + 1) * kChunk));
  };
  parallelFor(static_cast<std::int64_t>(chunks), 1, [&](std::int64_t chunk) {
    const auto [begin, end] = range(chunk);
    std::size_t next = begin;
    for (std::size_t i = begin; i < end; ++i) {
      const double z = cameraFromWorld(view, model.mean[i]).z;
      if (!(z > kNear) || !(opacity(model.opacity_logit[i]) * 255.0f > 1.0f)) continue;
      keys[next++] = {std::bit_cast<std::uint32_t>(static_cast<float>(z)), static_cast<std::uint32_t>(i)};
    }
    counts[chunk] = next - begin;
  });
  std::size_t kept = 0;
  for (std::size_t chunk = 0; chunk < chunks; ++chunk) {
    const auto from = keys.begin() + static_cast<std::ptrdiff_t>(range(chunk).first);
    std::copy(from, from + static_cast<std::ptrdiff_t>(counts[chunk]),
              keys.begin() + static_cast<std::ptrdiff_t>(kept));
    kept += counts[chunk];
  }
  keys.resize(kept);
  sortByKey(keys);
  std::vector<std::uint32_t> order(kept);
  for (std::size_t k = 0; k < kept; ++k) order[k] = keys[k].index;
  return order;
}

void projectSplats(const View& view, const GaussianModel& model, const std::vector<std::uint32_t>& order,
                   ScreenSplats& out) {
  out.splats.resize(order.size());
  out.screen_radius.resize(order.size());
  parallelFor(static_cast<std::int64_t>(order.size()), kGrain,
              [&](std::int64_t k) { out.splats[k] = makeSplat(view, model, order[k], out.screen_radius[k]); });
}

}  // namespace tg::cpu

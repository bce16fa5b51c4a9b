// SPDX-License-Identifier: Apache-2.0
// Plain loops: these pictures are looked at, not flown through.
#include "render/cpu/solid.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "core/model/verbs.h"
#include "core/system/assert.h"
#include "core/system/parallel.h"
#include "shared/limits.h"

namespace tg::cpu {
namespace {

// What of a splat fixes its surface: unlike Splat's, D is not divided by |d0|.
struct Surface {
  glm::vec3 wx, wy, dx, dy, d0;
  glm::vec3 mz;  // column z of local_from_camera; x and y are dx fx and dy fy
};

// The Geometry that project.cpp keeps is divided by |d0|, which the distance from the hit to the surface needs back:
// the length of local_from_camera's column x is known from the scales alone when all three columns are, since |dx|^2
// fx^2 + |dy|^2 fy^2 + |mz|^2 = sum of 1 / scale^2.
Surface surfaceOf(const View& view, const Splat& s, glm::dvec3 inverse_scale) {
  const glm::dvec3 c = ray(view, {s.center_x, s.center_y});
  const glm::dvec3 mx = view.focal.x * glm::dvec3(s.dx), my = view.focal.y * glm::dvec3(s.dy);
  const glm::dvec3 mz = glm::dvec3(s.d0) - c.x * mx - c.y * my;
  const double unit =
      std::sqrt((glm::dot(mx, mx) + glm::dot(my, my) + glm::dot(mz, mz)) / glm::dot(inverse_scale, inverse_scale));
  const auto full = [&](glm::dvec3 v) { return glm::vec3(v / unit); };
  return {full(s.wx), full(s.wy), full(s.dx), full(s.dy), full(s.d0), full(mz)};
}

}  // namespace

void drawEllipsoids(const View& view, const GaussianModel& model, const ScreenSplats& screen, const TileLists& lists,
                    std::vector<glm::vec3>& pixels) {
  TG_ASSERT(view.fixed_radius == 1.0f && view.intersection == IntersectionModel::maxResponse,
            "boxes hold the ellipsoids");
  TG_ASSERT(pixels.size() == static_cast<std::size_t>(view.size.x) * static_cast<std::size_t>(view.size.y),
            "a colour a pixel");
  std::fill(pixels.begin(), pixels.end(), view.background);
  const glm::vec2 focal(view.focal), center(view.center);
  parallelFor(lists.tiles(), 1, [&](std::int64_t tile) {
    std::array<float, kTilePixels> nearest;
    nearest.fill(std::numeric_limits<float>::infinity());
    const int tile_x = static_cast<int>(tile) % lists.tiles_x * kTileWidth;
    const int tile_y = static_cast<int>(tile) / lists.tiles_x * kTileHeight;
    for (const std::uint32_t k : lists.list(static_cast<int>(tile))) {
      const Splat& s = screen.splats[k];
      glm::dvec3 scale = sigmaOf(model, s.gaussian) * static_cast<double>(view.splat_scale);
      if (view.antialias) {
        const double pixel = s.depth / std::max(focal.x, focal.y);
        scale = glm::sqrt(scale * scale + kScreenVariance * pixel * pixel);
      }
      const Surface surface = surfaceOf(view, s, 1.0 / scale);
      for (int y = std::max(s.y0, tile_y); y < std::min(s.y1, tile_y + kTileHeight); ++y) {
        for (int x = std::max(s.x0, tile_x); x < std::min(s.x1, tile_x + kTileWidth); ++x) {
          const float px = static_cast<float>(x) + 0.5f - s.center_x;
          const float py = static_cast<float>(y) + 0.5f - s.center_y;
          const glm::vec3 w = surface.wx * px + surface.wy * py;
          const glm::vec3 d = surface.d0 + surface.dx * px + surface.dy * py;
          const float d2 = glm::dot(d, d);
          const float q = glm::dot(w, w) / d2;
          if (!(q <= 1.0f)) continue;
          const float back = std::sqrt((1.0f - q) / d2);
          const float t = s.depth * glm::dot(surface.d0, d) / d2 - back;
          float& depth = nearest[(y - tile_y) * kTileWidth + x - tile_x];
          if (!(t > view.near) || !(t < depth)) continue;
          depth = t;
          const glm::vec3 p = glm::cross(d, w) / d2 - back * d;
          const glm::vec3 normal(focal.x * glm::dot(surface.dx, p), focal.y * glm::dot(surface.dy, p),
                                 glm::dot(surface.mz, p));
          const glm::vec3 along((glm::vec2(x, y) + 0.5f - center) / focal, 1.0f);
          const float lambert = -glm::dot(normal, along) / std::sqrt(glm::dot(normal, normal) * glm::dot(along, along));
          pixels[static_cast<std::size_t>(y) * view.size.x + x] =
              s.base * (kEllipsoidAmbient + (1.0f - kEllipsoidAmbient) * std::max(lambert, 0.0f));
        }
      }
    }
  });
}

void drawCenters(const View& view, const ScreenSplats& screen, const std::vector<std::uint32_t>& order,
                 std::vector<glm::vec3>& pixels) {
  TG_ASSERT(pixels.size() == static_cast<std::size_t>(view.size.x) * static_cast<std::size_t>(view.size.y),
            "a colour a pixel");
  TG_ASSERT(order.size() <= screen.splats.size(), "an order of the splats");
  std::fill(pixels.begin(), pixels.end(), view.background);
  for (auto it = order.rbegin(); it != order.rend(); ++it) {  // the nearest last
    const Splat& s = screen.splats[*it];
    if (!(s.opacity * 255.0f > 1.0f) || !std::isfinite(s.center_x + s.center_y)) continue;
    const auto range = [](float center, int size) {
      const float low = std::ceil(std::clamp(center - kCenterRadius - 0.5f, 0.0f, static_cast<float>(size)));
      const float high = std::floor(std::clamp(center + kCenterRadius + 0.5f, 0.0f, static_cast<float>(size)));
      return std::pair(static_cast<int>(low), static_cast<int>(high));
    };
    const auto [x0, x1] = range(s.center_x, view.size.x);
    const auto [y0, y1] = range(s.center_y, view.size.y);
    for (int y = y0; y < y1; ++y) {
      for (int x = x0; x < x1; ++x) {
        const glm::vec2 off(static_cast<float>(x) + 0.5f - s.center_x, static_cast<float>(y) + 0.5f - s.center_y);
        if (glm::dot(off, off) <= kCenterRadius * kCenterRadius) {
          pixels[static_cast<std::size_t>(y) * view.size.x + x] = s.base;
        }
      }
    }
  }
}

}  // namespace tg::cpu

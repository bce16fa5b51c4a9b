// SPDX-License-Identifier: Apache-2.0
// shared/record.h: the reduced record says of every pixel what the full one says, and its tiles and blocks hold every
// pixel that a splat can colour, and few others.
#include "shared/record.h"

#include <cmath>

#include "support/catch.h"
#include "support/scenes.h"

using namespace tg;
using namespace tg::test;

namespace {

struct Prepared {
  Splat splat;
  SplatRecord record;
  bool bounded = false;
  glm::uvec4 rect{0u};  // x0, y0, x1, y1 [px], ends inclusive
};

// As project.comp prepares it; false when nothing of it can be seen.
bool prepare(const GaussianModel& model, const Camera& camera, IntersectionModel intersection, std::size_t i,
             Prepared& out) {
  const mat3 rotation_c(camera.rotation);
  const vec3 mean_c = rotation_c * model.mean[i] + vec3(camera.translation);
  const float opacity = 1.0f / (1.0f + std::exp(-model.opacity_logit[i]));
  const float radius = visibleRadius(opacity);
  if (mean_c.z <= kNear || radius <= 0.0f) return false;
  const mat3 axes = rotation_c * rotationFromQuaternion(model.rotation[i]);
  const vec3 scale = glm::exp(model.log_scale[i]);
  const int c = shortestAxis(scale);
  const int a = axisU(c), b = axisV(c);
  const mat3 axes_c(axes[a], axes[b], axes[c]);
  const vec3 scale_c(scale[a], scale[b], scale[c]);
  const vec4 focal_center = focalCenter(camera);
  vec4 box, outline;
  splatOutline(mean_c, axes_c, scale_c, radius, intersection == IntersectionModel::plane, focal_center,
               vec2(camera.size.x, camera.size.y), box, outline);
  out.bounded = outline.w != 0.0f;
  const vec2 first = glm::max(glm::ceil(vec2(box) - 0.5f - 1.0f / 64), vec2(0.0f));
  const vec2 last =
      glm::min(glm::floor(vec2(box.z, box.w) - 0.5f + 1.0f / 64), vec2(camera.size.x, camera.size.y) - 1.0f);
  if (!(first.x <= last.x && first.y <= last.y)) return false;
  out.rect = glm::uvec4(first, last);
  out.splat = makeSplat(mean_c, axes_c, scale_c, focal_center, opacity, vec3(0.25f, 0.5f, 0.75f));
  out.record = makeRecord(out.splat, static_cast<uint>(intersection), axes_c[2], outline);
  return true;
}

Hit recordHit(const SplatRecord& r, vec2 offset) {
  const float w = r.w_r.x * offset.x + r.w_r.y * offset.y;
  const float v = r.w_r.z * offset.y;
  const float moved = r.d_g.x * offset.x + r.d_g.y * offset.y;
  const float d = moved + r.d_g.z;
  const float s = r.e_b.x * offset.y + r.e_b.y;
  const float inverse = 1.0f / (d * d + s * s + r.e_b.z * r.e_b.z);
  const float t = (r.d_g.z * d + r.e_b.y * s + r.e_b.z * r.e_b.z) * inverse;
  const float shift = -(moved * d + r.e_b.x * offset.y * s) * inverse;
  Hit hit;
  hit.power = (w * w + v * v) * inverse;
  hit.t = t * r.center_depth_opacity.z;
  hit.uv = vec2(shift * r.u_offset.x + t * (r.u_offset.y * offset.x + r.u_offset.z * offset.y),
                shift * r.v_size.x + t * (r.v_size.y * offset.x + r.v_size.z * offset.y));
  return hit;
}

}  // namespace

TEST_CASE("the record gives the hit of the full formulas") {
  const SceneKind kind = GENERATE(from_range(kSceneKinds));
  const IntersectionModel intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  const TestScene scene = makeScene(kind, 4);
  int seen = 0, apart = 0;
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    Prepared p;
    if (!prepare(scene.model, scene.camera, intersection, i, p)) continue;
    for (uint y = p.rect.y; y <= p.rect.w; ++y) {
      for (uint x = p.rect.x; x <= p.rect.z; ++x) {
        const vec2 offset = (vec2(x, y) + 0.5f) - vec2(p.splat.center_depth_opacity);
        Hit expected;
        const Splat& s = p.splat;
        if (!intersectSplat(vec3(s.wx_r), vec3(s.wy_g), vec3(s.dx_b), vec3(s.dy_offset), vec3(s.d0_size),
                            s.center_depth_opacity.z, static_cast<uint>(intersection), offset, expected)) {
          continue;
        }
        if (expected.power > 11.0f) continue;
        const Hit hit = recordHit(p.record, offset);
        ++seen;
        const bool near = std::abs(hit.power - expected.power) < 1e-3f + 1e-3f * expected.power &&
                          std::abs(hit.t - expected.t) < 1e-3f * expected.t &&
                          glm::length(hit.uv - expected.uv) < 2e-3f * (1.0f + glm::length(expected.uv));
        apart += !near;
      }
    }
  }
  INFO(name(kind) << ", " << name(intersection) << ": " << apart << " of " << seen);
  CHECK(seen > 1000);
  CHECK(apart <= seen / 500);
}

TEST_CASE("tiles and blocks hold every pixel that a splat can colour, and not twice as many") {
  const SceneKind kind = GENERATE(from_range(kSceneKinds));
  const IntersectionModel intersection = GENERATE(IntersectionModel::plane, IntersectionModel::maxResponse);
  const TestScene scene = makeScene(kind, 5, 200, 100, 70);
  int missing = 0, exact_blocks = 0, blocks = 0;
  for (std::size_t i = 0; i < scene.model.size(); ++i) {
    Prepared p;
    if (!prepare(scene.model, scene.camera, intersection, i, p)) continue;
    for (uint tile_y = p.rect.y / kTileSize; tile_y <= p.rect.w / kTileSize; ++tile_y) {
      uint first = 0;
      const uint tiles = splatTiles(p.record, p.rect, tile_y, first);
      for (uint tile_x = 0; tile_x * kTileSize < static_cast<uint>(scene.camera.size.x); ++tile_x) {
        uint exact = 0;
        for (uint k = 0; k < kTileSize * kTileSize; ++k) {
          const uint x = tile_x * kTileSize + k % kTileSize, y = tile_y * kTileSize + k / kTileSize;
          if (x >= static_cast<uint>(scene.camera.size.x) || y >= static_cast<uint>(scene.camera.size.y)) continue;
          const Hit hit = recordHit(p.record, (vec2(x, y) + 0.5f) - vec2(p.splat.center_depth_opacity));
          const bool seen = hit.t > kNear && p.splat.center_depth_opacity.w * std::exp(-0.5f * hit.power) >= kAlphaMin;
          if (seen) exact |= 1u << (k / kTileSize / 4 * 4 + k % kTileSize / 4);
        }
        const bool in_list = tile_x >= first && tile_x < first + tiles;
        const uint found = in_list ? splatBlocks(p.record, tile_x, tile_y) : 0u;
        missing += (exact & ~found) != 0u;
        if (!p.bounded) continue;
        exact_blocks += __builtin_popcount(exact);
        blocks += __builtin_popcount(found);
      }
    }
  }
  INFO(name(kind) << ", " << name(intersection) << ": " << blocks << " blocks, " << exact_blocks << " coloured");
  CHECK(missing == 0);
  CHECK(exact_blocks > 100);
  CHECK(blocks <= 2 * exact_blocks);
}

// SPDX-License-Identifier: Apache-2.0
// shared/record.h: the reduced record says of every pixel what the full one says, and its tiles and blocks hold every
// pixel that a splat can colour, and few others.
#include "shared/record.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <vector>

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
                            s.center_depth_opacity.z, static_cast<uint>(intersection), offset, kNear, expected)) {
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

TEST_CASE("the columns of a sphere in the middle are those of its circle, no more") {
  const vec3 mean(0, 0, 4);
  const vec4 focal_center(100, 100, 32.3f, 32.4f);
  const float radius = 2, scale = 0.4f;
  vec4 box, outline;
  splatOutline(mean, mat3(1), vec3(scale), radius, false, focal_center, vec2(65), box, outline);
  REQUIRE(outline.w != 0.0f);
  const Splat splat = makeSplat(mean, mat3(1), vec3(scale), focal_center, 0.9f, vec3(0.5f));
  const SplatRecord record = makeRecord(splat, kIntersectMaxResponse, vec3(0, 0, 1), outline);
  const double extent = radius * scale, circle = 100 * extent / std::sqrt(16 - extent * extent);
  int rows = 0;
  for (int row = 0; row <= 64; ++row) {
    vec2 columns;
    const bool any = splatColumns(record, 0, 64, static_cast<float>(row), static_cast<float>(row), columns);
    const double y = row + 0.5 - focal_center.w;
    INFO("row " << row);
    CHECK(any == (std::abs(y) < circle));
    if (!any) continue;
    const double half = std::sqrt(circle * circle - y * y);
    const double low = focal_center.z - half - 0.5, high = focal_center.z + half - 0.5;
    // The columns have a margin against rounding.
    if (std::abs(low - std::round(low)) < 0.02 || std::abs(high - std::round(high)) < 0.02) continue;
    CHECK(columns.x == std::ceil(low));
    CHECK(columns.y == std::floor(high));
    ++rows;
  }
  CHECK(rows > 30);
}

TEST_CASE("a plane through the camera and along the rows of pixels has a record of finite numbers") {
  const mat3 axes(vec3(1, 0, 0), vec3(0, 0, 1), vec3(0, 1, 0));
  const Splat splat =
      makeSplat(vec3(0.25f, 0, 4), axes, vec3(4, 2, 0.5f), vec4(100, 100, 32.5f, 32.5f), 0.9f, vec3(0.5f));
  const SplatRecord record = makeRecord(splat, kIntersectPlane, axes[2], vec4(0, 0, 9, 0));
  CHECK(record.w_r.x == 0.0f);
  // Every ray that leaves the plane meets it in the camera alone: at (0.25 / 4, 4 / 2) sigma from the mean.
  const Hit hit = recordHit(record, vec2(5, 3));
  CHECK(std::abs(hit.power - 4.00390625f) < 1e-4f);
  CHECK(std::abs(hit.t) < 1e-6f);
  vec2 span;
  CHECK(outlineAt(record, 3, span));
}

TEST_CASE("a splat that reaches the camera's plane is left out where it lies beside the image, and only there") {
  const bool flat = GENERATE(false, true);
  std::vector<glm::dvec3> sphere(4000);  // Fibonacci's points, at most 0.04 rad from any direction
  for (std::size_t i = 0; i < sphere.size(); ++i) {
    const double z = 1.0 - (2.0 * static_cast<double>(i) + 1.0) / static_cast<double>(sphere.size());
    const double angle = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1.0 - z * z);
    sphere[i] = {r * std::cos(angle), r * std::sin(angle), z};
  }
  const vec4 focal_center(80, 60, 41, 33);
  const vec2 size(100, 70);
  const std::array<glm::dvec3, 4> inward = {  // normals of the planes through the left, top, right and bottom side
      glm::dvec3(1, 0, 41.0 / 80), {0, 1, 33.0 / 60}, {-1, 0, (100.0 - 41) / 80}, {0, -1, (70.0 - 33) / 60}};
  std::mt19937 random(flat ? 2u : 1u);
  std::uniform_real_distribution<float> unit(-1, 1);
  int left_out = 0, kept = 0;
  std::array<int, 4> by_one_side{};
  for (int i = 0; i < 3000; ++i) {
    const vec3 mean(3 * unit(random), 3 * unit(random), 0.25f + 0.15f * unit(random));
    const mat3 axes = rotationFromQuaternion(vec4(unit(random), unit(random), unit(random), unit(random)));
    const vec3 scale = glm::exp(vec3(unit(random), unit(random), unit(random))) * 0.3f;
    const float radius = 3;
    vec4 box, outline;
    splatOutline(mean, axes, scale, radius, flat, focal_center, size, box, outline);
    if (outline.w != 0.0f) continue;
    std::array<double, 4> reach;
    reach.fill(-1e9);
    for (const glm::dvec3& at : sphere) {
      const glm::dvec3 scaled = at * double{radius} * glm::dvec3(scale) * glm::dvec3(1, 1, flat ? 0 : 1);
      const glm::dvec3 point = glm::dvec3(mean) + glm::dmat3(axes) * scaled;
      for (std::size_t k = 0; k < 4; ++k) reach[k] = std::max(reach[k], glm::dot(inward[k], point));
    }
    constexpr double kUnsure = 0.02;  // what the points miss of the reach
    if (std::ranges::any_of(reach, [](double r) { return std::abs(r) < kUnsure; })) continue;
    const auto beyond = std::ranges::count_if(reach, [](double r) { return r < 0; });
    const bool empty = box.x > box.z && box.y > box.w;
    CHECK(empty == (beyond > 0));
    if (!empty) CHECK(box == vec4(0, 0, size.x, size.y));
    ++(empty ? left_out : kept);
    for (std::size_t k = 0; k < 4; ++k) by_one_side[k] += beyond == 1 && reach[k] < 0;
  }
  INFO(left_out << " left out, " << kept << " kept");
  CHECK(kept > 100);
  for (const int count : by_one_side) CHECK(count > 20);
}

TEST_CASE("a row through an outline without an end covers all columns") {
  SplatRecord r{};
  r.w_r.x = 1;
  r.d_g = vec4(1, 0, 1, 0);
  r.outline.z = 1;  // |W|^2 <= |D|^2 is x^2 <= (x + 1)^2: a parabola's inside
  vec2 span;
  REQUIRE(outlineAt(r, 0, span));
  CHECK(span == vec2(-1e9f, 1e9f));
}

TEST_CASE("a ray within a splat's plane does not hit it") {
  const auto hits = [](float normal) {
    Hit hit;
    return intersectSplat(vec3(0.1f, 0, 0), vec3(0, 0.1f, 0), vec3(0), vec3(0), vec3(0, 0, normal), 1, kIntersectPlane,
                          vec2(1, 2), kNear, hit);
  };
  for (const float normal : {0.0f, -0.0f}) CHECK_FALSE(hits(normal));
  for (const float normal : {1.0f, 1e-10f, -1e-18f}) CHECK(hits(normal));  // facing it, of 1e18 units
}

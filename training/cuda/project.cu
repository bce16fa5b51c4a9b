// SPDX-License-Identifier: Apache-2.0
// One thread a Gaussian. Tiles that an outline misses get no pair: each row of tiles is cut where the splat ends.
#include "training/cuda/project.h"

#include <bit>
#include <cstring>

#include "shared/record.h"
#include "shared/sh.h"
#include "training/cuda/geometry.h"

namespace tg::cuda {
namespace {

constexpr std::uint32_t kNotDrawn = 0xffffffffu;
constexpr float kBoxMargin = 0.01f;  // [px] more than rounding moves a box that matters; as on the CPU

struct ProjectArguments {
  View view;
  Parameters model;
  BlendSplat* splats;
  LocalFrame* frames;
  std::uint32_t* pixel_rects;
  std::uint32_t* tile_counts;
  std::uint32_t* depth_keys;
  float* screen_radius;
  glm::vec4* outlines;
};

TG_DEVICE std::uint32_t bitsOf(float value) {
  std::uint32_t bits;
  memcpy(&bits, &value, sizeof(bits));
  return bits;
}

TG_DEVICE glm::vec3 baseColor(const Parameters& model, std::size_t i, glm::dvec3 offset) {
  const glm::vec3 direction(offset / glm::length(offset));
  vec4 basis[4];
  shBasis(direction, basis[0], basis[1], basis[2], basis[3]);
  const float* sh = model.sh + i * 3 * model.sh_count;
  glm::vec3 color(0.5f);
#pragma unroll
  for (int k = 0; k < 16; ++k) {  // as many as there may be: an unrolled loop leaves `basis` in registers
    if (k >= model.sh_count) break;
    color += basis[k / 4][k % 4] * glm::vec3(sh[3 * k], sh[3 * k + 1], sh[3 * k + 2]);
  }
  return glm::max(color, glm::vec3(0.0f));
}

TG_DEVICE void store(float* to, glm::dvec3 v) {
  for (int k = 0; k < 3; ++k) to[k] = static_cast<float>(v[k]);
}

// The part of a record that splatTiles() reads.
TG_DEVICE SplatRecord outlineRecord(const BlendSplat& s, glm::vec4 outline) {
  SplatRecord record;
  const auto unit = static_cast<float>(1.0 / kExponentScale);
  record.center_depth_opacity = vec4(s.center_x, s.center_y, 0.0f, 0.0f);
  record.w_r = vec4(s.w_xx * unit, s.w_xy * unit, s.w_yy * unit, 0.0f);
  record.d_g = vec4(s.d_xx, s.d_xy, s.d_x1, 0.0f);
  record.e_b = vec4(s.d_yy, s.d_y1, s.d_11, 0.0f);
  record.outline = outline;
  return record;
}

TG_DEVICE uvec4 unpackRect(const std::uint32_t* packed) {
  return uvec4(packed[0] & 0xffffu, packed[0] >> 16, packed[1] & 0xffffu, packed[1] >> 16);
}

// False: nothing of the Gaussian is drawn. Its screen radius is written where its box is on the image.
TG_DEVICE bool projectOne(const ProjectArguments& a, std::size_t i) {
  const float opacity = 1.0f / (1.0f + ::expf(-a.model.opacity_logit[i]));
  const float radius = visibleRadius(opacity);
  const double z = cameraFromWorld(a.view, readMean(a.model, i)).z;
  if (!(z > kNear) || !(radius > 0.0f)) return false;
  const Geometry g = makeGeometry(a.view, a.model, i);

  const bool plane = a.view.intersection == kIntersectPlane;
  const glm::vec2 image(static_cast<float>(a.view.size.x), static_cast<float>(a.view.size.y));
  glm::vec4 box, outline;
  splatOutline(glm::vec3(g.mean_c), mat3(glm::vec3(g.axes_c[0]), glm::vec3(g.axes_c[1]), glm::vec3(g.axes_c[2])),
               glm::vec3(g.scale), radius, plane, focalCenter(a.view), image, box, outline);
  const float x0 = max(::ceilf(box.x - 0.5f - kBoxMargin), 0.0f);
  const float y0 = max(::ceilf(box.y - 0.5f - kBoxMargin), 0.0f);
  const float x1 = min(::floorf(box.z - 0.5f + kBoxMargin), image.x - 1.0f);
  const float y1 = min(::floorf(box.w - 0.5f + kBoxMargin), image.y - 1.0f);
  if (!(x0 <= x1 && y0 <= y1)) return false;  // also where a bound is no number

  BlendSplat s;
  const glm::dvec2 center = project(a.view, g.mean_c);
  s.center_x = static_cast<float>(center.x);
  s.center_y = static_cast<float>(center.y);
  s.log2_opacity = ::log2f(opacity);
  s.w_xx = static_cast<float>(kExponentScale * g.w_xx);
  s.w_xy = static_cast<float>(kExponentScale * g.w_xy);
  s.w_yy = static_cast<float>(kExponentScale * g.w_yy);
  s.d_xx = static_cast<float>(g.d_xx);
  s.d_xy = static_cast<float>(g.d_xy);
  s.d_x1 = static_cast<float>(g.d_x1);
  s.d_yy = static_cast<float>(g.d_yy);
  s.d_y1 = static_cast<float>(g.d_y1);
  s.d_11 = static_cast<float>(g.d_11);
  s.t_x = static_cast<float>(z * glm::dot(g.power_d[2], g.power_d[0]));
  s.t_y = static_cast<float>(z * glm::dot(g.power_d[2], g.power_d[1]));
  s.t_1 = static_cast<float>(z * glm::dot(g.power_d[2], g.power_d[2]));
  // Hits are tested only where the ellipsoid reaches the near plane.
  glm::dvec3 extent = g.scale * static_cast<double>(radius);
  if (plane) extent.z = 0;
  const double reach = glm::length(extent * glm::dvec3(g.axes_c[0].z, g.axes_c[1].z, g.axes_c[2].z));
  s.near = z - reach <= kNear * 1.001 ? kNear : 0.0f;
  const glm::vec3 base = baseColor(a.model, i, readMean(a.model, i) - a.view.eye);
  for (int k = 0; k < 3; ++k) s.base[k] = base[k];
  s.kappa_first = static_cast<float>(kExponentScale * glm::dot(g.kappa, g.w_first));
  s.kappa_second = static_cast<float>(kExponentScale * kExponentScale * glm::dot(g.kappa, g.w_second));
  s.gaussian = static_cast<std::uint32_t>(i);
  s.texel_offset = s.texture_size = 0;
  // What float cannot hold is not drawn.
  float size = s.log2_opacity + base.x + base.y + base.z;
  for (const float value : {s.center_x, s.center_y, s.w_xx, s.w_xy, s.w_yy, s.d_xx, s.d_xy, s.d_x1, s.d_yy, s.d_y1,
                            s.d_11, s.t_x, s.t_y, s.t_1}) {
    size += ::fabsf(value);
  }
  if (!(size < 3.0e38f)) return false;

  // A view counts for densification where the box has a pixel, as on the CPU, though the outline may miss every one.
  a.screen_radius[i] = 0.5f * max(box.z - box.x, box.w - box.y);

  const uvec4 rect(static_cast<uint>(x0), static_cast<uint>(y0), static_cast<uint>(x1), static_cast<uint>(y1));
  const SplatRecord record = outlineRecord(s, outline);
  uint tiles = 0;
  for (uint tile_y = rect.y / kTileSize; tile_y <= rect.w / kTileSize; ++tile_y) {
    uint first;
    tiles += splatTiles(record, rect, tile_y, first);
  }
  if (tiles == 0) return false;

  if (a.frames && a.model.rects[i].width > 0 && a.model.rects[i].height > 0) {
    const TextureRect r = a.model.rects[i];
    s.texel_offset = r.offset;
    s.texture_size = r.width | static_cast<std::uint32_t>(r.height) << 16;
    LocalFrame& frame = a.frames[i];
    store(frame.wx, g.power_w[0]);
    store(frame.wy, g.power_w[1]);
    store(frame.dx, g.power_d[0]);
    store(frame.dy, g.power_d[1]);
    store(frame.d0, g.power_d[2]);
    store(frame.kappa, g.kappa);
  }
  a.splats[i] = s;
  a.outlines[i] = outline;
  a.pixel_rects[2 * i] = rect.x | rect.y << 16;
  a.pixel_rects[2 * i + 1] = rect.z | rect.w << 16;
  a.tile_counts[i] = tiles;
  a.depth_keys[i] = bitsOf(static_cast<float>(z));
  return true;
}

TG_KERNEL projectKernel(ProjectArguments a) {
  const std::size_t i = itemIndex();
  if (i >= a.model.count) return;
  a.screen_radius[i] = 0.0f;
  if (projectOne(a, i)) return;
  a.tile_counts[i] = 0;
  a.depth_keys[i] = kNotDrawn;
}

TG_KERNEL numberKernel(std::uint32_t* indices, std::size_t count) {
  const std::size_t i = itemIndex();
  if (i < count) indices[i] = static_cast<std::uint32_t>(i);
}

// In depth order; their sum, in 64 bits, to `pairs`.
TG_KERNEL countKernel(const std::uint32_t* order, const std::uint32_t* tile_counts, std::uint32_t* counts,
                      std::size_t count, PairCount* pairs) {
  const std::size_t place = itemIndex();
  PairCount sum = 0;
  if (place < count) sum = counts[place] = tile_counts[order[place]];
  for (unsigned offset = kWarp / 2; offset > 0; offset /= 2) {
    sum += __shfl_xor_sync(kAllLanes, sum, static_cast<int>(offset));
  }
  if (threadIdx.x % kWarp == 0 && sum > 0) atomicAdd(pairs, sum);
}

struct EmitArguments {
  std::size_t count, room;
  int tiles_x;
  const BlendSplat* splats;
  const glm::vec4* outlines;
  const std::uint32_t* pixel_rects;
  const std::uint32_t* tile_counts;
  const std::uint32_t* order;
  const std::uint32_t* offsets;  // by place in the order
  std::uint32_t* pair_begin;
  std::uint32_t* pair_gaussian;
  std::uint32_t* pair_tiles;
  std::uint32_t* pair_indices;
};

TG_KERNEL emitKernel(EmitArguments a) {
  const std::size_t place = itemIndex();
  if (place >= a.count) return;
  const std::uint32_t i = a.order[place];
  std::uint32_t pair = a.offsets[place];
  a.pair_begin[i] = pair;
  if (a.tile_counts[i] == 0) return;
  const uvec4 rect = unpackRect(a.pixel_rects + 2 * static_cast<std::size_t>(i));
  const SplatRecord record = outlineRecord(a.splats[i], a.outlines[i]);
  for (uint tile_y = rect.y / kTileSize; tile_y <= rect.w / kTileSize; ++tile_y) {
    uint first;
    const uint tiles = splatTiles(record, rect, tile_y, first);
    for (uint k = 0; k < tiles && pair < a.room; ++k, ++pair) {
      a.pair_gaussian[pair] = i;
      a.pair_tiles[pair] = tile_y * static_cast<uint>(a.tiles_x) + first + k;
      a.pair_indices[pair] = pair;
    }
  }
}

// What is left of the room lies in a tile behind the last.
TG_KERNEL padKernel(const PairCount* pairs, std::size_t room, std::uint32_t tiles, std::uint32_t* pair_tiles,
                    std::uint32_t* pair_indices) {
  const std::size_t pair = itemIndex();
  if (pair >= room || pair < *pairs) return;
  pair_tiles[pair] = tiles;
  pair_indices[pair] = static_cast<std::uint32_t>(pair);
}

// One thread more than there is room: each writes the starts of the tiles between its pair's and the one before.
TG_KERNEL rangesKernel(const std::uint32_t* sorted_tiles, const PairCount* count, std::size_t room, std::uint32_t tiles,
                       std::uint32_t* tile_begin) {
  const std::size_t at = itemIndex();
  const std::size_t pairs = *count < room ? *count : room;
  if (at > pairs) return;
  const std::uint32_t before = at == 0 ? 0 : sorted_tiles[at - 1] + 1;
  const std::uint32_t here = at == pairs ? tiles : sorted_tiles[at];
  for (std::uint32_t tile = before; tile <= here; ++tile) tile_begin[tile] = static_cast<std::uint32_t>(at);
}

}  // namespace

void projectGaussians(const View& view, const Parameters& model, ScreenSplats& out) {
  const bool textured = view.texture_rgb || view.texture_alpha;
  out.splats.resize(model.count);
  out.frames.resize(textured ? model.count : 0);
  out.pixel_rects.resize(2 * model.count);
  out.tile_counts.resize(model.count);
  out.depth_keys.resize(model.count);
  out.screen_radius.resize(model.count);
  out.outlines.resize(model.count);
  const ProjectArguments arguments{view,
                                   model,
                                   out.splats.data(),
                                   textured ? out.frames.data() : nullptr,
                                   out.pixel_rects.data(),
                                   out.tile_counts.data(),
                                   out.depth_keys.data(),
                                   out.screen_radius.data(),
                                   out.outlines.data()};
  launch("project", projectKernel, blocksFor(model.count), arguments);
}

void makeRoom(std::size_t pairs, TileLists& out) {
  out.room = pairs;
  out.pair_gaussian.resizeExactly(pairs);
  out.sorted_pairs.resizeExactly(pairs);
  out.sums.resizeExactly(3 * pairs);
}

void buildLists(const View& view, const ScreenSplats& screen, Primitives& primitives, TileLists& out) {
  const std::size_t count = screen.tile_counts.size();
  const auto tiles = static_cast<std::uint32_t>(view.tiles_x * view.tiles_y);
  out.indices.resize(count);
  out.order.resize(count);
  out.sorted_keys.resize(count);
  out.counts.resize(count);
  out.offsets.resize(count);
  out.pair_begin.resize(count);
  out.tile_begin.resize(tiles + 1);
  out.pairs.resize(1);
  out.pairs.zero();
  launch("number", numberKernel, blocksFor(count), out.indices.data(), count);
  primitives.sortPairs(screen.depth_keys.data(), out.sorted_keys.data(), out.indices.data(), out.order.data(), count,
                       32);
  launch("count", countKernel, blocksFor(count), out.order.data(), screen.tile_counts.data(), out.counts.data(), count,
         out.pairs.data());
  primitives.exclusiveSum(out.counts.data(), out.offsets.data(), count);
  auto* pair_tiles = reinterpret_cast<std::uint32_t*>(out.sums.data());
  std::uint32_t* pair_indices = pair_tiles + out.room;
  std::uint32_t* sorted_tiles = pair_indices + out.room;
  const EmitArguments arguments{count,
                                out.room,
                                view.tiles_x,
                                screen.splats.data(),
                                screen.outlines.data(),
                                screen.pixel_rects.data(),
                                screen.tile_counts.data(),
                                out.order.data(),
                                out.offsets.data(),
                                out.pair_begin.data(),
                                out.pair_gaussian.data(),
                                pair_tiles,
                                pair_indices};
  launch("emit", emitKernel, blocksFor(count), arguments);
  launch("pad", padKernel, blocksFor(out.room), out.pairs.data(), out.room, tiles, pair_tiles, pair_indices);
  primitives.sortPairs(pair_tiles, sorted_tiles, pair_indices, out.sorted_pairs.data(), out.room,
                       std::bit_width(tiles));
  launch("ranges", rangesKernel, blocksFor(out.room + 1), sorted_tiles, out.pairs.data(), out.room, tiles,
         out.tile_begin.data());
}

}  // namespace tg::cuda

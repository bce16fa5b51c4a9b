#version 450
// SPDX-License-Identifier: Apache-2.0
// One thread per Gaussian: cull, splat record, base colour, and the number of tiles that it can colour. Models whose
// records exceed a binding come in chunks: the records are bound from the chunk's first Gaussian on.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "gaussian.glsl"
#include "shared/record.h"
#include "shared/sh.h"

layout(local_size_x = kGroupSize) in;
layout(constant_id = 0) const uint kShape = kShapeSplats;
FETCHED_UINTS(3, TextureSize, texture_size);  // [N] width | height << 16
layout(constant_id = 1) const bool kHalfSh = false;  // a texel buffer's format tells as well
// [N, rows, 3] 4 coefficients
#ifdef TG_STORAGE
layout(std430, binding = 4) readonly buffer Sh { uvec2 sh[]; };
vec4 fetchSh(int i) {
  if (kHalfSh) return vec4(unpackHalf2x16(sh[i].x), unpackHalf2x16(sh[i].y));
  return uintBitsToFloat(uvec4(sh[2 * i], sh[2 * i + 1]));
}
#define FETCH_SH(i) fetchSh(i)
#else
layout(binding = 4) uniform samplerBuffer sh;
#define FETCH_SH(i) texelFetch(sh, i)
#endif
layout(std430, binding = 5) writeonly buffer Records { SplatRecord records[]; };   // [chunk]
layout(std430, binding = 6) writeonly buffer PixelRects { uvec2 pixel_rects[]; };  // [N] x0 | y0 << 16, x1 | y1 << 16
layout(std430, binding = 7) writeonly buffer TileCounts { uint tile_counts[]; };   // [N] 0: culled

const float kColourMax = 3.4e38;
const float kBoxMargin = 1.0 / 64.0;  // [px] more than rounding moves a box that matters

vec3 baseColour(uint i, vec3 dir) {
  uint degree = decider(view.sh_degree);  // of the model
  uint rows = degree <= 1u ? 1u : degree == 2u ? 3u : 4u;
  uint used = shCoefficientCount(decider(view.sh_used));
  vec4 basis[4];
  shBasis(dir, basis[0], basis[1], basis[2], basis[3]);
  vec3 colour = vec3(0.5);
  for (uint row = 0u; row < rows; ++row) {
    int at = int((i * rows + row) * 3u);
    vec4 weights = mix(vec4(0.0), basis[row], lessThan(uvec4(row * 4u) + uvec4(0u, 1u, 2u, 3u), uvec4(used)));
    colour += vec3(dot(weights, FETCH_SH(at)), dot(weights, FETCH_SH(at + 1)),
                   dot(weights, FETCH_SH(at + 2)));
  }
  return colour;
}

// The pixels whose centres lie in `box` [px]: x0, y0, x1, y1, ends inclusive. False: none.
bool pixelsOfBox(vec4 box, out uvec4 pixels) {
  vec4 image = vec4(0.0, 0.0, float(view.width) - 1.0, float(view.height) - 1.0);
  vec2 first = max(ceil(vec2(box.x, box.y) - 0.5 - kBoxMargin), vec2(image.x, image.y));
  vec2 last = min(floor(vec2(box.z, box.w) - 0.5 + kBoxMargin), vec2(image.z, image.w));
  pixels = uvec4(0u);
  if (!(first.x <= last.x && first.y <= last.y)) return false;  // also where a bound is no number
  pixels = uvec4(uvec2(first), uvec2(last));
  return true;
}

// The shortest axis turned to the camera.
vec3 facingNormal(vec3 axis, vec3 mean_c) { return dot(axis, mean_c) > 0.0 ? -axis : axis; }

// A disc around the mean as a record: |W|^2 = x^2 + y^2 [px^2], |D|^2 = 1.
void makeDot(inout SplatRecord record, out vec4 box) {
  vec2 center = record.center_depth_opacity.xy;
  record.w_r.xyz = vec3(1.0, 0.0, 1.0);
  record.d_g.xyz = vec3(0.0, 0.0, 1.0);
  record.e_b.xyz = vec3(0.0);
  record.outline = vec4(0.0, 0.0, kCenterRadius * kCenterRadius, 1.0);
  box = vec4(center - kCenterRadius, center + kCenterRadius);
}

void main() {
  uint in_chunk = itemIndex();
  if (in_chunk >= pass.count) return;
  uint i = pass.first + in_chunk;
  tile_counts[i] = 0u;
  Gaussian g;
  if (!loadGaussian(i, g)) return;
  float radius = visibleRadius(g.opacity);
  if (!(radius > 0.0)) return;
  if (kShape == kShapeEllipsoids) radius = 1.0;
  uint intersection = kShape == kShapeEllipsoids ? kIntersectMaxResponse : decider(view.intersection);

  vec4 box;
  vec4 outline;
  splatOutline(g.mean_c, g.axes_c, g.scale, radius, intersection == kIntersectPlane, view.focal_center,
               vec2(float(view.width), float(view.height)), box, outline);
  uvec4 pixels;
  if (kShape != kShapeCenters && !pixelsOfBox(box, pixels)) return;

  vec3 colour = baseColour(i, normalize(fromCamera(g.mean)));
  // What float cannot hold is not drawn: where a splat has no weight it would leave no number.
  if (!(colour.x + colour.y + colour.z < kColourMax)) return;
  Splat splat = makeSplat(g.mean_c, g.axes_c, g.scale, view.focal_center, g.opacity, max(colour, vec3(0.0)));
  uint size = FETCH_UINT(texture_size, i);
  splat.dy_offset.w = uintBitsToFloat(FETCH(scale_offset, i).w);
  splat.d0_size.w = uintBitsToFloat(size);
  SplatRecord record = makeRecord(splat, intersection, facingNormal(g.axes_c[2], g.mean_c), outline);
  if (kShape == kShapeCenters) {
    makeDot(record, box);
    if (!pixelsOfBox(box, pixels)) return;
  }
  if (kShape == kShapeEllipsoids) {
    record.normal.w = g.mean_c.z * splat.d0_size.z;  // what u_offset and v_size have of the other axes
  } else if (size != 0u) {
    record.normal.w = texelDensity(splat.wx_r.xyz, splat.wy_g.xyz, splat.d0_size.xyz, size & 0xFFFFu, size >> 16u,
                                   decider(view.intersection));
  }
  uint tiles = 0u;
  for (uint tile_y = pixels.y / kTileSize; tile_y <= pixels.w / kTileSize; ++tile_y) {
    uint first;
    tiles += splatTiles(record, pixels, tile_y, first);
  }
  if (tiles == 0u) return;
  records[in_chunk] = record;
  pixel_rects[i] = uvec2(pixels.x | pixels.y << 16u, pixels.z | pixels.w << 16u);
  tile_counts[i] = tiles;
}

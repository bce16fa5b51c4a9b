#version 450
// SPDX-License-Identifier: Apache-2.0
// One thread per Gaussian: cull, splat record, base colour, exact screen box and the number of tiles under it. Models
// whose records exceed a binding come in chunks: the records are bound from the chunk's first Gaussian on.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "shared/record.h"
#include "shared/sh.h"

layout(local_size_x = kGroupSize) in;
layout(binding = 0) uniform samplerBuffer mean_logit;            // [N] mean, opacity logit
layout(binding = 1) uniform samplerBuffer rotation;              // [N] w, x, y, z
layout(binding = 2) uniform usamplerBuffer scale_offset;         // [N] ln(sigma), texel offset
layout(binding = 3) uniform usamplerBuffer texture_size;         // [N] width | height << 16
layout(binding = 4) uniform samplerBuffer sh;                    // [N, rows, 3] 4 coefficients
layout(std430, binding = 5) writeonly buffer Records { SplatRecord records[]; };    // [chunk]
layout(std430, binding = 6) writeonly buffer PixelRects { uvec2 pixel_rects[]; };   // [N] x0 | y0 << 16, x1 | y1 << 16
layout(std430, binding = 7) writeonly buffer TileCounts { uint tile_counts[]; };    // [N] 0: culled

// Sigmas outside these make 1 / sigma or its square overflow: such a Gaussian is a needle without width, or everywhere.
const float kScaleMin = 1e-18;
const float kScaleMax = 1e18;
const float kBoxMargin = 1.0 / 64.0;  // [px] more than rounding moves a box that matters

vec3 baseColour(uint i, vec3 dir) {
  uint rows = view.sh_degree <= 1u ? 1u : view.sh_degree == 2u ? 3u : 4u;
  vec4 basis[4];
  shBasis(dir, basis[0], basis[1], basis[2], basis[3]);
  vec3 colour = vec3(0.5);
  for (uint row = 0u; row < rows; ++row) {
    int at = int((i * rows + row) * 3u);
    colour += vec3(dot(basis[row], texelFetch(sh, at)), dot(basis[row], texelFetch(sh, at + 1)),
                   dot(basis[row], texelFetch(sh, at + 2)));
  }
  return max(colour, vec3(0.0));
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

void main() {
  uint in_chunk = itemIndex();
  if (in_chunk >= pass.count) return;
  uint i = pass.first + in_chunk;
  tile_counts[i] = 0u;

  vec4 mean = texelFetch(mean_logit, int(i));
  vec3 mean_c = (view.camera_from_world * vec4(mean.x, mean.y, mean.z, 1.0)).xyz;
  if (!(mean_c.z > kNear)) return;
  float opacity = 1.0 / (1.0 + exp(-mean.w));
  float radius = visibleRadius(opacity);
  if (!(radius > 0.0)) return;

  uvec4 log_scale_offset = texelFetch(scale_offset, int(i));
  vec3 scale = exp(uintBitsToFloat(log_scale_offset.xyz));
  if (!(min(scale.x, min(scale.y, scale.z)) > kScaleMin && max(scale.x, max(scale.y, scale.z)) < kScaleMax)) return;
  int c = shortestAxis(scale);
  int a = axisU(c);
  int b = axisV(c);
  mat3 axes = mat3(view.camera_from_world) * rotationFromQuaternion(texelFetch(rotation, int(i)));
  mat3 axes_c = mat3(axes[a], axes[b], axes[c]);
  vec3 scale_c = vec3(scale[a], scale[b], scale[c]);

  vec4 box;
  vec4 outline;
  bool flat_c = view.intersection == kIntersectPlane;
  vec2 size = vec2(float(view.width), float(view.height));
  splatOutline(mean_c, axes_c, scale_c, radius, flat_c, view.focal_center, size, box, outline);
  uvec4 pixels;
  if (!pixelsOfBox(box, pixels)) return;

  vec3 dir = normalize(mean.xyz - view.camera_position.xyz);
  Splat splat = makeSplat(mean_c, axes_c, scale_c, view.focal_center, opacity, baseColour(i, dir));
  splat.dy_offset.w = uintBitsToFloat(log_scale_offset.w);
  splat.d0_size.w = uintBitsToFloat(texelFetch(texture_size, int(i)).x);
  SplatRecord record = makeRecord(splat, view.intersection, facingNormal(axes_c[2], mean_c), outline);
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

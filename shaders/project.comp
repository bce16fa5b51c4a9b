#version 450
// SPDX-License-Identifier: Apache-2.0
// One thread per Gaussian: cull, splat record, base colour, exact screen box and the number of tiles under it. Models
// that exceed a binding come in chunks: the model's buffers are bound from the chunk's first Gaussian on.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "shared/sh.h"
#include "shared/splat.h"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) readonly buffer MeanLogit { vec4 mean_logit[]; };      // [chunk] mean, opacity logit
layout(std430, binding = 1) readonly buffer Rotation { vec4 rotation[]; };         // [chunk] w, x, y, z
layout(std430, binding = 2) readonly buffer ScaleOffset { vec4 scale_offset[]; };  // [chunk] ln(sigma), texel offset
layout(std430, binding = 3) readonly buffer TextureSize { uint texture_size[]; };  // [chunk] width | height << 16
layout(std430, binding = 4) readonly buffer Sh { vec4 sh[]; };                     // [chunk, rows, 3] 4 coefficients
layout(std430, binding = 5) writeonly buffer Center { vec4 center_depth_opacity[]; };  // [N] the members of Splat
layout(std430, binding = 6) writeonly buffer Wx { vec4 wx_r[]; };
layout(std430, binding = 7) writeonly buffer Wy { vec4 wy_g[]; };
layout(std430, binding = 8) writeonly buffer Dx { vec4 dx_b[]; };
layout(std430, binding = 9) writeonly buffer Dy { vec4 dy_offset[]; };
layout(std430, binding = 10) writeonly buffer D0 { vec4 d0_size[]; };
layout(std430, binding = 11) writeonly buffer PixelRects { uvec2 pixel_rects[]; }; // [N] x0 | y0 << 16, x1 | y1 << 16
layout(std430, binding = 12) writeonly buffer TileCounts { uint tile_counts[]; };  // [N] 0: culled

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
    uint at = (i * rows + row) * 3u;
    colour += vec3(dot(basis[row], sh[at]), dot(basis[row], sh[at + 1u]), dot(basis[row], sh[at + 2u]));
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

void main() {
  uint i = itemIndex();
  if (i >= pass.count) return;
  uint global = pass.first + i;
  tile_counts[global] = 0u;

  vec4 mean = mean_logit[i];
  vec3 mean_c = (view.camera_from_world * vec4(mean.x, mean.y, mean.z, 1.0)).xyz;
  if (!(mean_c.z > kNear)) return;
  float opacity = 1.0 / (1.0 + exp(-mean.w));
  float radius = visibleRadius(opacity);
  if (!(radius > 0.0)) return;

  vec4 log_scale_offset = scale_offset[i];
  vec3 scale = exp(log_scale_offset.xyz);
  if (!(min(scale.x, min(scale.y, scale.z)) > kScaleMin && max(scale.x, max(scale.y, scale.z)) < kScaleMax)) return;
  int c = shortestAxis(scale);
  int a = axisU(c);
  int b = axisV(c);
  mat3 axes = mat3(view.camera_from_world) * rotationFromQuaternion(rotation[i]);
  mat3 axes_c = mat3(axes[a], axes[b], axes[c]);
  vec3 scale_c = vec3(scale[a], scale[b], scale[c]);

  vec4 box;
  bool flat_c = view.intersection == kIntersectPlane;
  bool bounded = splatBox(mean_c, axes_c, scale_c, radius, flat_c, view.focal_center, box);
  if (!bounded) box = vec4(0.0, 0.0, float(view.width), float(view.height));
  uvec4 pixels;
  if (!pixelsOfBox(box, pixels)) return;

  vec3 dir = normalize(mean.xyz - view.camera_position.xyz);
  Splat splat = makeSplat(mean_c, axes_c, scale_c, view.focal_center, opacity, baseColour(i, dir));
  center_depth_opacity[global] = splat.center_depth_opacity;
  wx_r[global] = splat.wx_r;
  wy_g[global] = splat.wy_g;
  dx_b[global] = splat.dx_b;
  dy_offset[global] = vec4(splat.dy_offset.xyz, log_scale_offset.w);
  d0_size[global] = vec4(splat.d0_size.xyz, uintBitsToFloat(texture_size[i]));
  pixel_rects[global] = uvec2(pixels.x | pixels.y << 16u, pixels.z | pixels.w << 16u);
  uvec4 tiles = pixels / kTileSize;
  tile_counts[global] = (tiles.z - tiles.x + 1u) * (tiles.w - tiles.y + 1u);
}

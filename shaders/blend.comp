#version 450
// SPDX-License-Identifier: Apache-2.0
// One group per tile, 2 x 2 pixels per thread: the tile's splats front to back, 64 at a time through shared memory.
//
// A dispatch does at most pass.count list entries of a tile, from number pass.first on: one driver ends every loop of a
// thread after 65535 rounds without a word. Longer lists continue in the next dispatch from the sums stored here, which
// are turned into outputs by the dispatch that reaches a tile's end.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "shared/splat.h"
#include "shared/texture.h"

const uint kGroupSide = kTileSize / 2u;
const uint kBatch = kGroupSide * kGroupSide;
layout(local_size_x = kGroupSide, local_size_y = kGroupSide) in;
layout(constant_id = 0) const bool kGeometry = true;  // depth, normal and count are wanted
layout(constant_id = 1) const uint kTexelShift = 31u; // log2(texels per buffer); 31: all are in the first

layout(std430, binding = 0) readonly buffer TileRanges { uvec2 tile_ranges[]; };             // [tiles]
layout(std430, binding = 1) readonly buffer Splats { uint pair_splats[]; };                  // [pairs]
layout(std430, binding = 2) readonly buffer Center { vec4 splat_center_depth_opacity[]; };   // [N] the members of Splat
layout(std430, binding = 3) readonly buffer Wx { vec4 splat_wx_r[]; };
layout(std430, binding = 4) readonly buffer Wy { vec4 splat_wy_g[]; };
layout(std430, binding = 5) readonly buffer Dx { vec4 splat_dx_b[]; };
layout(std430, binding = 6) readonly buffer Dy { vec4 splat_dy_offset[]; };
layout(std430, binding = 7) readonly buffer D0 { vec4 splat_d0_size[]; };
layout(std430, binding = 8) readonly buffer Texels0 { uvec2 texels0[]; };                    // 4 halfs: r, g, b, alpha
layout(std430, binding = 9) readonly buffer Texels1 { uvec2 texels1[]; };
layout(std430, binding = 10) readonly buffer Texels2 { uvec2 texels2[]; };
layout(std430, binding = 11) readonly buffer Texels3 { uvec2 texels3[]; };
layout(std430, binding = 12) buffer BaseTransmittance { vec4 base_transmittance[]; };        // [pixels]
layout(std430, binding = 13) buffer TextureDepth { vec4 texture_depth[]; };                  // [pixels]
layout(std430, binding = 14) buffer NormalCount { vec4 normal_count[]; };                    // [pixels]

// 2 ln 255 = 11.08: beyond, alpha < kAlphaMin for every opacity. Written so that no-number fails it.
const float kPowerMax = 12.0;

struct Pixel {
  vec3 base;
  float transmittance;
  vec3 tint;  // the texture's share of the colour
  float depth;
  vec3 normal;
  float count;
  bool done;
};

shared Splat batch[kBatch];
shared vec4 batch_normals[kBatch];
shared uint live[2];  // some pixel of the tile still takes splats; one flag per parity of the batch

// The shortest axis in camera space, turned to the camera. It is the third row of what makeSplat() composed.
vec3 splatNormal(Splat s) {
  vec2 center = vec2(s.center_depth_opacity.x - view.focal_center.z, s.center_depth_opacity.y - view.focal_center.w);
  float z = s.d0_size.z - center.x * s.dx_b.z - center.y * s.dy_offset.z;
  vec3 axis = normalize(vec3(s.dx_b.z * view.focal_center.x, s.dy_offset.z * view.focal_center.y, z));
  return s.d0_size.z > 0.0 ? -axis : axis;  // d0.z has the sign of axis . mean
}

vec4 fetchTexel(uint index) {
  uint local = index & ((1u << kTexelShift) - 1u);
  uvec2 bits;
  switch (kTexelShift == 31u ? 0u : index >> kTexelShift) {
    case 0u: bits = texels0[local]; break;
    case 1u: bits = texels1[local]; break;
    case 2u: bits = texels2[local]; break;
    default: bits = texels3[local]; break;
  }
  return vec4(unpackHalf2x16(bits.x), unpackHalf2x16(bits.y));
}

vec4 fetchTexture(vec2 uv, uint offset, uint size) {
  uint width = size & 0xFFFFu;
  TextureTap u = textureTap(uv.x, width);
  TextureTap v = textureTap(uv.y, size >> 16u);
  vec4 top = mix(fetchTexel(offset + v.i0 * width + u.i0), fetchTexel(offset + v.i0 * width + u.i1), u.fraction);
  vec4 bottom = mix(fetchTexel(offset + v.i1 * width + u.i0), fetchTexel(offset + v.i1 * width + u.i1), u.fraction);
  return mix(top, bottom, v.fraction);
}

void blendSplat(uint k, vec2 center, inout Pixel pixel) {
  if (pixel.done) return;
  Splat s = batch[k];
  Hit hit;
  vec2 delta = center - s.center_depth_opacity.xy;
  if (!intersectSplat(s.wx_r.xyz, s.wy_g.xyz, s.dx_b.xyz, s.dy_offset.xyz, s.d0_size.xyz, s.center_depth_opacity.z,
                      view.intersection, delta, hit)) {
    return;
  }
  if (!(hit.power < kPowerMax)) return;
  float alpha = s.center_depth_opacity.w * exp(-0.5 * hit.power);
  vec3 tint = vec3(0.0);
  uint size = floatBitsToUint(s.d0_size.w);
  if (view.texture_mode != kModeNone && size != 0u && insideTexture(hit.uv)) {
    vec4 texel = fetchTexture(hit.uv, floatBitsToUint(s.dy_offset.w), size);
    if ((view.texture_mode & kModeAlpha) != 0u) alpha *= texel.w;
    if ((view.texture_mode & kModeRgb) != 0u) tint = texel.xyz;
  }
  alpha = min(kAlphaMax, alpha);
  if (!(alpha >= kAlphaMin)) return;
  float transmittance = pixel.transmittance * (1.0 - alpha);
  if (transmittance < kTransmittanceStop) {
    pixel.done = true;
    return;
  }
  float weight = pixel.transmittance * alpha;
  pixel.base += weight * vec3(s.wx_r.w, s.wy_g.w, s.dx_b.w);
  pixel.tint += weight * tint;
  if (kGeometry) {
    pixel.depth += weight * hit.t;
    pixel.normal += weight * batch_normals[k].xyz;
    pixel.count += 1.0;
  }
  pixel.transmittance = transmittance;
}

// A pixel that takes no more splats is stored with its transmittance negated.
Pixel loadPixel(uvec2 at) {
  Pixel pixel = Pixel(vec3(0.0), 1.0, vec3(0.0), 0.0, vec3(0.0), 0.0, at.x >= view.width || at.y >= view.height);
  if (pass.first > 0u && !pixel.done) {
    uint i = at.y * view.width + at.x;
    pixel.base = base_transmittance[i].xyz;
    pixel.transmittance = abs(base_transmittance[i].w);
    pixel.done = base_transmittance[i].w < 0.0;
    pixel.tint = texture_depth[i].xyz;
    if (kGeometry) {
      pixel.depth = texture_depth[i].w;
      pixel.normal = normal_count[i].xyz;
      pixel.count = normal_count[i].w;
    }
  }
  return pixel;
}

void storePixel(uvec2 at, Pixel pixel, bool finish) {
  if (at.x >= view.width || at.y >= view.height) return;
  uint i = at.y * view.width + at.x;
  float transmittance = pixel.transmittance;
  if (finish) {
    pixel.base += transmittance * view.background.xyz;
    pixel.depth = pixel.count > 0.0 ? pixel.depth / (1.0 - transmittance) : 0.0;
  } else if (pixel.done) {
    transmittance = -transmittance;
  }
  base_transmittance[i] = vec4(pixel.base, transmittance);
  texture_depth[i] = vec4(pixel.tint, pixel.depth);
  if (kGeometry) normal_count[i] = vec4(pixel.normal, pixel.count);
}

void main() {
  uint thread = gl_LocalInvocationIndex;
  uvec2 range = tile_ranges[gl_WorkGroupID.y * view.tiles_x + gl_WorkGroupID.x];
  uint length = range.y - range.x;
  if (pass.first > 0u && pass.first >= length) return;  // finished by an earlier dispatch
  uint begin = range.x + pass.first;
  uint end = begin + min(length - pass.first, pass.count);

  uvec2 at = gl_WorkGroupID.xy * kTileSize + gl_LocalInvocationID.xy * 2u;
  vec2 center = vec2(at) + 0.5;
  Pixel p00 = loadPixel(at);
  Pixel p10 = loadPixel(at + uvec2(1u, 0u));
  Pixel p01 = loadPixel(at + uvec2(0u, 1u));
  Pixel p11 = loadPixel(at + uvec2(1u, 1u));

  if (thread < 2u) live[thread] = 0u;
  barrier();
  uint parity = 0u;
  for (uint first = begin; first < end; first += kBatch) {
    if (first + thread < end) {
      uint i = pair_splats[first + thread];
      batch[thread] = Splat(splat_center_depth_opacity[i], splat_wx_r[i], splat_wy_g[i], splat_dx_b[i],
                            splat_dy_offset[i], splat_d0_size[i]);
      if (kGeometry) batch_normals[thread] = vec4(splatNormal(batch[thread]), 0.0);
    }
    if (!(p00.done && p10.done && p01.done && p11.done)) live[parity] = 1u;
    barrier();
    if (live[parity] == 0u) break;
    parity ^= 1u;
    if (thread == 0u) live[parity] = 0u;
    uint batch_size = min(kBatch, end - first);
    for (uint k = 0u; k < batch_size; ++k) {
      blendSplat(k, center, p00);
      blendSplat(k, center + vec2(1.0, 0.0), p10);
      blendSplat(k, center + vec2(0.0, 1.0), p01);
      blendSplat(k, center + vec2(1.0, 1.0), p11);
    }
    barrier();
  }
  bool finish = pass.first + pass.count >= length;
  storePixel(at, p00, finish);
  storePixel(at + uvec2(1u, 0u), p10, finish);
  storePixel(at + uvec2(0u, 1u), p01, finish);
  storePixel(at + uvec2(1u, 1u), p11, finish);
}

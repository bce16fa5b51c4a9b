#version 450
// SPDX-License-Identifier: Apache-2.0
// One group per tile, 2 x 2 pixels per thread. The tile's splats come front to back, 64 at a time, through shared
// memory. A bit per splat and block of 4 x 4 pixels says whether its screen box touches the block, and a thread looks
// only at the splats of its block: most splats are smaller than a tile.
//
// A dispatch does at most pass.count list entries of a tile, from number pass.first on: one driver ends every loop of a
// thread after 65535 rounds without a word. Longer lists continue in the next dispatch from the sums stored here, which
// are turned into outputs by the dispatch that reaches a tile's end.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "pass.glsl"
#include "shared/splat.h"
#include "shared/texture.h"

const uint kThreads = 64u;
const uint kThreadSide = 2u;  // [px]
const uint kPixels = 4u;      // of a thread
const uint kBlockSide = 4u;   // [px]
const uint kBlocks = 16u;     // of a tile, 4 to a row, 4 threads to a block
const uint kBatch = kThreads;
const uint kWords = kBatch / 32u;
layout(local_size_x = kThreads) in;
layout(constant_id = 0) const bool kGeometry = true;   // depth, normal and count are wanted
layout(constant_id = 1) const uint kTexelShift = 31u;  // log2(texels per buffer); 31: all are in the first

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
layout(std430, binding = 15) readonly buffer PixelRects { uvec2 pixel_rects[]; };            // [N] see project.comp

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
// Twice, for even and odd batches: one is cleared while the other is read.
shared uint block_splats[2][kBlocks * kWords];  // which splats of the batch each block sees
shared uint live[2];                            // some pixel of the tile still takes splats

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

void blendSplat(Splat s, vec3 normal, vec2 center, inout Pixel pixel) {
  if (pixel.done) return;
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
    pixel.normal += weight * normal;
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

// The blocks of this tile that a screen box [px, ends inclusive] touches, a bit each.
uint touchedBlocks(uvec2 rect) {
  ivec2 origin = ivec2(gl_WorkGroupID.xy * kTileSize);
  ivec2 first = clamp(ivec2(rect.x & 0xFFFFu, rect.x >> 16u) - origin, 0, int(kTileSize) - 1) / int(kBlockSide);
  ivec2 last = clamp(ivec2(rect.y & 0xFFFFu, rect.y >> 16u) - origin, 0, int(kTileSize) - 1) / int(kBlockSide);
  uint columns = (2u << last.x) - (1u << first.x);
  uint rows = (2u << (4 * last.y)) - (1u << (4 * first.y));
  return columns * (rows & 0x1111u);
}

// Puts a list entry at this thread's place of an even (0) or odd (1) batch.
void stage(uint entry, uint parity) {
  uint thread = gl_LocalInvocationIndex;
  uint i = pair_splats[entry];
  batch[thread] = Splat(splat_center_depth_opacity[i], splat_wx_r[i], splat_wy_g[i], splat_dx_b[i], splat_dy_offset[i],
                        splat_d0_size[i]);
  if (kGeometry) batch_normals[thread] = vec4(splatNormal(batch[thread]), 0.0);
  for (uint blocks = touchedBlocks(pixel_rects[i]); blocks != 0u; blocks &= blocks - 1u) {
    atomicOr(block_splats[parity][uint(findLSB(blocks)) * kWords + thread / 32u], 1u << (thread % 32u));
  }
}

void main() {
  uint thread = gl_LocalInvocationIndex;
  uvec2 range = tile_ranges[gl_WorkGroupID.y * view.tiles_x + gl_WorkGroupID.x];
  uint length = range.y - range.x;
  if (pass.first > 0u && pass.first >= length) return;  // finished by an earlier dispatch
  uint begin = range.x + pass.first;
  uint end = begin + min(length - pass.first, pass.count);

  uint block = thread / 4u;
  uvec2 in_block = uvec2(thread % 2u, thread / 2u % 2u) * kThreadSide;
  uvec2 at = gl_WorkGroupID.xy * kTileSize + uvec2(block % 4u, block / 4u) * kBlockSide + in_block;
  Pixel pixels[kPixels];
  bool done = true;
  [[unroll]] for (uint j = 0u; j < kPixels; ++j) {
    pixels[j] = loadPixel(at + uvec2(j % kThreadSide, j / kThreadSide));
    done = done && pixels[j].done;
  }

  if (thread < kBlocks * kWords) block_splats[0][thread] = 0u;
  if (thread == 0u) live[0] = 0u;
  barrier();
  uint parity = 0u;
  for (uint first = begin; first < end; first += kBatch, parity ^= 1u) {
    if (first + thread < end) stage(first + thread, parity);
    if (!done) live[parity] = 1u;
    barrier();
    if (live[parity] == 0u) break;
    if (thread < kBlocks * kWords) block_splats[parity ^ 1u][thread] = 0u;
    if (thread == 0u) live[parity ^ 1u] = 0u;
    for (uint word = 0u; word < kWords; ++word) {
      uint splats = block_splats[parity][block * kWords + word];
      while (splats != 0u && !done) {
        uint k = word * 32u + uint(findLSB(splats));
        splats &= splats - 1u;
        Splat s = batch[k];
        vec3 normal = kGeometry ? batch_normals[k].xyz : vec3(0.0);
        done = true;
        [[unroll]] for (uint j = 0u; j < kPixels; ++j) {
          blendSplat(s, normal, vec2(at + uvec2(j % kThreadSide, j / kThreadSide)) + 0.5, pixels[j]);
          done = done && pixels[j].done;
        }
      }
    }
    barrier();
  }
  bool finish = pass.first + pass.count >= length;
  [[unroll]] for (uint j = 0u; j < kPixels; ++j) {
    storePixel(at + uvec2(j % kThreadSide, j / kThreadSide), pixels[j], finish);
  }
}

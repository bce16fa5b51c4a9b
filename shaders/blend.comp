#version 450
// SPDX-License-Identifier: Apache-2.0
// A tile's splats front to back into its pixels: one group per tile, a square of kSide x kSide pixels per thread. A
// thread looks only at the splats that touch its block of 4 x 4 pixels: the pairs' keys have a bit for each block.
// Threads go their own ways through the list, without shared memory or barriers: what a thread loads of a splat serves
// all its pixels.
//
// A dispatch does at most pass.count list entries of a tile, from number pass.first on: one driver ends every loop of a
// thread after 65535 rounds without a word. Longer lists continue in the next dispatch from the sums stored here, which
// are turned into outputs by the dispatch that reaches a tile's end.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#include "fetch.glsl"
#include "pass.glsl"
#include "shared/splat.h"
#include "shared/texels.h"
#include "shared/texture.h"

layout(local_size_x_id = 1) in;
layout(constant_id = 0) const bool kAll = true;        // all outputs; otherwise base holds the final colour alone
layout(constant_id = 2) const uint kSide = 2u;         // [px] of a thread: 1, 2 or 4; threads: (kTileSize / kSide)^2
layout(constant_id = 3) const uint kSample = kSampleBilinear;
layout(constant_id = 4) const bool kOverdraw = false;  // count what lies behind the last blended splat, too
// Splats that a pixel keeps back to blend them in the order of their hits; 0: blend them in the order of the list.
layout(constant_id = 5) const uint kKept = 0u;
layout(constant_id = 6) const bool kHalfTexels = true;  // otherwise 8 bits
layout(constant_id = 7) const uint kOutside = kOutsideBase;
const bool kTextured = kSample != kSampleNone;

FETCHED_UVEC4S(0, PairKeys, pair_keys);         // [pairs / 4] tile << kBlockBits | blocks, four to a texel
FETCHED_UINTS(1, PairSplats, pair_splats);      // [pairs]
FETCHED_UVEC4S(2, Records, records);            // [N, 8] SplatRecord
FETCHED_UVEC4S(3, Texels, texels);              // cells of four texels (render/gpu/model_buffers.h)
FETCHED_VEC4S(4, TextureMeans, texture_means);  // [N] kSampleFootprint
layout(std430, binding = 5) buffer CountersBlock { Counters counters; };
layout(std430, binding = 6) readonly buffer TileRanges { uvec2 tile_ranges[]; };       // [tiles]
layout(std430, binding = 7) buffer BaseTransmittance { vec4 base_transmittance[]; };   // [pixels]
layout(std430, binding = 8) buffer TextureDepth { vec4 texture_depth[]; };             // [pixels]
layout(std430, binding = 9) buffer NormalCount { vec4 normal_count[]; };               // [pixels]
// [pixels] median depth, overdraw, texel density, and on the way the weight of the textured splats
layout(std430, binding = 10) buffer Extras { vec4 extras[]; };

const uint kPixels = kSide * kSide;
const uint kBlockSide = 4u;  // [px]
const uint kBlockThreadsPerSide = kBlockSide / kSide;
const uint kBlockThreads = kBlockThreadsPerSide * kBlockThreadsPerSide;
const float kHalfLog2E = 0.72134752044448170;  // exp(-x / 2) = exp2(-kHalfLog2E x)
// 2 ln 255 = 11.08: beyond, alpha < kAlphaMin for every opacity. Written so that no-number fails it.
const float kPowerMax = 12.0;

vec4 fetchRecord(uint splat, uint member) {
  return uintBitsToFloat(FETCH(records, splat * kRecordSize + member));
}

// Of the view: read once, since drivers read a uniform again wherever a loop or a branch uses it.
float near_plane;
uint texture_mode;

// Sums of a thread's pixels. A pixel that takes no more splats has its transmittance negated.
float transmittances[kPixels];
vec3 bases[kPixels];  // with the texture's share unless kAll
vec3 tints[kPixels];  // the texture's share of the colour
float depths[kPixels];
vec3 normals[kPixels];
float counts[kPixels];
vec4 more[kPixels];  // as extras

// A splat at a pixel, ready to be blended.
struct Fragment {
  float depth;  // camera z of the hit
  float alpha;  // 0: nothing
  vec3 base;    // with tint unless kAll
  vec3 tint;
  vec3 normal;
  float density;  // [texels / px], -1 without a texture
};

void blendFragment(uint j, Fragment f) {
  bool hit = f.alpha >= kAlphaMin;
  float before = transmittances[j];
  float after = before * (1.0 - f.alpha);
  bool take = hit && after >= kTransmittanceStop;
  transmittances[j] = take ? after : hit ? -abs(before) : before;
  float weight = take ? before * f.alpha : 0.0;
  bases[j] = fma(vec3(weight), f.base, bases[j]);
  if (kAll) {
    tints[j] += weight * f.tint;
    depths[j] += take ? weight * f.depth : 0.0;  // without bounds where nothing is taken
    normals[j] += weight * f.normal;
    counts[j] += take ? 1.0 : 0.0;
    if (take && before >= 0.5 && after < 0.5) more[j].x = f.depth;
    if (kOverdraw) more[j].y += hit ? 1.0 : 0.0;
    if (f.density >= 0.0) more[j].zw += weight * vec2(f.density, 1.0);
  }
}

// Fragments that wait, nearest first. Places not taken yet come first and have nothing to blend.
Fragment kept[kPixels * (kKept + 1u)];
const Fragment kNoFragment = Fragment(-1.0, 0.0, vec3(0.0), vec3(0.0), vec3(0.0), -1.0);

// The nearest of the fragments kept and `f` is blended, the others stay.
void keepFragment(uint j, Fragment f) {
  if (f.alpha < kAlphaMin) return;
  Fragment far = f;
  Fragment near = kept[j * kKept];
  bool placed = f.depth < near.depth;  // before its equals, which came later; `f` itself goes behind them
  if (placed) {
    far = near;
    near = f;
  }
  blendFragment(j, near);
  [[unroll]] for (uint k = 0u; k + 1u < kKept; ++k) {
    Fragment next = kept[j * kKept + k + 1u];
    bool in_order = placed ? far.depth <= next.depth : far.depth < next.depth;
    kept[j * kKept + k] = next;
    if (in_order) {
      kept[j * kKept + k] = far;
      far = next;
      placed = true;
    }
  }
  kept[j * kKept + max(kKept, 1u) - 1u] = far;  // compilers refuse -1, though nothing calls this then
}

// Where a pixel falls on a texture.
struct Tap {
  bool inside;
  int cell;       // 0, which changes nothing, when not inside
  vec2 fraction;  // of halfs: between the cell's texels, in [0, 1], 1 on the border only
  uvec2 steps;    // of bytes: the same in steps, whole ones
};

const int kStepBits = 8;
const uint kSteps = 1u << kStepBits;  // between two texels of bytes
const float kTexelSteps = kHalfTexels ? 1.0 : float(kSteps);

// texel: from the first one on, in units of 1 / kTexelSteps; of bytes half a step more, which rounds.
Tap tapAt(vec2 texel, uvec2 cells, int first_cell) {
  Tap tap = Tap(false, 0, vec2(0.0), uvec2(0u));
  ivec2 cell;
  if (kOutside == kOutsideEdge) texel = clamp(texel, vec2(0.0), kTexelSteps * vec2(cells));
  if (kHalfTexels) {
    vec2 corner = floor(texel);
    if (kOutside == kOutsideEdge) corner = min(corner, vec2(cells) - 1.0);
    cell = ivec2(corner);
    tap.fraction = texel - corner;
  } else {
    ivec2 steps = ivec2(texel);
    cell = steps >> kStepBits;
    tap.steps = uvec2(steps) & (kSteps - 1u);
    if (kOutside == kOutsideEdge) {
      cell = min(cell, ivec2(cells) - 1);
      tap.steps = uvec2(steps - (cell << kStepBits));
    }
  }
  tap.inside = uint(cell.x) < cells.x && uint(cell.y) < cells.y;
  if (tap.inside) tap.cell = first_cell + cell.y * int(cells.x) + cell.x;
  return tap;
}

vec4 halvesOf(uvec2 texel) { return vec4(unpackHalf2x16(texel.x), unpackHalf2x16(texel.y)); }
vec4 between(vec4 from, vec4 to, float share) { return fma(to - from, vec4(share), from); }

// Red and blue of a texel of bytes, or, of the texel shifted down by 8 bits, green and alpha: each in 16 bits.
uint twoBytes(uint texel) { return texel & 0x00FF00FFu; }

// The bilinear sample, before unit and start of TexelRange. Weights of bytes are multiples of 1 / kSteps, as those of
// most hardware: two channels are weighted at once.
vec4 sampleCell(Tap tap) {
  if (kHalfTexels) {
    uvec4 above = FETCH(texels, tap.cell * 2);
    uvec4 below = FETCH(texels, tap.cell * 2 + 1);
    return between(between(halvesOf(above.xy), halvesOf(above.zw), tap.fraction.x),
                   between(halvesOf(below.xy), halvesOf(below.zw), tap.fraction.x), tap.fraction.y);
  }
  uvec4 corners = FETCH(texels, tap.cell);
  uvec4 weights;  // their sum is kSteps
  weights.w = tap.steps.x * tap.steps.y + kSteps / 2u >> kStepBits;
  weights.yz = tap.steps - weights.w;
  weights.x = kSteps - tap.steps.x - weights.z;
  // One by one: an index into a vector, where a compiler does not unroll the loop, puts it into memory.
  uint red_blue = twoBytes(corners.x) * weights.x + twoBytes(corners.y) * weights.y + twoBytes(corners.z) * weights.z +
                  twoBytes(corners.w) * weights.w;
  corners >>= 8u;
  uint green_alpha = twoBytes(corners.x) * weights.x + twoBytes(corners.y) * weights.y +
                     twoBytes(corners.z) * weights.z + twoBytes(corners.w) * weights.w;
  return vec4(ivec4(red_blue & 0xFFFFu, green_alpha & 0xFFFFu, red_blue >> 16, green_alpha >> 16));
}

// What turns a sample into the texture's share of the colour and the factor on alpha.
struct TexelRange {
  vec4 unit;
  vec4 start;
};

// Of a texel, what the mode lets through.
vec4 inMode(vec4 texel, float no_alpha) {
  return vec4((texture_mode & kModeRgb) != 0u ? texel.xyz : vec3(0.0),
              (texture_mode & kModeAlpha) != 0u ? texel.w : no_alpha);
}

TexelRange texelRange(uint place) {
  TexelRange range = TexelRange(vec4(1.0), vec4(0.0));  // of halfs
  if (!kHalfTexels) {
    float unit = uintBitsToFloat((place >> kCellBits) + uint(127 + kTexelExponentMin) << 23u) / 127.0;
    range.unit = vec4(vec3(unit), -1.0 / 255.0) / float(kSteps);
    range.start = vec4(vec3(-128.0 * unit), 1.0);
  }
  range.unit = inMode(range.unit, 0.0);
  range.start = inMode(range.start, 1.0);
  return range;
}

void blendSplat(uint splat, vec2 first_center) {
  vec4 center_depth_opacity = fetchRecord(splat, 0u);
  vec4 w_r = fetchRecord(splat, 1u);
  vec4 d_g = fetchRecord(splat, 2u);
  vec4 e_b = fetchRecord(splat, 3u);
  vec4 u_offset = kTextured ? fetchRecord(splat, 4u) : vec4(0.0);
  vec4 v_size = kTextured ? fetchRecord(splat, 5u) : vec4(0.0);
  vec4 normal = kAll || kSample == kSampleFootprint ? fetchRecord(splat, 6u) : vec4(0.0);
  uint size = floatBitsToUint(v_size.w);
  uint place = floatBitsToUint(u_offset.w);
  uvec2 cells = max(uvec2(size & 0xFFFFu, size >> 16u), 2u) - 1u;
  // Texel coordinates: those of the mean, and how they change with shift, x and y. Without a texture: far outside.
  vec2 texels_per_sigma = kTexelSteps / (2.0 * kTextureExtent) * vec2(cells);
  vec2 texel_mean = size != 0u ? 0.5 * kTexelSteps * vec2(cells) + (kHalfTexels ? 0.0 : 0.5) : vec2(-1e9);
  vec2 texel_shift = vec2(u_offset.x, v_size.x) * texels_per_sigma - texel_mean;
  vec2 texel_x = vec2(u_offset.y, v_size.y) * texels_per_sigma;
  vec2 texel_y = vec2(u_offset.z, v_size.z) * texels_per_sigma;
  TexelRange range = texelRange(place);
  int first_cell = int(kHalfTexels ? place : place & (1u << kCellBits) - 1u);
  vec4 mean = kSample == kSampleFootprint ? inMode(FETCH(texture_means, splat), 1.0) : vec4(0.0);
  float mean_share = kSample == kSampleFootprint ? footprintShare(normal.w) : 0.0;
  vec3 base = vec3(w_r.w, d_g.w, e_b.w);
  if (!kAll && kSample == kSampleBilinear) {  // what all samples have in common, once
    base += range.start.xyz;
    range.start.xyz = vec3(0.0);
  }
  vec2 offset = first_center - center_depth_opacity.xy;
  [[unroll]] for (uint row = 0u; row < kSide; ++row) {
    float y = offset.y + float(row);
    // What a row has in common; see SplatRecord.
    float w_rest = w_r.z * y * w_r.z * y;
    float w_start = w_r.x * offset.x + w_r.y * y;
    float d_start = d_g.x * offset.x + d_g.y * y;
    float s = e_b.x * y + e_b.y;
    float d_rest = s * s + e_b.z * e_b.z;
    float t_rest = e_b.y * s + e_b.z * e_b.z;
    float shift_rest = e_b.x * y * s;
    vec2 texel_row = texel_mean + texel_x * offset.x + texel_y * y;
    [[unroll]] for (uint column = 0u; column < kSide; ++column) {
      float w = w_start + w_r.x * float(column);
      float d_moved = d_start + d_g.x * float(column);  // D - d0
      float d = d_moved + d_g.z;
      float inverse = 1.0 / fma(d, d, d_rest);
      float power = fma(w, w, w_rest) * inverse;
      float t = fma(d_g.z, d, t_rest) * inverse;  // in units of the mean's depth
      Fragment f;
      f.depth = t * center_depth_opacity.z;
      bool hit = power < kPowerMax && f.depth > near_plane;
      f.alpha = hit ? center_depth_opacity.w * exp2(-kHalfLog2E * power) : 0.0;
      f.base = base;
      f.tint = vec3(0.0);
      if (kTextured) {
        // t - 1; a NaN where a ray lies in the plane of the plane model's splat, which is not blended.
        float shift = hit ? -fma(d_moved, d, shift_rest) * inverse : 0.0;
        vec2 straight = texel_row + texel_x * float(column);
        Tap tap = tapAt(fma(vec2(shift), straight + texel_shift, straight), cells, first_cell);
        vec4 value = fma(sampleCell(tap), range.unit, range.start);
        if (kSample == kSampleFootprint) value = tap.inside ? mix(value, mean, mean_share) : value;
        f.tint = value.xyz;
        f.alpha *= value.w;
        if (kOutside == kOutsideClip && size != 0u && !tap.inside) f.alpha = 0.0;
        if (!kAll) f.base += f.tint;
      }
      f.alpha = min(kAlphaMax, f.alpha);
      f.normal = normal.xyz;
      f.density = size != 0u ? normal.w : -1.0;
      if (kKept == 0u) {
        blendFragment(row * kSide + column, f);
      } else {
        keepFragment(row * kSide + column, f);
      }
    }
  }
}

void loadPixel(uint j, uvec2 at) {
  bool outside = at.x >= view.width || at.y >= view.height;
  transmittances[j] = outside ? -1.0 : 1.0;
  bases[j] = vec3(0.0);
  tints[j] = vec3(0.0);
  depths[j] = 0.0;
  normals[j] = vec3(0.0);
  counts[j] = 0.0;
  more[j] = vec4(0.0);
  [[unroll]] for (uint k = 0u; k < kKept; ++k) kept[j * kKept + k] = kNoFragment;
  if (pass.first == 0u || outside) return;
  uint i = at.y * view.width + at.x;
  vec4 stored = base_transmittance[i];
  bases[j] = stored.xyz;
  transmittances[j] = stored.w;
  if (kAll) {
    tints[j] = texture_depth[i].xyz;
    depths[j] = texture_depth[i].w;
    normals[j] = normal_count[i].xyz;
    counts[j] = normal_count[i].w;
    more[j] = extras[i];
  }
}

void storePixel(uint j, uvec2 at, bool finish) {
  if (at.x >= view.width || at.y >= view.height) return;
  [[unroll]] for (uint k = 0u; k < kKept; ++k) blendFragment(j, kept[j * kKept + k]);
  uint i = at.y * view.width + at.x;
  float transmittance = finish ? abs(transmittances[j]) : transmittances[j];
  vec3 background = finish ? transmittance * view.background.xyz : vec3(0.0);
  base_transmittance[i] = vec4(bases[j] + background, transmittance);
  if (!kAll) return;
  float depth = finish ? (counts[j] > 0.0 ? depths[j] / (1.0 - transmittance) : 0.0) : depths[j];
  texture_depth[i] = vec4(tints[j], depth);
  normal_count[i] = vec4(normals[j], counts[j]);
  if (finish) more[j].z = more[j].w > 0.0 ? more[j].z / more[j].w : 0.0;
  extras[i] = more[j];
}

bool allDone() {
  if (kOverdraw) return false;
  float largest = transmittances[0];
  [[unroll]] for (uint j = 1u; j < kPixels; ++j) largest = max(largest, transmittances[j]);
  return largest < 0.0;
}

void main() {
  near_plane = view.near;
  texture_mode = view.texture_mode;
  uint thread = gl_LocalInvocationIndex;
  uint tile = gl_WorkGroupID.y * view.tiles_x + gl_WorkGroupID.x;
  uvec2 range = tile_ranges[tile];
  uint length = range.y - range.x;
  if (thread == 0u && pass.first == 0u) atomicMax(counters.longest_list, length);
  if (pass.first > 0u && pass.first >= length) return;  // finished by an earlier dispatch
  uint begin = range.x + min(pass.first, length);
  uint end = begin + min(length - pass.first, pass.count);

  uint block = thread / kBlockThreads;
  uint in_block = thread % kBlockThreads;
  uvec2 at = gl_WorkGroupID.xy * kTileSize + uvec2(block % 4u, block / 4u) * kBlockSide +
             uvec2(in_block % kBlockThreadsPerSide, in_block / kBlockThreadsPerSide) * kSide;
  [[unroll]] for (uint j = 0u; j < kPixels; ++j) loadPixel(j, at + uvec2(j % kSide, j / kSide));
  vec2 first_center = vec2(at) + 0.5;

  uint quad = begin / 4u;
  uint quads = (end + 3u) / 4u;
  uint hits = 0u;  // which pairs of the quad before `quad` touch the block and are still to come
  bool done = allDone();
  while (!done) {
    while (hits == 0u && quad < quads) {
      uvec4 bits = FETCH(pair_keys, quad) >> block & 1u;
      hits = bits.x | bits.y << 1u | bits.z << 2u | bits.w << 3u;
      uint base = quad * 4u;
      if (base < begin) hits &= 0xFu << (begin - base);
      if (base + 4u > end) hits &= 0xFu >> (base + 4u - end);
      ++quad;
    }
    if (hits == 0u) break;
    uint pair = (quad - 1u) * 4u + uint(findLSB(hits));
    hits &= hits - 1u;
    blendSplat(FETCH_UINT(pair_splats, pair), first_center);
    done = allDone();
  }
  bool finish = pass.first + pass.count >= length;
  [[unroll]] for (uint j = 0u; j < kPixels; ++j) storePixel(j, at + uvec2(j % kSide, j / kSide), finish);
}

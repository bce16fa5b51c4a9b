#version 450
// SPDX-License-Identifier: Apache-2.0
// Ellipsoids and centres: the nearest surface of each pixel in its base colour, or background. One group per tile, a
// thread per pixel; dispatches as those of blend.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"
#include "gaussian.glsl"
#include "shared/record.h"

layout(local_size_x = 16, local_size_y = 16) in;
layout(constant_id = 0) const uint kShape = kShapeEllipsoids;
FETCHED_UINTS(3, PairKeys, pair_keys);      // [pairs] tile << kBlockBits | blocks
FETCHED_UINTS(4, PairSplats, pair_splats);  // [pairs]
FETCHED_UVEC4S(5, Records, records);        // [N, 8] SplatRecord
layout(std430, binding = 6) buffer CountersBlock { Counters counters; };
layout(std430, binding = 7) readonly buffer TileRanges { uvec2 tile_ranges[]; };      // [tiles]
layout(std430, binding = 8) buffer BaseTransmittance { vec4 base_transmittance[]; };  // [pixels] colour, depth so far

const float kNothing = 3e38;

vec4 fetchRecord(uint splat, uint member) {
  return uintBitsToFloat(FETCH(records, splat * kRecordSize + member));
}

// Camera z at which the ray through the pixel centre meets the splat's surface; kNothing when it does not.
float surfaceDepth(uint splat, vec2 center) {
  vec4 center_depth = fetchRecord(splat, 0u);
  vec4 w = fetchRecord(splat, 1u);
  vec2 offset = center - center_depth.xy;
  if (kShape == kShapeCenters) {
    return dot(offset, offset) <= kCenterRadius * kCenterRadius ? center_depth.z : kNothing;
  }
  vec4 d = fetchRecord(splat, 2u);
  vec4 e = fetchRecord(splat, 3u);
  float u = w.x * offset.x + w.y * offset.y;
  float v = w.z * offset.y;
  float p = d.x * offset.x + d.y * offset.y + d.z;
  float s = e.x * offset.y + e.y;
  float square = p * p + s * s + e.z * e.z;
  float missing = square - u * u - v * v;  // (1 - |p|^2) |D|^2
  if (!(missing >= 0.0)) return kNothing;
  // The record's |D|^2 is over |d0|^2; u_offset, v_size and normal hold z d0.
  float d0_length = length(vec3(fetchRecord(splat, 4u).x, fetchRecord(splat, 5u).x, fetchRecord(splat, 6u).w));
  float middle = center_depth.z * (d.z * p + e.y * s + e.z * e.z) / square;
  float entry = middle - center_depth.z * sqrt(missing) / (square * d0_length);
  return entry > view.near ? entry : kNothing;
}

// Base colour under a light at the camera. The point of entry comes from D x W (docs/math.md 2.3): the rounding of its
// depth is more than a thin axis.
vec3 litColour(uint splat, vec2 center) {
  vec3 base = vec3(fetchRecord(splat, 1u).w, fetchRecord(splat, 2u).w, fetchRecord(splat, 3u).w);
  if (kShape == kShapeCenters) return base;
  Gaussian g;
  loadGaussian(splat, g);
  vec3 direction = vec3((center - view.focal_center.zw) / view.focal_center.xy, 1.0);
  float longest = max(g.scale.x, max(g.scale.y, g.scale.z));
  vec3 inverse = longest / g.scale;
  vec2 offset = (center - fetchRecord(splat, 0u).xy) / view.focal_center.xy;
  vec3 d = inverse * (transpose(g.axes_c) * direction);
  vec3 d0 = inverse * (transpose(g.axes_c) * (g.mean_c / g.mean_c.z));
  vec3 across = inverse * (transpose(g.axes_c) * vec3(offset, 0.0));
  vec3 w = cross(across, d0) * (g.mean_c.z / longest);
  float square = dot(d, d);
  vec3 local = cross(d, w) / square - sqrt(max(1.0 - dot(w, w) / square, 0.0) / square) * d;  // [sigma]
  vec3 normal = normalize(g.axes_c * (inverse * local));
  return base * mix(kEllipsoidAmbient, 1.0, max(-dot(normal, normalize(direction)), 0.0));
}

void main() {
  uint tile = gl_WorkGroupID.y * view.tiles_x + gl_WorkGroupID.x;
  uvec2 range = tile_ranges[tile];
  uint length = range.y - range.x;
  if (gl_LocalInvocationIndex == 0u && pass.first == 0u) atomicMax(counters.longest_list, length);
  uvec2 at = gl_GlobalInvocationID.xy;
  if (at.x >= view.width || at.y >= view.height || (pass.first > 0u && pass.first >= length)) return;
  uint pixel = at.y * view.width + at.x;
  vec2 center = vec2(at) + 0.5;
  float nearest = pass.first > 0u ? base_transmittance[pixel].w : kNothing;
  uint winner = 0xFFFFFFFFu;
  uint block = gl_LocalInvocationID.y / 4u * 4u + gl_LocalInvocationID.x / 4u;
  uint end = range.x + min(length, pass.first + pass.count);
  for (uint pair = range.x + min(length, pass.first); pair < end; ++pair) {
    if ((FETCH_UINT(pair_keys, pair) >> block & 1u) == 0u) continue;
    uint splat = FETCH_UINT(pair_splats, pair);
    float depth = surfaceDepth(splat, center);
    if (depth < nearest) {
      nearest = depth;
      winner = splat;
    }
  }
  if (winner != 0xFFFFFFFFu) {
    base_transmittance[pixel] = vec4(litColour(winner, center), nearest);
  } else if (pass.first == 0u) {
    base_transmittance[pixel] = vec4(view.background.xyz, kNothing);
  }
}

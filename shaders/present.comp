#version 450
// SPDX-License-Identifier: Apache-2.0
// One output as a picture for people: the mapping of tg::visualize().
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = 16, local_size_y = 16) in;
layout(binding = 0, rgba8) uniform writeonly image2D picture;
layout(std430, binding = 1) readonly buffer CountersBlock { Counters counters; };
layout(std430, binding = 2) readonly buffer BaseTransmittance { vec4 base_transmittance[]; };  // [pixels]
layout(std430, binding = 3) readonly buffer TextureDepth { vec4 texture_depth[]; };            // [pixels]
layout(std430, binding = 4) readonly buffer NormalCount { vec4 normal_count[]; };              // [pixels]
layout(std430, binding = 5) readonly buffer Extras { vec4 extras[]; };                         // [pixels]

// Of the whole picture: smallest and largest number above 0.
float rangeLeast() { return uintBitsToFloat(min(counters.output_range.x, view.range_least)); }
float rangeMost() { return uintBitsToFloat(max(counters.output_range.y, view.range_most)); }

vec3 depthGrey(float z) {
  if (z <= 0.0) return vec3(0.0);
  float nearest = rangeLeast();
  float span = rangeMost() - nearest;
  return vec3(1.0 - (1.0 - kFarthestGrey) * (span > 0.0 ? (z - nearest) / span : 0.0));
}

vec3 heat(float x) { return vec3(3.0 * x, 3.0 * x - 1.0, 3.0 * x - 2.0); }

vec3 countHeat(float count) {
  float most = rangeMost();
  return heat(most > 0.0 ? count / most : 0.0);
}

vec3 densityHeat(float density) {
  const float low = log2(kLowestDensity);
  const float high = log2(kHighestDensity);
  return heat(density > 0.0 ? (log2(density) - low) / (high - low) : 0.0);
}

// What lies in the buffers follows from the output: where final alone was asked for, or a solid output, it takes the
// place of the base colour. Magenta: no such output.
vec3 shown(uint i) {
  switch (decider(pass.output_kind)) {
    case kOutputBase: return view.exposure * base_transmittance[i].xyz;
    case kOutputTexture: return 0.5 + 0.5 * view.exposure * texture_depth[i].xyz;
    case kOutputAlpha: return vec3(1.0 - base_transmittance[i].w);
    case kOutputDepth: return depthGrey(texture_depth[i].w);
    case kOutputNormal: return 0.5 + 0.5 * vec3(1.0, -1.0, -1.0) * normal_count[i].xyz;
    case kOutputCount: return countHeat(normal_count[i].w);
    case kOutputDepthMedian: return depthGrey(extras[i].x);
    case kOutputOverdraw: return countHeat(extras[i].y);
    case kOutputTexelDensity: return densityHeat(extras[i].z);
    case kOutputEllipsoids:
    case kOutputCenters: return base_transmittance[i].xyz;
    default: return vec3(1.0, 0.0, 1.0);
  }
}

void main() {
  uvec2 at = gl_GlobalInvocationID.xy;
  if (at.x >= view.width || at.y >= view.height) return;
  // To the nearest of 256 steps here: what a driver makes of numbers between them may be a tenth of a step off.
  vec3 steps = floor(255.0 * clamp(shown(at.y * view.width + at.x), 0.0, 1.0) + 0.5);
  imageStore(picture, ivec2(at), vec4(steps / 255.0, 1.0));
}

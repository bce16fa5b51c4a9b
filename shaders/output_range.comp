#version 450
// SPDX-License-Identifier: Apache-2.0
// Smallest and largest number above 0 of an output over the image: what its picture is scaled by.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer TextureDepth { vec4 texture_depth[]; };  // [pixels]
layout(std430, binding = 2) readonly buffer NormalCount { vec4 normal_count[]; };    // [pixels]
layout(std430, binding = 3) readonly buffer Extras { vec4 extras[]; };               // [pixels]

shared uint smallest;
shared uint largest;

float shown(uint pixel) {
  switch (decider(pass.output_kind)) {
    case kOutputDepth: return texture_depth[pixel].w;
    case kOutputDepthMedian: return extras[pixel].x;
    case kOutputOverdraw: return extras[pixel].y;
    case kOutputCount: return normal_count[pixel].w;
    default: return 0.0;
  }
}

void main() {
  if (gl_LocalInvocationIndex == 0u) {
    smallest = 0xFFFFFFFFu;
    largest = 0u;
  }
  barrier();
  uint pixel = itemIndex();
  float value = pixel < view.width * view.height ? shown(pixel) : 0.0;
  if (value > 0.0) {  // then its bits sort like the number
    atomicMin(smallest, floatBitsToUint(value));
    atomicMax(largest, floatBitsToUint(value));
  }
  barrier();
  if (gl_LocalInvocationIndex == 0u && largest > 0u) {
    atomicMin(counters.output_range.x, smallest);
    atomicMax(counters.output_range.y, largest);
  }
}

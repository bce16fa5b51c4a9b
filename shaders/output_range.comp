#version 450
// SPDX-License-Identifier: Apache-2.0
// Smallest and largest depth and largest count over the image: what the depth and count pictures are scaled by.
#extension GL_GOOGLE_include_directive : require
#include "pass.glsl"

layout(local_size_x = kGroupSize) in;
layout(std430, binding = 0) buffer CountersBlock { Counters counters; };
layout(std430, binding = 1) readonly buffer TextureDepth { vec4 texture_depth[]; };  // [pixels]
layout(std430, binding = 2) readonly buffer NormalCount { vec4 normal_count[]; };    // [pixels]

shared uint smallest_depth;
shared uint largest_depth;
shared uint largest_count;

void main() {
  if (gl_LocalInvocationIndex == 0u) {
    smallest_depth = 0xFFFFFFFFu;
    largest_depth = 0u;
    largest_count = 0u;
  }
  barrier();
  uint pixel = itemIndex();
  if (pixel < view.width * view.height && normal_count[pixel].w > 0.0) {
    uint depth = floatBitsToUint(texture_depth[pixel].w);  // positive: its bits sort like its value
    atomicMin(smallest_depth, depth);
    atomicMax(largest_depth, depth);
    atomicMax(largest_count, uint(normal_count[pixel].w));
  }
  barrier();
  if (gl_LocalInvocationIndex == 0u && largest_count > 0u) {
    atomicMin(counters.output_range.x, smallest_depth);
    atomicMax(counters.output_range.y, largest_depth);
    atomicMax(counters.output_range.z, largest_count);
  }
}

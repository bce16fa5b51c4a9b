// SPDX-License-Identifier: Apache-2.0
// What a prefix sum by runs adds up, four items at a time: a thread has a partition of its own. As scan_input.glsl.
const uint kScanNonZero = 1u;
const uint kScanOrdered = 2u;
layout(constant_id = 0) const uint kScanInput = 0u;

layout(binding = 0) uniform usamplerBuffer values;  // four to a texel, one when ordered
layout(binding = 1) uniform usamplerBuffer order;   // four to a texel
layout(std430, binding = 2) buffer CountersBlock { Counters counters; };

// Items 4 quad .. 4 quad + 3, 0 from `end` on.
uvec4 scanInputs(uint quad, uint end) {
  bvec4 inside = lessThan(quad * 4u + uvec4(0u, 1u, 2u, 3u), uvec4(end));
  if (kScanInput == kScanOrdered) {
    uvec4 items = mix(uvec4(0u), texelFetch(order, int(quad)), inside);
    uvec4 inputs = uvec4(texelFetch(values, int(items.x)).x, texelFetch(values, int(items.y)).x,
                         texelFetch(values, int(items.z)).x, texelFetch(values, int(items.w)).x);
    return mix(uvec4(0u), inputs, inside);
  }
  uvec4 inputs = mix(uvec4(0u), texelFetch(values, int(quad)), inside);
  return kScanInput == kScanNonZero ? min(inputs, 1u) : inputs;
}

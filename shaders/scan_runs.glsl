// SPDX-License-Identifier: Apache-2.0
// What a prefix sum by runs adds up, four items at a time: a thread has a partition of its own. As scan_input.glsl.
const uint kScanNonZero = 1u;
const uint kScanOrdered = 2u;
layout(constant_id = 0) const uint kScanInput = 0u;

#include "fetch.glsl"
FETCHED_UVEC4S(0, Values, values);  // four to a texel, one when ordered
FETCHED_UVEC4S(1, Order, order);    // four to a texel
#ifdef TG_STORAGE
#define FETCH_VALUE(i) values[(i) / 4u][(i) % 4u]
#else
#define FETCH_VALUE(i) FETCH(values, i).x
#endif
layout(std430, binding = 2) buffer CountersBlock { Counters counters; };

// Items 4 quad .. 4 quad + 3, 0 from `end` on.
uvec4 scanInputs(uint quad, uint end) {
  bvec4 inside = lessThan(quad * 4u + uvec4(0u, 1u, 2u, 3u), uvec4(end));
  if (kScanInput == kScanOrdered) {
    uvec4 items = mix(uvec4(0u), FETCH(order, quad), inside);
    uvec4 inputs = uvec4(FETCH_VALUE(items.x), FETCH_VALUE(items.y),
                         FETCH_VALUE(items.z), FETCH_VALUE(items.w));
    return mix(uvec4(0u), inputs, inside);
  }
  uvec4 inputs = mix(uvec4(0u), FETCH(values, quad), inside);
  return kScanInput == kScanNonZero ? min(inputs, 1u) : inputs;
}

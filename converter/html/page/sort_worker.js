// SPDX-License-Identifier: Apache-2.0
// Sorts Gaussians by camera z, farthest first: exactly docs/math.md 1.2 (float32 z, the lower index in front on ties),
// by counting the two 16-bit halves of the float's bits, which order positive floats.
'use strict';

const kBuckets = 65536;
const kNear = 0.2;  // shaders/shared/limits.h
let positions = new Float32Array(0);
let depths, bits, indices, keys, byLow;
const low = new Uint32Array(kBuckets), high = new Uint32Array(kBuckets);

function load(newPositions) {
  positions = newPositions;
  const count = positions.length / 3;
  depths = new Float32Array(count);
  bits = new Uint32Array(depths.buffer);
  indices = new Uint32Array(count);
  keys = new Uint32Array(count);
  byLow = new Uint32Array(count);
}

// `row`: the third row of camera_from_world and the translation's z. Fills `order` (room for all), returns how many
// Gaussians lie in front of the near plane.
function sort(row, order) {
  const [rx, ry, rz, t] = row;
  low.fill(0);
  high.fill(0);
  let visible = 0;
  for (let i = 0; i < indices.length; ++i) {
    const z = rx * positions[3 * i] + ry * positions[3 * i + 1] + rz * positions[3 * i + 2] + t;
    if (!(z > kNear)) continue;
    depths[visible] = z;
    const key = bits[visible];
    ++low[key & 0xFFFF];
    ++high[key >>> 16];
    indices[visible++] = i;
  }
  for (let bucket = 0, a = 0, b = 0; bucket < kBuckets; ++bucket) {
    const inLow = low[bucket], inHigh = high[bucket];
    low[bucket] = a;
    high[bucket] = b;
    a += inLow;
    b += inHigh;
  }
  for (let i = 0; i < visible; ++i) {
    const to = low[bits[i] & 0xFFFF]++;
    keys[to] = bits[i];
    byLow[to] = indices[i];
  }
  for (let i = 0; i < visible; ++i) order[visible - 1 - high[keys[i] >>> 16]++] = byLow[i];
  return visible;
}

onmessage = ({data}) => {
  if (data.positions) {
    load(data.positions);
    return;
  }
  const order = data.order && data.order.length === indices.length ? data.order : new Uint32Array(indices.length);
  const visible = sort(data.row, order);
  postMessage({order, visible, model: data.model, request: data.request}, [order.buffer]);
};

// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files as the numbers they hold, alpha included.
import {MAX_ATLAS_TEXELS} from './png.js';
import {decodeVp8l} from './webp_pixels.js';

// The pixels of a lossless file, {begin, end} of what its chunk VP8L holds. What else may stand around them, as colour
// profiles do, is passed over.
function findPixels(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 25 || view.getUint32(0) !== 0x52494646 || view.getUint32(8) !== 0x57454250) {
    throw new Error('an image is no WebP file');
  }
  for (let at = 12; at + 8 <= bytes.length;) {
    const name = String.fromCharCode(...bytes.subarray(at, at + 4)), size = view.getUint32(at + 4, true);
    const begin = at + 8, end = begin + size;
    if (name === 'ANIM' || name === 'ANMF') throw new Error('WebP: an animation (expected a single picture)');
    if (name === 'VP8 ' || name === 'ALPH') throw new Error('WebP: lossy (expected lossless)');
    if (name === 'VP8L') {
      if (size < 5 || end > bytes.length) throw new Error('WebP: the file ends early');
      if (bytes[begin] !== 0x2F) throw new Error('WebP: its pixels have no signature (expected that of VP8L)');
      return {begin, end};
    }
    at = end + size % 2;
  }
  throw new Error('WebP: no pixels (expected a chunk VP8L)');
}

// {width, height} of a lossless file, which decoders allocate by.
export function webpSize(bytes) {
  const {begin} = findPixels(bytes);
  const sides = new DataView(bytes.buffer, bytes.byteOffset + begin + 1, 4).getUint32(0, true);  // 14 bits each, less 1
  return {width: (sides & 0x3FFF) + 1, height: (sides >> 14 & 0x3FFF) + 1};
}

// As decodePng: integers from 0 to 255.
export async function decodeWebp(bytes) {
  const {width, height} = webpSize(bytes);
  if (width * height > MAX_ATLAS_TEXELS) {
    throw new Error(`WebP: bad size ${width} x ${height} (expected at most ${MAX_ATLAS_TEXELS} texels)`);
  }
  const {begin, end} = findPixels(bytes), samples = await decodeVp8l(bytes.subarray(begin, end), width, height);
  return {width, height, channels: 4, largest: 255, samples};
}

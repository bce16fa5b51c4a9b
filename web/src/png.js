// SPDX-License-Identifier: Apache-2.0
// PNG files as the numbers they hold. The browser's own decoder may premultiply, convert colours or cut 16 bits to 8;
// atlases are data.
import {breathe} from './breathe.js';

export const MAX_ATLAS_TEXELS = 8192 * 8192;

// Decompresses `parts` (byte arrays, one stream) with a format of DecompressionStream, to at most `limit` bytes.
export async function inflate(parts, format, limit) {
  const reader = new Blob(parts).stream().pipeThrough(new DecompressionStream(format)).getReader();
  const chunks = [];
  let size = 0;
  for (;;) {
    const {done, value} = await reader.read();
    if (done) break;
    size += value.length;
    if (size > limit) {
      reader.cancel().catch(() => {});
      throw new Error(`packed data says more than the ${limit} bytes that were expected`);
    }
    chunks.push(value);
    await breathe();
  }
  const out = new Uint8Array(size);
  let at = 0;
  for (const chunk of chunks) {
    out.set(chunk, at);
    at += chunk.length;
  }
  return out;
}

// Undoes the five row filters; returns the rows without their filter bytes.
async function unfilterPng(raw, rows, rowBytes, pixelBytes) {
  const out = new Uint8Array(rows * rowBytes);
  for (let row = 0, from = 0; row < rows; ++row) {
    await breathe();
    const filter = raw[from++];
    const to = row * rowBytes;
    for (let i = 0; i < rowBytes; ++i) {
      const left = i >= pixelBytes ? out[to + i - pixelBytes] : 0;
      const up = row > 0 ? out[to + i - rowBytes] : 0;
      let guess = 0;
      if (filter === 1) {
        guess = left;
      } else if (filter === 2) {
        guess = up;
      } else if (filter === 3) {
        guess = (left + up) >> 1;
      } else if (filter === 4) {
        const corner = row > 0 && i >= pixelBytes ? out[to + i - rowBytes - pixelBytes] : 0;
        const a = Math.abs(up - corner), b = Math.abs(left - corner), c = Math.abs(left + up - 2 * corner);
        guess = a <= b && a <= c ? left : b <= c ? up : corner;
      } else if (filter > 4) {
        throw new Error(`PNG: unknown row filter (expected 0 to 4, found ${filter})`);
      }
      out[to + i] = raw[from + i] + guess;
    }
    from += rowBytes;
  }
  return out;
}

// {width, height}, which decoders allocate by.
export function pngSize(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 33 || view.getUint32(0) !== 0x89504E47 || view.getUint32(12) !== 0x49484452) {
    throw new Error('an atlas is no PNG file');
  }
  const width = view.getUint32(16), height = view.getUint32(20);
  if (!(width > 0 && height > 0 && width * height <= MAX_ATLAS_TEXELS)) {
    throw new Error(`PNG: bad size ${width} x ${height} (expected at most ${MAX_ATLAS_TEXELS} texels)`);
  }
  return {width, height};
}

// {width, height, channels, largest, samples}: samples are integers from 0 to `largest` (255 or 65535), row-major.
export async function decodePng(bytes) {
  const {width, height} = pngSize(bytes);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength), depth = bytes[24];
  const channels = {0: 1, 2: 3, 4: 2, 6: 4}[bytes[25]];
  if (channels === undefined || (depth !== 8 && depth !== 16) || bytes[28] !== 0) {
    throw new Error('PNG: unsupported kind (expected grey or RGB, 8 or 16 bit, not interlaced)');
  }
  const parts = [];
  for (let at = 8; at + 12 <= bytes.length;) {
    const length = view.getUint32(at);
    if (at + 12 + length > bytes.length) throw new Error('PNG: the file ends early');
    if (view.getUint32(at + 4) === 0x49444154) parts.push(bytes.subarray(at + 8, at + 8 + length));
    at += 12 + length;
  }
  const pixelBytes = channels * depth / 8;
  const rowBytes = width * pixelBytes;
  const raw = await inflate(parts, 'deflate', height * (rowBytes + 1));
  if (raw.length !== height * (rowBytes + 1)) throw new Error('PNG: the pixels end early');
  let samples = await unfilterPng(raw, height, rowBytes, pixelBytes);
  if (depth === 16) {
    const wide = new Uint16Array(samples.length / 2);
    for (let i = 0; i < wide.length; ++i) {
      if (i % 65536 === 0) await breathe();
      wide[i] = samples[2 * i] << 8 | samples[2 * i + 1];
    }
    samples = wide;
  }
  return {width, height, channels, largest: depth === 8 ? 255 : 65535, samples};
}

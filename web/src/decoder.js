// SPDX-License-Identifier: Apache-2.0
// Fetches chunks of a scene with levels of detail and unpacks them into what the device takes. Runs in a worker, or
// beside the page where there can be none: it knows a port, and nothing of either.
import {breathe} from './breathe.js';
import {failure, fetchBytes} from './fetch.js';
import {GAUSSIAN_NUMBERS, packGaussian, packSh} from './pack.js';
import {parseSogMeta, readSogParts, sogImages} from './sog.js';

export const BAND_WIDTH = 2048;  // [texels], which every device has
const MOST_BAND_ROWS = 256;      // a texture has up to 255
const MOST_FILE = 1 << 28;       // [bytes] of a file of a chunk
const SLICE_GAUSSIANS = 4096;

// The address that `name` has from `base` on, if it does not leave `folder`.
export function addressIn(folder, base, name) {
  let address = null;
  try {
    address = new URL(name, base);
  } catch (error) {
    throw new Error(`"${name}" is no address`, {cause: error});
  }
  if (!address.href.startsWith(folder)) throw new Error(`"${name}" leads out of the scene's folder`);
  return address.href;
}

// What goes wrong in `body` has the address before it.
async function telling(address, body) {
  try {
    return await body();
  } catch (error) {
    throw failure(address, error.message, error);
  }
}

// A chunk's files; a function that reads them as readSog would.
async function fetchChunk(address, folder, options) {
  const metaBytes = await fetchBytes(address, options);
  const {meta, images} = await telling(address, () => {
    const parsed = parseSogMeta(metaBytes);
    return {meta: parsed, images: sogImages(parsed).map((name) => [name, addressIn(folder, address, name)])};
  });
  const files = await Promise.all(images.map(async ([name, at]) => [name, await fetchBytes(at, options)]));
  const entries = new Map(files.map(([name, bytes]) => [name, async () => bytes]));
  const size = files.reduce((sum, [, bytes]) => sum + bytes.length, metaBytes.length);
  return () => readSogParts(meta, entries, size, {whole: true});
}

// Textures of Gaussians [first, first + count) on bands of BAND_WIDTH texels: rects lie in a band each, by `bandOf`.
async function packTextures({rects: from, pages, atlases}, first, count) {
  const rects = new Uint16Array(4 * count), bandOf = new Uint16Array(count), heights = [];
  const byHeight = Uint32Array.from({length: count}, (_, i) => i).filter((i) => from[4 * (first + i) + 2] > 0)
    .sort((a, b) => from[4 * (first + a) + 3] - from[4 * (first + b) + 3] || a - b);
  let x = BAND_WIDTH, y = 0, shelf = 0;
  for (const i of byHeight) {
    const [width, height] = from.subarray(4 * (first + i) + 2, 4 * (first + i) + 4);
    if (x + width > BAND_WIDTH || height > shelf) {
      x = 0;
      y += shelf;
      shelf = height;
    }
    if (heights.length === 0 || y + height > MOST_BAND_ROWS) {
      heights.push(0);
      x = y = 0;
      shelf = height;
    }
    rects.set([x, y, width, height], 4 * i);
    bandOf[i] = heights.length - 1;
    heights[bandOf[i]] = y + height;
    x += width;
  }
  const bands = heights.map((rows) => ({rows, texels: new Float32Array(4 * BAND_WIDTH * rows)}));
  for (const [n, i] of byHeight.entries()) {
    if (n % SLICE_GAUSSIANS === 0) await breathe();
    const [left, top, width, height] = from.subarray(4 * (first + i), 4 * (first + i) + 4);
    const {width: side, texels} = atlases[pages[first + i]];
    for (let row = 0; row < height; ++row) {
      const at = 4 * ((top + row) * side + left), to = 4 * ((rects[4 * i + 1] + row) * BAND_WIDTH + rects[4 * i]);
      bands[bandOf[i]].texels.set(texels.subarray(at, at + 4 * width), to);
    }
  }
  return {rects, bandOf, bands};
}

// All Gaussians of a chunk, and the textures of each piece of it, null where there are none.
async function packChunk(model, ranges) {
  const {count, sh: coefficients, layer} = model;
  const end = Math.max(...ranges.map(([first, held]) => first + held));
  if (end > count) throw new Error(`holds ${count} Gaussians (expected ${end}, as lod-meta.json has it)`);
  const numbers = 3 * (coefficients.length - 1);
  const gaussians = new Float32Array(GAUSSIAN_NUMBERS * count), sh = new Float32Array(numbers * count);
  for (let i = 0; i < count; ++i) {
    if (i % SLICE_GAUSSIANS === 0) await breathe();
    packGaussian(model, i, gaussians, GAUSSIAN_NUMBERS * i);
    packSh(model, i, sh, numbers * i);
  }
  const textures = [];
  for (const range of ranges) textures.push(layer ? await packTextures(layer, ...range) : null);
  return {positions: model.mean, gaussians, sh, textures};
}

function buffersOf({positions, gaussians, sh, textures}) {
  const lists = [positions, gaussians, sh];
  for (const part of textures.filter(Boolean)) {
    lists.push(part.rects, part.bandOf, ...part.bands.map(({texels}) => texels));
  }
  return lists.map((list) => list.buffer);
}

// Answers what `port` asks: {id, address, folder, ranges: first and count of each piece, textured: whether textures are
// wanted, shCoefficients: without the first one, null: as the chunk has them, again: past the browser's cache};
// {id, stop: true}. With {id, chunk, shCoefficients, mode, intersection,
// outside, notes} or {id, error: a sentence}; to what was stopped there is no answer.
export function decodeFor(port) {
  const stops = new Map();
  let turn = Promise.resolve();  // chunks are unpacked one after the other, so that the first one is soon there

  const unpack = async ({id, address, ranges, textured, shCoefficients}, read) => {
    if (!stops.has(id)) return;
    let chunk = null;
    const model = await telling(address, async () => {
      const found = await read();
      if (!textured) found.layer = null;
      if (shCoefficients !== null) {
        while (found.sh.length - 1 < shCoefficients) found.sh.push(new Float32Array(3 * found.count));
        found.sh.length = shCoefficients + 1;
      }
      chunk = await packChunk(found, ranges);
      return found;
    });
    if (!stops.has(id)) return;
    const {sh, layer, intersection, outside, notes} = model;
    port.postMessage({id, chunk, shCoefficients: sh.length - 1, mode: layer ? layer.mode : 0, intersection, outside,
                      notes}, buffersOf(chunk));
  };

  const answer = async (asked) => {
    const {id, address, folder, again} = asked;
    const stop = new AbortController();
    stops.set(id, stop);
    try {
      const options = {signal: stop.signal, most: MOST_FILE, cache: again ? 'reload' : 'default'};
      const read = await fetchChunk(address, folder, options);
      const unpacked = turn.then(() => unpack(asked, read));
      turn = unpacked.catch(() => {});
      await unpacked;
    } catch (error) {
      if (stops.has(id)) port.postMessage({id, error: error.message});
    } finally {
      stops.delete(id);
    }
  };

  port.onmessage = ({data}) => {
    if (!data.stop) {
      answer(data);
    } else if (stops.has(data.id)) {
      const stop = stops.get(data.id);
      stops.delete(data.id);
      stop.abort();
    }
  };
}

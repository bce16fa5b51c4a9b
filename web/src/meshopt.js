// SPDX-License-Identifier: Apache-2.0
// Views packed by EXT_meshopt_compression, as far as splats need it: mode ATTRIBUTES, version 0 of the stream, the
// filters QUATERNION and EXPONENTIAL (the extension's appendices A and B).
import {breathe} from './breathe.js';
import {valueNamed} from './names.js';

const MESHOPT_GROUP = 16;  // bytes that have one width

// The bytes `k` of up to 256 elements: groups of 16, 0, 2, 4 or 8 bits each, of which the largest number of 2 and 4
// bits says that a whole byte follows. Returns where the next ones begin.
function unpackMeshoptBytes(source, begin, count, out) {
  const groups = Math.ceil(count / MESHOPT_GROUP);
  let at = begin + Math.ceil(groups / 4);
  for (let group = 0; group < groups; ++group) {
    const first = group * MESHOPT_GROUP;
    const bits = [0, 2, 4, 8][source[begin + (group >> 2)] >> 2 * (group & 3) & 3];
    const escape = bits === 8 ? -1 : (1 << bits) - 1, perByte = bits === 0 ? 0 : 8 / bits;
    let next = at + 2 * bits;
    for (let i = 0; i < MESHOPT_GROUP; ++i) {
      if (bits === 0) {
        out[first + i] = 0;
        continue;
      }
      const value = source[at + Math.floor(i / perByte)] >> 8 - bits * (i % perByte + 1) & (1 << bits) - 1;
      out[first + i] = value === escape ? source[next++] : value;
    }
    at = next;
  }
  return at;
}

async function unpackMeshoptStream(source, count, stride) {
  const tail = Math.max(stride, 32);
  if (source.length < 1 + tail || source[0] !== 0xA0) throw new Error('a packed view is broken');
  const out = new Uint8Array(count * stride);
  const last = source.slice(source.length - stride);
  const blockSize = Math.min(256, Math.floor(8192 / stride) & ~(MESHOPT_GROUP - 1));
  const deltas = new Uint8Array(256);
  let at = 1;
  for (let first = 0; first < count; first += blockSize) {
    await breathe();
    const block = Math.min(blockSize, count - first);
    for (let k = 0; k < stride; ++k) {
      at = unpackMeshoptBytes(source, at, block, deltas);
      if (at > source.length - tail) throw new Error('a packed view ends early');
      let value = last[k];
      for (let i = 0; i < block; ++i) {
        value = value + (deltas[i] >> 1 ^ -(deltas[i] & 1)) & 255;
        out[(first + i) * stride + k] = value;
      }
      last[k] = value;
    }
  }
  if (at !== source.length - tail) throw new Error('a packed view is longer than it says');
  return out;
}

// In place, in the given words of four bytes, as the filters' names say.
const MESHOPT_FILTERS = {
  NONE: () => {},
  EXPONENTIAL: (bytes, begin, end) => {
    const words = new Int32Array(bytes.buffer), floats = new Float32Array(bytes.buffer);
    for (let i = begin; i < end; ++i) floats[i] = (words[i] << 8 >> 8) * 2 ** (words[i] >> 24);
  },
  QUATERNION: (bytes, begin, end) => {
    const q = new Int16Array(bytes.buffer);
    for (let i = 2 * begin; i < 2 * end; i += 4) {
      const unit = Math.SQRT1_2 / (q[i + 3] | 3), left = q[i + 3] & 3;
      const others = [q[i] * unit, q[i + 1] * unit, q[i + 2] * unit];
      const rest = 1 - others[0] ** 2 - others[1] ** 2 - others[2] ** 2;
      for (let k = 0; k < 3; ++k) q[i + (left + 1 + k & 3)] = Math.round(others[k] * 32767);
      q[i + left] = Math.round(Math.sqrt(Math.max(rest, 0)) * 32767);
    }
  },
};

// `packed`: the extension's object of a view; `source`: its bytes. Returns the view's.
export async function unpackMeshopt(packed, source) {
  const {count, byteStride: stride, mode, filter = 'NONE'} = packed;
  const unfilter = valueNamed(MESHOPT_FILTERS, filter);
  if (mode !== 'ATTRIBUTES' || !unfilter) throw new Error(`packed by ${mode} ${filter} (not supported)`);
  if (!(stride > 0 && stride <= 256 && stride % 4 === 0) || (filter === 'QUATERNION' && stride !== 8)) {
    throw new Error(`a packed view has a stride of ${stride}`);
  }
  if (!(count * stride <= 64 * source.length + 65536)) throw new Error('a packed view says more than it can hold');
  const bytes = await unpackMeshoptStream(source, count, stride);
  const words = bytes.length / 4;
  for (let i = 0; i < words; i += 65536) {
    await breathe();
    unfilter(bytes, i, Math.min(i + 65536, words));
  }
  return bytes;
}

// SPDX-License-Identifier: Apache-2.0
// ZIP archives in memory, as far as SOG files need them: stored and deflated entries.
import {inflate} from './png.js';

const END = 0x06054B50, ENTRY = 0x02014B50, LOCAL = 0x04034B50;
const END_BYTES = 22, ENTRY_BYTES = 46, LOCAL_BYTES = 30, LONGEST_COMMENT = 65535;
const MOST_RATIO = 1000;  // that an entry may unpack to, times the archive

// A map from names to functions that give an entry's bytes.
export function readZip(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let end = bytes.length - END_BYTES;
  const least = Math.max(end - LONGEST_COMMENT, 0);
  while (end >= least && view.getUint32(end, true) !== END) --end;
  if (end < least) {
    throw new Error(`the ZIP archive has no end of its directory (in ${bytes.length} bytes): it may be cut off, or ` +
                    'other bytes follow it');
  }
  const entries = new Map();
  let at = view.getUint32(end + 16, true);
  for (let left = view.getUint16(end + 10, true); left > 0; --left) {
    if (at + ENTRY_BYTES > end || view.getUint32(at, true) !== ENTRY) throw new Error('the ZIP directory is broken');
    const nameBytes = view.getUint16(at + 28, true);
    const name = new TextDecoder().decode(bytes.subarray(at + ENTRY_BYTES, at + ENTRY_BYTES + nameBytes));
    const method = view.getUint16(at + 10, true), encrypted = view.getUint16(at + 8, true) & 1;
    const packed = view.getUint32(at + 20, true), size = view.getUint32(at + 24, true);
    const local = view.getUint32(at + 42, true);
    entries.set(name, async () => {
      if (encrypted || (method !== 0 && method !== 8)) throw new Error(`${name}: packed in a way that is not supported`);
      if (local + LOCAL_BYTES > bytes.length || view.getUint32(local, true) !== LOCAL) {
        throw new Error(`${name}: its entry is broken`);
      }
      const begin = local + LOCAL_BYTES + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
      if (begin + packed > bytes.length || size > MOST_RATIO * bytes.length) throw new Error(`${name}: is cut off`);
      const content = bytes.subarray(begin, begin + packed);
      const out = method === 0 ? content : await inflate([content], 'deflate-raw', size);
      if (out.length !== size) throw new Error(`${name}: has another length than the directory says`);
      return out;
    });
    at += ENTRY_BYTES + nameBytes + view.getUint16(at + 30, true) + view.getUint16(at + 32, true);
  }
  return entries;
}

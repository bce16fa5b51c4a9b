// SPDX-License-Identifier: Apache-2.0
// Models from bytes and from addresses.
import {failure, fetchBytes} from './fetch.js';
import {readGlb} from './glb.js';
import {isLodMeta} from './lod.js';
import {readSog} from './sog.js';
import {readLod} from './streamed.js';

function bytesOf(data) {
  if (data instanceof Uint8Array) return data;
  const kind = Object.prototype.toString.call(data);  // also of another realm, as a frame's
  if (kind === '[object ArrayBuffer]') return new Uint8Array(data);
  if (ArrayBuffer.isView(data)) return new Uint8Array(data.buffer, data.byteOffset, data.byteLength);
  const found = data === null || data === undefined ? `${data}` :
    typeof data === 'object' && data.constructor ? data.constructor.name : typeof data;
  throw new TypeError(`readModel takes a Uint8Array or an ArrayBuffer (found ${found})`);
}

// The model in a GLB or a SOG file, in slices that leave the page its thread. data: a Uint8Array, an ArrayBuffer or
// another view of one.
export async function readModel(data) {
  const bytes = bytesOf(data);
  const magic = bytes.length < 4 ? 0 : new DataView(bytes.buffer, bytes.byteOffset, 4).getUint32(0);
  if (magic === 0x676C5446) return readGlb(bytes);
  if (magic === 0x504B0304) return readSog(bytes);
  if (isLodMeta(bytes)) throw new Error('levels of detail lie in files of their own: they are loaded by an address');
  throw new Error(`the file is neither GLB nor SOG (found ${beginningOf(bytes)})`);
}

function beginningOf(bytes) {
  const text = String.fromCharCode(...bytes.subarray(0, 64)).trimStart();
  if (bytes.length === 0) return 'nothing';
  if (text.startsWith('<')) return 'a page of HTML or XML';
  if (text.startsWith('ply')) return 'a PLY file, of which tgconvert makes a GLB';
  if (text.startsWith('NGSP')) return 'an SPZ file, of which tgconvert makes a GLB';
  if (bytes[0] === 0x1F && bytes[1] === 0x8B) return 'something gzipped: tgconvert makes a GLB of .tgz and .spz';
  return `${bytes.length} bytes that begin otherwise: if it is a .splat or .ksplat, tgconvert makes a GLB of it`;
}

// readModel, with the address in what goes wrong; a lod-meta.json, too, whose chunks are fetched from there. options:
// {splatBudget, signal}.
export async function readFrom(url, bytes, options = {}) {
  try {
    return isLodMeta(bytes) ? await readLod(url, bytes, options) : await readModel(bytes);
  } catch (error) {
    if (options.signal && options.signal.aborted) throw error;
    throw failure(url, error.message, error);
  }
}

export async function loadModel(url, options) { return readFrom(url, await fetchBytes(url, options), options); }

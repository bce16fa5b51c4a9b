// SPDX-License-Identifier: Apache-2.0
// Models from bytes and from addresses.
import {readGlb} from './glb.js';
import {readSog} from './sog.js';

// The model in a GLB or a SOG file, in slices that leave the page its thread.
export async function readModel(bytes) {
  const magic = bytes.length < 4 ? 0 : new DataView(bytes.buffer, bytes.byteOffset, 4).getUint32(0);
  if (magic === 0x676C5446) return readGlb(bytes);
  if (magic === 0x504B0304) return readSog(bytes);
  throw new Error(`the file is neither GLB nor SOG (found ${beginningOf(bytes)})`);
}

function beginningOf(bytes) {
  const text = String.fromCharCode(...bytes.subarray(0, 64)).trimStart();
  if (bytes.length === 0) return 'nothing';
  if (text.startsWith('<')) return 'a page of HTML or XML';
  if (bytes[0] === 0x1F && bytes[1] === 0x8B) return 'something gzipped: tgconvert makes a GLB of a model.tgz';
  return `${bytes.length} bytes that begin otherwise`;
}

const LONGEST_ADDRESS = 200;  // characters of one in what goes wrong: data: addresses hold whole files

function failure(url, words, cause) {
  const address = String(url);
  const told = address.length > LONGEST_ADDRESS ? `${address.slice(0, LONGEST_ADDRESS)}...` : address;
  return new Error(`${told}: ${words}`, {cause});
}

// The bytes at an address. onProgress(loaded, total): [bytes]; total is 0 where the server does not tell it. What goes
// wrong has the address before it, but for an AbortError of `signal`.
export async function fetchBytes(url, {onProgress, signal} = {}) {
  try {
    return await receivedBytes(url, onProgress, signal);
  } catch (error) {
    if (signal && signal.aborted || !(error instanceof TypeError)) throw error;
    // Browsers say "Failed to fetch" of all of these.
    throw failure(url, `no answer, an answer that broke off, or one that this page may not read (${error.message})`, error);
  }
}

async function receivedBytes(url, onProgress, signal) {
  const answer = await fetch(url, {signal});
  if (!answer.ok) throw failure(url, `${answer.status} ${answer.statusText}`.trim());
  if (!onProgress || !answer.body) return new Uint8Array(await answer.arrayBuffer());
  const packed = answer.headers.get('Content-Encoding');
  const total = packed ? 0 : Number(answer.headers.get('Content-Length')) || 0;
  const chunks = [], reader = answer.body.getReader();
  let loaded = 0;
  for (;;) {
    const {done, value} = await reader.read();
    if (done) break;
    chunks.push(value);
    loaded += value.length;
    onProgress(loaded, total);
  }
  const bytes = new Uint8Array(loaded);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

export async function loadModel(url, options) { return readFrom(url, await fetchBytes(url, options)); }

// readModel, with the address in what goes wrong.
export async function readFrom(url, bytes) {
  try {
    return await readModel(bytes);
  } catch (error) {
    throw failure(url, error.message, error);
  }
}

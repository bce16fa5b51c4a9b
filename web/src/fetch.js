// SPDX-License-Identifier: Apache-2.0
// The bytes at an address, and sentences that name it.

const SILENT_SECONDS = 60;    // after which an answer, or the rest of it, is given up
const LOOK_SECONDS = 5;       // between two looks whether something has come
const LONGEST_ADDRESS = 200;  // characters of one in what goes wrong: data: addresses hold whole files

export function failure(url, words, cause) {
  const address = String(url);
  const told = address.length > LONGEST_ADDRESS ? `${address.slice(0, LONGEST_ADDRESS)}...` : address;
  return new Error(`${told}: ${words}`, {cause});
}

let heard = 0;  // answers that have begun, and pieces of them, of all that is fetched

// Calls giveUp() once nothing of any answer has come for long: a browser may keep a request back until others are done.
// Time in which timers come late, as on a page that is frozen, does not count. Returns what ends the watch.
function watchSilence(giveUp) {
  let timer = 0;
  const look = (silent, before) => {
    const due = performance.now() + 1000 * LOOK_SECONDS;
    timer = setTimeout(() => {
      const late = performance.now() - due > 1000 * LOOK_SECONDS;
      const seconds = heard !== before ? 0 : silent + (late ? 0 : LOOK_SECONDS);
      if (seconds < SILENT_SECONDS) look(seconds, heard);
      else giveUp();
    }, 1000 * LOOK_SECONDS);
  };
  look(0, heard);
  return () => clearTimeout(timer);
}

// onProgress(loaded, total): [bytes]; total is 0 where the server does not tell it. most: [bytes] there may be. cache:
// as fetch() has it. What goes wrong has the address before it, but for an AbortError of `signal`.
export async function fetchBytes(url, {onProgress, signal, most = Infinity, cache = 'default'} = {}) {
  const end = new AbortController(), stop = () => end.abort(signal.reason);
  if (signal) signal.addEventListener('abort', stop);
  if (signal && signal.aborted) stop();
  let silent = false;
  const endWatch = watchSilence(() => {
    silent = true;
    end.abort();
  });
  try {
    return await receivedBytes(url, {onProgress, signal: end.signal, most, cache});
  } catch (error) {
    if (signal && signal.aborted) throw error;
    if (silent) throw failure(url, `no bytes for ${SILENT_SECONDS} s`, error);
    if (!(error instanceof TypeError)) throw error;
    // Browsers say "Failed to fetch" of all of these.
    const words = `no answer, an answer that broke off, or one that this page may not read (${error.message})`;
    throw failure(url, words, error);
  } finally {
    endWatch();
    if (signal) signal.removeEventListener('abort', stop);
  }
}

async function receivedBytes(url, {onProgress, signal, most, cache}) {
  const answer = await fetch(url, {signal, cache});
  ++heard;
  if (!answer.ok) throw failure(url, `${answer.status} ${answer.statusText}`.trim());
  if (!answer.body) return new Uint8Array(await answer.arrayBuffer());
  const packed = answer.headers.get('Content-Encoding');
  const total = packed ? 0 : Number(answer.headers.get('Content-Length')) || 0;
  const chunks = [], reader = answer.body.getReader();
  let loaded = 0;
  for (;;) {
    const {done, value} = await reader.read();
    ++heard;
    if (done) break;
    chunks.push(value);
    loaded += value.length;
    if (loaded > most) {
      reader.cancel().catch(() => {});
      throw failure(url, `too long (expected at most ${most} bytes)`);
    }
    if (onProgress) onProgress(loaded, total);
  }
  const bytes = new Uint8Array(loaded);
  let at = 0;
  for (const chunk of chunks) {
    bytes.set(chunk, at);
    at += chunk.length;
  }
  return bytes;
}

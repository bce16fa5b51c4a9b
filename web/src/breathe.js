// SPDX-License-Identifier: Apache-2.0
// Long work in slices: the page draws and listens in between.

const SLICE = 10;  // [ms]
let since = 0;
let channel = null;
const waiting = [];

function goOn() {
  since = performance.now();
  waiting.shift()();
  if (waiting.length === 0 && channel.port1.unref) channel.port1.unref();  // Node ends when nothing else is left
}

// Awaited in long loops: at once until SLICE is used up, otherwise after whatever else the page has to do. Messages, as
// timers are slow in pages that nobody looks at.
export function breathe() {
  if (performance.now() - since < SLICE) return null;
  if (!channel) {
    channel = new MessageChannel();
    channel.port1.onmessage = goOn;
  }
  return new Promise((resolve) => {
    waiting.push(resolve);
    if (channel.port1.ref) channel.port1.ref();
    channel.port2.postMessage(null);
  });
}

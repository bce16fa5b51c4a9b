// SPDX-License-Identifier: Apache-2.0
// As web/src/decoder_home.js, in a page that is one script: the worker runs its text, too.

const OWN_SCRIPT = typeof document === 'undefined' ? '' : document.currentScript.textContent;

function decoderWorker() {
  const text = new Blob([OWN_SCRIPT, '\ndecodeFor(self);'], {type: 'text/javascript'});
  const address = URL.createObjectURL(text);
  const worker = new Worker(address);
  worker.addEventListener('message', () => URL.revokeObjectURL(address), {once: true});
  return worker;
}

// SPDX-License-Identifier: Apache-2.0
// Where the decoder's worker comes from. A page that is one script has its own version of this
// (converter/html/page/decoder_home.js).

// A worker has to come from the page's own server; what it imports need not. Bundlers know the first form.
export function decoderWorker() {
  if (new URL(import.meta.url).origin === location.origin) {
    return new Worker(new URL('./decoder_worker.js', import.meta.url), {type: 'module'});
  }
  const text = `import ${JSON.stringify(import.meta.url.replace('decoder_home.js', 'decoder_worker.js'))};`;
  const address = URL.createObjectURL(new Blob([text], {type: 'text/javascript'}));
  const worker = new Worker(address, {type: 'module'});
  worker.addEventListener('message', () => URL.revokeObjectURL(address), {once: true});
  return worker;
}

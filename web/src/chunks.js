// SPDX-License-Identifier: Apache-2.0
// Chunks of a scene with levels of detail, from the decoder: in its worker, or beside the page where there is none.
import {decodeFor} from './decoder.js';
import {decoderWorker} from './decoder_home.js';

const TRIES = 3;                    // to load a chunk
const FIRST_WAIT = 500;             // [ms] before the second one; then twice as long
const IDLE_MILLISECONDS = 10000;    // after which the worker ends

export class ChunkLoader {
  constructor() {
    this.asked = new Map();  // by number: {request, resolve, reject}
    this.number = 0;
    this.port = null;        // of the worker, or of its stand-in
    this.heard = false;      // whether the worker has answered ever
  }

  // `request` as decodeFor() has it. Resolves with what that answers; a chunk that fails is tried again. An AbortError
  // of `signal` once that is told.
  async load(request, signal) {
    for (let tries = 1, wait = FIRST_WAIT; ; ++tries, wait *= 2) {
      try {
        return await this.ask({...request, again: tries > 1}, signal);
      } catch (error) {
        signal.throwIfAborted();
        if (tries === TRIES) throw error;
        await new Promise((done) => setTimeout(done, wait));
        signal.throwIfAborted();
      }
    }
  }

  ask(request, signal) {
    signal.throwIfAborted();
    const id = ++this.number;
    return new Promise((resolve, reject) => {
      const stop = () => {
        if (!this.asked.delete(id)) return;
        this.port.postMessage({id, stop: true});
        reject(signal.reason);
        this.rest();
      };
      signal.addEventListener('abort', stop, {once: true});
      const leave = (body) => (value) => {
        signal.removeEventListener('abort', stop);
        body(value);
      };
      this.asked.set(id, {request: {...request, id}, resolve: leave(resolve), reject: leave(reject)});
      clearTimeout(this.idle);
      this.open();
      this.port.postMessage({...request, id});
    });
  }

  open() {
    if (this.port) return;
    try {
      this.port = decoderWorker();
    } catch (error) {
      this.openBeside();
      return;
    }
    this.port.onmessage = ({data}) => this.answered(data);
    this.port.onerror = () => this.failed();
  }

  // Where a page's rules leave it no such worker: in slices.
  openBeside() {
    const {port1, port2} = new MessageChannel();
    decodeFor(port2);
    port1.onmessage = ({data}) => this.answered(data);
    this.port = port1;
  }

  failed() {
    this.port.terminate();
    this.port = null;
    if (!this.heard) {
      this.openBeside();
      for (const {request} of this.asked.values()) this.port.postMessage(request);
      return;
    }
    const asked = [...this.asked.values()];
    this.asked.clear();
    for (const {request, reject} of asked) reject(new Error(`${request.address}: the worker that unpacks it failed`));
  }

  answered(answer) {
    this.heard = true;
    const asked = this.asked.get(answer.id);
    if (!asked) return;
    this.asked.delete(answer.id);
    if (answer.error) asked.reject(new Error(answer.error));
    else asked.resolve(answer);
    this.rest();
  }

  rest() {
    clearTimeout(this.idle);
    this.idle = setTimeout(() => {
      if (this.asked.size > 0 || !this.port) return;
      if (this.port.terminate) this.port.terminate();
      else this.port.close();
      this.port = null;
    }, IDLE_MILLISECONDS);
  }
}

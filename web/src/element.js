// SPDX-License-Identifier: Apache-2.0
// <textured-gaussians src="scene.glb">: a model on a page, turned by hand.
import {fetchBytes} from './fetch.js';
import {listenToHands, moveByKey} from './hands.js';
import {readFrom} from './model.js';
import {wholeNumber} from './names.js';
import {Viewer} from './viewer.js';

const MOST_CONTEXTS = 8;  // at a time on a page: beyond 16 browsers take the oldest one away, phones beyond 8
const SETTINGS = ['camera', 'view', 'show', 'textures', 'intersection', 'outside', 'background', 'splat-budget'];
const STYLE = `
:host { display: block; position: relative; width: 100%; aspect-ratio: 16 / 9; overflow: hidden; background: #101114; }
:host([hidden]) { display: none; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; outline: none; touch-action: none; cursor: grab; }
canvas:active { cursor: grabbing; }
canvas.still { pointer-events: none; }
canvas:focus-visible { outline: 2px solid #8fb2ff; outline-offset: -2px; }
i { display: none; position: absolute; inset: 2px; border: 2px solid #101114; pointer-events: none;
  forced-color-adjust: none; }
canvas:focus-visible ~ i { display: block; }
div { position: absolute; left: 0; top: 0; height: 4px; width: 0; background: #5b8af0; transition: width 0.2s; }
p { position: absolute; left: 12px; right: 12px; bottom: 12px; max-height: max(1.4em, calc(100% - 40px));
  overflow: auto; margin: 0; padding: 8px 12px; border-radius: 6px; background: #7c2630; color: #fff;
  font: 13px/1.4 system-ui, sans-serif; overflow-wrap: anywhere; }
p:empty, div[hidden] { display: none; }`;

const awake = [];  // elements that have a context, the one seen last at the end
let turn = Promise.resolve();  // they get theirs one after the other

function makeRoom() {
  if (awake.length < MOST_CONTEXTS) return;
  (awake.find((element) => !element.inView) || awake[0]).sleep();
}

// What a model's address calls it: its file, or the folder of a lod-meta.json.
function nameIn(address) {
  if (/^\s*(data|blob):/i.test(address)) return 'a model';  // no names in these, but megabytes
  const [path] = address.split(/[?#]/, 1), [folder, file] = ['', ...path.split('/')].slice(-2);
  const name = (file === 'lod-meta.json' && folder) || file;
  try {
    return decodeURIComponent(name) || 'a model';
  } catch {  // a % of its own
    return name;
  }
}

// Imported on a server, which has no elements, it is a class of no use, and no error.
export class TexturedGaussiansElement extends (globalThis.HTMLElement || Object) {
  static get observedAttributes() { return ['src', 'alt', 'title', ...SETTINGS]; }

  constructor() {
    super();
    const root = this.attachShadow({mode: 'open'});
    root.innerHTML = `<style>${STYLE}</style><canvas tabindex="0" role="img"></canvas>
      <div hidden role="progressbar" aria-label="loading"></div><p role="alert"></p><i></i>`;
    [, this.canvas, this.bar, this.words] = root.children;
    this.viewer = null;
    this.still = null;     // what is seen instead of the canvas while the viewer has no context
    this.inView = false;
    this.loading = null;   // the address that is being read
    this.loaded = null;    // {address, model} of what was read last
    this.refused = null;   // {model, error}: the one that could not be shown, and why
    this.stop = null;
    this.letGo = null;     // ends what listens to hands
    this.reasons = {};     // by attribute, why it does nothing
    this.watcher = new ResizeObserver(() => this.viewer && this.viewer.changed());
    this.lookout = new IntersectionObserver((entries) => {
      this.inView = entries[entries.length - 1].isIntersecting;
      if (this.inView) this.look();
    }, {rootMargin: '25%'});
    for (const kind of ['pointerdown', 'focus', 'wheel']) {
      this.canvas.addEventListener(kind, () => this.look(), {passive: true});
    }
    this.canvas.onkeydown = (event) => {
      if (!this.viewer || event.ctrlKey || event.metaKey || event.altKey) return;
      if (moveByKey(this.viewer, event)) event.preventDefault();
    };
  }

  connectedCallback() {
    this.label();
    if (this.viewer) this.letGo = listenToHands(this.viewer);
    this.watcher.observe(this);
    this.lookout.observe(this);
    if (this.loaded && this.loaded.address === this.src) this.look();
    else this.open();
  }

  disconnectedCallback() {
    if (this.stop) this.stop.abort();
    if (this.letGo) this.letGo();
    this.letGo = null;
    this.loading = null;
    this.watcher.disconnect();
    this.lookout.disconnect();
    this.inView = false;
    turn = turn.then(() => {
      if (!this.isConnected) this.sleep();
    });
  }

  attributeChangedCallback(name, before, value) {
    if (['src', 'alt', 'title'].includes(name)) this.label();
    if (name === 'src') {
      this.refused = null;
      if (this.isConnected) this.open();
    } else if (SETTINGS.includes(name) && this.model) {
      this.wake().then(() => {
        if (value === null) this.viewer.reset(name);
        this.apply([name]);
      }).catch((error) => this.fail(error));
    }
  }

  // What the picture is called for who does not see it.
  label() {
    const name = this.getAttribute('alt') || this.getAttribute('title') || `3D view of ${nameIn(this.src)}`;
    this.canvas.setAttribute('aria-label', name);
  }

  get src() { return this.getAttribute('src') || ''; }
  set src(address) { this.setAttribute('src', address); }

  // The model that is shown, as readModel gives it, or null.
  get model() { return this.viewer && this.viewer.model; }

  async open() {
    const address = this.src;
    if (this.stop) this.stop.abort();
    this.loading = address;
    if (address === '') {
      this.bar.hidden = true;
      this.words.textContent = '';
      return;
    }
    this.stop = new AbortController();
    this.words.textContent = '';
    this.progress(0, 0);
    const {signal} = this.stop;
    try {
      const onProgress = (loaded, total) => this.progress(loaded, total);
      const splatBudget = wholeNumber(this.getAttribute('splat-budget')) || undefined;
      const model = await readFrom(address, await fetchBytes(address, {signal, onProgress}), {signal, splatBudget});
      if (signal.aborted) return;
      this.loaded = {address, model};
      if (this.inView || awake.length < MOST_CONTEXTS) await this.wake();
      if (signal.aborted) return;
      this.bar.hidden = true;
      this.dispatchEvent(new CustomEvent('load', {detail: {model}}));
    } catch (error) {
      if (!signal.aborted) this.fail(error);
    }
  }

  // Shows the model that was read last, in a context of its own, which another element may have to give back for it.
  // Resolves when its picture stands.
  wake() {
    if (awake.includes(this) && this.model === this.loaded.model) awake.push(...awake.splice(awake.indexOf(this), 1));
    const shown = turn.then(() => this.show());
    turn = shown.catch(() => {});
    return shown;
  }

  // Not for a model that was refused, which every move of a wheel would upload again.
  look() {
    if (this.refused && this.loaded && this.refused.model === this.loaded.model) return;
    this.wake().catch((error) => this.fail(error));
  }

  async show() {
    if (!this.isConnected || !this.loaded) return;
    const {model} = this.loaded;
    if (awake.includes(this) && this.model === model) return;
    if (this.refused && this.refused.model === model) throw this.refused.error;
    if (!awake.includes(this)) {
      makeRoom();
      if (this.viewer) {
        await this.viewer.resume();
        if (this.model) this.apply([]);
      } else {
        this.viewer = new Viewer(this.canvas);
        this.viewer.onError = (error) => this.fail(error);
        this.viewer.onLost = (words) => {
          if (words) this.fail(new Error(words));
          else if (this.model) this.apply([]);
          else this.words.textContent = '';
        };
        this.letGo = listenToHands(this.viewer);
      }
      awake.push(this);
    }
    try {
      if (this.model !== model) {
        await this.viewer.open(model).catch((error) => {
          if (!error.isLoss) this.refused = {model, error};  // a device may come back
          throw error;
        });
        this.apply(SETTINGS);
      }
      await this.viewer.settled();
    } finally {
      if (!this.model) this.sleep();
      else if (this.viewer.splats) this.endStill();
    }
  }

  // Gives the context back; a still picture stands for it.
  sleep() {
    if (!awake.includes(this)) return;
    awake.splice(awake.indexOf(this), 1);
    this.still = this.viewer.release();
    this.still.className = 'still';
    this.canvas.after(this.still);
  }

  endStill() {
    if (this.still) this.still.remove();
    this.still = null;
  }

  apply(names) {
    for (const name of names) {
      this.reasons[name] = this.hasAttribute(name) ? this.viewer.applyWhatCan({[name]: this.getAttribute(name)}) : [];
    }
    this.words.textContent = [...this.viewer.model.notes, ...Object.values(this.reasons).flat()].join(' ');
  }

  progress(loaded, total) {
    this.bar.hidden = false;
    const share = total > 0 ? 90 * loaded / total : 50;
    this.bar.style.width = `${share}%`;
    this.bar.setAttribute('aria-valuenow', String(Math.round(share)));
    this.dispatchEvent(new CustomEvent('progress', {detail: {loaded, total}}));
  }

  fail(error) {
    this.bar.hidden = true;
    this.words.textContent = error.message;
    this.dispatchEvent(new CustomEvent('error', {detail: {error}}));
  }

  // A PNG of the view as a data URL; settings: as the attributes. Throws where there is no model yet.
  async picture(settings = {}) {
    await this.wake();
    if (!awake.includes(this)) throw new Error('no model is shown');
    return this.viewer.picture(settings);
  }

  // Flies through the model's views, or its cameras; false to stop. False where it cannot fly.
  play(on = true) {
    if (!this.model) return false;
    if (awake.includes(this)) return this.viewer.play(on);
    this.wake().then(() => this.viewer.play(on)).catch((error) => this.fail(error));
    return on && this.viewer.stops.length > 1;
  }
}

if (globalThis.customElements && !customElements.get('textured-gaussians')) {
  customElements.define('textured-gaussians', TexturedGaussiansElement);
}

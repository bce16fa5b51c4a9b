// SPDX-License-Identifier: Apache-2.0
// <textured-gaussians src="scene.glb">: a model on a page, turned by hand.
import {listenToHands, moveByKey} from './hands.js';
import {fetchBytes, readFrom} from './model.js';
import {Viewer} from './viewer.js';

const SETTINGS = ['camera', 'view', 'show', 'textures', 'intersection', 'outside', 'background'];
const STYLE = `
:host { display: block; position: relative; width: 100%; aspect-ratio: 16 / 9; overflow: hidden; background: #101114; }
:host([hidden]) { display: none; }
canvas { position: absolute; inset: 0; width: 100%; height: 100%; outline: none; touch-action: none; cursor: grab; }
canvas:active { cursor: grabbing; }
canvas:focus-visible { outline: 2px solid #8fb2ff; outline-offset: -2px; }
div { position: absolute; left: 0; top: 0; height: 4px; width: 0; background: #5b8af0; transition: width 0.2s; }
p { position: absolute; left: 12px; right: 12px; bottom: 12px; margin: 0; padding: 8px 12px; border-radius: 6px;
  background: #7c2630; color: #fff; font: 13px/1.4 system-ui, sans-serif; overflow-wrap: anywhere; }
p:empty, div[hidden] { display: none; }`;

export class TexturedGaussiansElement extends HTMLElement {
  static get observedAttributes() { return ['src', ...SETTINGS]; }

  constructor() {
    super();
    const root = this.attachShadow({mode: 'open'});
    root.innerHTML = `<style>${STYLE}</style><canvas tabindex="0"></canvas><div hidden></div><p role="alert"></p>`;
    [, this.canvas, this.bar, this.words] = root.children;
    this.viewer = null;
    this.loading = null;   // the address that is being read
    this.stop = null;
    this.reasons = {};     // by attribute, why it does nothing
  }

  connectedCallback() {
    this.canvas.setAttribute('aria-label', this.getAttribute('alt') || '3D view of a model');
    try {
      this.viewer = new Viewer(this.canvas);
    } catch (error) {
      this.fail(error);
      return;
    }
    this.viewer.onError = (error) => this.fail(error);
    listenToHands(this.viewer);
    this.canvas.onkeydown = (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey) return;
      if (moveByKey(this.viewer, event)) event.preventDefault();
    };
    this.watcher = new ResizeObserver(() => this.viewer && this.viewer.changed());
    this.watcher.observe(this);
    this.open();
  }

  disconnectedCallback() {
    if (this.stop) this.stop.abort();
    this.loading = null;
    if (this.watcher) this.watcher.disconnect();
    if (this.viewer) this.viewer.dispose();
    this.viewer = null;
    // A context belongs to its canvas for good: another canvas for the next time.
    const fresh = this.canvas.cloneNode();
    this.canvas.replaceWith(fresh);
    this.canvas = fresh;
  }

  attributeChangedCallback(name) {
    if (!this.viewer) return;
    if (name === 'src') this.open();
    else if (this.viewer.model) this.apply([name]);
  }

  get src() { return this.getAttribute('src') || ''; }
  set src(address) { this.setAttribute('src', address); }

  // The model that is shown, as readModel gives it, or null.
  get model() { return this.viewer && this.viewer.model; }

  async open() {
    const address = this.src;
    if (this.stop) this.stop.abort();
    this.loading = address;
    if (address === '') return;
    this.stop = new AbortController();
    this.words.textContent = '';
    this.progress(0, 0);
    try {
      const {signal} = this.stop;
      const onProgress = (loaded, total) => this.progress(loaded, total);
      const model = await readFrom(address, await fetchBytes(address, {signal, onProgress}));
      if (this.loading !== address || signal.aborted) return;
      await this.viewer.open(model);
      if (this.loading !== address || signal.aborted) return;
      this.apply(SETTINGS);
      await this.viewer.settled();
      this.bar.hidden = true;
      this.dispatchEvent(new CustomEvent('load', {detail: {model}}));
    } catch (error) {
      if (this.loading === address && error.name !== 'AbortError') this.fail(error);
    }
  }

  apply(names) {
    for (const name of names) {
      this.reasons[name] = this.hasAttribute(name) ? this.viewer.applyWhatCan({[name]: this.getAttribute(name)}) : [];
    }
    this.words.textContent = [...this.viewer.model.notes, ...Object.values(this.reasons).flat()].join(' ');
  }

  progress(loaded, total) {
    this.bar.hidden = false;
    this.bar.style.width = `${total > 0 ? 90 * loaded / total : 50}%`;
    this.dispatchEvent(new CustomEvent('progress', {detail: {loaded, total}}));
  }

  fail(error) {
    this.bar.hidden = true;
    this.words.textContent = error.message;
    this.dispatchEvent(new CustomEvent('error', {detail: {error}}));
  }

  // A PNG of the view as a data URL; settings: as the attributes.
  picture(settings = {}) { return this.viewer.picture(settings); }

  // Flies through the model's views, or its cameras; false to stop.
  play(on = true) { return this.viewer.play(on); }
}

if (!customElements.get('textured-gaussians')) customElements.define('textured-gaussians', TexturedGaussiansElement);

// SPDX-License-Identifier: Apache-2.0
// The page: unpacks its model, keeps it sorted and drawn, and lets hands, keys, the address and tests move it.
'use strict';

const TEXTURE_CHOICES = {rgba: 3, rgb: 2, alpha: 1, off: 0, fallback: 0};  // masks on the model's kMode*
const OUTSIDE_TITLES = {base: 'beyond its texture a splat shows its base colour', clip: 'a splat ends with its texture',
                        edge: 'beyond its texture a splat has the texels of the border'};
const REST_MILLISECONDS = 150;  // without input: the picture is drawn in full again
const SLOW_FRAME = 50, FAST_FRAME = 20;  // [ms] between frames while moving
const MAX_FIXED_SIDE = 8192;

const modeName = (layer) => Object.keys(MODES).find((name) => MODES[name] === layer.mode);
const element = (id) => document.getElementById(id);

function showMessage(text, isNote = false) {
  const box = element('message');
  box.textContent = text;
  box.className = isNote ? 'note' : '';
  box.hidden = text === '';
}

// The model in the page: base64 of a gzip stream, in elements that are dropped as they are read.
async function unpackPayload() {
  const nodes = [...document.querySelectorAll('script.model')];
  if (nodes.length === 0) return null;
  const source = new ReadableStream({
    pull(controller) {
      const node = nodes.shift();
      if (!node) {
        controller.close();
        return;
      }
      const text = atob(node.textContent.trim());
      node.remove();
      const bytes = new Uint8Array(text.length);
      for (let i = 0; i < bytes.length; ++i) bytes[i] = text.charCodeAt(i);
      controller.enqueue(bytes);
    },
  });
  const stream = source.pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

class Viewer {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new SplatRenderer(canvas, shaderText);
    const worker = new Blob([element('sort_worker.js').textContent], {type: 'text/javascript'});
    this.worker = new Worker(URL.createObjectURL(worker));
    this.worker.onmessage = ({data}) => this.sorted(data);
    this.worker.onerror = (event) => showMessage(`The sorting worker failed: ${event.message}`);
    this.next = null;         // a model that waits for its first order
    this.models = 0;          // loaded so far: orders of an older one are dropped
    this.request = 0;         // of the last order asked for
    this.sorting = false;
    this.asked = null;        // what the last order was asked for
    this.spare = null;        // an order to fill again
    this.fixedSize = null;    // [px] instead of the window's
    this.settings = {show: 'final', textures: 'rgba', intersection: 1, outside: 0, background: [0, 0, 0]};
    this.motionScale = 1;     // resolution while the camera moves
    this.lastInput = -Infinity;
    this.lastFrame = 0;
    this.framePending = false;
    this.waiting = [];        // called when the picture is what was asked for
  }

  async open(bytes) {
    const model = await readGlb(bytes);
    this.renderer.setModel(model);
    this.model = model;
    this.orbit = new Orbit(model);
    ++this.models;
    this.asked = null;
    this.worker.postMessage({positions: new Float32Array(model.mean)});
    this.settings.textures = model.layer ? modeName(model.layer) : 'off';
    this.settings.intersection = model.intersection;
    this.settings.outside = model.outside;
    this.settings.background = model.background;
    this.resize();
    const test = model.cameras.findIndex((camera) => camera.test);
    this.jump(model.cameras.length > 0 ? Math.max(test, 0) : -1);
    showMessage(model.notes.join(' '), true);
  }

  // The same model, further trained: the view stays, and the old picture until there is an order of the new one.
  async replace(bytes) {
    const model = await readGlb(bytes);
    await new Promise((resolve, reject) => {
      this.next = {model, resolve, reject};
      ++this.models;
      this.asked = null;
      this.worker.postMessage({positions: new Float32Array(model.mean)});
      this.sortIfNeeded();
    });
  }

  takeNext() {
    const {model, resolve, reject} = this.next;
    this.next = null;
    try {
      this.renderer.setModel(model);
      const had = Boolean(this.model.layer);
      this.model = model;
      const {camera, distance} = this.orbit;
      this.orbit = Object.assign(new Orbit(model), {camera, distance});
      if (Boolean(model.layer) !== had) this.settings.textures = model.layer ? modeName(model.layer) : 'off';
      this.settings.intersection = model.intersection;
      resolve();
    } catch (error) {
      reject(error);
    }
  }

  // To a camera of the model, or -1: everything in view.
  jump(index) {
    this.cameraIndex = index;
    if (index >= 0) {
      this.orbit.set(this.model.cameras[index]);
    } else {
      this.orbit.start(this.canvas.width, this.canvas.height);
    }
    this.changed();
  }

  // After any change of camera or settings. `byHand`: more is to be expected at once.
  changed(byHand = false) {
    if (byHand) {
      this.lastInput = performance.now();
      clearTimeout(this.restTimer);
      this.restTimer = setTimeout(() => this.changed(), REST_MILLISECONDS);
    }
    this.sortIfNeeded();
    if (this.framePending) return;
    this.framePending = true;
    requestAnimationFrame(() => {
      this.framePending = false;
      if (this.model) this.frame();
      if (this.onChange) this.onChange();
    });
  }

  sortIfNeeded() {
    if (this.sorting || !this.model) return;
    const {axes, eye} = this.orbit.camera;
    const row = [...axes[2], -dot(axes[2], eye)];
    const key = `${this.models} ${row}`;
    if (key === this.asked) return;
    this.asked = key;
    this.sorting = true;
    const transfer = this.spare ? [this.spare.buffer] : [];
    this.worker.postMessage({row, order: this.spare, model: this.models, request: ++this.request}, transfer);
    this.spare = null;
  }

  sorted({order, visible, model}) {
    this.sorting = false;
    this.spare = order;
    if (model === this.models) {
      if (this.next) this.takeNext();
      this.renderer.setOrder(order, visible);
    }
    this.changed();
  }

  get moving() { return performance.now() - this.lastInput < REST_MILLISECONDS; }

  frame() {
    const now = performance.now();
    const gap = now - this.lastFrame;
    this.lastFrame = now;
    if (this.moving && gap < 500) {
      if (gap > SLOW_FRAME) this.motionScale = Math.max(0.8 * this.motionScale, 0.25);
      if (gap < FAST_FRAME) this.motionScale = Math.min(1.1 * this.motionScale, 1);
      this.gap = gap;
    }
    const unfinished = this.moving || this.sorting;
    if (this.waiting.length > 0 && unfinished) return;  // whoever waits looks at the finished picture only
    this.draw(this.moving ? this.motionScale : 1);
    if (unfinished) return;
    for (const done of this.waiting.splice(0)) done();
  }

  draw(scale) {
    this.resize();
    const width = Math.max(Math.round(this.canvas.width * scale), 1);
    const height = Math.max(Math.round(this.canvas.height * scale), 1);
    const {bounds, camera} = this.orbit;
    const middle = dot(add(bounds.center, camera.eye, -1), camera.axes[2]);
    const near = Math.max(middle - bounds.radius, NEAR);
    this.renderer.draw(fitted(camera, width, height), {
      ...this.settings, textures: TEXTURE_CHOICES[this.settings.textures],
      fallback: this.settings.textures === 'fallback',
      depthRange: [near, Math.max(middle + bounds.radius, near + 1e-3)],
    });
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    let size = this.fixedSize;
    if (!size) size = [this.canvas.clientWidth * ratio, this.canvas.clientHeight * ratio].map(Math.round);
    const [width, height] = size.map((side) => Math.max(side, 1));
    if (this.canvas.width !== width) this.canvas.width = width;
    if (this.canvas.height !== height) this.canvas.height = height;
  }

  // Settings under the names and with the values of tgview's flags, all optional: camera (index, or {width, height, fx,
  // fy, cx, cy, axes, eye} as in camera.js), size "WxH" or "window", show, textures, intersection, outside,
  // background.
  apply(wanted) {
    const choice = (key, known) => {
      if (wanted[key] === undefined) return;
      if (!known.includes(wanted[key])) throw new Error(`${key}=${wanted[key]} (expected ${known.join(', ')})`);
      this.settings[key] = wanted[key];
    };
    choice('show', Object.keys(SHOW));
    choice('textures', Object.keys(TEXTURE_CHOICES));
    for (const [key, numbers] of [['intersection', INTERSECTIONS], ['outside', OUTSIDES]]) {
      if (wanted[key] === undefined) continue;
      if (numbers[wanted[key]] === undefined) throw new Error(`${key}=${wanted[key]}`);
      this.settings[key] = numbers[wanted[key]];
    }
    if (wanted.background !== undefined) {
      const named = {black: [0, 0, 0], white: [1, 1, 1]}[wanted.background];
      const color = named || String(wanted.background).split(',').map(Number);
      if (color.length !== 3 || !color.every((c) => c >= 0 && c <= 1)) {
        throw new Error(`background=${wanted.background} (expected r,g,b in [0, 1], black or white)`);
      }
      this.settings.background = color;
    }
    if (wanted.size !== undefined) {
      const size = wanted.size === 'window' ? null : String(wanted.size).split('x').map(Number);
      if (size && !(size.length === 2 && size.every((n) => Number.isInteger(n) && n > 0 && n <= MAX_FIXED_SIDE))) {
        throw new Error(`size=${wanted.size} (expected WxH)`);
      }
      this.fixedSize = size;
      const ratio = window.devicePixelRatio || 1;
      Object.assign(this.canvas.style, size ? {width: `${size[0] / ratio}px`, height: `${size[1] / ratio}px`}
                                            : {width: '', height: ''});
      this.resize();
    }
    if (typeof wanted.camera === 'object') {
      this.cameraIndex = -1;
      this.orbit.set(wanted.camera);
    } else if (wanted.camera !== undefined) {
      const index = Number(wanted.camera);
      if (!this.model.cameras[index]) {
        throw new Error(`camera=${wanted.camera} (the model has ${this.model.cameras.length})`);
      }
      this.jump(index);
    }
    this.changed();
  }

  // Resolves when the picture on the canvas is in full resolution and in the right order.
  settled() {
    return new Promise((resolve) => {
      this.waiting.push(resolve);
      this.changed();
    });
  }

  // The picture for these settings, as a data URL of a PNG.
  async picture(wanted = {}) {
    this.apply(wanted);
    await this.settled();  // goes on in the task that drew: later the canvas is empty
    return this.canvas.toDataURL('image/png');
  }

  restore() {
    this.renderer = new SplatRenderer(this.canvas, shaderText);
    if (!this.model) return;
    this.renderer.setModel(this.model);
    this.asked = null;
    this.changed();
  }
}

const shaderText = (name) => element(name).textContent.trimStart();

// Buttons of which one is pressed. choices: [[value, title]].
function fillChoices(id, choices, choose) {
  element(id).replaceChildren(...choices.map(([value, title]) => {
    const button = document.createElement('button');
    button.textContent = value;
    button.title = title || '';
    button.onclick = () => choose(value);
    return button;
  }));
}

function press(id, value) {
  for (const button of element(id).children) button.setAttribute('aria-pressed', String(button.textContent === value));
}

class Panel {
  constructor(viewer, name) {
    this.viewer = viewer;
    this.name = name;
    const {canvas} = viewer;
    const move = (step) => {
      const count = viewer.model.cameras.length;
      if (count > 0) viewer.jump((viewer.cameraIndex + step + count) % count);
    };
    const frameAll = () => {
      viewer.orbit.frame(canvas.width, canvas.height);
      viewer.changed();
    };
    const cycle = (values, value, set) => {
      set(values[(values.indexOf(value) + 1) % values.length]);
      viewer.changed();
    };
    element('previous').onclick = () => move(-1);
    element('next').onclick = () => move(1);
    element('frame').onclick = frameAll;
    element('camera').onchange = (event) => viewer.jump(Number(event.target.value));
    element('background').oninput = (event) => {
      const bits = parseInt(event.target.value.slice(1), 16);
      viewer.settings.background = [bits >> 16, bits >> 8 & 255, bits & 255].map((byte) => byte / 255);
      viewer.changed();
    };
    addEventListener('keydown', (event) => {
      if (event.ctrlKey || event.metaKey || event.altKey || !viewer.model) return;
      if (event.target.tagName === 'SELECT' || event.target.tagName === 'INPUT') return;
      const {settings} = viewer;
      const output = Object.keys(SHOW)[Number(event.key) - 1];
      const key = event.key.toLowerCase();
      if (output) {
        settings.show = output;
        viewer.changed();
      } else if (key === 't') {
        cycle(this.textureChoices().map(([value]) => value), settings.textures, (value) => settings.textures = value);
      } else if (key === 'i') {
        cycle(Object.values(INTERSECTIONS), settings.intersection, (value) => settings.intersection = value);
      } else if (key === 'f') {
        frameAll();
      } else if (key === 'h') {
        element('panel').hidden = !element('panel').hidden;
      } else if (key === ' ') {
        move(event.shiftKey ? -1 : 1);
      } else {
        return;
      }
      event.preventDefault();
    });
    viewer.onChange = () => this.update();
  }

  // After another model was opened.
  fill() {
    const {model} = this.viewer;
    element('title').textContent = this.name;
    const textures = model.layer ? `${modeName(model.layer)} textures` : 'no textures';
    element('facts').textContent = `${model.count.toLocaleString('en')} Gaussians, SH degree ` +
      `${Math.round(Math.sqrt(model.sh.length)) - 1}, ${textures}`;
    element('cameras').style.display = model.cameras.length === 0 ? 'none' : '';
    element('camera').replaceChildren(...model.cameras.map((camera, index) =>
      new Option(`${index} ${camera.name}${camera.test ? ' (test)' : ''}`, String(index))));
    const set = (key) => (value) => {
      this.viewer.settings[key] = value;
      this.viewer.changed();
    };
    fillChoices('show', Object.keys(SHOW).map((name) => [name]), set('show'));
    fillChoices('textures', this.textureChoices(), set('textures'));
    fillChoices('outside', model.layer ? Object.keys(OUTSIDES).map((name) => [name, OUTSIDE_TITLES[name]]) : [],
                (value) => set('outside')(OUTSIDES[value]));
    fillChoices('intersection', Object.keys(INTERSECTIONS).map((name) => [name]),
                (value) => set('intersection')(INTERSECTIONS[value]));
    this.update();
  }

  textureChoices() {
    const {layer} = this.viewer.model;
    if (!layer) return [];
    const possible = Object.keys(TEXTURE_CHOICES).filter((name) => (TEXTURE_CHOICES[name] & ~layer.mode) === 0);
    const titles = {off: 'the base alone', fallback: 'as viewers show it that do not know the textures'};
    return possible.map((name) => [name, titles[name]]);
  }

  update() {
    const {viewer} = this;
    if (!viewer.model) return;
    const {settings} = viewer;
    press('show', settings.show);
    press('textures', settings.textures);
    press('outside', Object.keys(OUTSIDES)[settings.outside]);
    press('intersection', Object.keys(INTERSECTIONS)[settings.intersection]);
    element('camera').value = String(viewer.cameraIndex);
    element('background').value =
      '#' + settings.background.map((c) => Math.round(c * 255).toString(16).padStart(2, '0')).join('');
    if (viewer.moving && viewer.gap) element('speed').textContent = `${viewer.gap.toFixed(0)} ms`;
  }
}

// Drags, wheel and fingers.
function listenToHands(viewer) {
  const {canvas} = viewer;
  const pointers = new Map();
  const middle = () => {
    const points = [...pointers.values()];
    const x = points.reduce((sum, p) => sum + p.x, 0) / points.length;
    const y = points.reduce((sum, p) => sum + p.y, 0) / points.length;
    return {x, y, spread: points.length < 2 ? 0 : Math.hypot(points[0].x - points[1].x, points[0].y - points[1].y)};
  };
  const size = () => [canvas.clientWidth, canvas.clientHeight];
  canvas.addEventListener('pointerdown', (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
  });
  canvas.addEventListener('pointermove', (event) => {
    if (!pointers.has(event.pointerId) || !viewer.model) return;
    const before = middle();
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
    const after = middle();
    const dx = after.x - before.x, dy = after.y - before.y;
    if (pointers.size > 1) {
      viewer.orbit.pan(dx, dy, ...size());
      if (after.spread > 0 && before.spread > 0) viewer.orbit.dolly(before.spread / after.spread);
    } else if (event.shiftKey || event.buttons & 6) {
      viewer.orbit.pan(dx, dy, ...size());
    } else {
      const turn = Math.PI / Math.max(Math.min(...size()), 1);  // half a turn for the shorter side
      viewer.orbit.orbit(-dx * turn, -dy * turn);
    }
    viewer.cameraIndex = -1;
    viewer.changed(true);
  });
  for (const name of ['pointerup', 'pointercancel']) {
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener('contextmenu', (event) => event.preventDefault());
  canvas.addEventListener('wheel', (event) => {
    event.preventDefault();
    if (!viewer.model) return;
    const pixels = event.deltaY * (event.deltaMode === 0 ? 1 : 16);
    viewer.orbit.dolly(Math.exp(0.0015 * Math.max(-300, Math.min(300, pixels))));
    viewer.cameraIndex = -1;
    viewer.changed(true);
  }, {passive: false});
}

// Another GLB dropped on the page. A broken one is reported and leaves the old model.
function listenToDrops(viewer, panel) {
  addEventListener('dragover', (event) => event.preventDefault());
  addEventListener('drop', async (event) => {
    event.preventDefault();
    const [file] = event.dataTransfer.files;
    if (!file) return;
    try {
      await viewer.open(new Uint8Array(await file.arrayBuffer()));
      panel.name = file.name;
      panel.fill();
    } catch (error) {
      showMessage(`${file.name}: ${error.message}`);
    }
  });
}

// Called at the end of the page. Sets window.__done to {gaussians} when the first picture stands, or to {error}.
// window.tgViewer offers picture(), apply() and settled() to tests; the address takes apply()'s settings and panel=off.
async function startViewer() {
  try {
    if (typeof DecompressionStream === 'undefined') throw new Error('This browser is too old: no DecompressionStream.');
    const viewer = new Viewer(element('picture'));
    const panel = new Panel(viewer, document.title);
    const bytes = await unpackPayload().catch(() => {
      throw new Error('The model in this page is damaged.');
    });
    if (!bytes) throw new Error('The page holds no model.');
    await viewer.open(bytes);
    const wanted = Object.fromEntries(new URLSearchParams(location.search || location.hash.slice(1)));
    element('panel').hidden = wanted.panel === 'off';
    viewer.apply(wanted);
    panel.fill();
    listenToHands(viewer);
    listenToDrops(viewer, panel);
    addEventListener('resize', () => viewer.changed());
    viewer.canvas.addEventListener('webglcontextlost', (event) => event.preventDefault());
    viewer.canvas.addEventListener('webglcontextrestored', () => viewer.restore());
    window.tgViewer = viewer;
    await viewer.settled();
    window.__done = {gaussians: viewer.model.count};
  } catch (error) {
    showMessage(error.message);
    window.__done = {error: error.message};
  }
}

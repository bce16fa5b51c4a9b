// SPDX-License-Identifier: Apache-2.0
// A canvas that shows a model by itself, without an engine: keeps it sorted and drawn, and moves the camera.
import {Orbit, NEAR, add, dot, fitted} from './camera.js';
import {Flight} from './flight.js';
import {INTERSECTIONS, OUTSIDES} from './glb.js';
import {noSuchCamera} from './matrices.js';
import {valueNamed, wholeNumber} from './names.js';
import {SHOW, SplatRenderer} from './renderer.js';
import {Splats, TEXTURE_CHOICES} from './splats.js';
import {formatView, parseView} from './view_text.js';

const REST_MILLISECONDS = 150;  // without input: the picture is drawn in full again
const PATIENCE_MILLISECONDS = 5;  // between two looks whether the device is done
const SLOW_FRAME = 50, FAST_FRAME = 35;  // [ms] that a frame takes while moving; a screen of 30 Hz has fast ones
const LOST_MILLISECONDS = 5000;  // until a device that the browser took away and has not given back is spoken of
const LOOK_MILLISECONDS = 1000;  // between two looks whether something has come that somebody waits for
const MOST_LOOKS = 60;  // in vain
const MOST_UPLOADS = 3;  // of a model, where the device is lost meanwhile
const MAX_FIXED_SIDE = 8192;
const NOWHERE = {camera: -1, view: -1};

const LOST = 'The browser has taken the graphics device away. If the picture does not come back, reload the page.';

export class Viewer {
  // Throws without WebGL 2.
  constructor(canvas) {
    this.canvas = canvas;
    this.openContext();
    this.splats = null;       // what is shown
    this.model = null;        // what it is of
    this.settings = {show: 'final', textures: 'rgba', intersection: 'maxResponse', outside: 'base', background: [0, 0, 0]};
    this.fixedSize = null;    // [px] instead of the canvas' own
    this.layout = null;       // {style, pixels} of the canvas before it was of a fixed size
    this.cameraIndex = -1;    // of the model's cameras, while the view is one of them; likewise for its views
    this.viewIndex = -1;
    this.left = NOWHERE;      // the two indices as they were before it was none of them
    this.motionScale = 1;     // resolution while the camera moves
    this.tooMuch = Infinity;  // a resolution that was too slow in this movement
    this.lastInput = -Infinity;
    this.lastFrame = 0;
    this.askedAt = 0;         // when a frame was asked for first since then; 0: it was not
    this.framePending = false;
    this.pendingSince = 0;
    this.watchTimer = 0;      // while somebody waits for a picture
    this.flight = null;       // a path that is played
    this.toFly = false;       // whether one is to begin once nobody waits for a picture
    this.waiting = [];        // {resolve, reject} of those that wait for the picture that was asked for
    this.pictures = Promise.resolve();  // those that were asked for, one after the other
    this.openings = 0;
    this.uploads = 0;         // under way: where the device is lost meanwhile they begin again
    this.uploaded = null;     // resolves when the last of them ends
    this.missing = [];        // called once there is a device again
    this.lostSaid = false;
    this.taking = null;       // resolves when a larger budget has its room
    this.end = new AbortController();  // what listens for the viewer until it is disposed of
    this.lost = null;         // resolves once the context is, that release() has given back
    this.onChange = () => {};
    this.onError = (error) => console.error(error);
    this.onLost = (words) => words && console.error(words);  // of a device that stays away; '' once it is back
    canvas.addEventListener('webglcontextlost', (event) => {
      event.preventDefault();
      if (this.lost || !this.renderer) return;  // it was given back
      this.lostTimer = setTimeout(() => this.sayLost(LOST), LOST_MILLISECONDS);
    });
    canvas.addEventListener('webglcontextrestored', () => {
      if (!this.renderer) return;
      this.sayLost('');
      if (!this.lost) this.restore().catch((error) => this.fail(error));
    });
    this.watchRatio();
  }

  // Another screen, or another zoom, has other pixels; nothing else of the page need change with it.
  watchRatio() {
    if (this.ratio) this.ratio.onchange = null;
    this.ratio = window.matchMedia(`(resolution: ${window.devicePixelRatio || 1}dppx)`);
    this.ratio.onchange = () => {
      this.watchRatio();
      this.changed();
    };
    if (this.fixedSize) this.layOut();
  }

  // Those that wait for a picture are told why none comes, else whoever listens.
  fail(error) {
    this.toFly = false;
    if (this.waiting.length === 0) this.onError(error);
    for (const {reject} of this.takeWaiting()) reject(error);
  }

  takeWaiting() {
    clearTimeout(this.watchTimer);
    this.watchTimer = 0;
    return this.waiting.splice(0);
  }

  sayLost(words) {
    clearTimeout(this.lostTimer);
    if (words || this.lostSaid) this.onLost(words);
    this.lostSaid = words !== '';
  }

  openContext() {
    const gl = this.canvas.getContext('webgl2', {alpha: false, antialias: false, depth: false, stencil: false,
                                                 powerPreference: 'high-performance'});
    if (!gl) throw new Error('This browser offers no WebGL 2, which the picture needs.');
    this.renderer = new SplatRenderer(gl);
    this.device = gl.getExtension('WEBGL_lose_context');
  }

  // Shows another model, from its start view on: the first of its views, its first test camera, or everything.
  async open(model) {
    if (!await this.take(model, new Orbit(model))) return;
    this.cameraIndex = this.viewIndex = -1;
    this.left = NOWHERE;
    this.settings = {...this.splats.settings};
    this.resize();
    const test = model.cameras.findIndex((camera) => camera.test);
    if (model.views.length > 0) this.jumpToView(0);
    else this.jump(model.cameras.length > 0 ? Math.max(test, 0) : -1);
  }

  // The same model, further trained: the view stays, and the old picture until there is an order of the new one.
  async replace(model) {
    if (!this.model) {
      await this.open(model);
      return;
    }
    const modeOf = ({layer}) => (layer ? layer.mode : 0), had = modeOf(this.model);
    if (!await this.take(model, new Orbit(model))) return;
    const own = this.splats.settings;
    if (modeOf(model) !== had) this.settings.textures = own.textures;
    this.settings.intersection = own.intersection;
    if (this.cameraIndex >= model.cameras.length) this.cameraIndex = -1;
    if (this.viewIndex >= model.views.length) this.viewIndex = -1;
    if (this.left.camera >= model.cameras.length || this.left.view >= model.views.length) this.left = NOWHERE;
    this.changed();
  }

  // The view stays unless `orbit` has one. False where another model was asked for meanwhile. Where it cannot be, what
  // was seen before stays.
  take(model, orbit) {
    const taken = this.takeNow(model, orbit);
    this.uploaded = taken.catch(() => {});
    return taken;
  }

  async takeNow(model, orbit) {
    if (!this.renderer) throw new Error('the viewer was disposed of');
    const opening = ++this.openings;
    let next = null;
    ++this.uploads;
    try {
      for (let tries = 0; !next && opening === this.openings; ++tries) {
        if (tries === MOST_UPLOADS) {
          const words = 'The graphics device is lost whenever the model is put onto it.';
          throw Object.assign(new Error(words), {isLoss: true});
        }
        next = await this.upload(model);
      }
    } catch (error) {
      if (opening === this.openings && !this.model) for (const {reject} of this.takeWaiting()) reject(error);
      const back = opening === this.openings && !this.splats && model !== this.model && !this.deviceLost;
      const was = back && this.model;
      if (was && await this.takeNow(was, this.orbit).catch(() => false)) this.changed();
      throw error;
    } finally {
      --this.uploads;
    }
    if (opening !== this.openings) {
      if (next) next.dispose();
      return false;
    }
    next.onChange = () => this.changed();
    next.onFailed = (error) => this.fail(error);
    if (this.splats) this.splats.dispose();
    this.splats = next;
    this.model = model;
    const {camera, distance, first} = orbit.camera || !this.orbit ? orbit : this.orbit;
    this.orbit = Object.assign(orbit, {camera, distance, first});
    return true;
  }

  // On the device, and in order where another model is seen meanwhile. Null where the device was lost: there is another
  // one then. Throws where there is none for long.
  async upload(model) {
    const {renderer} = this;
    const held = () => renderer === this.renderer && renderer !== null && !renderer.gl.isContextLost();
    let first = () => {}, broken = () => {}, next = null;
    const ordered = new Promise((resolve, reject) => { [first, broken] = [resolve, reject]; });
    ordered.catch(() => {});  // where nobody waits for it
    try {
      // Notes of a model that is opened are for who opens it.
      const onNote = (words) => this.model === model && this.onError(new Error(words));
      next = await Splats.create(renderer, model, {onChange: () => first(), onError: (e) => this.onError(e),
                                                   onFailed: (e) => broken(e), onNote});
      if (next.failure) throw next.failure;
      if (this.orbit && this.splats) {
        next.sort(this.camera);
        await ordered;
      }
      if (held()) return next;
    } catch (error) {
      if (held()) {
        if (next) next.dispose();
        throw error;
      }
    }
    if (next) next.dispose();
    if (this.renderer && renderer.gl.isContextLost()) await this.deviceBack();
    return null;
  }

  // Resolves at goOn(). Time in which the page is not seen, or the viewer has given its context back, does not count.
  deviceBack() {
    return new Promise((resolve, reject) => {
      let timer = 0;
      const look = (looks) => {
        timer = setTimeout(() => {
          const more = looks + (document.hidden || this.lost ? 0 : 1);
          if (more < MOST_LOOKS) look(more);
          else reject(Object.assign(new Error(LOST), {isLoss: true}));
        }, LOOK_MILLISECONDS);
      };
      look(0);
      this.missing.push(() => {
        clearTimeout(timer);
        resolve();
      });
    });
  }

  // By the browser, not by release().
  get deviceLost() { return !this.lost && this.renderer.gl.isContextLost(); }

  requireModel() {
    if (!this.model) throw new Error('there is no model yet');
  }

  need(index, views) {
    this.requireModel();
    if (!(views ? this.model.views : this.model.cameras)[index]) throw noSuchCamera(this.model, index, views);
  }

  // To a camera of the model, or -1: everything in view. Throws where it has none of that number.
  jump(index) {
    if (!this.model || index !== -1) this.need(index, false);
    this.moved();
    this.cameraIndex = index;
    if (index >= 0) this.orbit.set(this.model.cameras[index]);
    else this.orbit.start(this.canvas.width, this.canvas.height);
    this.changed();
  }

  // Throws where the model has none of that number.
  jumpToView(index) {
    this.need(index, true);
    this.moved();
    this.orbit.set(this.model.views[index]);
    this.viewIndex = index;
    this.changed();
  }

  // Everything in view, from the same side.
  frameAll() {
    this.moved();
    this.orbit.frame(this.canvas.width, this.canvas.height);
    this.changed();
  }

  // A flight ends, and the view is none of the model's.
  moved() {
    this.land();
    this.leave();
  }

  leave() {
    this.left = this.last;
    this.cameraIndex = this.viewIndex = -1;
  }

  // Which of the model's cameras or views it is looked from, or was last: {camera, view}, at least one of them -1.
  get last() {
    const {cameraIndex: camera, viewIndex: view} = this;
    return camera >= 0 || view >= 0 ? {camera, view} : this.left;
  }

  // What a flight passes: the views in their order, or the cameras where there are none.
  get stops() { return this.model.views.length > 1 ? this.model.views : this.model.cameras; }

  // Ends a flight, also one that has not begun yet.
  land() {
    this.flight = null;
    this.toFly = false;
  }

  // Round and round past the stops. False without two of them.
  play(on = true) {
    const {stops} = this;
    this.land();
    if (on && stops.length > 1) {
      this.toFly = this.waiting.length > 0;  // who waits for a picture that stands sees it first
      if (!this.toFly) this.flight = new Flight(stops, this.orbit.camera);
    }
    if (this.flight) this.leave();
    this.changed();
    return this.playing;
  }

  get playing() { return Boolean(this.flight) || this.toFly; }

  // The view at hand, in the canvas' size.
  get camera() { return fitted(this.orbit.camera, this.canvas.width, this.canvas.height); }

  // After any change of camera or settings. `byHand`: more is to be expected at once.
  changed(byHand = false) {
    if (byHand) this.stir();
    if (this.splats && this.orbit.camera) this.splats.sort(this.camera);
    this.askedAt = this.askedAt || performance.now();
    if (this.framePending) return;
    this.framePending = true;
    this.pendingSince = performance.now();
    requestAnimationFrame((now) => {
      this.framePending = false;
      try {
        if (this.splats && this.orbit.camera) this.frame(now);
      } catch (error) {
        this.fail(error);
      }
      this.onChange();
    });
  }

  stir() {
    this.lastInput = performance.now();
    clearTimeout(this.restTimer);
    this.restTimer = setTimeout(() => this.changed(), REST_MILLISECONDS);
  }

  get moving() { return performance.now() - this.lastInput < REST_MILLISECONDS; }

  frame(time) {
    if (this.lost || this.renderer.gl.isContextLost()) {
      this.askedAt = 0;
      return;  // whoever waits does so for restore()
    }
    if (!this.renderer.idle) {  // a picture that the device cannot begin yet would hold up the page
      setTimeout(() => this.changed(), PATIENCE_MILLISECONDS);
      return;
    }
    if (this.flight) {
      this.orbit.set(this.flight.at(time));
      this.changed(true);
    }
    const now = performance.now();
    const took = now - Math.max(this.lastFrame, this.askedAt);
    this.lastFrame = now;
    this.askedAt = 0;
    if (this.moving) {
      this.adapt(took);
    } else {
      this.tooMuch = Infinity;
    }
    const unfinished = this.moving || !this.splats.sorted;
    if (this.waiting.length > 0 && unfinished) return;  // whoever waits looks at the finished picture only
    this.draw(this.moving ? this.motionScale : 1);
    if (unfinished || !this.splats.sorted) return;  // a new size wants a new order
    const {failure} = this.splats;
    for (const {resolve, reject} of this.takeWaiting()) {
      if (failure) reject(failure);
      else resolve();
    }
    if (this.toFly) this.play();
  }

  // The resolution of the next frames of a movement, of which none goes back to one that was too much: frames take
  // whole periods of a screen, between which there may be nothing that suits.
  adapt(took) {
    this.took = took;
    if (took > SLOW_FRAME) {
      this.tooMuch = this.motionScale;
      this.motionScale = Math.max(0.8 * this.motionScale, 0.25);
    } else if (took < FAST_FRAME) {
      const more = Math.min(1.1 * this.motionScale, 1);
      if (more < this.tooMuch) this.motionScale = more;
    }
  }

  draw(scale) {
    this.resize();
    const width = Math.max(Math.round(this.canvas.width * scale), 1);
    const height = Math.max(Math.round(this.canvas.height * scale), 1);
    const {bounds, camera} = this.orbit;
    const middle = dot(add(bounds.center, camera.eye, -1), camera.axes[2]);
    const near = Math.max(middle - bounds.radius, NEAR);
    this.splats.takeOrder();
    this.renderer.draw(this.splats.gpu, fitted(camera, width, height), {
      ...Splats.forShaders(this.settings), depthRange: [near, Math.max(middle + bounds.radius, near + 1e-3)],
    });
  }

  resize() {
    const ratio = window.devicePixelRatio || 1;
    let size = this.fixedSize;
    if (!size) size = [this.canvas.clientWidth * ratio, this.canvas.clientHeight * ratio].map(Math.round);
    const [width, height] = size.map((side) => Math.max(side, 1));
    if (this.canvas.width === width && this.canvas.height === height) return;
    this.setPixels(width, height);
    this.fitStart();
    this.changed();  // the order, and the levels of detail, are of the size before
  }

  // The start view is one of the canvas' size.
  fitStart() {
    if (this.orbit && this.orbit.atStart) this.orbit.start(this.canvas.width, this.canvas.height);
  }

  // A canvas that a page gives no size is as large as its pixels are many: it stays as large as it was.
  setPixels(width, height) {
    const {canvas} = this, {clientWidth, clientHeight} = canvas;
    Object.assign(canvas, {width, height});
    if (this.fixedSize) return;
    if (Math.abs(canvas.clientWidth - clientWidth) > 1) canvas.style.width = `${clientWidth}px`;
    if (Math.abs(canvas.clientHeight - clientHeight) > 1) canvas.style.height = `${clientHeight}px`;
  }

  // Settings under the names and with the values of tgview's flags, all optional: camera (index, or {width, height, fx,
  // fy, cx, cy, axes, eye} as in camera.js), view (name or index of one of the model's, or what viewText gives), size
  // "WxH" or "window", show, textures, intersection, outside, background, splat-budget. Throws at the first that cannot
  // be.
  apply(wanted) {
    try {
      this.set(wanted);
    } finally {
      this.changed();  // what stands before the first that cannot be is done
    }
  }

  set(wanted) {
    const choice = (key, known) => {
      if (wanted[key] === undefined) return;
      if (!known.includes(wanted[key])) throw new Error(`${key}=${wanted[key]} (expected ${known.join(', ')})`);
      this.settings[key] = wanted[key];
    };
    choice('show', Object.keys(SHOW));
    choice('textures', Object.keys(TEXTURE_CHOICES));
    choice('intersection', Object.keys(INTERSECTIONS));
    choice('outside', Object.keys(OUTSIDES));
    if (wanted.background !== undefined) {
      const named = valueNamed({black: [0, 0, 0], white: [1, 1, 1]}, wanted.background);
      const color = named || String(wanted.background).split(',').map(Number);
      if (color.length !== 3 || !color.every((c) => c >= 0 && c <= 1)) {
        throw new Error(`background=${wanted.background} (expected r,g,b in [0, 1], black or white)`);
      }
      this.settings.background = color;
    }
    if (wanted['splat-budget'] !== undefined) this.setBudget(wanted['splat-budget']);
    if (wanted.size !== undefined) this.setSize(wanted.size);
    if (wanted.camera !== undefined) this.setCamera(wanted.camera);
    if (wanted.view !== undefined) this.setView(wanted.view);
  }

  // The model's own value of a setting; camera and view stay, where a hand may have taken them.
  reset(key) {
    const own = Splats.settingsOf(this.model);
    if (key in own) this.settings[key] = own[key];
    if (key === 'splat-budget' && this.model.lod) this.setBudget(this.model.lod.usualBudget);
    this.changed();
  }

  // What apply() does, one by one: the reasons why some cannot be done.
  applyWhatCan(wanted) {
    const reasons = [];
    for (const [key, value] of Object.entries(wanted)) {
      try {
        this.apply({[key]: value});
      } catch (error) {
        reasons.push(error.message);
      }
    }
    return reasons;
  }

  // Gaussians that a scene with levels may have drawn; other models are drawn whole.
  setBudget(wanted) {
    const budget = wholeNumber(wanted);
    if (!(Number.isInteger(budget) && budget > 0)) {
      throw new Error(`splat-budget=${wanted} (expected a number of Gaussians)`);
    }
    this.requireModel();
    const {lod} = this.model;
    if (!lod) return;
    lod.budget = budget;
    // Else with more room, and the old picture until that is filled.
    if (!this.splats || this.splats.replan()) return;
    this.taking = this.take(this.model, this.orbit).then(() => this.changed()).catch((error) => this.onError(error));
  }

  setSize(text) {
    const size = text === 'window' ? null : String(text).split('x').map(wholeNumber);
    if (size && !(size.length === 2 && size.every((n) => Number.isInteger(n) && n > 0 && n <= MAX_FIXED_SIDE))) {
      throw new Error(`size=${text} (expected WxH, 1 to ${MAX_FIXED_SIDE} pixels each, or window)`);
    }
    const {canvas, fixedSize: before} = this;
    const sidesOf = ({width, height}) => ({width, height});
    if (size && !before) this.layout = {style: sidesOf(canvas.style), pixels: sidesOf(canvas)};
    if (before && !size) {
      Object.assign(canvas, this.layout.pixels);  // whose aspect may be that of the layout
      this.fitStart();
    }
    this.fixedSize = size;
    if (before || size) this.layOut();
    this.resize();
  }

  // The style of a fixed size in this screen's pixels, or that of before.
  layOut() {
    const {canvas, fixedSize: size, layout} = this, ratio = window.devicePixelRatio || 1;
    Object.assign(canvas.style, size ? {width: `${size[0] / ratio}px`, height: `${size[1] / ratio}px`} : layout.style);
  }

  setCamera(wanted) {
    this.requireModel();
    if (wanted !== null && typeof wanted === 'object') {
      this.orbit.set(wanted);
      this.moved();
      return;
    }
    const {cameras} = this.model;
    const index = wholeNumber(wanted);
    if (!cameras[index]) {
      const expected = cameras.length > 0 ? `0 to ${cameras.length - 1}` : 'none: the model has no cameras';
      throw new Error(`camera=${wanted} (expected ${expected})`);
    }
    this.jump(index);
  }

  setView(wanted) {
    this.requireModel();
    const {views} = this.model;
    const named = views.findIndex(({name}) => name === wanted);
    const index = named >= 0 ? named : wholeNumber(wanted);
    if (views[index]) {
      this.jumpToView(index);
      return;
    }
    const camera = parseView(String(wanted));
    if (!camera) {
      const own = views.length > 0 ? `a view's name, 0 to ${views.length - 1},` : 'no name or number: the model has no views,';
      throw new Error(`view=${wanted} (expected ${own} or x,y,z and what a link has behind it)`);
    }
    this.moved();
    this.orbit.set(camera);
    this.orbit.distance = camera.distance;
  }

  // The view at hand, for an address.
  get viewText() { return formatView(this.orbit.camera, this.orbit.distance); }

  // Resolves when the picture on the canvas is in full resolution and in the right order; rejects with what keeps it
  // from that. Ends a flight.
  settled() {
    if (!this.renderer) return Promise.reject(new Error('the viewer was disposed of'));
    this.flight = null;
    return new Promise((resolve, reject) => {
      this.waiting.push({resolve, reject});
      if (!this.watchTimer) this.watch();
      this.changed();
    });
  }

  // Tells who waits for a picture where nothing comes of it for long. Time in which the page is not seen or the browser
  // gives no frames does not count, nor between release() and resume(), while the model comes or is put on the device.
  watch(looks = 0, before = '') {
    this.watchTimer = setTimeout(() => {
      this.watchTimer = 0;
      if (this.waiting.length === 0) return;
      const lost = this.deviceLost;
      const unseen = this.framePending && performance.now() - this.pendingSince > LOOK_MILLISECONDS;
      const comes = document.hidden || this.lost || (!lost && (!this.model || this.uploads > 0 || unseen));
      const news = `${this.lastFrame} ${this.splats && this.splats.clock}`;
      if (!comes && news === before && looks + 1 >= MOST_LOOKS) {
        this.fail(new Error(lost ? LOST : `No picture: nothing has come of it for ${MOST_LOOKS} s.`));
      } else {
        this.watch(comes || news !== before ? 0 : looks + 1, news);
      }
    }, LOOK_MILLISECONDS);
  }

  // The picture for these settings, as a data URL of a PNG; of a scene with levels once all is there that the view
  // wants, and where the device is lost once there is another one; after those that were asked for before.
  picture(wanted = {}) {
    const taken = this.pictures.then(() => this.takePicture(wanted));
    this.pictures = taken.catch(() => {});
    return taken;
  }

  async takePicture(wanted) {
    this.apply(wanted);
    await this.taking;
    do {
      if (this.splats) await this.splats.completed();
      await this.settled();  // goes on in the task that drew: later the canvas is empty
    } while (!this.splats || !this.splats.complete);
    return this.canvas.toDataURL('image/png');
  }

  async restore() {
    this.openContext();
    if (this.splats) this.splats.dispose();
    this.splats = null;
    this.goOn();
    if (this.uploads > 0) await this.uploaded;
    if (!this.splats && this.model && await this.take(this.model, this.orbit)) this.changed();
  }

  goOn() {
    for (const resolve of this.missing.splice(0)) resolve();
  }

  // Gives the context back, of which a browser has few, until resume(). Returns a canvas with what was seen.
  release() {
    const still = document.createElement('canvas');
    [still.width, still.height] = [this.canvas.width, this.canvas.height];
    if (this.splats && this.orbit.camera) {
      this.draw(1);
      still.getContext('2d').drawImage(this.canvas, 0, 0);
      this.splats.dispose();
    }
    this.splats = null;
    this.land();
    this.ratio.onchange = null;  // a page keeps what listens: the viewer, and its model
    clearTimeout(this.lostTimer);
    if (this.renderer.gl.isContextLost()) {
      this.lost = Promise.resolve();
      return still;
    }
    // A context may be asked back once the event is over.
    this.lost = new Promise((done) => {
      this.canvas.addEventListener('webglcontextlost', () => setTimeout(done), {once: true});
    });
    this.device.loseContext();
    return still;
  }

  // Goes on where release() was called. Resolves when the model is on the device again; throws where the browser does
  // not give that back.
  async resume() {
    await this.lost;
    if (this.renderer.gl.isContextLost()) {
      await new Promise((done, fail) => {
        const timer = setTimeout(() => fail(new Error(LOST)), LOST_MILLISECONDS);
        this.canvas.addEventListener('webglcontextrestored', () => {
          clearTimeout(timer);
          done();
        }, {once: true});
        this.device.restoreContext();
      });
    }
    this.lost = null;  // what is lost from here on is given back to restore()
    this.watchRatio();
    await this.restore();
    this.changed();
  }

  dispose() {
    if (!this.renderer) return;
    ++this.openings;
    this.land();
    this.end.abort();
    this.ratio.onchange = null;
    clearTimeout(this.restTimer);
    clearTimeout(this.lostTimer);
    if (this.splats) this.splats.dispose();
    this.renderer.dispose();
    this.splats = this.model = this.renderer = null;
    this.device.loseContext();
    this.goOn();
    for (const {reject} of this.takeWaiting()) reject(new Error('the viewer was disposed of'));
  }
}

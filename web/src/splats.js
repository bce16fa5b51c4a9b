// SPDX-License-Identifier: Apache-2.0
// A model in a context: on the device, kept in order by a worker. What all engines' adapters draw.
import {INTERSECTIONS, MODES, OUTSIDES} from './glb.js';
import {cameraOf, objection} from './matrices.js';
import {drawOver} from './gl_state.js';
import {dot} from './camera.js';
import {SHOW, SplatRenderer} from './renderer.js';
import {Sorter} from './sort.js';

export const TEXTURE_CHOICES = {rgba: 3, rgb: 2, alpha: 1, off: 0, fallback: 0};  // masks on the model's kMode*
export const modeName = (layer) => Object.keys(MODES).find((name) => MODES[name] === layer.mode);

const renderers = new WeakMap();  // of contexts that belong to other engines

function rendererOf(gl) {
  const known = renderers.get(gl);
  if (!known || (known.lost && !gl.isContextLost())) renderers.set(gl, new SplatRenderer(gl, {shared: true}));
  return renderers.get(gl);
}

const viewRow = ({axes, eye}) => [...axes[2], -dot(axes[2], eye)];

export class Splats {
  // Settings that a model brings along, under the names that Viewer.apply() takes.
  static settingsOf(model) {
    const nameOf = (known, number) => Object.keys(known).find((name) => known[name] === number);
    return {show: 'final', textures: model.layer ? nameOf(MODES, model.layer.mode) : 'off',
            intersection: nameOf(INTERSECTIONS, model.intersection), outside: nameOf(OUTSIDES, model.outside),
            background: model.background};
  }

  // onChange(): there is a better order than the last one drawn. onError(error): of what cannot be drawn.
  // onFailed(error): there will be no order any more. onNote(words): of what the model's notes say from now on.
  static async create(renderer, model, {onChange = () => {}, onError = (error) => console.error(error),
                                        onFailed = onError, onNote = (words) => console.warn(words)} = {}) {
    const hooks = {onChange, onError, onFailed, onNote};
    if (model.lod) return model.lod.open(renderer, model, hooks);
    const splats = new Splats(renderer, model, await renderer.upload(model), hooks);
    splats.sorter.put(0, Float32Array.from(model.mean));
    splats.sorter.show([0, model.count]);
    return splats;
  }

  // In a context that another engine draws with.
  static inContext(gl, model, options) { return Splats.create(rendererOf(gl), model, options); }

  constructor(renderer, model, gpu, hooks) {
    Object.assign(this, {renderer, model, gpu, ...hooks});
    this.settings = Splats.settingsOf(model);
    this.complaint = '';  // the last one, which is said once
    this.sorter = new Sorter(gpu.perRow * gpu.rows, {
      onChange: () => this.onChange(), onError: (error) => this.sortingFailed(error),
    });
    this.disposed = false;
    ++renderer.users;
  }

  sortingFailed(error) { this.onFailed(error); }

  // Why there will be no order any more, or null: the last one is drawn.
  get failure() { return this.sorter.failed; }

  // The newest order to the device: at once before drawing, when the device has nothing else to do.
  takeOrder() {
    this.sorter.take((order, visible) => this.renderer.setOrder(this.gpu, order, visible));
  }

  // Whether the order is that of the last camera sorted for.
  get sorted() { return !this.sorter.busy; }

  // Whether nothing more is to come for the last camera; a promise of that.
  get complete() { return true; }
  async completed() {
    if (this.failure) throw this.failure;
  }

  // After the budget of a scene with levels was changed. False where the model is to be put on the device again for it.
  replan() { return true; }

  sort(camera) { this.sorter.want(viewRow(camera)); }

  // As the shaders want them; `settings` as Viewer.apply() names them. Throws at the first value that cannot be.
  static forShaders(settings) {
    const number = (key, known) => {
      const value = settings[key];
      if (Object.hasOwn(known, value)) return known[value];
      throw new Error(`settings.${key} is ${JSON.stringify(value)} (expected ${Object.keys(known).join(', ')})`);
    };
    number('show', SHOW);
    return {...settings, textures: number('textures', TEXTURE_CHOICES), fallback: settings.textures === 'fallback',
            intersection: number('intersection', INTERSECTIONS), outside: number('outside', OUTSIDES)};
  }

  // Over what another engine has drawn into the framebuffer that is bound. view: {viewFromModel, projection: matrices,
  // 16 numbers by columns; viewport: [x, y, width, height] in pixels; linear: whether the framebuffer holds linear
  // light, its format decides where it is undefined}. Returns whether all was there, in the right order. What cannot be
  // drawn is told to onError, once.
  drawInto({viewFromModel, projection, viewport, linear}) {
    const found = cameraOf(viewFromModel, projection, viewport[2], viewport[3]);
    if (!found) {
      this.complain(objection(viewFromModel, projection));
      return true;
    }
    this.sort(found.camera);
    try {
      const settings = Splats.forShaders(this.settings);
      this.takeOrder();
      const view = {camera: found.camera, depth: found.depth, origin: [viewport[0], viewport[1]], linear};
      if (this.gpu.visible > 0) drawOver(this.renderer, this.gpu, view, settings);
      this.complaint = '';
    } catch (error) {
      this.complain(error.message);
      return true;
    }
    return this.sorted;
  }

  complain(words) {
    if (words && words !== this.complaint) this.onError(new Error(words));
    this.complaint = words;
  }

  // Once nothing is left that is drawn with the context, nothing but programs is.
  dispose() {
    if (this.disposed) return;
    this.disposed = true;
    this.onChange = this.onFailed = () => {};
    this.sorter.dispose();
    this.gpu.dispose();
    if (--this.renderer.users === 0) this.renderer.dropTarget();
  }
}

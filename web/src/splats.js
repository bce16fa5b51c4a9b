// SPDX-License-Identifier: Apache-2.0
// A model in a context: on the device, kept in order by a worker. What all engines' adapters draw.
import {MODES} from './glb.js';
import {cameraOf} from './matrices.js';
import {drawOver} from './gl_state.js';
import {dot} from './camera.js';
import {SplatRenderer} from './renderer.js';
import {Sorter} from './sort.js';

export const TEXTURE_CHOICES = {rgba: 3, rgb: 2, alpha: 1, off: 0, fallback: 0};  // masks on the model's kMode*
export const modeName = (layer) => Object.keys(MODES).find((name) => MODES[name] === layer.mode);

const renderers = new WeakMap();  // of contexts that belong to other engines

function rendererOf(gl) {
  if (!renderers.has(gl)) renderers.set(gl, new SplatRenderer(gl, {shared: true}));
  return renderers.get(gl);
}

const viewRow = ({axes, eye}) => [...axes[2], -dot(axes[2], eye)];

export class Splats {
  // Settings that a model brings along, under the names that Viewer.apply() takes.
  static settingsOf(model) {
    return {show: 'final', textures: model.layer ? modeName(model.layer) : 'off', intersection: model.intersection,
            outside: model.outside, background: model.background};
  }

  // onChange(): there is a better order than the last one drawn. onError(error): of the worker.
  static async create(renderer, model, {onChange = () => {}, onError = (error) => console.error(error)} = {}) {
    const gpu = await renderer.upload(model);
    return new Splats(renderer, model, gpu, onChange, onError);
  }

  // In a context that another engine draws with.
  static inContext(gl, model, options) { return Splats.create(rendererOf(gl), model, options); }

  constructor(renderer, model, gpu, onChange, onError) {
    Object.assign(this, {renderer, model, gpu, onChange});
    this.settings = Splats.settingsOf(model);
    this.sorter = new Sorter(model.mean, {
      take: (order, visible) => this.gpu.setOrder(order, visible), onChange: () => this.onChange(), onError,
    });
  }

  // Whether the order is that of the last camera sorted for.
  get sorted() { return !this.sorter.busy; }

  sort(camera) { this.sorter.want(viewRow(camera)); }

  // As the shaders want them; `settings` as Viewer.apply() names them.
  static forShaders(settings) {
    return {...settings, textures: TEXTURE_CHOICES[settings.textures], fallback: settings.textures === 'fallback'};
  }

  // Over what another engine has drawn into the framebuffer that is bound. view: {viewFromModel, projection: matrices,
  // 16 numbers by columns; viewport: [x, y, width, height] in pixels; linear: whether the framebuffer holds linear
  // light, its format decides where it is undefined}. Returns whether all was there, in the right order.
  drawInto({viewFromModel, projection, viewport, linear}) {
    const found = cameraOf(viewFromModel, projection, viewport[2], viewport[3]);
    if (!found) return true;
    this.sort(found.camera);
    if (this.gpu.visible > 0) {
      const view = {camera: found.camera, depth: found.depth, origin: [viewport[0], viewport[1]], linear};
      drawOver(this.renderer, this.gpu, view, Splats.forShaders(this.settings));
    }
    return this.sorted;
  }

  dispose() {
    this.onChange = () => {};
    this.sorter.dispose();
    this.gpu.dispose();
  }
}

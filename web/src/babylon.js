// SPDX-License-Identifier: Apache-2.0
// Babylon.js: drawn after a scene's meshes, hidden by what is nearer, in the engine's context. Nothing of Babylon.js is
// imported: its modules and its one-file build will do alike.
import {IDENTITY, matricesOf, multiplied, noSuchCamera} from './matrices.js';
import {loadModel} from './model.js';
import {Splats} from './splats.js';

const MIRROR = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1];  // as glTF files are in left-handed scenes

export class TexturedGaussians {
  // `model`: as readModel gives it. It stands where `node`, a TransformNode, puts it.
  constructor(model, scene, node = null) {
    const gl = scene.getEngine()._gl;
    if (!gl || !gl.texStorage2D) throw new Error('TexturedGaussians needs an engine with WebGL 2');
    Object.assign(this, {model, scene, node});
    this.settings = Splats.settingsOf(model);
    this.visible = true;
    this.splats = null;   // once it is on the device
    this.settled = false; // whether the last picture had everything in the right order
    this.gone = false;
    this.ready = Splats.inContext(gl, model).then((splats) => {
      if (this.gone) splats.dispose();
      else this.splats = splats;
    });
    this.observer = scene.onAfterDrawPhaseObservable.add(() => this.draw());
  }

  draw() {
    this.settled = false;
    if (!this.splats || !this.visible || (this.node && !this.node.isEnabled())) return;
    const {scene} = this;
    const engine = scene.getEngine();
    const {x, y, width, height} = scene.activeCamera.viewport.toGlobal(engine.getRenderWidth(), engine.getRenderHeight());
    const world = this.node ? this.node.computeWorldMatrix(true).m : IDENTITY;
    const model = scene.useRightHandedSystem ? world : multiplied(world, MIRROR);
    this.splats.settings = this.settings;
    this.settled = this.splats.drawInto({
      viewFromModel: multiplied(scene.getViewMatrix().m, model), projection: scene.getProjectionMatrix().m,
      viewport: [x, y, width, height].map(Math.round),
    });
    engine.wipeCaches(true);  // it remembers what it has set
  }

  // Makes a camera that one of the model's: its own cameras or, with `views`, those somebody has chosen. As if there
  // were no node.
  placeCamera(camera, index = 0, {views = false} = {}) {
    const pinhole = (views ? this.model.views : this.model.cameras)[index];
    if (!pinhole) throw noSuchCamera(this.model, index, views);
    if (camera.getClassName() === 'ArcRotateCamera') {
      throw new Error('placeCamera takes a FreeCamera, no ArcRotateCamera');
    }
    const engine = this.scene.getEngine();
    const {worldFromCamera: m, fovY} = matricesOf(pinhole, engine.getRenderWidth(), engine.getRenderHeight());
    const hand = this.scene.useRightHandedSystem ? 1 : -1;
    camera.position.copyFromFloats(m[12], m[13], hand * m[14]);
    camera.upVector.copyFromFloats(m[4], m[5], hand * m[6]);
    camera.setTarget(camera.position.clone().addInPlaceFromFloats(-m[8], -m[9], -hand * m[10]));
    camera.fov = fovY;
  }

  dispose() {
    this.gone = true;
    this.scene.onAfterDrawPhaseObservable.remove(this.observer);
    if (this.splats) this.splats.dispose();
    this.splats = null;
  }
}

// The model at an address in a scene, on the device. options: {node, onProgress, signal}.
export async function loadTexturedGaussians(url, scene, {node = null, ...options} = {}) {
  const gaussians = new TexturedGaussians(await loadModel(url, options), scene, node);
  try {
    await gaussians.ready;
  } catch (error) {
    gaussians.dispose();
    throw error;
  }
  return gaussians;
}

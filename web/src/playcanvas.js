// SPDX-License-Identifier: Apache-2.0
// PlayCanvas: an entity, drawn after the transparent meshes of the world's layer, hidden by what is nearer, in the
// device's context.
import {BLENDEQUATION_ADD, BLENDMODE_ONE, BLENDMODE_ONE_MINUS_SRC_ALPHA, BlendState, CULLFACE_NONE, DepthState, Entity,
        FUNC_LESSEQUAL, LAYERID_WORLD, Mat4, Quat, Vec3} from 'playcanvas';
import {loadModel} from './model.js';
import {matricesOf, noSuchCamera} from './matrices.js';
import {Splats} from './splats.js';

const viewFromModel = new Mat4();
// What drawing leaves in the context, and the device is told.
const BLENDING = new BlendState(true, BLENDEQUATION_ADD, BLENDMODE_ONE, BLENDMODE_ONE_MINUS_SRC_ALPHA);
const DEPTH = new DepthState(FUNC_LESSEQUAL, false);

export class TexturedGaussians extends Entity {
  // `model`: as readModel gives it.
  constructor(name, model, app) {
    super(name, app);
    this.model = model;
    this.settings = Splats.settingsOf(model);
    this.splats = null;   // once it is on the device
    this.settled = false;  // whether the last picture had everything in the right order
    this.gone = false;
    this.device = app.graphicsDevice;
    if (!this.device.gl) throw new Error('TexturedGaussians needs a device with WebGL 2');
    this.ready = Splats.inContext(this.device.gl, model).then((splats) => {
      if (this.gone) splats.dispose();
      else this.splats = splats;
    });
    this.drawing = app.scene.on('postrender:layer', (camera, layer, transparent) => {
      if (transparent && layer.id === LAYERID_WORLD && this.enabled && this.parent) this.draw(camera);
    });
  }

  draw(component) {
    this.settled = false;
    if (!this.splats) return;
    const {device} = this;
    viewFromModel.mul2(component.viewMatrix, this.getWorldTransform());
    device.setBlendState(BLENDING);
    device.setDepthState(DEPTH);
    device.setCullMode(CULLFACE_NONE);
    this.splats.settings = this.settings;
    this.settled = this.splats.drawInto({
      viewFromModel: viewFromModel.data, projection: component.projectionMatrix.data,
      viewport: [device.vx, device.vy, device.vw, device.vh],
    });
  }

  // Makes a camera's entity that one of the model's: its own cameras or, with `views`, those somebody has chosen. The
  // entity of the model must not be turned or moved.
  placeCamera(entity, index = 0, {views = false} = {}) {
    const pinhole = (views ? this.model.views : this.model.cameras)[index];
    if (!pinhole) throw noSuchCamera(this.model, index, views);
    const {worldFromCamera, fovY} = matricesOf(pinhole, this.device.width, this.device.height);
    const matrix = new Mat4();
    matrix.data.set(worldFromCamera);
    entity.setPosition(matrix.getTranslation(new Vec3()));
    entity.setRotation(new Quat().setFromMat4(matrix));
    entity.camera.horizontalFov = false;
    entity.camera.fov = fovY * 180 / Math.PI;
  }

  destroy() {
    this.gone = true;
    this.drawing.off();
    if (this.splats) this.splats.dispose();
    this.splats = null;
    super.destroy();
  }
}

// The model at an address as an entity below the root, on the device. options: {name, onProgress, signal}.
export async function loadTexturedGaussians(url, app, {name = 'textured gaussians', ...options} = {}) {
  const entity = new TexturedGaussians(name, await loadModel(url, options), app);
  try {
    await entity.ready;
  } catch (error) {
    entity.destroy();
    throw error;
  }
  app.root.addChild(entity);
  return entity;
}

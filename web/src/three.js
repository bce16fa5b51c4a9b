// SPDX-License-Identifier: Apache-2.0
// three.js: an object of a scene, drawn with its transparent ones, hidden by what is nearer, in the renderer's context.
import {Box3, BufferAttribute, BufferGeometry, Loader, Mesh, ShaderMaterial, Sphere, Vector4} from 'three';
import {sceneUp} from './camera.js';
import {fetchBytes} from './fetch.js';
import {matricesOf, noSuchCamera} from './matrices.js';
import {readFrom, readModel} from './model.js';
import {Splats} from './splats.js';

const viewport = new Vector4();

export class TexturedGaussians extends Mesh {
  // `model`: as readModel gives it.
  constructor(model) {
    // Nothing of three.js' own is drawn: its turn is ours.
    const geometry = new BufferGeometry();
    geometry.setAttribute('position', new BufferAttribute(new Float32Array(3), 3));
    geometry.setDrawRange(0, 0);
    geometry.boundingBox = new Box3().setFromArray(model.mean);
    geometry.boundingSphere = geometry.boundingBox.getBoundingSphere(new Sphere());
    super(geometry, new ShaderMaterial({transparent: true, depthWrite: false}));
    this.type = 'TexturedGaussians';
    this.frustumCulled = false;
    this.model = model;
    this.settings = Splats.settingsOf(model);
    this.splats = null;      // once the renderer is known
    // Whether the last picture had everything in the right order: "change" is sent when another would be better.
    this.settled = false;
    this.opening = null;
    this.disposed = false;
    this.onBeforeRender = (renderer, scene, camera) => this.draw(renderer, camera);
  }

  // Puts the model on the renderer's device, which the first picture does otherwise. Resolves when it can be drawn.
  prepare(renderer) {
    if (!renderer.isWebGLRenderer) throw new Error('TexturedGaussians needs a WebGLRenderer');
    if (!this.opening) this.opening = this.open(renderer.getContext());
    return this.opening;
  }

  async open(gl) {
    const onChange = () => this.dispatchEvent({type: 'change'});
    const onError = (error) => this.fail(error);
    const splats = await Splats.inContext(gl, this.model, {onChange, onError});
    if (this.disposed) {
      splats.dispose();
      return;
    }
    this.splats = splats;
    onChange();
  }

  fail(error) {
    console.error(error);
    this.dispatchEvent({type: 'error', error});
  }

  draw(renderer, camera) {
    this.settled = false;
    if (!this.splats) {
      if (!this.opening) this.prepare(renderer).catch((error) => this.fail(error));
      return;
    }
    const target = renderer.getRenderTarget();
    renderer.getCurrentViewport(viewport);
    this.splats.settings = this.settings;
    this.settled = this.splats.drawInto({
      viewFromModel: this.modelViewMatrix.multiplyMatrices(camera.matrixWorldInverse, this.matrixWorld).elements,
      projection: camera.projectionMatrix.elements,
      viewport: [viewport.x, viewport.y, viewport.z, viewport.w].map(Math.floor),
      linear: target ? !target.isXRRenderTarget && target.texture.colorSpace !== 'srgb' : false,
    });
    // three.js remembers what it has set; the target, its viewport and scissors are then set once more.
    renderer.resetState();
    renderer.setRenderTarget(target, renderer.getActiveCubeFace(), renderer.getActiveMipmapLevel());
  }

  // Makes a perspective camera that one of the model's: its own cameras or, with `views`, those somebody has chosen. The
  // object must not be turned or moved. camera.up becomes the model's, for controls that are made afterwards.
  placeCamera(camera, index = 0, {views = false} = {}) {
    const pinhole = (views ? this.model.views : this.model.cameras)[index];
    if (!pinhole) throw noSuchCamera(this.model, index, views);
    if (!camera.isPerspectiveCamera) throw new Error('placeCamera takes a PerspectiveCamera');
    const height = 1000, width = height * camera.aspect;
    const {worldFromCamera, fovY} = matricesOf(pinhole, width, height);
    camera.matrix.fromArray(worldFromCamera).decompose(camera.position, camera.quaternion, camera.scale);
    camera.fov = fovY * 180 / Math.PI;
    camera.up.fromArray(sceneUp(this.model.cameras));
    camera.updateProjectionMatrix();
    camera.updateMatrixWorld();
  }

  dispose() {
    this.disposed = true;
    if (this.splats) this.splats.dispose();
    this.splats = null;
    this.geometry.dispose();
    this.material.dispose();
  }
}

export class TexturedGaussiansLoader extends Loader {
  splatBudget = undefined;  // Gaussians of a scene with levels of detail that may be drawn, or as loadModel has it

  load(url, onLoad, onProgress, onError = (error) => console.error(error)) {
    this.manager.itemStart(url);
    this.open(url, onProgress).then(onLoad, (error) => {
      this.manager.itemError(url);
      onError(error);
    }).finally(() => this.manager.itemEnd(url));
  }

  loadAsync(url, onProgress) {
    return new Promise((resolve, reject) => { this.load(url, resolve, onProgress, reject); });
  }

  async open(url, onProgress) {
    const tell = onProgress && ((loaded, total) => onProgress({loaded, total, lengthComputable: total > 0}));
    const address = this.manager.resolveURL(this.path + url);
    const {splatBudget} = this;
    return new TexturedGaussians(await readFrom(address, await fetchBytes(address, {onProgress: tell}), {splatBudget}));
  }

  // bytes: a Uint8Array or an ArrayBuffer of a GLB or a SOG file.
  async parse(bytes) { return new TexturedGaussians(await readModel(new Uint8Array(bytes))); }
}

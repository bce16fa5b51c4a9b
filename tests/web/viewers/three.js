// SPDX-License-Identifier: Apache-2.0
// three.js' part of a page that shows a file.
import * as THREE from 'three/webgpu';
import {GLTFLoader} from 'three/addons/loaders/GLTFLoader.js';
import {GLTFGaussianSplatLoaderExtension} from 'three/addons/loaders/GLTFGaussianSplatLoaderExtension.js';
import {canvas, start, view} from './view.js';

start(async () => {
  const renderer = new THREE.WebGPURenderer({canvas: canvas(), antialias: false, forceWebGL: true});
  await renderer.init();
  renderer.setSize(view.width, view.height, false);
  // It blends in linear space and ignores colorSpace: numbers as they are come out with a linear output only.
  renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
  renderer.setClearColor(new THREE.Color(...view.background));
  const camera = new THREE.PerspectiveCamera(view.fovDegrees, view.width / view.height, 0.01, 1000);
  camera.position.set(...view.eye);
  camera.up.set(...view.up);
  camera.lookAt(...view.target);
  const loader = new GLTFLoader();
  if (!view.plain) loader.register((parser) => new GLTFGaussianSplatLoaderExtension(parser));
  const {scene: model} = await loader.loadAsync(view.file);
  const scene = new THREE.Scene();
  scene.add(model);
  const found = [];
  model.traverse((object) => {
    if (object.geometry) found.push({type: object.type, attributes: Object.keys(object.geometry.attributes)});
  });
  renderer.setAnimationLoop(() => renderer.render(scene, camera));
  return {found};
});

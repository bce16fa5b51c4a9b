// SPDX-License-Identifier: Apache-2.0
// Babylon.js' part of a page that shows a file.
import '@babylonjs/core/Loading/loadingScreen.js';
import '@babylonjs/core/Materials/standardMaterial.js';
import '@babylonjs/core/Rendering/index.js';
import '@babylonjs/loaders/glTF/index.js';
import {FreeCamera} from '@babylonjs/core/Cameras/freeCamera.js';
import {Engine} from '@babylonjs/core/Engines/engine.js';
import {AppendSceneAsync} from '@babylonjs/core/Loading/sceneLoader.js';
import {Color4} from '@babylonjs/core/Maths/math.color.js';
import {Vector3} from '@babylonjs/core/Maths/math.vector.js';
import {Scene} from '@babylonjs/core/scene.js';
import {canvas, start, view} from './view.js';

start(async () => {
  const engine = new Engine(canvas(), false);
  const scene = new Scene(engine);
  scene.useRightHandedSystem = true;  // otherwise the picture is mirrored
  scene.clearColor = new Color4(...view.background, 1);
  await AppendSceneAsync(view.file, scene);
  const camera = new FreeCamera('camera', new Vector3(...view.eye), scene);
  camera.upVector = new Vector3(...view.up);
  camera.setTarget(new Vector3(...view.target));
  camera.fov = view.fovDegrees * Math.PI / 180;
  camera.minZ = 0.01;
  scene.activeCamera = camera;
  engine.runRenderLoop(() => scene.render());
  return {meshes: scene.meshes.map((mesh) => mesh.getClassName())};
});

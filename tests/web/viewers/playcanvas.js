// SPDX-License-Identifier: Apache-2.0
// PlayCanvas' part of a page that shows a file.
import * as pc from 'playcanvas';
import {canvas, start, view} from './view.js';

start(async () => {
  const app = new pc.Application(canvas(), {graphicsDeviceOptions: {antialias: false}});
  app.setCanvasResolution(pc.RESOLUTION_FIXED, view.width, view.height);
  app.start();
  const camera = new pc.Entity('camera');
  camera.addComponent('camera', {clearColor: new pc.Color(...view.background), fov: view.fovDegrees, nearClip: 0.01});
  app.root.addChild(camera);
  camera.setPosition(...view.eye);
  camera.lookAt(new pc.Vec3(view.target), new pc.Vec3(view.up));
  const asset = new pc.Asset('model', 'container', {url: view.file});
  await new Promise((resolve, reject) => {
    asset.ready(resolve);
    asset.on('error', (message) => reject(new Error(message)));
    app.assets.add(asset);
    app.assets.load(asset);
  });
  app.root.addChild(asset.resource.instantiateRenderEntity());
  return {splats: (asset.resource.gsplats || []).length};
});

// SPDX-License-Identifier: Apache-2.0
// What needs no engine: reading models, showing one on a canvas, drawing one into another engine's WebGL 2 context.
export {loadModel, readModel} from './model.js';
export {fetchBytes} from './fetch.js';
export {Viewer} from './viewer.js';
export {listenToHands, moveByKey} from './hands.js';
export {Splats} from './splats.js';
export {cameraOf, matricesOf} from './matrices.js';

// SPDX-License-Identifier: Apache-2.0
import {BufferGeometry, Loader, Material, Mesh, Object3DEventMap, PerspectiveCamera, WebGLRenderer} from 'three';
import {Model, Settings} from './index.js';

export interface TexturedGaussiansEventMap extends Object3DEventMap {
  change: {};
  error: {error: Error};
}

/** Sends 'change' when another picture would be better than the last one, and 'error'. */
export class TexturedGaussians extends Mesh<BufferGeometry, Material, TexturedGaussiansEventMap> {
  constructor(model: Model);
  readonly model: Model;
  settings: Settings;
  /** Whether the last picture had everything in the right order. */
  readonly settled: boolean;
  prepare(renderer: WebGLRenderer): Promise<void>;
  placeCamera(camera: PerspectiveCamera, index?: number, options?: {views?: boolean}): void;
  dispose(): void;
}

export class TexturedGaussiansLoader extends Loader<TexturedGaussians> {
  /** Gaussians of a scene with levels of detail that may be drawn. */
  splatBudget?: number;
  load(url: string, onLoad: (gaussians: TexturedGaussians) => void, onProgress?: (event: ProgressEvent) => void,
       onError?: (error: unknown) => void): void;
  parse(bytes: Uint8Array | ArrayBuffer): Promise<TexturedGaussians>;
}

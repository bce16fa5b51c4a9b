// SPDX-License-Identifier: Apache-2.0
import type {FreeCamera, Scene, TransformNode} from '@babylonjs/core';
import {LoadOptions, Model, Settings} from './index.js';

export class TexturedGaussians {
  constructor(model: Model, scene: Scene, node?: TransformNode | null);
  readonly model: Model;
  readonly ready: Promise<void>;
  settings: Settings;
  visible: boolean;
  /** Whether the last picture had everything in the right order. */
  readonly settled: boolean;
  placeCamera(camera: FreeCamera, index?: number, options?: {views?: boolean}): void;
  dispose(): void;
}

export function loadTexturedGaussians(url: string, scene: Scene,
                                      options?: LoadOptions & {node?: TransformNode}): Promise<TexturedGaussians>;

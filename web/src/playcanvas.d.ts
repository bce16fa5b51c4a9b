// SPDX-License-Identifier: Apache-2.0
import {AppBase, Entity} from 'playcanvas';
import {LoadOptions, Model, Settings} from './index.js';

export class TexturedGaussians extends Entity {
  constructor(name: string, model: Model, app: AppBase);
  /** A Model; any, as an Entity's own `model` is something else, which is not used here. */
  readonly model: any;
  readonly ready: Promise<void>;
  settings: Settings;
  /** Whether the last picture had everything in the right order. */
  readonly settled: boolean;
  placeCamera(camera: Entity, index?: number, options?: {views?: boolean}): void;
}

export function loadTexturedGaussians(url: string, app: AppBase,
                                      options?: LoadOptions & {name?: string}): Promise<TexturedGaussians>;

// SPDX-License-Identifier: Apache-2.0
import {Model, Viewer, ViewerSettings} from './index.js';

/** <textured-gaussians src>: sends 'load', 'progress' ({loaded, total}) and 'error' ({error}), in `detail`. */
export class TexturedGaussiansElement extends HTMLElement {
  src: string;
  readonly model: Model | null;
  readonly viewer: Viewer | null;
  /** A PNG as a data URL. */
  picture(settings?: ViewerSettings): Promise<string>;
  play(on?: boolean): boolean;
}

declare global {
  interface HTMLElementTagNameMap { 'textured-gaussians': TexturedGaussiansElement; }
}

// SPDX-License-Identifier: Apache-2.0
import {Model, Viewer, ViewerSettings} from './index.js';

export interface TexturedGaussiansElementEventMap extends Omit<HTMLElementEventMap, 'load' | 'progress' | 'error'> {
  load: CustomEvent<{model: Model}>;
  progress: CustomEvent<{loaded: number, total: number}>;
  error: CustomEvent<{error: Error}>;
}

/** <textured-gaussians src>: sends 'load', 'progress' ({loaded, total}) and 'error' ({error}), in `detail`. */
export class TexturedGaussiansElement extends HTMLElement {
  src: string;
  readonly model: Model | null;
  readonly viewer: Viewer | null;
  /** A PNG as a data URL. */
  picture(settings?: ViewerSettings): Promise<string>;
  play(on?: boolean): boolean;
  addEventListener<K extends keyof TexturedGaussiansElementEventMap>(
      type: K, listener: (this: TexturedGaussiansElement, event: TexturedGaussiansElementEventMap[K]) => unknown,
      options?: boolean | AddEventListenerOptions): void;
  addEventListener(type: string, listener: EventListenerOrEventListenerObject,
                   options?: boolean | AddEventListenerOptions): void;
}

declare global {
  interface HTMLElementTagNameMap { 'textured-gaussians': TexturedGaussiansElement; }
}

// SPDX-License-Identifier: Apache-2.0

/** A pinhole camera in the model's space. */
export interface Pinhole {
  name: string;
  test: boolean;
  width: number;   // [px]
  height: number;
  fx: number;      // [px]
  fy: number;
  cx: number;
  cy: number;
  /** x (right), y (down) and z (forward) of the camera. */
  axes: [number[], number[], number[]];
  eye: number[];
}

/** A scene with levels of detail, of which what a view wants is fetched and drawn. */
export interface LodStream {
  /** Where its lod-meta.json lies. */
  readonly address: string;
  /** Gaussians of the finest level. */
  readonly count: number;
  /** How many levels there are. */
  readonly levels: number;
  /** Gaussians that may be drawn. To be set before the model is drawn; later by Viewer.apply. */
  budget: number;
  /** Gaussians that are drawn, and those that the view wants. */
  readonly shown: number;
  readonly wanted: number;
}

/** What readModel gives. Space is glTF's: y up, z forward. */
export interface Model {
  /** Set where the model is a scene with levels of detail: count and mean are then of its coarsest levels, and other
      numbers of Gaussians are left out (empty arrays). */
  lod?: LodStream;
  /** Gaussians. */
  count: number;
  /** Positions, three numbers a Gaussian. */
  mean: Float32Array;
  rotation: Float32Array;  // x y z w
  scale: Float32Array;
  opacity: Float32Array;
  /** Spherical harmonics: an array a coefficient, three numbers a Gaussian. */
  sh: Float32Array[];
  /** Textures, or null. */
  layer: object | null;
  /** What it was trained from. */
  cameras: Pinhole[];
  /** What somebody has chosen; the first one is to start with. */
  views: Pinhole[];
  /** r, g, b from 0 to 1, as displayed. */
  background: [number, number, number];
  intersection: number;
  outside: number;
  /** What could not be read, in words. */
  notes: string[];
}

export interface FetchOptions {
  /** [bytes]; total is 0 where the server does not tell it. */
  onProgress?: (loaded: number, total: number) => void;
  signal?: AbortSignal;
}

export interface LoadOptions extends FetchOptions {
  /** Gaussians of a scene with levels of detail that may be drawn; 1,000,000 where it is left out. */
  splatBudget?: number;
}

export type Show = 'final' | 'base' | 'texture' | 'alpha' | 'depth' | 'normal' | 'overdraw';
export type Intersection = 'plane' | 'maxResponse';
export type Outside = 'base' | 'clip' | 'edge';
export type Textures = 'rgba' | 'rgb' | 'alpha' | 'off' | 'fallback';

/** How a model is drawn in an engine. A value that cannot be is told as an error, and nothing is drawn. */
export interface Settings {
  show: 'final' | 'base';
  textures: Textures;
  intersection: Intersection;
  outside: Outside;
  background: number[];
}

/** Rejects where the server is silent for 60 s, and nothing else that is fetched comes meanwhile. */
export function fetchBytes(url: string, options?: FetchOptions): Promise<Uint8Array>;
/** Of a GLB or a SOG file. */
export function readModel(bytes: ArrayBuffer | ArrayBufferView): Promise<Model>;
/** Of a GLB or a SOG file, or of a lod-meta.json, once its coarsest levels are there. */
export function loadModel(url: string, options?: LoadOptions): Promise<Model>;

/** What Viewer.apply takes: names and values of tgview's flags. */
export interface ViewerSettings {
  show?: Show;
  textures?: Textures;
  intersection?: Intersection;
  outside?: Outside;
  /** 'r,g,b' from 0 to 1, 'black' or 'white'. */
  background?: string;
  /** 'WxH' in pixels, or 'window'. */
  size?: string;
  /** Gaussians of a scene with levels of detail that may be drawn. */
  'splat-budget'?: number | string;
  /** One of the model's, or any other. */
  camera?: number | string | Pinhole;
  /** Name or number of one of the model's views, or Viewer.viewText. */
  view?: number | string;
}

/** A canvas that shows a model by itself. */
export class Viewer {
  constructor(canvas: HTMLCanvasElement);
  readonly model: Model | null;
  readonly playing: boolean;
  readonly viewText: string;
  onChange: () => void;
  onError: (error: Error) => void;
  /** Of a graphics device that was taken away and stays so; '' once it is back. */
  onLost: (words: string) => void;
  /** Rejects with what keeps the model from being shown, as a device lost for 60 s in which the page is seen. */
  open(model: Model): Promise<void>;
  /** The same model, further trained: the view stays. Without one before it, as open(). */
  replace(model: Model): Promise<void>;
  apply(settings: ViewerSettings): void;
  applyWhatCan(settings: Record<string, unknown>): string[];
  /** To a camera of the model; -1: everything in view. Throws where there is none of that number. */
  jump(camera: number): void;
  /** Throws as jump(). */
  jumpToView(view: number): void;
  frameAll(): void;
  play(on?: boolean): boolean;
  changed(byHand?: boolean): void;
  /** Resolves when the picture stands; rejects with what keeps it from that, or where nothing comes of it for 60 s in
      which the page is seen and the viewer has a context. */
  settled(): Promise<void>;
  /** Gives the WebGL context back, of which a browser has few, until resume(). A canvas with what was seen. */
  release(): HTMLCanvasElement;
  resume(): Promise<void>;
  /**
   * A PNG as a data URL; of a scene with levels of detail once all is there that the view wants. Pictures are taken one
   * after the other, and the settings stay: they are applied when the pictures before are there.
   */
  picture(settings?: ViewerSettings): Promise<string>;
  dispose(): void;
}

/** Until the function that it returns is called, or the viewer is disposed of. */
export function listenToHands(viewer: Viewer): () => void;
export function moveByKey(viewer: Viewer, event: {key: string; shiftKey: boolean}): boolean;

/** A model in a WebGL 2 context that another engine draws with. */
export class Splats {
  static inContext(gl: WebGL2RenderingContext, model: Model,
                   options?: {onChange?: () => void; onError?: (error: Error) => void;
                              onNote?: (words: string) => void}): Promise<Splats>;
  settings: Settings;
  /** Whether nothing more is to come for the last view; a promise of that. */
  readonly complete: boolean;
  completed(): Promise<void>;
  /** Over the framebuffer that is bound, with its depth. Returns whether all was there, in the right order. What
      cannot be drawn is told to onError, once. */
  drawInto(view: {viewFromModel: ArrayLike<number>; projection: ArrayLike<number>;
                  viewport: number[]; linear?: boolean}): boolean;
  dispose(): void;
}

export function cameraOf(viewFromModel: ArrayLike<number>, projection: ArrayLike<number>, width: number,
                         height: number): {camera: Pinhole; depth: [number, number]} | null;
export function matricesOf(camera: Pinhole, width: number, height: number, near?: number,
                           far?: number): {worldFromCamera: number[]; projection: number[]; fovY: number};

// SPDX-License-Identifier: Apache-2.0
// Room on the device for Gaussians that come and go: those of a scene with levels of detail.
import {breathe} from './breathe.js';
import {BAND_WIDTH} from './decoder.js';
import {BLOCK_BYTES, GpuModel, TEXELS_PER_GAUSSIAN} from './renderer.js';

const LEAST_PER_ROW = 128;    // Gaussians: what a piece leaves free of its last row
const LAYER_ROWS = 2048;      // [texels] of an atlas, if so many are needed
const ROWS_APART = 256;       // of an atlas that is lower
const SHELF_WASTE = 1.25;     // bands over the texels on them

// Which of `size` rows are free: runs [first, count], in order.
class Rows {
  constructor(size) {
    this.runs = [[0, size]];
  }

  // The first of `count` rows that lie together, or -1.
  take(count) {
    const index = this.runs.findIndex(([, free]) => free >= count);
    if (index < 0) return -1;
    const run = this.runs[index], [first] = run;
    run[0] += count;
    run[1] -= count;
    if (run[1] === 0) this.runs.splice(index, 1);
    return first;
  }

  get free() { return this.runs.reduce((sum, [, count]) => sum + count, 0); }

  // `count` rows, which must be free, as runs.
  takeRuns(count) {
    const runs = [];
    for (let left = count; left > 0;) {
      const some = Math.min(this.runs[0][1], left);
      runs.push([this.take(some), some]);
      left -= some;
    }
    return runs;
  }

  give(first, count) {
    let at = this.runs.findIndex(([begin]) => begin > first);
    if (at < 0) at = this.runs.length;
    this.runs.splice(at, 0, [first, count]);
    const join = (i) => {
      const [a, b] = this.runs.slice(i, i + 2);
      if (i >= 0 && b && a[0] + a[1] === b[0]) this.runs.splice(i, 2, [a[0], a[1] + b[1]]);
    };
    join(at);
    join(at - 1);
  }
}

// How many Gaussians stand in a row on this device if `places` are to have room; 0 where they cannot.
export function perRowFor(side, places, shCoefficients) {
  const most = Math.floor(side / Math.max(TEXELS_PER_GAUSSIAN, shCoefficients));
  const perRow = Math.max(Math.min(LEAST_PER_ROW, most), Math.ceil(places / side));
  return perRow <= most ? perRow : 0;
}

export class SplatPool extends GpuModel {
  // rows: of perRow Gaussians; kind: {shCoefficients, mode} as GpuModel has it; texels: of all textures together.
  static async open(renderer, rows, perRow, kind, texels) {
    await renderer.linked();
    const {gl} = renderer;
    await renderer.finished();  // before asking for errors, here and below: that waits for all that was sent
    while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
    const pool = new SplatPool(renderer, rows, perRow, kind);
    try {
      renderer.guarded(() => pool.allocate(texels));
      await renderer.finished();
      if (gl.getError() !== gl.NO_ERROR) throw new Error('the scene does not fit into the memory of the graphics device');
    } catch (error) {
      pool.dispose();
      throw error;
    }
    return pool;
  }

  constructor(renderer, rows, perRow, kind) {
    super(renderer.gl, {...kind, count: rows * perRow}, perRow, rows);
    this.renderer = renderer;
    this.gaussianRows = new Rows(rows);
    this.layers = [];  // rows of atlases
  }

  allocate(texels) {
    const {gl, renderer, perRow, rows, shCoefficients} = this;
    const open = (name, format, width) => {
      renderer.newTexture(this.textures, name, gl.TEXTURE_2D, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, perRow * width, rows);
    };
    open('u_gaussians', gl.RGBA32F, TEXELS_PER_GAUSSIAN);
    if (shCoefficients > 0) open('u_sh', gl.RGB16F, shCoefficients);
    if (this.mode > 0) {
      open('u_rects', gl.RGBA16UI, 1);
      this.allocateAtlases(texels);
    }
    this.openOrder();
  }

  allocateAtlases(texels) {
    const {gl, renderer} = this;
    const wanted = Math.ceil(SHELF_WASTE * texels / BAND_WIDTH / ROWS_APART + 1) * ROWS_APART;
    const height = Math.min(wanted, LAYER_ROWS);
    const count = Math.min(Math.ceil(wanted / height), gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS));
    this.layers = Array.from({length: count}, () => new Rows(height));
    renderer.newTexture(this.textures, 'u_ranges', gl.TEXTURE_2D, gl.NEAREST);
    const ranges = Float32Array.from({length: 8 * count}, (_, i) => (i % 8 < 4 ? 1 : 0));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2, count, 0, gl.RGBA, gl.FLOAT, ranges);
    renderer.newTexture(this.textures, 'u_atlas', gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, BAND_WIDTH, height, count);
  }

  // Room for a piece as the decoder packs it, or null where there is none: {rows: runs, bands: [{layer, first, count}]}.
  take({positions, textures}) {
    const rows = Math.ceil(positions.length / 3 / this.perRow);
    if (this.gaussianRows.free < rows) return null;
    const room = {rows: [], bands: []};
    for (const {rows: count} of textures && this.mode > 0 ? textures.bands : []) {
      let first = -1;
      const layer = this.layers.findIndex((free) => (first = free.take(count)) >= 0);
      if (layer < 0) {
        this.give(room);
        return null;
      }
      room.bands.push({layer, first, count});
    }
    room.rows = this.gaussianRows.takeRuns(rows);
    return room;
  }

  give({rows, bands}) {
    for (const [first, count] of rows) this.gaussianRows.give(first, count);
    for (const {layer, first, count} of bands) this.layers[layer].give(first, count);
  }

  // Uploads a piece into its room, in slices. Nothing of it is drawn before it is there.
  async fill(piece, room) {
    const steps = this.fillSteps(piece, room);
    while (!this.gl.isContextLost() && !this.renderer.guarded(() => steps.next()).done) await breathe();
  }

  *fillSteps({positions, gaussians, sh, textures}, {rows, bands}) {
    const {gl, perRow, shCoefficients} = this;
    const count = positions.length / 3;
    const numbers = gaussians.length / count;
    const rects = textures ? textures.rects : new Uint16Array(4 * count);
    if (bands.length > 0) {
      const {bandOf} = textures;
      for (let i = 0; i < count; ++i) {
        if (rects[4 * i + 2] === 0) continue;
        const {layer, first} = bands[bandOf[i]];
        rects[4 * i + 1] += first;
        gaussians[numbers * i + 11] = layer;
      }
      for (const [index, {layer, first}] of bands.entries()) yield* this.fillBand(textures.bands[index], layer, first);
    }
    let from = 0;
    for (const [row, runRows] of rows) {
      const last = Math.min(from + runRows * perRow, count);
      yield* this.fillRows('u_gaussians', TEXELS_PER_GAUSSIAN, 4, [gl.RGBA, gl.FLOAT], gaussians, from, last, row);
      if (shCoefficients > 0) {
        yield* this.fillRows('u_sh', shCoefficients, 3, [gl.RGB, gl.FLOAT], sh, from, last, row);
      }
      if (this.mode > 0) {
        yield* this.fillRows('u_rects', 1, 4, [gl.RGBA_INTEGER, gl.UNSIGNED_SHORT], rects, from, last, row);
      }
      from = last;
    }
  }

  // Gaussians [first, last) of `numbers`, `width` texels of `channels` numbers each, from the beginning of `row` on.
  *fillRows(name, width, channels, [format, type], numbers, first, last, row) {
    const {gl, perRow, renderer} = this;
    const size = width * channels;
    const most = Math.max(Math.floor(BLOCK_BYTES / (perRow * size * numbers.BYTES_PER_ELEMENT)), 1);
    for (let at = first, to = row; at < last;) {
      const whole = Math.min(Math.floor((last - at) / perRow), most);
      const across = whole > 0 ? perRow : last - at, down = Math.max(whole, 1);
      const end = at + across * down;
      renderer.bind(this.textures, name, gl.TEXTURE_2D);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, to, across * width, down, format, type, numbers.subarray(at * size, end * size));
      at = end;
      to += down;
      yield;
    }
  }

  *fillBand({rows, texels}, layer, first) {
    const {gl, renderer} = this;
    const most = Math.floor(BLOCK_BYTES / (4 * BAND_WIDTH * texels.BYTES_PER_ELEMENT));
    for (let row = 0; row < rows; row += most) {
      const some = Math.min(most, rows - row);
      const part = texels.subarray(4 * BAND_WIDTH * row, 4 * BAND_WIDTH * (row + some));
      renderer.bind(this.textures, 'u_atlas', gl.TEXTURE_2D_ARRAY);
      gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, first + row, layer, BAND_WIDTH, some, 1, gl.RGBA, gl.FLOAT, part);
      yield;
    }
  }
}

// SPDX-License-Identifier: Apache-2.0
// Room on the device for Gaussians that come and go: those of a scene with levels of detail.
import {breathe} from './breathe.js';
import {BAND_WIDTH} from './decoder.js';
import {GAUSSIAN_NUMBERS} from './pack.js';
import {BLOCK_BYTES, GpuModel, TEXELS_PER_GAUSSIAN} from './renderer.js';

const LEAST_PER_ROW = 128;    // Gaussians: what a piece leaves free of its last row
const SPARE = 0.5;            // of the budget: what was seen a moment ago, and what comes in place of what is drawn
const LAYER_ROWS = 512;       // [texels] of an atlas
const USUAL_TEXELS = 16;      // of a Gaussian, where atlases cannot grow

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

// Parts of `list`, `width` numbers a Gaussian, as one.
function gathered(list, width, pieces) {
  const [{first}] = pieces, {first: last, count} = pieces[pieces.length - 1];
  const sum = pieces.reduce((total, piece) => total + piece.count, 0);
  if (last + count - first === sum) return list.subarray(width * first, width * (first + sum));
  const out = new list.constructor(width * sum);
  let at = 0;
  for (const piece of pieces) {
    out.set(list.subarray(width * piece.first, width * (piece.first + piece.count)), at);
    at += width * piece.count;
  }
  return out;
}

// What a scene takes on a device whose textures have `side` texels a side: {perRow, rows: of Gaussians, budget: of
// those that may be drawn, `asked` or the most that there is room for, Infinity: all, most: that room}. `all`, `least`:
// Gaussians of all levels and of the coarsest ones, in so many files. A larger budget never gets less. Throws where not
// even the coarsest levels have room.
export function planPool(side, {all, least, files, shCoefficients}, asked) {
  const widest = Math.floor(side / Math.max(TEXELS_PER_GAUSSIAN, shCoefficients));
  if (least > widest * side) {
    throw new Error(`${least} Gaussians are too many for this device, even in the coarsest levels`);
  }
  const full = Math.max(side - files, 0);  // rows: the last one of what comes together is not
  const room = full * widest;
  const most = all <= room ? Infinity : Math.max(Math.floor((room - least) / (1 + SPARE)), 0);
  const budget = Math.min(asked, most);
  const places = Math.min(all, least + Math.ceil((1 + SPARE) * budget));
  const perRow = Math.max(Math.min(LEAST_PER_ROW, widest), Math.ceil(places / (places <= room ? full : side)));
  const rows = Math.min(Math.ceil(places / perRow) + files, side);
  return {perRow, rows, budget: places === all ? Infinity : budget, most};
}

export class SplatPool extends GpuModel {
  // plan: {perRow, rows, budget, most} as planPool() has it; kind: {shCoefficients, mode} as GpuModel has it. Throws an
  // error with isTooLarge where the device has no memory for it.
  static async open(renderer, plan, kind) {
    await renderer.linked();
    const {gl} = renderer;
    await renderer.finished();  // before asking for errors, here and below: that waits for all that was sent
    while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
    const pool = new SplatPool(renderer, plan, kind);
    try {
      renderer.guarded(() => pool.allocate());
      await renderer.finished();
      if (gl.getError() !== gl.NO_ERROR) {
        throw Object.assign(new Error('the scene does not fit into the graphics device\'s memory'), {isTooLarge: true});
      }
    } catch (error) {
      pool.dispose();
      throw error;
    }
    return pool;
  }

  constructor(renderer, {perRow, rows, budget, most}, kind) {
    super(renderer.gl, {...kind, count: rows * perRow}, perRow, rows);
    this.renderer = renderer;
    this.budget = budget;
    this.mostBudget = most;
    this.gaussianRows = new Rows(rows);
    this.users = new Uint16Array(rows);  // pieces that stand in a row
    this.layers = [];  // rows of atlases
    this.most = 0;     // layers that there may be
    this.density = 0;  // [texels] of a Gaussian, with what bands leave free: the most that a chunk had
  }

  allocate() {
    const {gl, renderer, perRow, rows, shCoefficients} = this;
    const open = (name, format, width) => {
      renderer.newTexture(this.textures, name, gl.TEXTURE_2D, gl.NEAREST);
      gl.texStorage2D(gl.TEXTURE_2D, 1, format, perRow * width, rows);
    };
    open('u_gaussians', gl.RGBA32F, TEXELS_PER_GAUSSIAN);
    if (shCoefficients > 0) open('u_sh', gl.RGB16F, shCoefficients);
    if (this.mode > 0) {
      open('u_rects', gl.RGBA16UI, 1);
      this.most = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS);
      this.openAtlases(renderer.deep ? 1 : this.layersFor(USUAL_TEXELS));
    }
    this.openOrder(renderer);
  }

  layersFor(density) {
    return Math.min(Math.ceil(density * this.count / (BAND_WIDTH * LAYER_ROWS)), this.most);
  }

  openAtlases(count) {
    const {gl, renderer, textures} = this;
    for (let layer = this.layers.length; layer < count; ++layer) this.layers.push(new Rows(LAYER_ROWS));
    renderer.newTexture(textures, 'u_ranges', gl.TEXTURE_2D, gl.NEAREST);
    const ranges = Float32Array.from({length: 8 * count}, (_, i) => (i % 8 < 4 ? 1 : 0));
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 2, count, 0, gl.RGBA, gl.FLOAT, ranges);
    renderer.newTexture(textures, 'u_atlas', gl.TEXTURE_2D_ARRAY, gl.LINEAR);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, 1, gl.RGBA16F, BAND_WIDTH, LAYER_ROWS, count);
  }

  // As many layers as the densest chunk so far asks for, with what they hold. False where there are as many.
  grow() {
    const {gl, renderer, textures} = this;
    const before = this.layers.length, count = this.layersFor(this.density);
    if (count <= before || !renderer.deep) return false;
    const {u_atlas: atlas, u_ranges: ranges} = textures;
    while (gl.getError() !== gl.NO_ERROR && !gl.isContextLost());
    this.openAtlases(count);
    const framebuffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    for (let layer = 0; layer < before; ++layer) {
      gl.framebufferTextureLayer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, atlas, 0, layer);
      gl.copyTexSubImage3D(gl.TEXTURE_2D_ARRAY, 0, 0, 0, layer, 0, 0, BAND_WIDTH, LAYER_ROWS);
    }
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.deleteFramebuffer(framebuffer);
    if (gl.getError() !== gl.NO_ERROR) {  // no memory: what there was stays
      this.most = before;
      this.layers.length = before;
      gl.deleteTexture(textures.u_atlas);
      gl.deleteTexture(textures.u_ranges);
      Object.assign(textures, {u_atlas: atlas, u_ranges: ranges});
      return false;
    }
    gl.deleteTexture(atlas);
    gl.deleteTexture(ranges);
    return true;
  }

  // Of the pieces of a chunk, {first, count, textures: as the decoder packs them}, before any of them is given room.
  expect(pieces) {
    const sum = (numberOf) => pieces.reduce((total, piece) => total + numberOf(piece), 0);
    const rows = sum(({textures}) => (textures ? textures.bands.reduce((total, band) => total + band.rows, 0) : 0));
    this.density = Math.max(this.density, BAND_WIDTH * rows / sum(({count}) => count));
  }

  // Room for pieces of a chunk, one after the other: {rows: runs, rooms: {places: first and count in turns, bands} of
  // each}. Null where there is none.
  take(pieces) {
    const count = pieces.reduce((sum, piece) => sum + piece.count, 0);
    const rows = Math.ceil(count / this.perRow);
    if (this.gaussianRows.free < rows) return null;
    const rooms = pieces.map(() => ({places: [], bands: []}));
    for (const [index, {textures}] of pieces.entries()) {
      for (const {rows: height} of textures && this.mode > 0 ? textures.bands : []) {
        const band = this.takeBand(height) || (this.renderer.guarded(() => this.grow()) && this.takeBand(height));
        if (!band) {
          for (const room of rooms) this.give(room);
          return null;
        }
        rooms[index].bands.push(band);
      }
    }
    const runs = this.gaussianRows.takeRuns(rows);
    const left = runs.map(([first, some]) => [first * this.perRow, some * this.perRow]);
    for (const [index, {places}] of rooms.entries()) {
      for (let needed = pieces[index].count; needed > 0;) {
        const [run] = left;
        const some = Math.min(needed, run[1]);
        places.push(run[0], some);
        this.eachRow(run[0], some, (row) => ++this.users[row]);
        run[0] += some;
        run[1] -= some;
        needed -= some;
        if (run[1] === 0) left.shift();
      }
    }
    return {rows: runs, rooms};
  }

  eachRow(first, count, body) {
    for (let row = Math.floor(first / this.perRow); row * this.perRow < first + count; ++row) body(row);
  }

  takeBand(count) {
    for (const [layer, free] of this.layers.entries()) {
      const first = free.take(count);
      if (first >= 0) return {layer, first, count};
    }
    return null;
  }

  // A piece's room is free again.
  give({places, bands}) {
    for (let i = 0; i < places.length; i += 2) {
      this.eachRow(places[i], places[i + 1], (row) => {
        if (--this.users[row] === 0) this.gaussianRows.give(row, 1);
      });
    }
    for (const {layer, first, count} of bands) this.layers[layer].give(first, count);
  }

  // Uploads pieces of a chunk, as decoder and take() have them, in slices, each when the device has done what it was told
  // before: numbers that it cannot take yet would hold up the page. Nothing of them is drawn before they are there.
  async fill(chunk, pieces, room) {
    const {gl, renderer} = this;
    const steps = this.fillSteps(chunk, pieces, room);
    do {
      await renderer.finished();
      await breathe();
    } while (!gl.isContextLost() && !renderer.guarded(() => steps.next()).done);
  }

  *fillSteps(chunk, pieces, {rows, rooms}) {
    const {gl, perRow, shCoefficients} = this;
    const gaussians = gathered(chunk.gaussians, GAUSSIAN_NUMBERS, pieces);
    const sh = gathered(chunk.sh, 3 * shCoefficients, pieces);
    const count = gaussians.length / GAUSSIAN_NUMBERS;
    const rects = new Uint16Array(this.mode > 0 ? 4 * count : 0);
    let at = 0;
    for (const [index, piece] of pieces.entries()) {
      const {bands} = rooms[index];
      if (bands.length > 0) {
        const {textures} = piece;
        for (let i = 0; i < piece.count; ++i) {
          if (textures.rects[4 * i + 2] === 0) continue;
          const {layer, first} = bands[textures.bandOf[i]];
          for (let k = 0; k < 4; ++k) rects[4 * (at + i) + k] = textures.rects[4 * i + k] + (k === 1 ? first : 0);
          gaussians[GAUSSIAN_NUMBERS * (at + i) + 11] = layer;
        }
        yield;
        for (const [n, {layer, first}] of bands.entries()) yield* this.fillBand(textures.bands[n], layer, first);
      }
      at += piece.count;
    }
    let from = 0;
    for (const [row, some] of rows) {
      const last = Math.min(from + some * perRow, count);
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

  // The positions of the same pieces, for a sorter: put(first place, positions).
  eachRun({positions}, pieces, {rows}, put) {
    const all = gathered(positions, 3, pieces);
    let from = 0;
    for (const [row, some] of rows) {
      const part = all.slice(from, from + 3 * some * this.perRow);
      put(row * this.perRow, part);
      from += part.length;
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
      const part = numbers.subarray(at * size, end * size);
      gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, to, across * width, down, format, type, part);
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

// SPDX-License-Identifier: Apache-2.0
// Scenes with levels of detail: the coarsest levels first, then those that the view wants, as they come. A coarser
// level is drawn until a finer one is there to the last Gaussian; what is no longer wanted makes room for what is.
import {breathe} from './breathe.js';
import {sceneBounds} from './camera.js';
import {readCameraFile} from './camera_file.js';
import {ChunkLoader} from './chunks.js';
import {addressIn} from './decoder.js';
import {fetchBytes} from './fetch.js';
import {chooseLevels, parseLodMeta} from './lod.js';
import {GAUSSIAN_NUMBERS, SCALE_NUMBER} from './pack.js';
import {SplatPool, planPool} from './pool.js';
import {Splats} from './splats.js';

const SPLAT_BUDGET = 1000000;  // Gaussians, if nobody says another number
const MOST_CAMERAS = 1 << 25;  // [bytes] of cameras.json
const AT_ONCE = 4;             // chunks on their way
const PLAN_MILLISECONDS = 100; // between two choices of levels

// Promise.allSettled of what `begin` gives for each of the list, of which so many are under way at a time. No more
// begin once that many have failed and none has come: then it is that of the first ones.
async function settledAtMost(most, list, begin) {
  const results = [];
  let next = 0, failed = 0, came = false;
  const goOn = async () => {
    while (next < list.length && (came || failed < most)) {
      const at = next++;
      [results[at]] = await Promise.allSettled([begin(list[at])]);
      if (results[at].status === 'fulfilled') came = true;
      else ++failed;
    }
  };
  await Promise.all(Array.from({length: most}, goOn));
  return results;
}

// What scenes that are shown have in common: the chunks' addresses and the way to them.
export class LodStream {
  constructor(scene, address, budget) {
    this.scene = scene;
    this.address = String(new URL(address, document.baseURI));
    this.folder = String(new URL('.', this.address));
    for (const file of scene.files) file.address = addressIn(this.folder, this.address, file.name);
    this.budget = budget;
    this.memory = Infinity;  // a budget beyond which the device has none
    this.loader = new ChunkLoader();
    // Of the pieces: what the file says, or the first chunk. Textures are this toolchain's, whose files say so.
    const {shCoefficients = null, mode = 0} = scene.own || {};
    this.kind = {shCoefficients, mode};
    this.coarsest = new Set(scene.leaves.map(({pieces}) => pieces[pieces.length - 1]));
    this.textures = null;  // {intersection, outside} of all that there are
    this.first = null;  // chunks of the coarsest levels, until they are on a device
    this.shown = 0;     // Gaussians that are drawn, and that the view wants
    this.wanted = 0;
  }

  get count() { return this.scene.count; }

  get usualBudget() { return SPLAT_BUDGET; }

  get levels() { return this.scene.levels; }

  async load(file, signal) { return this.checked(await this.fetch(file, signal)); }

  // What the decoder answers, and {file, pieces: {piece, first, count, textures}}; throws what goes wrong.
  async fetch(file, signal) {
    const {shCoefficients} = this.kind;
    const answer = await this.loader.load({
      address: file.address, folder: this.folder, ranges: file.pieces.map(({first, count}) => [first, count]),
      textured: this.kind.mode > 0, shCoefficients,
    }, signal);
    const {textures} = answer.chunk;
    const pieces = file.pieces.map((piece, i) => ({piece, first: piece.first, count: piece.count, textures: textures[i]}));
    return {...answer, file, pieces};
  }

  // A chunk whose textures are drawn as those before it; throws where they are not: one picture has one way.
  checked(chunk) {
    const {file, mode, intersection, outside} = chunk;
    if (mode === 0) return chunk;
    this.textures = this.textures || {intersection, outside};
    if (intersection === this.textures.intersection && outside === this.textures.outside) return chunk;
    const words = 'another intersection model, or another way for textures to end, than other files have';
    throw new Error(`${file.address}: ${words}`);
  }

  // The chunks of the coarsest levels; {chunks, errors}.
  async loadCoarsest(signal) {
    const files = [...new Set([...this.coarsest].map(({file}) => file))];
    const results = await settledAtMost(AT_ONCE, files, (file) => this.fetch(file, signal));
    signal.throwIfAborted();
    const chunks = [], errors = [];
    for (const {value, reason} of results) {  // in the files' order, whichever came first
      try {
        if (!value) throw reason;
        chunks.push(this.checked(value));
      } catch (error) {
        errors.push(error);
      }
    }
    return {chunks, errors};
  }

  open(renderer, model, hooks) { return StreamedSplats.open(this, renderer, model, hooks); }
}

const LOOKED_AT = 1 << 15;  // Gaussians, for where the scene is

// Means and scales of the coarsest levels, [{leaf, positions, gaussians}], each leaf with as many as its share of the
// finest level.
function sampleOf(scene, found) {
  const mean = [], scale = [];
  for (const {leaf, positions, gaussians} of found) {
    const held = positions.length / 3, count = Math.ceil(LOOKED_AT * leaf.pieces[0].count / scene.count);
    for (let i = 0; i < count; ++i) {
      const at = Math.floor(i * held / count);
      for (let k = 0; k < 3; ++k) {
        mean.push(positions[3 * at + k]);
        scale.push(gaussians[GAUSSIAN_NUMBERS * at + SCALE_NUMBER + k]);
      }
    }
  }
  return [mean, scale];
}

// The cameras that a lod-meta.json of this toolchain names, {cameras, notes}.
async function fetchCameras({scene, address, folder}, signal) {
  if (!scene.own || !scene.own.cameras) return {cameras: [], notes: []};
  try {
    const at = addressIn(folder, address, scene.own.cameras);
    return {cameras: readCameraFile(await fetchBytes(at, {signal, most: MOST_CAMERAS})), notes: []};
  } catch (error) {
    signal.throwIfAborted();
    return {cameras: [], notes: [`The scene's cameras cannot be used (${error.message}).`]};
  }
}

// The model of a lod-meta.json, once its coarsest levels are there: readModel's, of those levels; more of it comes as
// `lod` is drawn. What Gaussians have beyond their means stays with what draws them.
export async function readLod(address, bytes, options) {
  const {signal = new AbortController().signal, splatBudget = SPLAT_BUDGET} = options;
  const scene = await parseLodMeta(bytes);
  const budget = Number.isInteger(splatBudget) && splatBudget > 0 ? splatBudget : SPLAT_BUDGET;
  const stream = new LodStream(scene, address, budget);
  const both = [stream.loadCoarsest(signal), fetchCameras(stream, signal)];
  const [{chunks, errors}, {cameras, notes: said}] = await Promise.all(both);
  if (chunks.length === 0) throw errors[0];
  stream.first = chunks;
  if (!scene.own) stream.kind.shCoefficients = Math.max(...chunks.map((chunk) => chunk.shCoefficients));
  const {shCoefficients, mode} = stream.kind;
  const leafOf = new Map(scene.leaves.map((leaf) => [leaf.pieces[leaf.pieces.length - 1], leaf]));
  const found = chunks.flatMap(({chunk, pieces}) => pieces.filter(({piece}) => leafOf.has(piece))
    .map(({piece, first, count}) =>
      ({leaf: leafOf.get(piece), positions: chunk.positions.subarray(3 * first, 3 * (first + count)),
        gaussians: chunk.gaussians.subarray(GAUSSIAN_NUMBERS * first, GAUSSIAN_NUMBERS * (first + count))})));
  await breathe();
  const mean = new Float32Array(found.reduce((sum, {positions}) => sum + positions.length, 0));
  let at = 0;
  for (const {positions} of found) {
    mean.set(positions, at);
    at += positions.length;
  }
  await breathe();
  const bounds = sceneBounds(...sampleOf(scene, found));
  const none = new Float32Array(0);
  const {intersection, outside, background = [0, 0, 0]} = {...(scene.own || chunks[0]), ...stream.textures};
  const notes = [...said, ...chunks.flatMap((chunk) => chunk.notes), ...errors.map(({message}) => message)];
  return {
    count: mean.length / 3, mean, rotation: none, scale: none, opacity: none,
    sh: Array.from({length: shCoefficients + 1}, () => none), layer: mode > 0 ? {mode} : null, cameras, views: [],
    background, intersection, outside, notes: [...new Set(notes)], bounds,
    lod: stream,
  };
}

export class StreamedSplats extends Splats {
  static async open(stream, renderer, model, hooks) {
    const stop = new AbortController();
    const {first} = stream;
    const chunks = first || (await stream.loadCoarsest(stop.signal)).chunks;
    stream.first = null;
    const pool = await openPool(stream, renderer, first !== null);
    const splats = new StreamedSplats(stream, renderer, model, pool, hooks, stop);
    try {
      for (const chunk of chunks) await splats.place(chunk);
    } catch (error) {
      splats.dispose();
      throw error;
    }
    splats.advance();
    splats.tellRoom();
    return splats;
  }

  constructor(stream, renderer, model, pool, hooks, stop) {
    super(renderer, model, pool, hooks);
    Object.assign(this, {stream, stop});
    const {leaves} = stream.scene;
    this.choice = leaves.map(({pieces}) => pieces[pieces.length - 1]);  // what the view wants
    this.wanted = new Set(this.choice);  // the same, less those that failed
    this.order = leaves.map((_, leaf) => leaf);  // the one that matters most to the view first
    this.shown = leaves.map(() => null);  // pieces
    this.held = new Map();       // by piece: {room, used: when it was wanted last, hidden: since which order}
    this.failed = new Set();     // files
    this.coming = new Map();     // by file: what stops it
    this.placing = Promise.resolve();
    this.drawn = 0;              // what sorter.show() returned for what is drawn
    this.pressed = false;        // room is short: what is not wanted is shown in its coarsest level
    this.clock = 0;
    this.camera = null;
    this.planned = null;         // the camera of the last choice
    this.planTimer = 0;
    this.lastPlan = -Infinity;
    this.waiting = [];           // called when an order comes, or all is there
  }

  get complete() {
    return this.planned === this.camera && this.coming.size === 0 && !this.planTimer &&
      this.shown.every((piece, leaf) => piece === this.bestOf(leaf) || !this.bestOf(leaf));
  }

  async completed() {
    while (!this.stop.signal.aborted && !this.complete) await this.nextChange();
    await super.completed();
  }

  // At once where nothing changes any more.
  nextChange() {
    return new Promise((done) => {
      if (this.stop.signal.aborted) done();
      else this.waiting.push(done);
    });
  }

  tellWaiting() { for (const done of this.waiting.splice(0)) done(); }

  sort(camera) {
    super.sort(camera);
    const same = this.camera && ['fx', 'fy', 'width', 'height'].every((key) => camera[key] === this.camera[key]) &&
      String([camera.axes, camera.eye]) === String([this.camera.axes, this.camera.eye]);
    if (!same) this.camera = camera;
    if (this.planned !== this.camera) this.planSoon();
  }

  planSoon() {
    if (this.planTimer) return;
    const wait = Math.max(this.lastPlan + PLAN_MILLISECONDS - performance.now(), 0);
    this.planTimer = setTimeout(() => {
      this.planTimer = 0;
      this.plan();
    }, wait);
  }

  // After the budget was changed. False where a larger pool has room for it, or for more of it.
  replan() {
    const {stream, gpu} = this;
    this.planned = null;
    if (this.camera) this.planSoon();
    this.tellRoom();
    return Math.min(stream.budget, gpu.mostBudget) <= gpu.budget;
  }

  // A note of the model's, once, where somebody asked for more than the device has room for.
  tellRoom() {
    const {stream, gpu, model} = this;
    if (stream.budget <= gpu.mostBudget || stream.budget === stream.usualBudget) return;
    const room = gpu.mostBudget > 0 ? `${gpu.mostBudget} Gaussians` : 'no more than the coarsest level';
    const words = `This device has room for ${room} of the scene at a time.`;
    if (model.notes.includes(words)) return;
    model.notes.push(words);
    this.onNote(words);
  }

  // Chooses levels for the camera.
  plan() {
    if (this.stop.signal.aborted) return;
    this.lastPlan = performance.now();
    this.planned = this.camera;
    const {scene, budget} = this.stream;
    const {levels, errors} = chooseLevels(scene, this.camera, Math.min(budget, this.gpu.budget));
    this.choice = scene.leaves.map(({levels: own}, leaf) => own[levels[leaf]]);
    this.order.sort((a, b) => errors[b] - errors[a] || a - b);
    this.advance();
  }

  // What a leaf should show: what was chosen or, where that failed, the next coarser piece that did not, then the next
  // finer one. Null where all failed.
  bestOf(leaf) {
    if (!this.failed.has(this.choice[leaf].file)) return this.choice[leaf];
    const {pieces} = this.stream.scene.leaves[leaf];
    const chosen = pieces.indexOf(this.choice[leaf]);
    const good = ({file}) => !this.failed.has(file);
    return pieces.slice(chosen).find(good) || pieces.slice(0, chosen).reverse().find(good) || null;
  }

  // What a leaf shows until that is there.
  pieceFor(leaf, best) {
    if (this.held.has(best)) return best;
    const now = this.shown[leaf];
    const {pieces} = this.stream.scene.leaves[leaf];
    const at = pieces.indexOf(best);
    if (now && pieces.indexOf(now) < at && !this.pressed) return now;
    const held = (piece) => this.held.has(piece);
    return pieces.slice(at).find(held) || now || pieces.slice(0, at).reverse().find(held) || null;
  }

  // Shows the best of what is there, and asks for what is not.
  advance() {
    if (this.stop.signal.aborted) return;
    ++this.clock;
    const best = this.shown.map((_, leaf) => this.bestOf(leaf));
    this.wanted = new Set(best);
    for (const piece of best) if (this.held.has(piece)) this.held.get(piece).used = this.clock;
    const next = best.map((piece, leaf) => this.pieceFor(leaf, piece));
    if (next.some((piece, leaf) => piece !== this.shown[leaf])) this.show(next);
    const countOf = (pieces) => pieces.reduce((sum, piece) => sum + (piece ? piece.count : 0), 0);
    this.stream.wanted = countOf(best);
    this.stream.shown = countOf(this.shown);
    this.request(best);
    this.tellWaiting();
  }

  show(next) {
    const runs = [];
    for (const piece of next) {
      if (!piece) continue;
      const {places} = this.held.get(piece).room;
      for (let i = 0; i < places.length; i += 2) {
        const {length} = runs;
        if (length > 0 && runs[length - 2] + runs[length - 1] === places[i]) runs[length - 1] += places[i + 1];
        else runs.push(places[i], places[i + 1]);
      }
    }
    const showing = this.sorter.show(runs);
    const stays = new Set(next);
    for (const piece of this.shown) if (piece && !stays.has(piece)) this.held.get(piece).hidden = showing;
    for (const piece of next) if (piece) this.held.get(piece).hidden = Infinity;
    this.shown = next;
    if (this.camera) super.sort(this.camera);
  }

  takeOrder() {
    this.sorter.take((order, visible, showing) => {
      this.renderer.setOrder(this.gpu, order, visible);
      this.drawn = showing;
      this.tellWaiting();
    });
  }

  // Loads files that hold what is wanted and not there, as many at once as may be; stops those that are not wanted now.
  request(best) {
    const files = new Set();
    for (const leaf of this.order) {
      const piece = best[leaf];
      if (piece && !this.held.has(piece)) files.add(piece.file);
    }
    for (const [file, stop] of this.coming) if (!files.has(file)) stop.abort();
    for (const file of files) {
      if (this.coming.size >= AT_ONCE) break;
      if (!this.coming.has(file)) this.load(file);
    }
  }

  async load(file) {
    const stop = new AbortController();
    this.coming.set(file, stop);
    try {
      const chunk = await this.stream.load(file, stop.signal);
      const placed = this.placing.then(() => this.place(chunk));
      this.placing = placed.catch(() => {});
      await placed;
      if (chunk.notes.length > 0) this.onError(new Error(`${file.address}: ${chunk.notes.join(' ')}`));
    } catch (error) {
      if (!stop.signal.aborted && !this.stop.signal.aborted) {
        this.failed.add(file);
        this.onError(error);
      }
    }
    this.coming.delete(file);
    this.advance();
  }

  // A chunk's pieces on the device: all, or where there is no room for them those that somebody wants.
  async place({file, chunk, pieces}) {
    const {gpu, sorter} = this;
    const missing = pieces.filter(({piece}) => !this.held.has(piece));
    if (missing.length === 0) return;
    gpu.expect(missing);
    let placed = missing;
    let room = gpu.take(missing);
    if (!room) {
      placed = missing.filter(({piece}) => this.wanted.has(piece) || this.stream.coarsest.has(piece));
      room = placed.length > 0 ? await this.roomFor(file, placed) : null;
    }
    if (!room || this.stop.signal.aborted) return;
    await gpu.fill(chunk, placed, room);
    if (this.stop.signal.aborted) return;
    gpu.eachRun(chunk, placed, room, (first, positions) => sorter.put(first, positions));
    for (const [index, {piece}] of placed.entries()) {
      this.held.set(piece, {room: room.rooms[index], used: this.clock, hidden: 0});
    }
  }

  // Room for pieces of a file that are wanted, made by giving up what was wanted longest ago.
  async roomFor(file, pieces) {
    for (;;) {
      const room = this.gpu.take(pieces);
      if (room) {
        this.pressed = false;
        return room;
      }
      const others = [...this.held].filter(([piece]) => !this.wanted.has(piece) && !this.stream.coarsest.has(piece));
      const [oldest] = others.filter(([, {hidden}]) => hidden <= this.drawn).sort(([, a], [, b]) => a.used - b.used);
      if (oldest) {
        this.held.delete(oldest[0]);
        this.gpu.give(oldest[1].room);
        continue;
      }
      // What is drawn beyond what is wanted goes with the next order.
      this.pressed = true;
      this.advance();
      if (others.every(([piece]) => this.shown.includes(piece))) {
        throw new Error(`${file.address}: no room for it on this device`);
      }
      await this.nextChange();
      if (this.stop.signal.aborted) return null;
    }
  }

  // Nothing more is fetched, and who waits for more goes on.
  halt() {
    this.stop.abort(new DOMException('The scene is no longer shown.', 'AbortError'));
    for (const stop of this.coming.values()) stop.abort();
    clearTimeout(this.planTimer);
    this.tellWaiting();
  }

  sortingFailed(error) {
    this.halt();
    super.sortingFailed(error);
  }

  dispose() {
    this.halt();
    super.dispose();
  }
}

// A pool for what a stream's budget needs on the renderer's device: all coarsest levels, the budget and some to spare.
// `shrinks`: where the device has no memory for it, for half of it and so on.
async function openPool(stream, renderer, shrinks) {
  const {scene, coarsest, kind} = stream;
  const {gl} = renderer;
  const sum = (pieces) => pieces.reduce((total, {count}) => total + count, 0);
  const needs = {all: sum(scene.pieces), least: sum([...coarsest]), files: scene.files.length,
                 shCoefficients: kind.shCoefficients};
  for (;;) {
    const plan = planPool(gl.getParameter(gl.MAX_TEXTURE_SIZE), needs, Math.min(stream.budget, stream.memory));
    plan.most = Math.min(plan.most, stream.memory);
    try {
      return await SplatPool.open(renderer, plan, kind);
    } catch (error) {
      const less = Math.floor(Math.min(plan.budget, needs.all) / 2);
      if (!shrinks || !error.isTooLarge || less === 0 || gl.isContextLost()) throw error;
      stream.memory = less;
    }
  }
}

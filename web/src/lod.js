// SPDX-License-Identifier: Apache-2.0
// Scenes with levels of detail: what a lod-meta.json says (docs/lod.md), and which level of each node a view wants.
import {breathe} from './breathe.js';
import {INTERSECTIONS, MODES, OUTSIDES} from './glb.js';
import {valueNamed} from './names.js';

const LEVELS = 'TG_levels_of_detail', MEANS = 'TG_means';  // of this toolchain
const MOST_LOD_META = 1 << 26;    // [bytes]
const MOST_LEVELS = 16;
const MOST_FILES = 1 << 16;
const MOST_NAME = 1024;
const MOST_LEAVES = 1 << 16;
const MOST_COUNT = 2 ** 31;   // Gaussians of a level
const NODES_AT_A_TIME = 256;  // between two looks at the clock

// Whether bytes are a lod-meta.json, as it is or spoilt.
export function isLodMeta(bytes) {
  let at = bytes[0] === 0xEF && bytes[1] === 0xBB && bytes[2] === 0xBF ? 3 : 0;
  while (at < bytes.length && [0x20, 0x09, 0x0A, 0x0D].includes(bytes[at])) ++at;
  return bytes[at] === 0x7B && bytes.length <= MOST_LOD_META && new TextDecoder().decode(bytes).includes('"lodLevels"');
}

const complaint = (where, words) => new Error(`lod-meta.json: ${where}: ${words}`);

function expectThat(ok, where, words) {
  if (!ok) throw complaint(where, words);
}

const isCount = (value, least, most) => Number.isInteger(value) && value >= least && value <= most;

const SIGNS = 'letters, digits, spaces, _ - . ( ) + and /';

// A file's name as addresses have it, in one spelling; null for what the C++ library refuses (nameInside), too.
function nameInside(name) {
  const inside = name.replace(/^\.\//, '');
  const plain = inside.length <= MOST_NAME &&
    inside.split('/').every((part) => /^(?!\.)[\w\-. ()+\u{a0}-\u{d7ff}\u{e000}-\u{10ffff}]+$/u.test(part));
  return plain ? inside : null;
}

// A box of the file's axes in those of models here, a half turn about z from them; floats, as the C++ library has them.
function readBound(bound, where) {
  const corner = (list) => Array.isArray(list) && list.length === 3 && list.every(Number.isFinite);
  expectThat(bound && corner(bound.min) && corner(bound.max), where, 'expected min and max of 3 numbers');
  const [min, max] = [bound.min, bound.max].map((list) => list.map(Math.fround));
  expectThat(min.every((x, k) => x <= max[k]), where, 'min is beyond max');
  return {low: [-max[0], -max[1], min[2]], high: [-min[0], -min[1], max[2]]};
}

// What the toolchain adds, {shCoefficients, mode, intersection, outside, background: or undefined, cameras: the name of
// a file or null}; null where another program wrote the file, or a later one.
function readOwn(own) {
  if (!own || own.version !== 1) return null;
  const where = `/${LEVELS}`;
  const {sh_degree: degree, texture_mode: mode, intersection, outside, background, cameras = null} = own;
  expectThat(isCount(degree, 0, 3), `${where}/sh_degree`, `${degree} (expected 0 to 3)`);
  expectThat(mode === 'none' || valueNamed(MODES, mode) !== undefined, `${where}/texture_mode`, mode);
  expectThat(valueNamed(INTERSECTIONS, intersection) !== undefined, `${where}/intersection`, intersection);
  expectThat(valueNamed(OUTSIDES, outside) !== undefined, `${where}/outside`, outside);
  expectThat(background === undefined ||
             (Array.isArray(background) && background.length === 3 && background.every(Number.isFinite)),
             `${where}/background`, 'expected 3 numbers');
  expectThat(cameras === null || typeof cameras === 'string', `${where}/cameras`, cameras);
  return {shCoefficients: (degree + 1) ** 2 - 1, mode: MODES[mode] || 0, intersection: INTERSECTIONS[intersection],
          outside: OUTSIDES[outside], background, cameras};
}

// The levels of a leaf; what is missing is the next finer one or, where there is none, the next coarser.
function filled(levels) {
  const found = levels.map((piece, level) => piece || levels.slice(0, level).reverse().find(Boolean));
  return found.map((piece, level) => piece || found.slice(level).find(Boolean));
}

// {files: [{name, pieces}], leaves: [{box: around all it shows, means: around its means, pieces, levels}], pieces,
// levels: how many, count: Gaussians of the finest one, own: as readOwn()}. A piece is a level of a leaf, {level, file,
// first, count}; the pieces of a leaf, of which there is at least one, go from the finest to the coarsest, and `levels`
// are pieces for each level. Throws at the first thing that cannot be.
export async function parseLodMeta(bytes) {
  const meta = JSON.parse(new TextDecoder().decode(bytes));
  const {version, lodLevels: levels, filenames: names} = Object(meta);
  expectThat(version === undefined || version === 1, '/version', `${version} (expected 1)`);
  expectThat(isCount(levels, 1, MOST_LEVELS), '/lodLevels', `${levels} (expected 1 to ${MOST_LEVELS})`);
  expectThat(Array.isArray(names) && names.length > 0 && names.length <= MOST_FILES &&
             names.every((name) => typeof name === 'string'), '/filenames', `expected 1 to ${MOST_FILES} names`);
  const seen = new Set();  // a file's Gaussians would count again
  for (const [at, name] of names.entries()) {
    const inside = nameInside(name);
    expectThat(inside !== null, `/filenames/${at}`,
               `leaves the folder, or has other signs (expected ${SIGNS}, found ${JSON.stringify(name.slice(0, 80))})`);
    expectThat(!seen.has(inside), `/filenames/${at}`,
               `names a file a second time (expected each once, found ${JSON.stringify(inside)})`);
    seen.add(inside);
  }
  const scene = {files: names.map((name) => ({name, pieces: []})), leaves: [], pieces: [], levels, count: 0,
                 own: readOwn(meta[LEVELS])};
  const readPiece = (lod, level, where) => {
    if (!lod || lod.count === 0) return null;
    const {file, offset: first = 0, count} = lod;
    if (!isCount(file, 0, names.length - 1)) {
      throw complaint(`${where}/lods/${level}/file`, `${file} (expected 0 to ${names.length - 1})`);
    }
    if (!isCount(first, 0, MOST_COUNT) || !isCount(count, 1, MOST_COUNT)) {
      throw complaint(`${where}/lods/${level}`, `offset ${first}, count ${count}`);
    }
    const piece = {level, file: scene.files[file], first, count};
    scene.files[file].pieces.push(piece);
    scene.pieces.push(piece);
    return piece;
  };
  const ranges = new Map(scene.files.map((file) => [file, []]));  // pieces without those that a leaf repeats
  const left = [[meta.tree, '/tree']];  // JSON holds no circles
  for (let nodes = 0; left.length > 0; ++nodes) {
    if (nodes % NODES_AT_A_TIME === 0) await breathe();
    const [node, where] = left.pop();
    expectThat(node && typeof node === 'object', where, 'expected a node');
    const {children, lods} = node;
    if (!lods || children !== undefined) {
      const some = Array.isArray(children) && children.length + left.length <= MOST_LEAVES;
      expectThat(some, where, 'expected children or lods');
      for (let i = children.length - 1; i >= 0; --i) left.push([children[i], `${where}/children/${i}`]);
    }
    if (!lods) continue;
    expectThat(scene.leaves.length < MOST_LEAVES, where, `more than ${MOST_LEAVES} leaves`);
    const box = readBound(node.bound, `${where}/bound`);
    const means = node[MEANS] ? readBound(node[MEANS], `${where}/${MEANS}`) : box;
    const found = Array.from({length: levels}, (_, level) => readPiece(lods[level], level, where));
    const pieces = found.filter(Boolean);
    for (const [at, {file, first, count}] of pieces.entries()) {
      const same = (piece) => piece.file === file && piece.first === first && piece.count === count;
      if (!pieces.slice(0, at).some(same)) ranges.get(file).push({first, count});
    }
    if (pieces.length === 0) continue;
    scene.leaves.push({box, means, pieces, levels: filled(found)});
    scene.count += pieces[0].count;
  }
  expectThat(scene.leaves.length > 0, '/tree', 'expected a leaf with Gaussians');
  for (const [{name}, parts] of ranges) {  // else a small file is a large scene
    let end = 0;
    for (const {first, count} of parts.sort((a, b) => a.first - b.first)) {
      expectThat(first >= end, '/tree',
                 `ranges of Gaussians overlap in ${name} (expected one from ${end} on, found ${first})`);
      end = first + count;
    }
  }
  return scene;
}

const LEAST_PIXELS = 1;   // between Gaussians of a leaf on the screen: finer levels show nothing more
const LEAST_SIZE2 = 1e-12;
const VIEW_MARGIN = 0.1;       // around the picture, of its sides

// Whether a box reaches into what the camera sees, with a margin.
function isInView({low, high}, planes, eye) {
  return planes.every((a) => {
    let sum = 0;
    for (let k = 0; k < 3; ++k) sum += a[k] * ((a[k] >= 0 ? high[k] : low[k]) - eye[k]);
    return sum >= 0;
  });
}

function planesOf({axes: [right, down, ahead], fx, fy, cx, cy, width, height}) {
  const x = VIEW_MARGIN * width, y = VIEW_MARGIN * height;
  const sum = (f, a, g) => a.map((_, k) => f * a[k] + g * ahead[k]);
  const difference = (g, f, a) => a.map((_, k) => g * ahead[k] - f * a[k]);
  return [ahead, sum(fx, right, cx + x), difference(width - cx + x, fx, right), sum(fy, down, cy + y),
          difference(height - cy + y, fy, down)];
}

// A heap of [error, leaf], the largest error first, of equal ones the first leaf.
class Errors {
  constructor() { this.list = []; }

  before(a, b) { return a[0] > b[0] || (a[0] === b[0] && a[1] < b[1]); }

  push(item) {
    const {list} = this;
    let at = list.length;
    list.push(item);
    for (let up; at > 0 && this.before(item, list[up = (at - 1) >> 1]); at = up) list[at] = list[up];
    list[at] = item;
  }

  pop() {
    const {list} = this;
    const [first] = list, last = list.pop();
    if (list.length === 0) return first;
    let at = 0;
    for (let child; (child = 2 * at + 1) < list.length; at = child) {
      if (child + 1 < list.length && this.before(list[child + 1], list[child])) ++child;
      if (!this.before(list[child], last)) break;
      list[at] = list[child];
    }
    list[at] = last;
    return first;
  }
}

// The level of each leaf that a view wants, as chooseLevels of converter/lod chooses it, to the bit (docs/lod.md): the
// squared distance of a leaf's Gaussians on the screen is brought down where it is largest, as long as `budget`
// Gaussians are not passed. {levels, errors: that distance in the coarsest level, [px^2], by leaf; 0 out of view}.
export function chooseLevels(scene, camera, budget) {
  const {leaves} = scene;
  const {eye, fx, fy} = camera;
  const planes = planesOf(camera), focal = Math.max(fx, fy), focal2 = focal * focal;
  const coarsest = scene.levels - 1;
  const levels = new Uint8Array(leaves.length).fill(coarsest);
  const errors = new Float64Array(leaves.length), sizes = new Float64Array(leaves.length);
  const heap = new Errors();
  let total = 0;
  // Of one Gaussian that filled the leaf.
  const pixels2 = ({low, high}) => {
    let size2 = 0, far2 = 0;
    for (let k = 0; k < 3; ++k) {
      const side = high[k] - low[k];
      const out = eye[k] < low[k] ? low[k] - eye[k] : eye[k] > high[k] ? eye[k] - high[k] : 0;
      size2 += side * side;
      far2 += out * out;
    }
    if (size2 === 0) size2 = LEAST_SIZE2;
    return focal2 * size2 / (far2 + 0.01 * size2);
  };
  const countAt = (leaf) => leaves[leaf].levels[levels[leaf]].count;
  for (const [leaf, {box, means}] of leaves.entries()) {
    total += countAt(leaf);
    if (!isInView(box, planes, eye)) continue;
    sizes[leaf] = pixels2(means);
    errors[leaf] = sizes[leaf] / countAt(leaf);
    heap.push([errors[leaf], leaf]);
  }
  while (heap.list.length > 0) {
    const [error, leaf] = heap.pop();
    if (error <= LEAST_PIXELS * LEAST_PIXELS) break;
    if (levels[leaf] === 0) continue;
    const more = total - countAt(leaf) + leaves[leaf].levels[levels[leaf] - 1].count;
    if (more > budget) break;
    total = more;
    --levels[leaf];
    heap.push([sizes[leaf] / countAt(leaf), leaf]);
  }
  return {levels, errors};
}

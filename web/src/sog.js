// SPDX-License-Identifier: Apache-2.0
// Reads a SOG file, version 2, with the textures that docs/sog.md defines, into what readGlb gives: the file's numbers
// are those of a PLY (x right, y down, z forward) and become glTF's by a half turn about z. The file is an archive, or
// lies in a folder, as the chunks of a scene with levels of detail do.
import {breathe} from './breathe.js';
import {INTERSECTIONS, MODES, OUTSIDES, TEXTURES} from './glb.js';
import {valueNamed} from './names.js';
import {decodeWebp, webpSize} from './webp.js';
import {readZip} from './zip.js';

const CODEBOOK = 256, PALETTE_COLUMNS = 64, FIRST_LARGEST = 252, NEUTRAL = 128;
const MOST_META = 16 << 20;       // [bytes]
const MOST_PER_BYTE = 4;          // Gaussians; as many as a million are always fine
// Pixels of an image, of each that is needed: some writers make it square, or its sides powers of two. As in
// converter/sog/read_sog.cpp; as many as the largest palette has are always fine.
const MOST_PER_NEEDED = 4, PIXELS_ALWAYS_ALLOWED = 1 << 22;
const ATLAS_SIDE = 4096;          // [texels]
const MOST_TEXELS = 1 << 25;
const OWN = 1, SHARED = 2, MOST_SHARED = 65536;  // versions: a texture a Gaussian, or one for several
const SHARED_STEP = 1 / 127;  // of a shared texture's texels, at least
const SH_C0 = 0.28209479177387814;
const AT_A_TIME = 4096;          // Gaussians between two looks at the clock
// Where textures are looked at for what stands in for them (docs/sog.md#textures).
const SAMPLES = Array.from({length: 12}, (_, i) => 3 * ((2 * i + 1) / 12 - 1));

const fromLogarithm = (x) => Math.sign(x) * Math.expm1(Math.abs(x));

function checkNumbers(list, count, where) {
  if (!Array.isArray(list) || list.length !== count || !list.every(Number.isFinite)) {
    throw new Error(`meta.json: ${where}: expected ${count} numbers`);
  }
  return list;
}

class SogFile {
  constructor(entries, meta, bytes) {
    Object.assign(this, {entries, meta});
    if (meta.version !== 2) throw new Error(`SOG version ${meta.version} (expected 2)`);
    this.count = meta.count;
    const most = Math.max(1 << 20, MOST_PER_BYTE * bytes);
    if (!(Number.isInteger(this.count) && this.count > 0 && this.count <= most)) {
      throw new Error(`meta.json: count ${this.count} (expected 1 to ${most} in ${bytes} bytes)`);
    }
  }

  part(name) {
    const part = this.meta[name];
    if (!part || typeof part !== 'object') throw new Error(`meta.json has no "${name}"`);
    return part;
  }

  // Pixels of image `index` of a part, at least `least` and not many more.
  async image(part, index, least) {
    const name = Array.isArray(part.files) ? part.files[index] : undefined;
    const entry = this.entries.get(name);
    if (!entry) throw new Error(`there is no image "${name}"`);
    const bytes = await entry(), most = Math.max(MOST_PER_NEEDED * least, PIXELS_ALWAYS_ALLOWED);
    try {
      const {width, height} = webpSize(bytes), found = width * height;
      if (found < least) throw new Error(`too few pixels (expected at least ${least}, found ${found})`);
      if (found > most) throw new Error(`too many pixels (expected at most ${most}, found ${found})`);
      return await decodeWebp(bytes);
    } catch (error) {
      throw new Error(`${name}: ${error.message}`, {cause: error});
    }
  }

  codebook(part) {
    const list = part.codebook;
    if (!Array.isArray(list) || list.length < 1 || list.length > CODEBOOK) throw new Error('meta.json: bad codebook');
    const repaired = list.length === CODEBOOK && list[0] === null;  // which a writer's bug left out (docs/sog.md)
    checkNumbers(repaired ? list.slice(1) : list, list.length - repaired, 'codebook');
    if (repaired) list[0] = list[1] + (list[1] - list[CODEBOOK - 1]) / (CODEBOOK - 1);
    return Float32Array.from({length: CODEBOOK}, (_, i) => list[Math.min(i, list.length - 1)]);
  }

  // body(i) for every Gaussian, in slices.
  async each(body) {
    for (let begin = 0; begin < this.count; begin += AT_A_TIME) {
      await breathe();
      for (let i = begin, end = Math.min(begin + AT_A_TIME, this.count); i < end; ++i) body(i);
    }
  }
}

async function readMeans(file) {
  const means = file.part('means');
  const low = checkNumbers(means.mins, 3, 'mins'), high = checkNumbers(means.maxs, 3, 'maxs');
  const {samples: lower} = await file.image(means, 0, file.count);
  const {samples: upper} = await file.image(means, 1, file.count);
  const mean = new Float32Array(3 * file.count);
  await file.each((i) => {
    for (let k = 0; k < 3; ++k) {
      const code = lower[4 * i + k] | upper[4 * i + k] << 8;
      const value = fromLogarithm(low[k] + (high[k] - low[k]) * code / 65535);
      mean[3 * i + k] = k === 2 ? value : -value;
    }
  });
  return mean;
}

async function readShape(file, model) {
  const scales = file.codebook(file.part('scales'));
  const {samples: sizes} = await file.image(file.part('scales'), 0, file.count);
  const {samples: turns} = await file.image(file.part('quats'), 0, file.count);
  const q = new Float64Array(4), s = new Float64Array(3);
  await file.each((i) => {
    readQuaternion(turns, 4 * i, q);
    for (let k = 0; k < 3; ++k) s[k] = scales[sizes[4 * i + k]];
    const normal = putNormalLast(s, q);
    const [w, x, y, z] = q;
    model.rotation.set([-y, x, w, -z], 4 * i);
    for (let k = 0; k < 3; ++k) model.scale[3 * i + k] = Math.exp(s[normal[k]]);
  });
}

// w, x, y, z: three components in bytes, the largest one left out.
function readQuaternion(bytes, at, q) {
  const largest = bytes[at + 3] - FIRST_LARGEST;
  q.fill(0);
  if (largest < 0) {
    q[0] = 1;
    return;
  }
  let rest = 1;
  for (let k = 0, from = at; k < 4; ++k) {
    if (k === largest) continue;
    q[k] = (bytes[from++] / 255 * 2 - 1) * Math.SQRT1_2;
    rest -= q[k] * q[k];
  }
  q[largest] = Math.sqrt(Math.max(rest, 0));
}

const ORDERS = [[1, 2, 0], [0, 2, 1], [0, 1, 2]];  // u, v, normal where the shortest axis is x, y, z

// Turns q's local axes so that the shortest, the first of equal ones, is z; returns their order.
function putNormalLast(s, q) {
  const shortest = s[1] < s[0] ? (s[2] < s[1] ? 2 : 1) : s[2] < s[0] ? 2 : 0;
  const [w, x, y, z] = q;
  if (shortest === 0) {         // a third of a turn about (1, 1, 1)
    q.set([0.5 * (w - x - y - z), 0.5 * (w + x + y - z), 0.5 * (w - x + y + z), 0.5 * (w + x - y + z)]);
  } else if (shortest === 1) {  // a quarter about x
    q.set([Math.SQRT1_2 * (w - x), Math.SQRT1_2 * (w + x), Math.SQRT1_2 * (y + z), Math.SQRT1_2 * (z - y)]);
  }
  return ORDERS[shortest];
}

async function readColors(file, model) {
  const first = file.codebook(file.part('sh0'));
  const {samples} = await file.image(file.part('sh0'), 0, file.count);
  await file.each((i) => {
    for (let k = 0; k < 3; ++k) model.sh[0][3 * i + k] = first[samples[4 * i + k]];
    model.opacity[i] = samples[4 * i + 3] / 255;
  });
  const more = file.meta.shN;
  if (!more) return;
  if (![0, 1, 2, 3].includes(more.bands)) throw new Error(`meta.json: shN: bands ${more.bands} (expected 0 to 3)`);
  const rest = (more.bands + 1) ** 2 - 1;
  if (rest === 0) return;
  const values = file.codebook(more);
  const rows = await file.image(more, 0, 1), {samples: labels} = await file.image(more, 1, file.count);
  if (rows.width !== PALETTE_COLUMNS * rest) throw new Error('the palette of SH has a wrong width');
  const held = Math.min(PALETTE_COLUMNS * rows.height, more.count);
  for (let c = 0; c < rest; ++c) model.sh.push(new Float32Array(3 * file.count));
  await file.each((i) => {
    const label = labels[4 * i] | labels[4 * i + 1] << 8;
    if (!(label < held)) throw new Error(`Gaussian ${i} has SH that the palette lacks`);
    for (let c = 0; c < rest; ++c) {
      const sign = c % 2 === 0 ? -1 : 1;  // of basis function c + 1 under the half turn
      for (let k = 0; k < 3; ++k) {
        model.sh[c + 1][3 * i + k] = sign * values[rows.samples[4 * (label * rest + c) + k]];
      }
    }
  });
}

// The share of each texel of an axis in the mean under the Gaussian: the integral of its hat over +-3 sigma.
function texelShares(size) {
  if (size === 1) return [1];
  const step = 6 / (size - 1), shares = new Float64Array(size);
  const fine = 64 * size;
  for (let i = 0; i < fine; ++i) {  // midpoints
    const u = -3 + 6 * (i + 0.5) / fine;
    const at = Math.min((u + 3) / step, size - 1.000001), cell = Math.floor(at), weight = Math.exp(-0.5 * u * u);
    shares[cell] += weight * (1 - at + cell);
    shares[cell + 1] += weight * (at - cell);
  }
  const sum = shares.reduce((a, b) => a + b);
  return Array.from(shares, (share) => share / sum);
}

function texelSpreads(width, height) {
  const u = texelShares(width), v = texelShares(height);
  const most = Math.max(...u) * Math.max(...v);
  return v.flatMap((row) => u.map((column) => Math.min((most / (row * column)) ** 0.7, 16)));
}

// Classes of textures of one size, by height, then width, placed on shelves of pages.
function placeTextures(sizes, count) {
  const classes = new Map();
  let texels = 0;
  for (let i = 0; i < count; ++i) {
    const width = sizes[4 * i], height = sizes[4 * i + 1];
    if (width === 0 || height === 0) continue;
    texels += width * height;
    const key = height * CODEBOOK + width;
    if (!classes.has(key)) classes.set(key, {width, height, textures: []});
    classes.get(key).textures.push(i);
  }
  if (texels > MOST_TEXELS) throw new Error(`${texels} texels are too many (expected at most ${MOST_TEXELS})`);
  const sorted = [...classes.keys()].sort((a, b) => a - b).map((key) => classes.get(key));
  const side = Math.min(Math.max(Math.ceil(Math.sqrt(texels)), 256), ATLAS_SIDE);
  const rects = new Uint16Array(4 * count), pages = new Float32Array(count);
  const heights = [0];
  let x = 0, y = 0, shelf = 0, page = 0;
  for (const {width, height, textures} of sorted) {
    for (const i of textures) {
      if (x + width > side || height > shelf) {
        x = 0;
        y += shelf;
        shelf = height;
      }
      if (y + height > ATLAS_SIDE) {
        heights[++page] = 0;
        x = y = 0;
        shelf = height;
      }
      rects.set([x, y, width, height], 4 * i);
      pages[i] = page;
      heights[page] = y + height;
      x += width;
    }
  }
  return {classes: sorted, texels, side, rects, pages, heights};
}

async function readLabels(file, part, stored) {
  const {samples} = await file.image(part, 2, file.count), labels = new Uint16Array(file.count);
  await file.each((i) => {
    labels[i] = samples[4 * i] | samples[4 * i + 1] << 8;
    if (labels[i] >= stored) throw new Error(`texture ${labels[i]} of Gaussian ${i} (expected below ${stored})`);
  });
  return labels;
}

// How much coarser a texture is than its texels' spreads, by how many Gaussians have it.
function sharedSpreads(labels, stored) {
  const members = new Uint32Array(stored);
  for (const label of labels) ++members[label];
  return Float64Array.from(members, (count) => 1 / Math.sqrt(Math.max(count, 1)));
}

// The rectangle and page of every Gaussian, whose label names one of the textures.
function handOut(labels, placed) {
  const rects = new Uint16Array(4 * labels.length), pages = new Float32Array(labels.length);
  for (let i = 0; i < labels.length; ++i) {
    rects.set(placed.rects.subarray(4 * labels[i], 4 * labels[i] + 4), 4 * i);
    pages[i] = placed.pages[labels[i]];
  }
  return {rects, pages};
}

async function readTextures(file, model, part) {
  const shared = part.version === SHARED;
  if (part.version !== OWN && !shared) throw new Error(`version ${part.version}`);
  const stored = shared ? part.textures : file.count;
  if (!(Number.isInteger(stored) && stored > 0 && (!shared || stored <= MOST_SHARED))) {
    throw new Error(`${stored} textures (expected 1 to ${MOST_SHARED})`);
  }
  const mode = valueNamed(MODES, part.mode), outside = valueNamed(OUTSIDES, part.outside);
  const intersection = valueNamed(INTERSECTIONS, part.intersection);
  if (mode === undefined || intersection === undefined || outside === undefined) {
    throw new Error(`mode "${part.mode}", intersection "${part.intersection}", outside "${part.outside}"`);
  }
  const steps = checkNumbers(part.steps, 2, 'steps');
  const {samples: sizes} = await file.image(part, 0, stored);
  const placed = placeTextures(sizes, stored);
  const labels = shared ? await readLabels(file, part, stored) : null;
  const {samples: bytes} = await file.image(part, 1, placed.texels);
  const {side, rects, pages, heights} = placed;
  const atlases = heights.map((height) => ({
    width: side, height: Math.max(height, 1), deep: true, texels: new Float32Array(4 * side * Math.max(height, 1)),
    scale: [1, 1, 1, 1], offset: [0, 0, 0, 0],
  }));
  const color = mode & MODES.rgb, alpha = mode & MODES.alpha;
  const coarser = shared ? sharedSpreads(labels, stored)
    : Float32Array.from(model.opacity, (o) => Math.min(Math.max(o, 1e-6) ** -0.35, 16));
  const least = shared ? SHARED_STEP : 0;
  let at = 0;
  for (const {width, height, textures} of placed.classes) {
    const spreads = texelSpreads(width, height);
    for (let t = 0; t < spreads.length; ++t) {
      for (let n = 0; n < textures.length; ++n, at += 4) {
        if (n % AT_A_TIME === 0) await breathe();
        const i = textures[n], spread = spreads[t] * coarser[i];
        const {texels} = atlases[pages[i]];
        const to = 4 * ((rects[4 * i + 1] + Math.floor(t / width)) * side + rects[4 * i] + t % width);
        const ofColor = Math.max(steps[0] * spread, least), ofAlpha = Math.max(steps[1] * spread, least);
        for (let k = 0; k < 3; ++k) texels[to + k] = color ? (bytes[at + k] - NEUTRAL) * ofColor : 0;
        texels[to + 3] = alpha ? Math.min(Math.max(1 + (bytes[at + 3] - NEUTRAL) * ofAlpha, 0), 1) : 1;
      }
    }
  }
  const own = shared ? handOut(labels, placed) : {rects, pages};
  const layer = {mode, intersection, atlases, ...own, opacity: model.opacity.slice(), dc: model.sh[0].slice()};
  if (shared) layer.scale = model.scale.slice();  // the base's are of the base alone
  await takeOffBase(file, layer);
  return {layer, intersection, outside};
}

// Texels and weights of the samples along an axis of `size` texels.
function tapsOf(size) {
  return SAMPLES.map((u) => {
    const at = (u + 3) / 6 * (size - 1), cell = Math.min(Math.floor(at), Math.max(size - 2, 0));
    return {first: cell, second: Math.min(cell + 1, size - 1), share: at - cell, at: u, weight: Math.exp(-0.5 * u * u)};
  });
}

// The mean of a texture: of alpha, and of colour weighted by it as well; and the area of what alpha leaves of the
// Gaussian, by its variances, over the Gaussian's.
function meanOf(texels, side, x, y, across, down, mean) {
  let red = 0, green = 0, blue = 0, alpha = 0, weights = 0, own = 0;
  let placeU = 0, placeV = 0, squareU = 0, squareV = 0;
  for (const v of down) {
    const upper = 4 * ((y + v.first) * side + x), lower = 4 * ((y + v.second) * side + x);
    for (const u of across) {
      const a = upper + 4 * u.first, b = upper + 4 * u.second, c = lower + 4 * u.first, d = lower + 4 * u.second;
      const wb = u.share * (1 - v.share), wc = (1 - u.share) * v.share, wd = u.share * v.share, wa = 1 - wb - wc - wd;
      const weight = u.weight * v.weight;
      const w = weight * (wa * texels[a + 3] + wb * texels[b + 3] + wc * texels[c + 3] + wd * texels[d + 3]);
      red += w * (wa * texels[a] + wb * texels[b] + wc * texels[c] + wd * texels[d]);
      green += w * (wa * texels[a + 1] + wb * texels[b + 1] + wc * texels[c + 1] + wd * texels[d + 1]);
      blue += w * (wa * texels[a + 2] + wb * texels[b + 2] + wc * texels[c + 2] + wd * texels[d + 2]);
      alpha += w;
      weights += weight;
      own += weight * u.at * u.at;
      placeU += w * u.at;
      placeV += w * v.at;
      squareU += w * u.at * u.at;
      squareV += w * v.at * v.at;
    }
  }
  const over = alpha > 0 ? 1 / alpha : 0;
  mean[0] = red * over;
  mean[1] = green * over;
  mean[2] = blue * over;
  mean[3] = alpha / weights;
  const varianceU = Math.max(squareU * over - (placeU * over) ** 2, 0);
  const varianceV = Math.max(squareV * over - (placeV * over) ** 2, 0);
  mean[4] = Math.sqrt(varianceU * varianceV) * weights / own;
}

// What stands in for alpha of some mean above 0 and area: a factor of the opacity and of the scales.
function standIn(alpha, area) {
  const part = Math.min(Math.max(area, alpha, 1 / 64), 1);
  const scale = Math.exp(-Math.round(-8 * Math.log(part)) / 16);
  return {opacity: Math.min(alpha / scale ** 2, 1), scale};
}

// Opacity, colour and, where they are fitted, scales as they were before what stands in for the textures went into them.
async function takeOffBase(file, layer) {
  const taps = new Map(), mean = new Float64Array(5);
  const tapsFor = (size) => taps.get(size) || taps.set(size, tapsOf(size)).get(size);
  const {rects, pages, atlases, opacity, dc, scale} = layer;
  for (let i = 0; i < file.count; ++i) {
    if (i % 256 === 0) await breathe();
    const width = rects[4 * i + 2], height = rects[4 * i + 3];
    if (width === 0) continue;
    const {texels, width: side} = atlases[pages[i]];
    meanOf(texels, side, rects[4 * i], rects[4 * i + 1], tapsFor(width), tapsFor(height), mean);
    for (let k = 0; k < 3; ++k) dc[3 * i + k] -= mean[k] / SH_C0;
    if (!(layer.mode & MODES.alpha && mean[3] > 0)) continue;
    const base = scale ? standIn(mean[3], mean[4]) : {opacity: mean[3]};
    opacity[i] = Math.min(opacity[i] / base.opacity, 1);
    for (let k = 0; scale && k < 3; ++k) scale[3 * i + k] /= base.scale;
  }
}

// The names of the images that a meta.json wants.
export function sogImages(meta) {
  return ['means', 'scales', 'quats', 'sh0', 'shN', TEXTURES].flatMap((key) => {
    const files = meta[key] && meta[key].files;
    return Array.isArray(files) ? files.filter((name) => typeof name === 'string') : [];
  });
}

export function parseSogMeta(bytes) {
  if (bytes.length > MOST_META) throw new Error('meta.json is too long');
  const meta = JSON.parse(new TextDecoder().decode(bytes));
  if (!meta || typeof meta !== 'object') throw new Error('meta.json is no object');
  return meta;
}

// entries: a map from the images' names to functions that give bytes; size: [bytes] of all there is; whole: textures
// that cannot be read are an error, too.
export async function readSogParts(meta, entries, size, {whole = false} = {}) {
  const file = new SogFile(entries, meta, size);
  const {count} = file;
  const mean = await readMeans(file);  // before there is room for the rest: who says a count holds means, too
  const model = {
    count, mean, rotation: new Float32Array(4 * count), scale: new Float32Array(3 * count),
    opacity: new Float32Array(count), sh: [new Float32Array(3 * count)], layer: null, cameras: [], views: [],
    background: [0, 0, 0], intersection: INTERSECTIONS.maxResponse, outside: OUTSIDES.base, notes: [],
  };
  await readShape(file, model);
  await readColors(file, model);
  const part = file.meta[TEXTURES];
  try {
    if (part) Object.assign(model, await readTextures(file, model, part));
  } catch (error) {
    if (whole && (part.version === OWN || part.version === SHARED)) throw error;
    model.notes.push(`The textures cannot be used (${error.message}): the picture is the base without them.`);
  }
  return model;
}

export async function readSog(bytes) {
  const entries = readZip(bytes);
  const json = entries.get('meta.json');
  if (!json) throw new Error('the archive holds no meta.json (expected a SOG file)');
  return readSogParts(parseSogMeta(await json()), entries, bytes.length);
}

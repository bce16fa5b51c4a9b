// SPDX-License-Identifier: Apache-2.0
// Reads a GLB with KHR_gaussian_splatting and TG_gaussian_splatting_texture (docs/gltf.md) into plain arrays.
import {breathe} from './breathe.js';
import {unpackMeshopt} from './meshopt.js';
import {valueNamed} from './names.js';
import {decodePng, pngSize} from './png.js';
import {decodeWebp, webpSize} from './webp.js';

const SPLATS = 'KHR_gaussian_splatting';
export const TEXTURES = 'TG_gaussian_splatting_texture';
const WEBP = 'EXT_texture_webp';
const OURS = 'textured_gaussians';  // extras of this toolchain
const MESHOPT = 'EXT_meshopt_compression';
const COMPONENTS = {
  5120: {array: Int8Array, largest: 127, get: 'getInt8'},
  5121: {array: Uint8Array, largest: 255, get: 'getUint8'},
  5122: {array: Int16Array, largest: 32767, get: 'getInt16'},
  5123: {array: Uint16Array, largest: 65535, get: 'getUint16'},
  5126: {array: Float32Array, largest: 1, get: 'getFloat32'},
};
const WIDTHS = {SCALAR: 1, VEC3: 3, VEC4: 4};
export const MODES = {alpha: 1, rgb: 2, rgba: 3};             // kMode* of shaders/shared/limits.h
export const INTERSECTIONS = {plane: 0, maxResponse: 1};      // kIntersect*
export const OUTSIDES = {base: 0, clip: 1, edge: 2};          // kOutside*
const MOST_ATLASES = 255;
const MOST_ATLASES_TEXELS = 1 << 28;  // of all images of a layer, as tgconvert has it; MAX_ATLAS_TEXELS each
const LEAST_NORM2 = 1e-12;            // of a quaternion that turns
const ZERO_SCALE_FRACTION = 1e-4;     // a scale of 0 is that of the smallest other one, as tgconvert has it
const POINT_SCALE = 1e-10;            // [world units] at least
const NUMBERS_AT_A_TIME = 65536;      // between two looks at the clock
const NODES_TO_BREATHE = 4096;

class GlbFile {
  constructor(bytes) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    if (bytes.length < 4 || view.getUint32(0, true) !== 0x46546C67) throw new Error('the file is no GLB');
    if (bytes.length < 20) throw new Error(`the GLB is cut off (${bytes.length} bytes, in its header)`);
    if (view.getUint32(4, true) !== 2) throw new Error(`GLB version ${view.getUint32(4, true)} (expected 2)`);
    const length = view.getUint32(8, true);
    if (length > bytes.length) {
      throw new Error(`the GLB is cut off (${bytes.length} of ${length} bytes): copy or export it again`);
    }
    if (length < bytes.length) throw new Error(`a GLB of ${length} bytes in a file of ${bytes.length}`);
    const jsonBytes = view.getUint32(12, true);
    if (20 + jsonBytes > bytes.length) throw new Error('the JSON of the GLB leaves the file');
    this.json = Object(JSON.parse(new TextDecoder().decode(bytes.subarray(20, 20 + jsonBytes))));
    this.binary = bytes.subarray(Math.min(20 + jsonBytes + 8, bytes.length));
    this.unpacked = new Map();  // views by index: several accessors may look into one
  }

  list(key) { return Array.isArray(this.json[key]) ? this.json[key] : []; }

  async viewBytes(index) {
    const view = this.list('bufferViews')[index];
    if (!view) throw new Error(`/bufferViews/${index}: missing`);
    const packed = view.extensions && view.extensions[MESHOPT];
    if (packed) {
      const source = this.range(packed, `/bufferViews/${index}/extensions/${MESHOPT}`);
      if (!this.unpacked.has(index)) this.unpacked.set(index, await unpackMeshopt(packed, source));
      return {bytes: this.unpacked.get(index), stride: packed.byteStride};
    }
    if (view.extensions) throw new Error(`/bufferViews/${index}: compressed data is not supported`);
    return {bytes: this.range(view, `/bufferViews/${index}`), stride: view.byteStride || 0};
  }

  // The bytes that a view, or what stands for one, names.
  range(view, where) {
    if (view.buffer !== 0 || (this.list('buffers')[0] || {}).uri !== undefined) {
      throw new Error(`${where}: its buffer is outside the file`);
    }
    const begin = view.byteOffset || 0, end = begin + view.byteLength;
    if (!(begin >= 0 && end <= this.binary.length)) throw new Error(`${where}: leaves the buffer`);
    return this.binary.subarray(begin, end);
  }

  // Count x width numbers as floats, normalised integers converted; `raw`: 16-bit integers as they are.
  async accessor(index, width, count, raw = false) {
    const where = `/accessors/${index}`;
    const accessor = this.list('accessors')[index];
    const component = accessor && valueNamed(COMPONENTS, String(accessor.componentType));
    if (!component || accessor.bufferView === undefined || accessor.sparse) throw new Error(`${where}: not supported`);
    if (WIDTHS[accessor.type] !== width) throw new Error(`${where}: wrong type ${accessor.type}`);
    if (accessor.count !== count) throw new Error(`${where}: wrong count (expected ${count}, found ${accessor.count})`);
    const {bytes, stride: given} = await this.viewBytes(accessor.bufferView);
    const size = component.array.BYTES_PER_ELEMENT;
    const offset = accessor.byteOffset || 0, stride = given || size * width;
    if (!(Number.isInteger(offset) && offset >= 0)) throw new Error(`${where}: bad byteOffset`);
    if (!(Number.isInteger(stride) && stride >= size * width)) throw new Error(`${where}: bad byteStride`);
    if (offset + (count - 1) * stride + size * width > bytes.length) throw new Error(`${where}: leaves its bufferView`);
    const start = bytes.byteOffset + offset;
    if (component.array === Float32Array && stride === 4 * width && start % 4 === 0) {
      return new Float32Array(bytes.buffer, start, count * width);
    }
    const out = raw ? new Uint16Array(count * width) : new Float32Array(count * width);
    const view = new DataView(bytes.buffer, start);
    const scale = accessor.normalized && !raw ? 1 / component.largest : 1;
    for (let i = 0; i < count; ++i) {
      if (i % 16384 === 0) await breathe();
      for (let k = 0; k < width; ++k) {
        const value = view[component.get](i * stride + k * size, true) * scale;
        out[i * width + k] = raw ? value : Math.max(value, accessor.normalized ? -1 : -Infinity);
      }
    }
    return out;
  }
}

const listOf = (value) => (Array.isArray(value) ? value : []);

// Indices of the nodes that the default scene, the first one where none is, begins with; of a file without scenes those
// that are no other node's children.
function rootsOf(file) {
  const scenes = file.list('scenes'), {scene = 0} = file.json;
  if (scenes.length > 0) {
    if (scenes[scene]) return listOf(scenes[scene].nodes);
    throw new Error(`/scene: names no scene (expected below ${scenes.length}, found ${scene})`);
  }
  const nodes = file.list('nodes'), below = new Set();
  for (const node of nodes) for (const child of listOf(Object(node).children)) below.add(child);
  return [...nodes.keys()].filter((index) => !below.has(index));
}

// The nodes of the scene, [{node, index, above: the one of these that it stands under, or null}].
async function placedNodes(file) {
  const nodes = file.list('nodes'), seen = new Set(), placed = [];
  const add = (index, above) => {
    if (!nodes[index]) throw new Error(`/nodes/${index}: missing`);
    if (seen.has(index)) throw new Error(`/nodes/${index}: is reached twice (expected a tree)`);
    seen.add(index);
    placed.push({node: nodes[index], index, above});
  };
  for (const root of rootsOf(file)) add(root, null);
  for (let next = 0; next < placed.length; ++next) {
    if (next % NODES_TO_BREATHE === 0) await breathe();
    for (const child of listOf(placed[next].node.children)) add(child, placed[next]);
  }
  return placed;
}

// The one node of the scene whose mesh has splats, as placedNodes() has it, and those primitives.
function findSplats(file, nodes) {
  const found = [];
  for (const placed of nodes) {
    for (const [k, primitive] of listOf(Object(file.list('meshes')[placed.node.mesh]).primitives).entries()) {
      if (!(primitive && primitive.extensions && primitive.extensions[SPLATS])) continue;
      const {mode = 4} = primitive;
      if (mode !== 0) {
        const where = `/meshes/${placed.node.mesh}/primitives/${k}/mode`;
        throw new Error(`${where}: wrong mode for splats (expected 0, POINTS, found ${JSON.stringify(mode)})`);
      }
      found.push({placed, primitive});
    }
  }
  if (found.length === 0) throw new Error(`the scene holds no splats (expected a primitive with ${SPLATS})`);
  const [{placed}] = found;
  if (found.some((other) => other.placed !== placed)) throw new Error('the splats stand under several nodes');
  return {placed, primitives: found.map(({primitive}) => primitive)};
}

function attributeOf(primitive, name) {
  const index = Object(primitive.attributes)[name];
  if (index === undefined) throw new Error(`the splats have no ${name}`);
  return index;
}

function countOf(file, primitive) {
  const position = file.list('accessors')[attributeOf(primitive, 'POSITION')];
  const count = position ? position.count : 0;
  if (!(Number.isInteger(count) && count > 0)) throw new Error('the file has no splats');
  return count;
}

// A node may move and scale uniformly (as quantised positions need); turning would have to turn the SH too.
function placeOf({node, index}) {
  const {translation = [0, 0, 0], rotation = [0, 0, 0, 1], scale = [1, 1, 1]} = node;
  const numbers = isNumbers(translation, 3) && isNumbers(rotation, 4) && isNumbers(scale, 3);
  const turned = !(Math.hypot(rotation[0], rotation[1], rotation[2]) < 1e-6 * Math.abs(rotation[3]));
  if (node.matrix || !numbers || turned || scale[0] !== scale[1] || scale[0] !== scale[2]) {
    throw new Error(`/nodes/${index}: the splats stand under a transform that is not supported (tgconvert applies it)`);
  }
  return {translation, scale: scale[0]};
}

// In the scene.
function placeInScene(placed) {
  const place = {translation: [0, 0, 0], scale: 1};
  for (let at = placed; at; at = at.above) {
    const {translation, scale} = placeOf(at);
    place.translation = place.translation.map((x, k) => translation[k] + scale * x);
    place.scale *= scale;
  }
  const where = `/nodes/${placed.index}`;
  if (![place.scale, ...place.translation].every(Number.isFinite)) {
    throw new Error(`${where}: the transform is not finite (expected finite numbers)`);
  }
  if (!(place.scale > 0)) {
    throw new Error(`${where}: the transform mirrors or flattens (expected a scale above 0, found ${place.scale})`);
  }
  return place;
}

// An image of an atlas by way of a texture, {width, height, decode: gives its numbers}.
async function openImage(file, index) {
  const texture = file.list('textures')[index];
  const webp = texture && texture.extensions && texture.extensions[WEBP];
  const source = texture && file.list('images')[(webp || texture).source];
  if (!source || source.bufferView === undefined) throw new Error('an atlas has no image in the file');
  const {bytes} = await file.viewBytes(source.bufferView);
  return webp ? {...webpSize(bytes), decode: () => decodeWebp(bytes)}
              : {...pngSize(bytes), decode: () => decodePng(bytes)};
}

// The images that a mode wants of each atlas, [{color, alpha}], none of them decoded: their headers say whether they
// are too large.
async function openAtlases(file, entries, mode) {
  if (!Array.isArray(entries) || entries.length === 0 || entries.length > MOST_ATLASES) {
    const found = Array.isArray(entries) ? entries.length : 'none';
    throw new Error(`no atlases, or too many (expected an array of 1 to ${MOST_ATLASES}, found ${found})`);
  }
  const opened = [];
  let texels = 0;
  const open = async (wanted, index) => {
    if (!wanted) return null;
    const image = await openImage(file, index);
    texels += image.width * image.height;
    if (texels > MOST_ATLASES_TEXELS) {
      const limits = `expected at most ${MOST_ATLASES_TEXELS} texels in all, found ${texels} so far`;
      throw new Error(`the atlases are too large (${limits})`);
    }
    return image;
  };
  for (const entry of entries.map(Object)) {
    opened.push({color: await open(mode & MODES.rgb, entry.color), alpha: await open(mode & MODES.alpha, entry.alpha)});
  }
  return opened;
}

async function readAtlas(entry, images) {
  const {scale = [1, 1, 1, 1], offset = [0, 0, 0, 0]} = Object(entry);
  if (!isNumbers(scale, 4) || !isNumbers(offset, 4)) throw new Error('scale or offset of an atlas is wrong');
  const color = images.color && await images.color.decode();
  const alpha = images.alpha && await images.alpha.decode();
  const {width, height, largest} = color || alpha;
  if (color && alpha && (alpha.width !== width || alpha.height !== height)) {
    throw new Error('colour and alpha of an atlas differ in size');
  }
  const deep = largest > 255 || (alpha && alpha.largest > 255);
  const texels = new (deep ? Float32Array : Uint8Array)(width * height * 4).fill(deep ? 1 : 255);
  const put = async (picture, channels, to) => {
    const grey = picture.channels < 3;
    for (let i = 0, n = width * height; i < n; ++i) {
      if (i % 65536 === 0) await breathe();
      for (let c = 0; c < channels; ++c) {
        const value = picture.samples[i * picture.channels + (grey ? 0 : c)];
        texels[4 * i + to + c] = deep ? value / picture.largest : value;
      }
    }
  };
  if (color) await put(color, 3, 0);
  if (alpha) await put(alpha, 1, 3);
  return {width, height, deep, texels, scale, offset};
}

// `atlases`: as the primitive before has read them, or none yet.
async function readLayer(file, primitive, atlases) {
  const {extensions} = primitive.extensions[SPLATS];
  const extension = extensions && extensions[TEXTURES];
  if (!extension) return null;
  const {mode: modeGiven, intersection: intersectionGiven = 'plane', extent = 3, filter = 'bilinear'} = extension;
  const mode = valueNamed(MODES, modeGiven), intersection = valueNamed(INTERSECTIONS, intersectionGiven);
  const refuse = (key, found, known) => {
    throw new Error(`${key} ${JSON.stringify(found)} is not supported (expected ${known})`);
  };
  if (mode === undefined) refuse('mode', modeGiven, Object.keys(MODES).join(', '));
  if (intersection === undefined) refuse('intersection', intersectionGiven, Object.keys(INTERSECTIONS).join(', '));
  if (extent !== 3) refuse('extent', extent, '3');
  if (filter !== 'bilinear') refuse('filter', filter, 'bilinear');
  const attribute = (name) => Object(primitive.attributes)[`${TEXTURES}:${name}`];
  const count = countOf(file, primitive);
  // As rules T13 and T14 have them.
  const integers = async (name, componentType, width) => {
    const index = attribute(name), found = Object(file.list('accessors')[index]);
    if (found.componentType !== componentType || found.normalized) {
      const kind = `${found.normalized ? 'normalized ' : ''}${found.componentType}`;
      throw new Error(`${name}: wrong component type (expected ${componentType}, not normalized, found ${kind})`);
    }
    return file.accessor(index, width, count, true);
  };
  const rects = await integers('RECT', 5123, 4);
  const pages = attribute('ATLAS') === undefined ? null : await integers('ATLAS', 5121, 1);
  if (!atlases) {
    const images = await openAtlases(file, extension.atlases, mode);
    atlases = [];
    for (const [k, entry] of extension.atlases.entries()) atlases.push(await readAtlas(entry, images[k]));
  }
  for (let i = 0; i < count; ++i) {
    if (i % 16384 === 0) await breathe();
    const x = rects[4 * i], y = rects[4 * i + 1], w = rects[4 * i + 2], h = rects[4 * i + 3];
    if (w === 0 || h === 0) {  // no texture: what else is said of it names nothing
      rects.fill(0, 4 * i, 4 * i + 4);
      if (pages) pages[i] = 0;
      continue;
    }
    const page = pages ? pages[i] : 0, atlas = atlases[page];
    if (!atlas) throw new Error(`splat ${i}: names no atlas (expected below ${atlases.length}, found ${page})`);
    if (x + w > atlas.width || y + h > atlas.height) throw new Error(`splat ${i}: its rectangle leaves the atlas`);
  }
  const optional = (name, width) =>
    attribute(name) === undefined ? null : file.accessor(attribute(name), width, count);
  return {mode, intersection, atlases, rects, pages, scale: await optional('SCALE', 3),
          opacity: await optional('OPACITY', 1), dc: await optional('SH_DEGREE_0_COEF_0', 3)};
}

const join = async (parts) => {
  if (parts.length === 1) return parts[0];
  if (parts.every((part) => part === null)) return null;
  if (parts.some((part) => part === null)) throw new Error('primitives differ in what they have');
  const all = new parts[0].constructor(parts.reduce((sum, part) => sum + part.length, 0));
  let at = 0;
  for (const part of parts) {
    all.set(part, at);
    at += part.length;
    await breathe();
  }
  return all;
};

// Of all primitives, which differ in their splats alone.
async function readLayers(file, primitives) {
  const texts = primitives.map(({extensions}) => {
    const own = extensions[SPLATS].extensions;
    return JSON.stringify((own && own[TEXTURES]) || null);
  });
  if (texts.some((text) => text !== texts[0])) throw new Error('primitives have textures of several kinds');
  const layers = [];
  for (const primitive of primitives) layers.push(await readLayer(file, primitive, layers.length > 0 && layers[0].atlases));
  if (layers[0] === null) return null;
  const joined = {...layers[0]};
  for (const key of ['rects', 'pages', 'scale', 'opacity', 'dc']) {
    joined[key] = await join(layers.map((layer) => layer[key]));
  }
  return joined;
}

// A pinhole camera of a node, or of what stands for one, or null: `own` is what this toolchain's files add.
function readCamera({name, rotation, translation}, lens, own) {
  const quaternion = rotation || [0, 0, 0, 1], eye = translation || [0, 0, 0];
  if (!isNumbers(quaternion, 4) || !isNumbers(eye, 3)) return null;
  const length = Math.hypot(...quaternion);
  const [x, y, z, w] = quaternion.map((component) => component / length);
  const axes = [  // glTF cameras look along -z with y up: a half turn about x
    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    [-2 * (x * y - w * z), -1 + 2 * (x * x + z * z), -2 * (y * z + w * x)],
    [-2 * (x * z + w * y), -2 * (y * z - w * x), -1 + 2 * (x * x + y * y)],
  ];
  const height = own.height || 720;
  const width = own.width || Math.round(height * (lens.aspectRatio || 16 / 9));
  const fy = own.fy || 0.5 * height / Math.tan(0.5 * lens.yfov);
  const known = own.cx !== undefined;
  const camera = {
    name: String(name || ''), test: own.split === 'test', width, height, fx: own.fx || fy, fy,
    cx: known ? own.cx : 0.5 * width, cy: known ? own.cy : 0.5 * height, axes, eye,
  };
  const numbers = [width, height, camera.fx, fy, camera.cx, camera.cy, ...axes.flat()];
  return Math.min(width, height, camera.fx, fy) > 0 && numbers.every(Number.isFinite) ? camera : null;
}

// Camera nodes of the scene as pinhole cameras: OpenCV axes (x right, y down, z forward), rows of camera_from_world.
// Those that no other node moves.
function readCameras(file, nodes) {
  const cameras = [];
  for (const {node, above} of nodes) {
    const lens = (file.list('cameras')[node.camera] || {}).perspective;
    if (!lens || node.matrix || above) continue;
    cameras.push(readCamera(node, lens, (node.extras && node.extras[OURS]) || {}));
  }
  return cameras.filter(Boolean);
}

// SCALE of a primitive, which the extension's first release candidate had as logarithms: of signed integers all, else
// where half of the splats have one below 0. Null where they are none.
function fromLogarithms(scale, componentType) {
  let negative = 0;
  for (let i = 0; i < scale.length; i += 3) negative += Math.min(scale[i], scale[i + 1], scale[i + 2]) < 0;
  const signed = componentType === 5120 || componentType === 5122;
  const floats = componentType === 5126 && negative > 0 && 6 * negative >= scale.length;
  return signed || floats ? scale.map(Math.exp) : null;
}

// Scales, none below 0, without one of 0; the list itself where it has none.
async function withoutZeroScales(list) {
  let own = list;
  for (let i = 0; i < list.length; i += 3) {
    if (i % (3 * NUMBERS_AT_A_TIME) === 0) await breathe();
    if (list[i] !== 0 && list[i + 1] !== 0 && list[i + 2] !== 0) continue;
    const others = list.subarray(i, i + 3).filter((scale) => scale !== 0);
    const least = others.length > 0 ? Math.min(...others) : 0;
    if (own === list) own = list.slice();
    for (let k = i; k < i + 3; ++k) own[k] = list[k] || Math.max(ZERO_SCALE_FRACTION * least, POINT_SCALE);
  }
  return own;
}

// Drops splats with numbers that are not finite or with a quaternion of length 0, takes the sign of scales and clamps
// opacities, as tgconvert does, each with a note, and gives scales of 0 a size. Lists that are fine stay as they are,
// which may be the file's bytes.
async function mendSplats(model) {
  const {layer, notes} = model;
  const lists = [[model, 'mean', 3], [model, 'rotation', 4], [model, 'scale', 3], [model, 'opacity', 1]];
  for (const k of model.sh.keys()) lists.push([model.sh, k, 3]);
  const ofLayer = (...known) => known.filter(([key]) => layer && layer[key]).map((one) => [layer, ...one]);
  lists.push(...ofLayer(['scale', 3], ['opacity', 1], ['dc', 3]));
  const dropped = new Uint8Array(model.count);
  for (const [owner, key, width] of lists) {
    const list = owner[key];
    for (let i = 0; i < list.length; ++i) {
      if (i % NUMBERS_AT_A_TIME === 0) await breathe();
      if (!Number.isFinite(list[i])) dropped[Math.floor(i / width)] = 1;
    }
  }
  const {rotation: q} = model;
  for (let i = 0; i < q.length; i += 4) {
    if (i % NUMBERS_AT_A_TIME === 0) await breathe();
    if (!(q[i] ** 2 + q[i + 1] ** 2 + q[i + 2] ** 2 + q[i + 3] ** 2 > LEAST_NORM2)) dropped[i / 4] = 1;
  }
  const say = (marks, words) => {
    const count = marks.reduce((sum, mark) => sum + mark, 0);
    if (count > 0) notes.push(`${count} splats with ${words}.`);
    return count;
  };
  const mend = async (key, mended, words) => {
    const marks = new Uint8Array(model.count);
    for (const [owner, , width] of lists.filter(([, name]) => name === key)) {
      const list = owner[key];
      let own = null;
      for (let i = 0; i < list.length; ++i) {
        if (i % NUMBERS_AT_A_TIME === 0) await breathe();
        const value = mended(list[i]);
        if (value === list[i]) continue;
        const splat = Math.floor(i / width);
        if (dropped[splat]) continue;
        own = own || list.slice();
        own[i] = value;
        marks[splat] = 1;
      }
      if (own) owner[key] = own;
    }
    say(marks, words);
  };
  await mend('opacity', (value) => Math.min(Math.max(value, 0), 1), 'an opacity outside [0, 1]: clamped');
  await mend('scale', Math.abs, 'a negative scale: sign dropped');
  for (const owner of [model, layer]) {
    if (owner && owner.scale) owner.scale = await withoutZeroScales(owner.scale);
  }
  const left = model.count - say(dropped, 'values that are not finite or a quaternion of length 0: dropped');
  if (left === 0) throw new Error('no splat is left: none had finite values');
  if (left === model.count) return;
  for (const [owner, key, width] of [...lists, ...ofLayer(['rects', 4], ['pages', 1])]) {
    const list = owner[key], kept = new list.constructor(width * left);
    for (let i = 0, to = 0; i < model.count; ++i) {
      if (i % 16384 === 0) await breathe();
      for (let k = 0; k < width && !dropped[i]; ++k) kept[to++] = list[width * i + k];
    }
    owner[key] = kept;
  }
  model.count = left;
}

const isNumbers = (value, length) => Array.isArray(value) && value.length === length && value.every(Number.isFinite);

// {count, mean, rotation (xyzw), scale, opacity, sh: [coefficient], layer or null, cameras, views: cameras that somebody
// has chosen, the first one to start with, background, intersection, outside, notes: [text]}. World space is the file's:
// y up, z forward.
export async function readGlb(bytes) {
  const file = new GlbFile(bytes);
  const nodes = await placedNodes(file);
  const {placed, primitives} = findSplats(file, nodes);
  for (const {extensions} of primitives) {
    const {kernel, colorSpace} = extensions[SPLATS];
    if (kernel !== 'ellipse') throw new Error(`unknown kernel "${kernel}" (expected "ellipse")`);
    if (colorSpace === 'lin_rec709_display') throw new Error('the colours are linear (tgconvert turns them to sRGB)');
  }
  const place = placeInScene(placed);
  const counts = primitives.map((primitive) => countOf(file, primitive));
  const count = counts.reduce((sum, more) => sum + more, 0);
  const all = async (name, width) => {
    const parts = [];
    for (const [k, primitive] of primitives.entries()) {
      parts.push(await file.accessor(attributeOf(primitive, name), width, counts[k]));
    }
    return join(parts);
  };
  const notes = [];
  const scales = async () => {
    const parts = [];
    for (const [k, primitive] of primitives.entries()) {
      const index = attributeOf(primitive, `${SPLATS}:SCALE`), stored = await file.accessor(index, 3, counts[k]);
      const scale = fromLogarithms(stored, file.list('accessors')[index].componentType);
      if (scale) notes.push('SCALE are logarithms, as the first release candidate of the extension had them.');
      parts.push(scale || stored);
    }
    return join(parts);
  };
  const own = (name, width) => all(`${SPLATS}:${name}`, width);
  const extras = (file.json.asset && file.json.asset.extras && file.json.asset.extras[OURS]) || {};
  const views = Array.isArray(extras.views) ? extras.views : [];
  const model = {
    count, mean: await all('POSITION', 3),
    rotation: await own('ROTATION', 4), scale: await scales(), opacity: await own('OPACITY', 1),
    sh: [await own('SH_DEGREE_0_COEF_0', 3)], layer: null, cameras: readCameras(file, nodes),
    views: views.map((view) => readCamera(Object(view), {}, Object(view))).filter(Boolean),
    background: isNumbers(extras.background, 3) ? extras.background : [0, 0, 0],
    intersection: valueNamed(INTERSECTIONS, extras.intersection) ?? INTERSECTIONS.maxResponse,
    outside: valueNamed(OUTSIDES, extras.outside) ?? OUTSIDES.base, notes,
  };
  for (let l = 1; l <= 3; ++l) {
    if (primitives.every(({attributes}) => Object(attributes)[`${SPLATS}:SH_DEGREE_${l}_COEF_0`] === undefined)) break;
    for (let k = 0; k <= 2 * l; ++k) model.sh.push(await own(`SH_DEGREE_${l}_COEF_${k}`, 3));
  }
  if (place.scale !== 1 || place.translation.some((t) => t !== 0)) {
    model.mean = model.mean.map((x, i) => x * place.scale + place.translation[i % 3]);
    model.scale = model.scale.map((s) => s * place.scale);
  }
  try {
    model.layer = await readLayers(file, primitives);
  } catch (error) {
    model.notes.push(`The textures cannot be used (${error.message}): the picture is the fallback without them.`);
  }
  if (model.layer) {
    model.intersection = model.layer.intersection;
    if (model.layer.scale && place.scale !== 1) model.layer.scale = model.layer.scale.map((s) => s * place.scale);
  }
  await mendSplats(model);
  return model;
}

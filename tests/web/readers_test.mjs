// SPDX-License-Identifier: Apache-2.0
// The package's readers without a browser: a file as it is, and spoilt: `node readers_test.mjs FILE.glb`. What cannot
// be read is refused with a sentence, never by a slip of the reader's own. The element is imported where there are no
// elements, as a server does. Pixels of WebP: tests/web/webp_test.mjs.
import {readFileSync} from 'node:fs';
import {runInNewContext} from 'node:vm';
import {cameraOf, matricesOf, readModel} from '../../web/src/index.js';
import {unpackMeshopt} from '../../web/src/meshopt.js';
import {GAUSSIAN_NUMBERS, packGaussian} from '../../web/src/pack.js';
import {readSogParts} from '../../web/src/sog.js';
import {readZip} from '../../web/src/zip.js';
import {formatView, parseView} from '../../web/src/view_text.js';
import {decodeWebp, webpSize} from '../../web/src/webp.js';

const failures = [];
const expect = (what, ok, found = '') => {
  if (!ok) failures.push(`${what}: ${found}`);
};
// A chunk VP8L of width = height = `side`, whose bits `write` puts behind its header.
const vp8lOf = (side, bytes, write) => {
  const out = new Uint8Array(bytes);
  let at = 0;
  const put = (value, count) => {
    for (let k = 0; k < count; ++k, ++at) out[at >> 3] |= (value >> k & 1) << (at & 7);
  };
  put(0x2F, 8);
  put(side - 1, 14);
  put(side - 1, 14);
  put(0, 1 + 3);  // no alpha, version 0
  write(put);
  return out;
};
const putOnly = (put, symbol) => {  // a prefix code of one symbol
  put(0b101, 3);
  put(symbol, 8);
};
const greyPixels = () => vp8lOf(8, 13, (put) => {  // 128 in all channels
  put(0, 3);  // no transforms, no cache, one group of codes
  for (const symbol of [128, 128, 128, 128, 0]) putOnly(put, symbol);
});
// As many groups of codes as there are blocks of 4 x 4 pixels, with tables much larger than what a file says of them.
const manyCodes = () => vp8lOf(1024, 1700000, (put) => {
  const putLengths = (lengths, count) => {
    put(0, 1);
    put(15, 4);
    for (let i = 0; i < 19; ++i) put(i < 2 || i === 8 ? 0 : 4, 3);  // lengths 0 to 15 take 4 bits each
    put(1, 1);
    put(3, 3);
    put(count - 2, 8);
    for (const length of lengths) [3, 2, 1, 0].forEach((k) => put(length >> k, 1));
  };
  put(0b100, 3 + 3);  // no transforms, no cache, blocks of 4 x 4
  put(0, 1);
  putLengths(new Array(256).fill(8), 256);
  putLengths(new Array(256).fill(8), 256);
  for (const symbol of [0, 0, 0]) putOnly(put, symbol);
  for (let i = 0; i < 65536; ++i) put(i, 16);
  const deep = [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 15];
  for (let i = 0; i < 5 * 17480; ++i) putLengths(deep, deep.length);
});
let seed = 1;
const random = (n) => (seed = (1103515245 * seed + 12345) % 2147483648) % n;

const original = new Uint8Array(readFileSync(process.argv[2]));
const model = await readModel(original.slice());
expect('the file is read', model.count > 0 && model.notes.length === 0, model.notes);
expect('numbers are finite', [model.mean, model.scale, model.rotation].every((list) => list.every(Number.isFinite)));

const jsonBytes = new DataView(original.buffer, original.byteOffset).getUint32(12, true);
let read = 0, refused = 0;
for (let i = 0; i < 400; ++i) {
  const bytes = original.slice(0, i % 4 === 0 ? random(original.length) : original.length);
  for (let k = 0; k < 3 && bytes.length > 0; ++k) {  // half of them in the JSON
    bytes[i % 2 === 0 ? random(bytes.length) : Math.min(20 + random(jsonBytes), bytes.length - 1)] = random(256);
  }
  try {
    await readModel(bytes);
    ++read;
  } catch (error) {
    ++refused;
    const own = error instanceof Error && !(error instanceof RangeError) && !(error instanceof ReferenceError) &&
      (!(error instanceof TypeError) || /decompress|inflate|deflate/i.test(`${error.message} ${error.code || ''}`));
    expect(`spoilt copy ${i}`, own, error.stack);
  }
}
expect('some are read and some refused', read > 0 && refused > 50, `${read} and ${refused}`);

// The same splats as two primitives that share their views.
{
  const gltf = JSON.parse(new TextDecoder().decode(original.subarray(20, 20 + jsonBytes)));
  const [first] = gltf.meshes[0].primitives;
  const second = structuredClone(first);
  const cut = Math.floor(model.count / 3);
  for (const [name, index] of Object.entries(first.attributes)) {
    const accessor = gltf.accessors[index], {byteStride} = gltf.bufferViews[accessor.bufferView];
    const bytes = {5121: 1, 5123: 2, 5126: 4}[accessor.componentType] * {SCALAR: 1, VEC3: 3, VEC4: 4}[accessor.type];
    second.attributes[name] = gltf.accessors.push({...accessor, count: model.count - cut,
                                                   byteOffset: cut * (byteStride || bytes)}) - 1;
    accessor.count = cut;
  }
  const fileOf = (primitives) => {
    gltf.meshes[0].primitives = primitives;
    const text = JSON.stringify(gltf), json = new TextEncoder().encode(text.padEnd(Math.ceil(text.length / 4) * 4));
    const rest = original.subarray(20 + jsonBytes), file = new Uint8Array(20 + json.length + rest.length);
    new Uint32Array(file.buffer, 0, 5).set([0x46546C67, 2, file.length, json.length, 0x4E4F534A]);
    file.set(json, 20);
    file.set(rest, 20 + json.length);
    return file;
  };
  const two = await readModel(fileOf([first, second]));
  expect('two primitives are one model', two.count === model.count && two.notes.length === 0, two.notes);
  const equal = (a, b) => a.length === b.length && a.every((x, k) => x === b[k]);
  for (const key of ['mean', 'rotation', 'scale', 'opacity']) expect(key, equal(two[key], model[key]));
  expect('sh', two.sh.length === model.sh.length && two.sh.every((band, k) => equal(band, model.sh[k])));
  for (const key of ['rects', 'opacity', 'dc']) expect(`${key} of the textures`, equal(two.layer[key], model.layer[key]));
  // Strides that no file has: a small one would stand for gigabytes.
  const view = gltf.bufferViews[gltf.accessors[first.attributes.POSITION].bufferView], {byteStride} = view;
  for (const stride of [1e-9, -12, 3, 12.5, '12']) {
    view.byteStride = stride;
    const said = await readModel(fileOf([first, second])).then(() => 'read', (error) => error.message);
    expect(`a stride of ${stride}`, said.endsWith(': bad byteStride'), said);
  }
  if (byteStride === undefined) delete view.byteStride;
  else view.byteStride = byteStride;
  for (const mode of [4, undefined, null, '0']) {
    const said = await readModel(fileOf([first, {...second, mode}])).then(() => 'read', (error) => error.message);
    const expected = `expected 0, POINTS, found ${JSON.stringify(mode === undefined ? 4 : mode)}`;
    expect(`splats of mode ${mode}`, said === `/meshes/0/primitives/1/mode: wrong mode for splats (${expected})`, said);
  }
  // Logarithms of the first release candidate: where half of the splats have one below 0.
  const kept = [first, second].map(({attributes}) => attributes['KHR_gaussian_splatting:SCALE']);
  for (const {attributes} of [first, second]) attributes['KHR_gaussian_splatting:SCALE'] = attributes.POSITION;
  const early = await readModel(fileOf([first, second]));
  let noted = 0, signs = 0;
  for (const [from, to] of [[0, cut], [cut, model.count]]) {
    const own = [...early.mean.subarray(3 * from, 3 * to)];
    const below = own.filter((x, k) => k % 3 === 0 && Math.min(x, own[k + 1], own[k + 2]) < 0).length;
    const logarithms = 2 * below >= to - from;
    const right = own.map((x) => (logarithms ? Math.fround(Math.exp(x)) : Math.abs(x) || 'of 0'));
    noted += logarithms;
    signs += logarithms ? 0 : below;
    const found = early.scale.subarray(3 * from, 3 * to);
    expect(`scales ${from} to ${to}`, right.every((x, k) => x === found[k] || (x === 'of 0' && found[k] > 0)), found);
  }
  const ofLogarithms = early.notes.filter((note) => note.includes('logarithms')).length;
  expect('logarithms are told', noted > 0 && ofLogarithms === noted && early.notes.length === noted + (signs > 0),
         early.notes);
  [first, second].forEach(({attributes}, k) => attributes['KHR_gaussian_splatting:SCALE'] = kept[k]);
  // A scale to use with the textures: any accessor of its type.
  const other = 'KHR_gaussian_splatting:SH_DEGREE_0_COEF_0', own = 'TG_gaussian_splatting_texture:SCALE';
  for (const {attributes} of [first, second]) attributes[own] = attributes[other];
  gltf.nodes[gltf.nodes.findIndex((node) => node.mesh === 0)].scale = [2, 2, 2];
  const scaled = await readModel(fileOf([first, second])), packed = new Float32Array(GAUSSIAN_NUMBERS);
  for (let k = 0; k < 3 * model.count; k += 1000) {
    packGaussian(scaled, Math.floor(k / 3), packed, 0);
    const value = 2 * model.sh[0][k];
    expect('scale to use with the texture', packed[8 + k % 3] === value && scaled.layer.scale[k] === value, packed);
    expect('scale without', scaled.scale[k] === 2 * model.scale[k], scaled.scale[k]);
  }
  // Under a node that moves and scales all; under one that turns it, and with linear light, it is refused.
  const above = {children: [gltf.nodes.findIndex((node) => node.mesh === 0)], translation: [1, 2, 3], scale: [3, 3, 3]};
  const roots = gltf.scenes[0].nodes;
  gltf.scenes[0].nodes = [gltf.nodes.push(above) - 1];
  const below = await readModel(fileOf([first, second]));
  expect('scale under a node', Math.abs(below.scale[5] / scaled.scale[5] - 3) < 1e-6, below.scale[5]);
  expect('place under a node', Math.abs(below.mean[4] - (2 + 3 * scaled.mean[4])) < 1e-5, below.mean[4]);
  above.rotation = [0, 1, 0, 0];
  const told = async () => readModel(fileOf([first, second])).then(() => 'read', (error) => error.message);
  expect('a turn above is told', (await told()).includes('transform that is not supported'), await told());
  gltf.nodes.pop();
  gltf.scenes[0].nodes = roots;
  first.extensions.KHR_gaussian_splatting.colorSpace = 'lin_rec709_display';
  expect('linear colours are told', (await told()).includes('colours are linear'), await told());
  first.extensions.KHR_gaussian_splatting.colorSpace = 'srgb_rec709_display';
  delete second.extensions.KHR_gaussian_splatting.extensions;
  const odd = await readModel(fileOf([first, second]));
  expect('textures of one primitive alone are told', odd.layer === null && odd.notes.length === 1, odd.notes);
}

const SPLATS = 'KHR_gaussian_splatting', TEXTURES = 'TG_gaussian_splatting_texture';
const jsonOf = () => JSON.parse(new TextDecoder().decode(original.subarray(20, 20 + jsonBytes)));

// The file with other JSON, other bytes of its buffer, and some behind them, which the last view then has.
function madeFile(change, {spoil = () => {}, more = null, stride} = {}) {
  const gltf = jsonOf();
  const binary = original.slice(28 + jsonBytes);
  if (more) {
    const byteOffset = binary.length;
    gltf.bufferViews.push({buffer: 0, byteOffset, byteLength: more.length, ...(stride ? {byteStride: stride} : {})});
    gltf.buffers[0].byteLength = byteOffset + more.length;
  }
  change(gltf, gltf.meshes[0].primitives[0]);
  const at = (name) => {
    const accessor = gltf.accessors[gltf.meshes[0].primitives[0].attributes[name]];
    return gltf.bufferViews[accessor.bufferView].byteOffset + (accessor.byteOffset || 0);
  };
  spoil(new DataView(binary.buffer), at, gltf);
  const text = JSON.stringify(gltf), json = new TextEncoder().encode(text.padEnd(Math.ceil(text.length / 4) * 4));
  const own = Math.ceil((binary.length + (more ? more.length : 0)) / 4) * 4;
  const file = new Uint8Array(28 + json.length + own);
  new Uint32Array(file.buffer, 0, 5).set([0x46546C67, 2, file.length, json.length, 0x4E4F534A]);
  file.set(json, 20);
  new DataView(file.buffer).setUint32(20 + json.length, own, true);
  new DataView(file.buffer).setUint32(24 + json.length, 0x004E4942, true);
  file.set(binary, 28 + json.length);
  if (more) file.set(more, 28 + json.length + binary.length);
  return file;
}
const layerOf = (primitive) => primitive.extensions[SPLATS].extensions[TEXTURES];
const toldOf = (promise) => promise.then(() => 'read', (error) => error.message);
const noteOf = async (change, options) => {
  const {layer, notes} = await readModel(madeFile(change, options));
  return layer === null && notes.length === 1 ? notes[0] : `${notes} (${layer ? 'textures' : 'none'})`;
};

// Names that every object has stand for nothing.
for (const name of ['constructor', 'toString', '__proto__', 'hasOwnProperty']) {
  for (const key of ['mode', 'intersection']) {
    const note = await noteOf((_, primitive) => { layerOf(primitive)[key] = name; });
    expect(`${key} ${name}`, note.includes(`${key} "${name}" is not supported (expected `), note);
  }
  const plain = await readModel(madeFile((gltf, primitive) => {
    delete primitive.extensions[SPLATS].extensions;
    gltf.asset.extras = {textured_gaussians: {intersection: name, outside: name}};
  }));
  expect(`extras of ${name}`, plain.intersection === 1 && plain.outside === 0, [plain.intersection, plain.outside]);
  const packed = {count: 4, byteStride: 8, mode: 'ATTRIBUTES', filter: name};
  const told = await toldOf(unpackMeshopt(packed, new Uint8Array(99)));
  expect(`filter ${name}`, told === `packed by ATTRIBUTES ${name} (not supported)`, told);
  const type = await toldOf(readModel(madeFile((gltf) => { gltf.accessors[0].componentType = name; })));
  expect(`component type ${name}`, type.endsWith('not supported'), type);
}

// Values that the extension does not know, and kinds of numbers that its rules do not allow.
for (const [key, value] of [['intersection', ''], ['intersection', 0], ['extent', 0], ['extent', 2], ['filter', ''],
                            ['filter', 'nearest']]) {
  const note = await noteOf((_, primitive) => { layerOf(primitive)[key] = value; });
  expect(`${key} ${JSON.stringify(value)}`, note.includes(`${key} ${JSON.stringify(value)} is not supported`), note);
}
{
  const rect = `${TEXTURES}:RECT`, atlas = `${TEXTURES}:ATLAS`;
  const withAtlas = (accessor) => (gltf, primitive) => {
    primitive.attributes[atlas] = gltf.accessors.push({bufferView: gltf.bufferViews.length - 1, componentType: 5121,
                                                       type: 'SCALAR', count: 4, ...accessor}) - 1;
  };
  const pages = {more: Uint8Array.of(0, 0, 0, 0, 9, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0), stride: 4};
  for (const change of [{normalized: true}, {componentType: 5122}]) {
    const note = await noteOf((gltf, {attributes}) => Object.assign(gltf.accessors[attributes[rect]], change));
    expect('RECT of another type', note.includes('RECT: wrong component type (expected 5123, not normalized'), note);
    const other = await noteOf(withAtlas(change), pages);
    expect('ATLAS likewise', other.includes('ATLAS: wrong component type (expected 5121, not normalized'), other);
  }
  const named = await noteOf(withAtlas({}), pages);
  expect('an atlas that there is not', named.includes('splat 1: names no atlas (expected below 1, found 9)'), named);
  for (const side of [2, 3]) {  // of no width, or of no height
    const {layer, notes} = await readModel(madeFile(withAtlas({}), {
      ...pages, spoil: (view, at) => view.setUint16(at(rect) + 8 + 2 * side, 0, true)}));
    expect('a splat without a texture may name any atlas', layer !== null && notes.length === 0, notes);
    expect('and names the first one', layer && layer.pages[1] === 0 && !layer.rects.subarray(4, 8).some(Boolean),
           layer && [...layer.pages, ...layer.rects]);
  }
  // What is to be decoded has a bound, which headers tell.
  const many = await noteOf((_, primitive) => {
    layerOf(primitive).atlases = new Array(256).fill(layerOf(primitive).atlases[0]);
  });
  expect('256 atlases', many.includes('(expected an array of 1 to 255, found 256)'), many);
  for (const atlases of [[], {length: 1}, 'x']) {
    const note = await noteOf((_, primitive) => { layerOf(primitive).atlases = atlases; });
    expect('no atlases', note.includes('expected an array of 1 to 255'), note);
  }
  const large = await noteOf((_, primitive) => {
    layerOf(primitive).atlases = new Array(3).fill(layerOf(primitive).atlases[0]);
  }, {spoil: (view, at, gltf) => {
    for (const {bufferView} of gltf.images) {
      for (const to of [16, 20]) view.setUint32(gltf.bufferViews[bufferView].byteOffset + to, 8192);
    }
  }});
  expect('5 images of 2^26 texels', large.includes('expected at most 268435456 texels in all, found 335544320'), large);
}

// Splats that no model has are put right as tgconvert does.
{
  const own = (name) => `${SPLATS}:${name}`;
  const put = (name, at, value) => (view, start) => view.setFloat32(start(name) + 4 * at, value, true);
  const spoil = (...changes) => ({spoil: (...given) => changes.forEach((change) => change(...given))});
  const file = madeFile(() => {});
  const untouched = await readModel(file);
  expect('what is fine is the file\'s bytes', untouched.mean.buffer === file.buffer && untouched.notes.length === 0);
  const spoilt = madeFile(() => {}, spoil(put(own('SCALE'), 1, -2), put(own('SCALE'), 2, -3),
                                          put(own('OPACITY'), 2, 1.5), put(`${TEXTURES}:OPACITY`, 3, -1)));
  const before = spoilt.slice();
  const mended = await readModel(spoilt);
  expect('signs and opacities are mended', mended.count === 4 && mended.scale[1] === 2 && mended.scale[2] === 3 &&
         mended.opacity[2] === 1 && mended.layer.opacity[3] === 0, [...mended.scale, ...mended.opacity]);
  expect('and told', mended.notes.join(' ') === '2 splats with an opacity outside [0, 1]: clamped. ' +
         '1 splats with a negative scale: sign dropped.', mended.notes);
  expect('not in the file\'s bytes', before.every((x, k) => x === spoilt[k]));
  const flat = await readModel(madeFile(() => {}, spoil(put(own('SCALE'), 0, 3), put(own('SCALE'), 1, 2),
                                                        put(own('SCALE'), 2, 0), put(own('SCALE'), 3, 0),
                                                        put(own('SCALE'), 4, 0), put(own('SCALE'), 5, 0))));
  expect('scales of 0 have a size', String([...flat.scale.subarray(0, 6)]) ===
         String([3, 2, 2e-4, 1e-10, 1e-10, 1e-10].map(Math.fround)) && flat.notes.length === 0, flat.scale);
  const without = (list, width) => [...list].filter((_, k) => Math.floor(k / width) !== 1);
  const same = (list, from, width) => String([...list]) === String(without(from, width));
  const places = [put('POSITION', 3, NaN), put('POSITION', 5, Infinity), put(own('ROTATION'), 4, NaN),
                  put(own('SCALE'), 4, NaN), put(own('OPACITY'), 1, NaN), put(own('SH_DEGREE_0_COEF_0'), 4, -Infinity),
                  put(`${TEXTURES}:OPACITY`, 1, NaN), put(`${TEXTURES}:SH_DEGREE_0_COEF_0`, 5, NaN),
                  (...given) => [4, 5, 6, 7].forEach((k) => put(own('ROTATION'), k, 0)(...given))];
  for (const [k, place] of places.entries()) {
    const {count, mean, rotation, scale, opacity, sh, layer, notes} = await readModel(madeFile(() => {}, spoil(place)));
    expect(`splat ${k} is dropped`, count === 3 && notes.join() ===
           '1 splats with values that are not finite or a quaternion of length 0: dropped.', notes);
    expect('the others stay', same(mean, model.mean, 3) && same(rotation, model.rotation, 4) &&
           same(scale, model.scale, 3) && same(opacity, model.opacity, 1) && same(sh[0], model.sh[0], 3));
    expect('and their textures', same(layer.rects, model.layer.rects, 4) &&
           same(layer.opacity, model.layer.opacity, 1) && same(layer.dc, model.layer.dc, 3));
  }
  const none = await toldOf(readModel(madeFile(() => {}, spoil(...[0, 3, 6, 9].map((k) => put('POSITION', k, NaN))))));
  expect('a model of nothing else is refused', none === 'no splat is left: none had finite values', none);
}

// Of the default scene's nodes alone, which neither mirror nor flatten.
{
  const under = (...scales) => (gltf) => {
    const [{nodes}] = gltf.scenes;
    for (const [k, factor] of scales.entries()) {
      const scale = [factor, factor, factor];
      if (k === 0) gltf.nodes[0].scale = scale;
      else nodes[0] = gltf.nodes.push({children: [nodes[0]], scale}) - 1;
    }
  };
  for (const [scales, words] of [[[0], 'mirrors or flattens'], [[-1], 'mirrors or flattens'], [[-1, -1], 'read'],
                                 [[1, -2], 'mirrors or flattens'], [[1e200, 1e200], 'not finite']]) {
    const told = await toldOf(readModel(madeFile(under(...scales))));
    expect(`scales of ${scales}`, told.includes(words), told);
  }
  const scenes = [
    ['of another scene', (gltf) => { gltf.scenes = [{nodes: [1]}, {nodes: [0]}]; }, 'the scene holds no splats'],
    ['of none', (gltf) => { gltf.scenes = [{}]; }, 'the scene holds no splats'],
    ['of the scene that is shown', (gltf) => Object.assign(gltf, {scenes: [{}, {nodes: [0]}], scene: 1}), 'read'],
    ['where there is no such', (gltf) => { gltf.scene = 7; }, '/scene: names no scene (expected below 1, found 7)'],
    ['of a file without scenes', (gltf) => { delete gltf.scenes; }, 'read'],
    ['in a ring', (gltf) => { gltf.nodes[0].children = [0]; }, '/nodes/0: is reached twice'],
    ['below a node that there is not', (gltf) => { gltf.scenes[0].nodes.push(9); }, '/nodes/9: missing'],
  ];
  for (const [what, change, words] of scenes) {
    const told = await toldOf(readModel(madeFile(change)));
    expect(`splats ${what}`, told.startsWith(words), told);
  }
  const {cameras} = await readModel(madeFile((gltf) => { gltf.scenes[0].nodes = [0]; }));
  expect('cameras of other scenes are none', cameras.length === 0 && model.cameras.length === 1, cameras.length);
  // What is no camera is left out, and turns nothing but by its angle.
  const of = (gltf) => gltf.nodes.find((node) => node.camera !== undefined);
  const own = (gltf, more) => Object.assign(of(gltf), {extras: {textured_gaussians: more}});
  for (const [what, change] of [
    ['a rotation of 5', (gltf) => { of(gltf).rotation = 5; }],
    ['a rotation of length 0', (gltf) => { of(gltf).rotation = [0, 0, 0, 0]; }],
    ['a rotation of three numbers', (gltf) => { of(gltf).rotation = [0, 0, 1]; }],
    ['a translation of 5', (gltf) => { of(gltf).translation = 5; }],
    ['a translation of words', (gltf) => { of(gltf).translation = 'abc'; }],
    ['fx below 0', (gltf) => own(gltf, {fx: -500})],
    ['fy below 0', (gltf) => own(gltf, {fy: -500})],
  ]) {
    const found = await readModel(madeFile(change)).catch((error) => ({cameras: [error.message]}));
    expect(`a camera with ${what}`, found.cameras.length === 0, JSON.stringify(found.cameras));
  }
  const longer = await readModel(madeFile((gltf) => { of(gltf).rotation = [0, 0, 3, 3]; }));
  const unit = await readModel(madeFile((gltf) => { of(gltf).rotation = [0, 0, Math.SQRT1_2, Math.SQRT1_2]; }));
  const apart = Math.max(...longer.cameras[0].axes.flat().map((x, k) => Math.abs(x - unit.cameras[0].axes.flat()[k])));
  expect('a rotation longer than 1', apart < 1e-12, apart);
}

// SOG: room only for what a file's images hold, and names as above.
{
  const shape = {means: {mins: [0, 0, 0], maxs: [1, 1, 1], files: ['means_l.webp', 'means_u.webp']}};
  const told = (meta, bytes) => toldOf(readSogParts({version: 2, ...shape, ...meta}, new Map(), bytes));
  const many = await told({count: 1300000}, 300000);
  expect('too few bytes', many === 'meta.json: count 1300000 (expected 1 to 1200000 in 300000 bytes)', many);
  const huge = await told({count: 4e9}, 1e9);
  expect('no room before there are images', huge === 'there is no image "means_l.webp"', huge);

  const pixels = greyPixels(), image = new Uint8Array(20 + pixels.length);
  new DataView(image.buffer).setUint32(0, 0x52494646);
  new DataView(image.buffer).setUint32(8, 0x57454250);
  new DataView(image.buffer).setUint32(12, 0x5650384C);
  image[16] = pixels.length;
  image.set(pixels, 20);
  const part = (...files) => ({files, codebook: [0, 1]});
  const entries = new Map(['a', 'b'].map((name) => [name, async () => image]));
  const read = (more) => readSogParts({version: 2, count: 50, means: {...shape.means, files: ['a', 'b']},
                                       scales: part('a'), quats: part('a'), sh0: part('a'), ...more}, entries, 1000);
  const plain = await read({});
  expect('a SOG is read', plain.count === 50 && plain.mean.length === 150 && plain.notes.length === 0, plain.notes);
  // Of a size that is not decoded: the file is cut off behind it.
  const sized = (width, height) => {
    const bytes = image.slice(0, 32);
    bytes[16] = 12;
    new DataView(bytes.buffer).setUint32(21, width - 1 | height - 1 << 14, true);
    return bytes;
  };
  for (const [width, height, count, words] of [
    [8192, 8192, 1, 'a: too many pixels (expected at most 4194304, found 67108864)'],
    [2049, 2048, 50, 'a: too many pixels (expected at most 4194304, found 4196352)'],
    [2048, 2048, 1, 'a: WebP: '], [4096, 2048, (1 << 21) - 1, 'a: too many pixels'], [4096, 2048, 1 << 21, 'a: WebP: '],
    [8, 4, 50, 'a: too few pixels (expected at least 50, found 32)'],
  ]) {
    const large = new Map([['a', async () => sized(width, height)]]);
    const meta = {version: 2, count, means: {...shape.means, files: ['a', 'a']}};
    const found = await toldOf(readSogParts(meta, large, 1 << 21));
    expect(`an image of ${width} x ${height} for ${count} Gaussians`, found.startsWith(words), found);
  }
  for (const name of ['constructor', 'toString', '__proto__']) {
    for (const key of ['mode', 'intersection', 'outside']) {
      const textures = {version: 1, mode: 'rgba', intersection: 'plane', outside: 'base', [key]: name, steps: [1, 1]};
      const {layer, notes} = await read({[TEXTURES]: textures});
      expect(`${key} ${name} of a SOG`, layer === null && String(notes).includes(`${key} "${name}"`), notes);
    }
  }
  for (const bands of ['length', 4, 'constructor', null]) {
    const words = await toldOf(read({shN: {...part('a', 'b'), bands, count: 64}}));
    expect(`SH of ${bands} bands`, words === `meta.json: shN: bands ${bands} (expected 0 to 3)`, words);
  }
}

// WebP: the pixels, whatever stands around them.
{
  const chunk = (name, ...bytes) => {
    const size = [bytes.length & 255, bytes.length >> 8, 0, 0];
    return [...new TextEncoder().encode(name), ...size, ...bytes, ...(bytes.length % 2 ? [0] : [])];
  };
  const file = (...chunks) => {
    const body = [...new TextEncoder().encode('WEBP'), ...chunks.flat()];
    return Uint8Array.from([...new TextEncoder().encode('RIFF'), body.length, 0, 0, 0, ...body]);
  };
  const pixels = chunk('VP8L', ...greyPixels()), extended = chunk('VP8X', 0x20, 0, 0, 0, 7, 0, 0, 7, 0, 0);
  const simple = file(pixels), profiled = file(extended, chunk('ICCP', 1, 2, 3), pixels, chunk('EXIF', 1, 2));
  for (const bytes of [simple, profiled]) {
    const {width, height} = webpSize(bytes), {samples} = await decodeWebp(bytes);
    expect('the size of a WebP', width === 8 && height === 8, [width, height]);
    expect('the pixels of a WebP', samples.length === 256 && samples.every((x) => x === 128), samples);
  }
  const huge = simple.slice();
  huge.set([0xFF, 0xFF, 0xFF, 0x0F], 21);
  const told = await toldOf(decodeWebp(huge));
  expect('a WebP of 2^28 pixels', told === 'WebP: bad size 16384 x 16384 (expected at most 67108864 texels)', told);
  const codes = manyCodes(), head = simple.slice(0, 20), many = new Uint8Array(20 + codes.length);
  new DataView(head.buffer).setUint32(16, codes.length, true);
  many.set(head);
  many.set(codes, 20);
  const room = await toldOf(decodeWebp(many));
  expect('a WebP of many codes', room === 'WebP: codes take too much room (expected at most 33554432 entries)', room);
  const others = [[file(chunk('VP8 ', ...new Array(20).fill(0))), 'WebP: lossy (expected lossless)'],
                  [file(extended, chunk('ALPH', 0), chunk('VP8 ', 0, 0)), 'WebP: lossy (expected lossless)'],
                  [file(extended, chunk('ANIM', 0, 0, 0, 0, 0, 0)), 'WebP: an animation (expected a single picture)'],
                  [file(extended), 'WebP: no pixels (expected a chunk VP8L)'],
                  [simple.slice(0, simple.length - 2), 'WebP: the file ends early'],
                  [new Uint8Array(30), 'an image is no WebP file']];
  for (const [bytes, words] of others) {
    let told = 'read';
    try { webpSize(bytes); } catch (error) { told = error.message; }
    expect('a WebP that is not read', told === words, told);
  }
}

// Cameras to matrices and back, with a model that is moved, turned and scaled.
const camera = {name: '', test: false, width: 640, height: 480, fx: 500, fy: 510, cx: 300, cy: 260,
                axes: [[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]], eye: [1, 2, 3]};
const {worldFromCamera: w, projection} = matricesOf(camera, 640, 480);
const viewFromModel = [w[0], w[4], w[8], 0, w[1], w[5], w[9], 0, w[2], w[6], w[10], 0,
                       -(w[0] * w[12] + w[1] * w[13] + w[2] * w[14]), -(w[4] * w[12] + w[5] * w[13] + w[6] * w[14]),
                       -(w[8] * w[12] + w[9] * w[13] + w[10] * w[14]), 1];
const near = (a, b) => a.flat().every((x, k) => Math.abs(x - b.flat()[k]) < 1e-6);
for (const [hand, scale] of [[1, 1], [1, 3], [-1, 1]]) {  // -1: a left-handed view
  const view = viewFromModel.map((x, k) => (k === 15 ? 1 : x * scale * (k % 4 === 2 ? hand : 1)));
  const p = projection.map((x, k) => (k >= 8 && k < 12 ? hand * x : x));
  const found = cameraOf(view, p, 640, 480);
  expect('a camera comes back', found !== null, hand);
  for (const key of ['axes', 'eye']) expect(key, near(found.camera[key], camera[key]), found.camera[key]);
  for (const key of ['fx', 'fy', 'cx', 'cy']) expect(key, near([found.camera[key]], [camera[key]]), found.camera[key]);
}
expect('a mirrored model is not drawn', cameraOf(viewFromModel.map((x, k) => (k < 4 ? -x : x)), projection, 9, 9) === null);
const back = parseView(formatView(camera, 4));
const eyeAt = (eye, distance) => parseView(formatView({...camera, eye}, distance)).eye;
for (const [eye, distance] of [[[51234.56, -4000.7, 12], 4], [[1e7 + 0.25, 0, -3], 2], [[0.001, 2, 3], 0.01]]) {
  expect(`an eye at ${eye}`, eyeAt(eye, distance).every((x, k) => Math.abs(x - eye[k]) <= 1e-4 * distance),
         eyeAt(eye, distance));
}
for (const zoom of [0.01, 100]) {  // wide and narrow lenses
  const lens = {...camera, fx: zoom * camera.fx, fy: zoom * camera.fy};
  expect('every lens is read again', parseView(formatView(lens, 4)) !== null, zoom);
}
expect('a view comes back from its word', back && back.distance === 4 &&
  back.axes.flat().every((x, k) => Math.abs(x - camera.axes.flat()[k]) < 1e-4), JSON.stringify(back));
for (const key of ['fx', 'fy', 'cx', 'cy']) {
  const scale = 480 / back.height;
  expect(`${key} of a view comes back`, Math.abs(back[key] * scale - camera[key]) < 0.02, back[key] * scale);
}
const square = {...camera, fx: 510, cx: 320, cy: 240};
expect('a plain lens is ten numbers', formatView(square, 4).split(',').length === 10, formatView(square, 4));
expect('and comes back', ['fx', 'fy', 'cx', 'cy'].every(
  (key) => Math.abs(parseView(formatView(square, 4))[key] * 480 / 720 - square[key]) < 0.02), '');
for (const text of ['', '1,2', '1,2,3,0,0,0,1,50,1,4,0,0.5,0.5', '1,2,3,0,0,0,1,50,1,4,1,0.5',
                    '1,2,3,0,0,0,1,50,1,x', '1,2,3,0,0,0,2,50,1,4', 'NaN,0,0,0,0,0,1,50,1,4']) {
  expect('a word that is no view', parseView(text) === null, text);
}
const end = new Uint8Array(22);
end.set([0x50, 0x4B, 5, 6]);  // of an archive without entries
expect('an archive without entries', readZip(end).size === 0, '');
expect('and with a comment', readZip(Uint8Array.of(...end, ...new Uint8Array(65535))).size === 0, '');
for (const bytes of [new Uint8Array(0), new Uint8Array(100), new Uint8Array([0x50, 0x4B, 3, 4]),
                     ...[...end.keys()].map((length) => end.slice(0, length)),
                     Uint8Array.of(...end, ...new Uint8Array(65536))]) {
  let told = '';
  try { readZip(bytes); } catch (error) { told = error.message; }
  expect('no archive', told.startsWith('the ZIP archive has no end of its directory'), told);
}
// What is cut off is told with how much there is, and of other formats what reads them.
for (const [bytes, words] of [
  [original.slice(0, 1000), `the GLB is cut off (1000 of ${original.length} bytes): copy or export it again`],
  [original.slice(0, 16), 'the GLB is cut off (16 bytes, in its header)'],
  [original.slice(0, 4), 'the GLB is cut off (4 bytes, in its header)'],
  [Uint8Array.of(...original, 0), `a GLB of ${original.length} bytes in a file of ${original.length + 1}`],
  [new TextEncoder().encode('ply\nformat'), 'a PLY file, of which tgconvert makes a GLB'],
  [new TextEncoder().encode('NGSP....'), 'an SPZ file, of which tgconvert makes a GLB'],
  [Uint8Array.of(0x1F, 0x8B, 8, 0), 'tgconvert makes a GLB of .tgz and .spz'],
  [new Uint8Array(64), '64 bytes that begin otherwise: if it is a .splat or .ksplat, tgconvert makes a GLB of it'],
]) {
  const told = await toldOf(readModel(bytes));
  expect('what is no model', told.includes(words), told);
}
const padded = new Uint8Array(original.length + 8);
padded.set(original, 4);
const foreign = runInNewContext(`new ArrayBuffer(${original.length})`);  // of another realm, as of a frame
new Uint8Array(foreign).set(original);
for (const same of [original.slice().buffer, foreign, new DataView(padded.buffer, 4, original.length)]) {
  const told = await readModel(same).then(({count}) => `${count}`, (error) => error.message);
  expect('the bytes of a buffer', told === `${model.count}`, told);
}
const others = [[null, 'null'], ['scene.glb', 'string'], [[1, 2], 'Array'], [undefined, 'undefined']];
for (const [other, found] of others) {
  const error = await readModel(other).catch((thrown) => thrown);
  expect('what are no bytes', error instanceof TypeError &&
    error.message === `readModel takes a Uint8Array or an ArrayBuffer (found ${found})`, error.message);
}
const imported = await import('../../web/src/element.js').catch((error) => error);
expect('the element without elements', typeof imported.TexturedGaussiansElement === 'function', imported.message);
console.log(failures.join('\n') || `${read} spoilt copies read, ${refused} refused`);
process.exit(failures.length > 0 ? 1 : 0);

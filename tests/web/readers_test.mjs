// SPDX-License-Identifier: Apache-2.0
// The package's readers without a browser: a file as it is, and spoilt: `node readers_test.mjs FILE.glb`. What cannot be
// read is refused with a sentence, never by a slip of the reader's own. WebP needs a browser: tests/web/package_test.py.
import {readFileSync} from 'node:fs';
import {cameraOf, matricesOf, readModel} from '../../web/src/index.js';
import {GAUSSIAN_NUMBERS, packGaussian} from '../../web/src/pack.js';
import {readZip} from '../../web/src/zip.js';
import {formatView, parseView} from '../../web/src/view_text.js';

const failures = [];
const expect = (what, ok, found = '') => {
  if (!ok) failures.push(`${what}: ${found}`);
};
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
  // Logarithms of the first release candidate: where half of the splats have one below 0.
  const kept = [first, second].map(({attributes}) => attributes['KHR_gaussian_splatting:SCALE']);
  for (const {attributes} of [first, second]) attributes['KHR_gaussian_splatting:SCALE'] = attributes.POSITION;
  const early = await readModel(fileOf([first, second]));
  let noted = 0;
  for (const [from, to] of [[0, cut], [cut, model.count]]) {
    const own = [...early.mean.subarray(3 * from, 3 * to)];
    const below = own.filter((x, k) => k % 3 === 0 && Math.min(x, own[k + 1], own[k + 2]) < 0).length;
    const logarithms = 2 * below >= to - from, right = logarithms ? own.map((x) => Math.fround(Math.exp(x))) : own;
    noted += logarithms;
    expect(`scales ${from} to ${to}`, equal(early.scale.subarray(3 * from, 3 * to), right));
  }
  expect('logarithms are told', noted > 0 && early.notes.length === noted && early.notes[0].includes('logarithms'),
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
  gltf.nodes.push(above);
  const below = await readModel(fileOf([first, second]));
  expect('scale under a node', Math.abs(below.scale[5] / scaled.scale[5] - 3) < 1e-6, below.scale[5]);
  expect('place under a node', Math.abs(below.mean[4] - (2 + 3 * scaled.mean[4])) < 1e-5, below.mean[4]);
  above.rotation = [0, 1, 0, 0];
  const told = async () => readModel(fileOf([first, second])).then(() => 'read', (error) => error.message);
  expect('a turn above is told', (await told()).includes('transform that is not supported'), await told());
  gltf.nodes.pop();
  first.extensions.KHR_gaussian_splatting.colorSpace = 'lin_rec709_display';
  expect('linear colours are told', (await told()).includes('colours are linear'), await told());
  first.extensions.KHR_gaussian_splatting.colorSpace = 'srgb_rec709_display';
  delete second.extensions.KHR_gaussian_splatting.extensions;
  const odd = await readModel(fileOf([first, second]));
  expect('textures of one primitive alone are told', odd.layer === null && odd.notes.length === 1, odd.notes);
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
for (const bytes of [new Uint8Array(0), new Uint8Array(100), new Uint8Array([0x50, 0x4B, 3, 4])]) {
  let told = '';
  try { readZip(bytes); } catch (error) { told = error.message; }
  expect('no archive', told.startsWith('the ZIP'), told);
}
console.log(failures.join('\n') || `${read} spoilt copies read, ${refused} refused`);
process.exit(failures.length > 0 ? 1 : 0);

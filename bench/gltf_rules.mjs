// SPDX-License-Identifier: Apache-2.0
// What `tgconvert check` and Khronos' validator say of a hundred spoilt copies of a sound GLB, side by side.
// In a folder with `npm install gltf-validator`: node .../bench/gltf_rules.mjs TGCONVERT docs/gltf-extension/sample.glb [FOLDER]
// FOLDER keeps the copies. Exit code 1 when `check` passes a copy that the validator refuses.
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import { beside, glb, partsOf } from './gltf_beside.mjs';

const [program, source, kept] = process.argv.slice(2);
const folder = kept ?? fs.mkdtempSync(path.join(os.tmpdir(), 'gltf-rules-'));
fs.mkdirSync(folder, { recursive: true });
const { text, bin } = partsOf(source);
const sound = JSON.parse(text);
const primitive = (g) => g.meshes[0].primitives[0];
const attribute = (g, name) => g.accessors[primitive(g).attributes[name]];
const position = (g) => attribute(g, 'POSITION');
const viewOf = (g, accessor) => g.bufferViews[accessor.bufferView];
const offsetOf = (g, accessor) => (viewOf(g, accessor).byteOffset ?? 0) + (accessor.byteOffset ?? 0);
const withCamera = (g, camera) => {
  g.cameras = [...(g.cameras ?? []), camera];
  g.nodes.push({ camera: g.cameras.length - 1 });
  g.scenes[0].nodes.push(g.nodes.length - 1);
};
const perspective = (values) => ({ type: 'perspective', perspective: { yfov: 1, znear: 0.1, ...values } });
const orthographic = (values) =>
  ({ type: 'orthographic', orthographic: { xmag: 1, ymag: 1, znear: 0.1, zfar: 10, ...values } });
const withMaterial = (g, material) => {
  g.materials = [material];
  primitive(g).material = 0;
};
const node = (g, values) => {
  g.nodes.push(values);
  g.scenes[0].nodes.push(g.nodes.length - 1);
};
const putFloat = (name, element, value) => (g, data) => data.writeFloatLE(value, offsetOf(g, attribute(g, name)) + 4 * element);

// name: what is done to the JSON and the bytes.
const spoilt = {
  nothing: () => {},
  'asset/missing': (g) => delete g.asset,
  'asset/no version': (g) => delete g.asset.version,
  'asset/version 3.0': (g) => (g.asset.version = '3.0'),
  'asset/version abc': (g) => (g.asset.version = 'abc'),
  'asset/version is a number': (g) => (g.asset.version = 2),
  'asset/minVersion above': (g) => (g.asset.minVersion = '2.5'),
  'asset/generator is a number': (g) => (g.asset.generator = 5),
  'bounds/no min': (g) => delete position(g).min,
  'bounds/no max': (g) => delete position(g).max,
  'bounds/min of 2': (g) => position(g).min.pop(),
  'bounds/max of 4': (g) => position(g).max.push(1),
  'bounds/min too low': (g) => (position(g).min[0] -= 1),
  'bounds/min too high': (g) => (position(g).min[0] += 1),
  'bounds/max too high': (g) => (position(g).max[2] += 1),
  'bounds/max too low': (g) => (position(g).max[2] -= 1),
  'bounds/min is text': (g) => (position(g).min[0] = 'x'),
  'bounds/of opacity': (g) => {
    const a = attribute(g, 'KHR_gaussian_splatting:OPACITY');
    a.min = [-1];
    a.max = [2];
  },
  'data/POSITION is NaN': putFloat('POSITION', 4, NaN),
  'data/SCALE is infinite': putFloat('KHR_gaussian_splatting:SCALE', 1, Infinity),
  'data/COLOR_0 above 1': (g, data) => {
    const a = attribute(g, 'COLOR_0') ?? position(g);
    Object.assign(a, { componentType: 5126, type: 'VEC4', normalized: false, count: 4 });
    delete a.min;
    delete a.max;
    data.writeFloatLE(7, offsetOf(g, a));
  },
  'accessor/no count': (g) => delete position(g).count,
  'accessor/count 0': (g) => (position(g).count = 0),
  'accessor/count -1': (g) => (position(g).count = -1),
  'accessor/count 1.5': (g) => (position(g).count = 1.5),
  'accessor/count too large': (g) => (position(g).count *= 100000),
  'accessor/other count': (g) => (attribute(g, 'KHR_gaussian_splatting:SCALE').count -= 1),
  'accessor/no type': (g) => delete position(g).type,
  'accessor/type VEC7': (g) => (position(g).type = 'VEC7'),
  'accessor/POSITION is VEC2': (g) => {
    position(g).type = 'VEC2';
    position(g).min.pop();
    position(g).max.pop();
  },
  'accessor/no componentType': (g) => delete position(g).componentType,
  'accessor/componentType 5124': (g) => (position(g).componentType = 5124),
  'accessor/normalized float': (g) => (position(g).normalized = true),
  'accessor/normalized is text': (g) => (position(g).normalized = 'yes'),
  'accessor/offset not aligned': (g) => (position(g).byteOffset = 2),
  'accessor/offset beyond': (g) => (position(g).byteOffset = 1 << 28),
  'accessor/offset without view': (g) => {
    g.accessors.push({ componentType: 5126, type: 'VEC3', count: 3, byteOffset: 4 });
  },
  'accessor/no such view': (g) => (position(g).bufferView = 999),
  'accessor/unused, no such view': (g) =>
    g.accessors.push({ bufferView: 999, componentType: 5126, type: 'VEC3', count: 1 }),
  'accessor/sparse count 0': (g) =>
    (position(g).sparse = {
      count: 0,
      indices: { bufferView: 0, componentType: 5123 },
      values: { bufferView: 0 },
    }),
  'accessor/sparse indices not rising': (g) =>
    (position(g).sparse = {
      count: 3,
      indices: { bufferView: position(g).bufferView, componentType: 5121 },
      values: { bufferView: position(g).bufferView },
    }),
  'accessor/sparse of floats': (g) =>
    (position(g).sparse = {
      count: 1,
      indices: { bufferView: 0, componentType: 5126 },
      values: { bufferView: 0 },
    }),
  'COLOR_0/SCALAR': (g) => (attribute(g, 'COLOR_0').type = 'SCALAR'),
  'COLOR_0/VEC2': (g) => (attribute(g, 'COLOR_0').type = 'VEC2'),
  'COLOR_0/not normalized': (g) => delete attribute(g, 'COLOR_0').normalized,
  'COLOR_0/short': (g) => (attribute(g, 'COLOR_0').componentType = 5122),
  'COLOR_0/other count': (g) => (attribute(g, 'COLOR_0').count -= 1),
  'view/no buffer': (g) => delete g.bufferViews[0].buffer,
  'view/no such buffer': (g) => (g.bufferViews[0].buffer = 9),
  'view/no byteLength': (g) => delete g.bufferViews[0].byteLength,
  'view/byteLength 0': (g) => (g.bufferViews[0].byteLength = 0),
  'view/leaves the buffer': (g) => (g.bufferViews[0].byteLength = 1 << 29),
  'view/byteOffset -4': (g) => (g.bufferViews[0].byteOffset = -4),
  'view/byteStride 2': (g) => (g.bufferViews[0].byteStride = 2),
  'view/byteStride 6': (g) => (g.bufferViews[0].byteStride = 6),
  'view/byteStride 256': (g) => (g.bufferViews[0].byteStride = 256),
  'view/byteStride below the element': (g) => (viewOf(g, position(g)).byteStride = 8),
  'view/target 5': (g) => (g.bufferViews[0].target = 5),
  'view/image with byteStride': (g) => (g.bufferViews[(g.images ?? [{ bufferView: 0 }])[0].bufferView].byteStride = 4),
  'buffer/no byteLength': (g) => delete g.buffers[0].byteLength,
  'buffer/byteLength 0': (g) => (g.buffers[0].byteLength = 0),
  'buffer/longer than BIN': (g) => (g.buffers[0].byteLength += 400),
  'buffer/second without uri': (g) => g.buffers.push({ byteLength: 4 }),
  'node/no such mesh': (g) => node(g, { mesh: 99 }),
  'node/no such camera': (g) => node(g, { camera: 99 }),
  'node/no such child': (g) => node(g, { children: [999] }),
  'node/no such skin': (g) => node(g, { skin: 3 }),
  'node/empty children': (g) => node(g, { children: [] }),
  'node/child twice': (g) => {
    g.nodes.push({});
    node(g, { children: [g.nodes.length - 1, g.nodes.length - 1] });
  },
  'node/own child': (g) => node(g, { children: [g.nodes.length] }),
  'node/two parents': (g) => {
    g.nodes.push({});
    const child = g.nodes.length - 1;
    node(g, { children: [child] });
    node(g, { children: [child] });
  },
  'node/unused ring': (g) => {
    const n = g.nodes.length;
    g.nodes.push({ children: [n + 1] }, { children: [n] });
  },
  'node/rotation of length 2': (g) => node(g, { rotation: [0, 0, 0, 2] }),
  'node/rotation of 3': (g) => node(g, { rotation: [0, 0, 1] }),
  'node/matrix of 12': (g) => node(g, { matrix: Array(12).fill(1) }),
  'node/matrix cannot be taken apart': (g) => node(g, { matrix: [1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1] }),
  'node/matrix and translation': (g) =>
    node(g, { matrix: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 0, 1], translation: [1, 0, 0] }),
  'node/weights without a mesh': (g) => node(g, { weights: [1] }),
  'scene/no such scene': (g) => (g.scene = 7),
  'scene/no such node': (g) => g.scenes[0].nodes.push(999),
  'scene/node twice': (g) => g.scenes[0].nodes.push(g.scenes[0].nodes[0]),
  'scene/node is a child': (g) => {
    g.nodes.push({});
    const child = g.nodes.length - 1;
    node(g, { children: [child] });
    g.scenes[0].nodes.push(child);
  },
  'scene/empty nodes': (g) => g.scenes.push({ nodes: [] }),
  'scenes/empty': (g) => (g.scenes = []),
  'camera/type': (g) => withCamera(g, { type: 'fisheye' }),
  'camera/no type': (g) => withCamera(g, { perspective: { yfov: 1, znear: 1 } }),
  'camera/no perspective': (g) => withCamera(g, { type: 'perspective' }),
  'camera/both': (g) => withCamera(g, { ...perspective({}), orthographic: orthographic({}).orthographic }),
  'camera/yfov 0': (g) => withCamera(g, perspective({ yfov: 0 })),
  'camera/no yfov': (g) => withCamera(g, perspective({ yfov: undefined })),
  'camera/yfov -1': (g) => withCamera(g, perspective({ yfov: -1 })),
  'camera/znear 0': (g) => withCamera(g, perspective({ znear: 0 })),
  'camera/no znear': (g) => withCamera(g, perspective({ znear: undefined })),
  'camera/zfar below znear': (g) => withCamera(g, perspective({ zfar: 0.01 })),
  'camera/aspectRatio 0': (g) => withCamera(g, perspective({ aspectRatio: 0 })),
  'camera/xmag 0': (g) => withCamera(g, orthographic({ xmag: 0 })),
  'camera/orthographic zfar below znear': (g) => withCamera(g, orthographic({ zfar: 0.01 })),
  'camera/orthographic znear -1': (g) => withCamera(g, orthographic({ znear: -1 })),
  'mesh/no primitives': (g) => (g.meshes[0].primitives = []),
  'mesh/no such attribute': (g) => (primitive(g).attributes._X = 999),
  'mesh/no such material': (g) => (primitive(g).material = 5),
  'mesh/no such indices': (g) => (primitive(g).indices = 999),
  'mesh/mode 9': (g) => (primitive(g).mode = 9),
  'mesh/COLOR_00': (g) => (primitive(g).attributes.COLOR_00 = primitive(g).attributes.COLOR_0),
  'mesh/attribute without _': (g) => (primitive(g).attributes.FOO = primitive(g).attributes.POSITION),
  'mesh/empty targets': (g) => (primitive(g).targets = []),
  'mesh/indices are floats': (g) => (primitive(g).indices = primitive(g).attributes.POSITION),
  'material/alphaMode': (g) => withMaterial(g, { alphaMode: 'GLASS' }),
  'material/baseColorFactor of 3': (g) => withMaterial(g, { pbrMetallicRoughness: { baseColorFactor: [1, 1, 1] } }),
  'material/metallicFactor 2': (g) => withMaterial(g, { pbrMetallicRoughness: { metallicFactor: 2 } }),
  'material/no such texture': (g) => withMaterial(g, { emissiveTexture: { index: 99 } }),
  'texture/no such source': (g) => (g.textures = [...(g.textures ?? []), { source: 99 }]),
  'texture/no such sampler': (g) => (g.textures = [...(g.textures ?? []), { sampler: 9 }]),
  'sampler/wrapS 5': (g) => (g.samplers = [{ wrapS: 5 }]),
  'sampler/magFilter 1': (g) => (g.samplers = [{ magFilter: 1 }]),
  'image/neither': (g) => (g.images = [...(g.images ?? []), {}]),
  'image/both': (g) => (g.images = [...(g.images ?? []), { uri: 'data:image/png;base64,AAAA', bufferView: 0, mimeType: 'image/png' }]),
  'image/no mimeType': (g) => (g.images = [...(g.images ?? []), { bufferView: 0 }]),
  'image/no such view': (g) => (g.images = [...(g.images ?? []), { bufferView: 999, mimeType: 'image/png' }]),
  'image/mimeType of text': (g) => (g.images = [...(g.images ?? []), { bufferView: 0, mimeType: 'text/plain' }]),
  'extensions/required and not used': (g) => (g.extensionsRequired = ['KHR_materials_unlit']),
  'extensions/listed twice': (g) => g.extensionsUsed.push(g.extensionsUsed[0]),
  'extensions/used and not listed': (g) => (g.extensionsUsed = []),
  'extensions/list of numbers': (g) => (g.extensionsUsed = [1]),
  'extensions/is a list': (g) => (g.extensions = []),
  'skin/no joints': (g) => (g.skins = [{}]),
  'skin/no such joint': (g) => (g.skins = [{ joints: [999] }]),
  'animation/no channels': (g) => (g.animations = [{ samplers: [] }]),
  'animation/no such sampler': (g) =>
    (g.animations = [{ samplers: [{ input: 999, output: 999 }], channels: [{ sampler: 9, target: { path: 'scale' } }] }]),
};

let missed = 0;
const count = { validator: 0, both: 0, ours: 0 };
for (const [name, spoil] of Object.entries(spoilt)) {
  const g = structuredClone(sound);
  const data = Buffer.from(bin);
  try {
    spoil(g, data);
  } catch (error) {
    console.log(`      ${name}: does not apply to this file (${error.message})`);
    continue;
  }
  const file = path.join(folder, name.replaceAll(/[^a-zA-Z0-9_]+/g, '_') + '.glb');
  fs.writeFileSync(file, glb(g, data));
  const { theirs, ours } = await beside(program, file);
  count.validator += theirs.length > 0;
  count.both += theirs.length > 0 && ours.length > 0;
  count.ours += ours.length > 0;
  const bad = theirs.length > 0 && ours.length === 0;
  missed += bad;
  console.log(`${bad ? 'MISSED' : '      '} ${name}: validator ${[...new Set(theirs.map((m) => m.code))].join(' ') || '-'}; ` +
              `check ${ours[0] ? `${ours[0].pointer} ${ours[0].message}` : '-'}`);
}
console.log(`${Object.keys(spoilt).length} files; the validator refuses ${count.validator}, check ${count.both} of those ` +
            `and ${count.ours} in all`);
if (!kept) fs.rmSync(folder, { recursive: true });
process.exit(missed > 0 ? 1 : 0);

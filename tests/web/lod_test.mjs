// SPDX-License-Identifier: Apache-2.0
// Scenes with levels of detail without a browser: `node lod_test.mjs CUTS.json`. What lod-meta.json may say and may
// not, where addresses may lead, and which levels a view wants: the same as the C++ library, by one file of cases
// (tests/goldens/lod_cuts.json), which `node lod_test.mjs CUTS.json --make` makes anew.
import {readFileSync, writeFileSync} from 'node:fs';
import {readCameraFile} from '../../web/src/camera_file.js';
import {addressIn} from '../../web/src/decoder.js';
import {chooseLevels, isLodMeta, parseLodMeta} from '../../web/src/lod.js';
import {planPool} from '../../web/src/pool.js';
import {LodStream, StreamedSplats} from '../../web/src/streamed.js';

setInterval(() => {}, 1000);  // long work in slices does not keep Node from ending
const failures = [];
const expect = (what, ok, found = '') => {
  if (!ok) failures.push(`${what}: ${found}`);
};
let seed = 7;
const random = () => (seed = (1103515245 * seed + 12345) % 2147483648) / 2147483648;
const between = (a, b) => Math.fround(a + (b - a) * random());
const bytesOf = (value) => new TextEncoder().encode(typeof value === 'string' ? value : JSON.stringify(value));

// A scene of `leaves` boxes, some of them flat or far, each a quarter as full from level to level; `gaps`: some leaves
// lack some levels.
function randomScene(leaves, levels, gaps) {
  const files = Array.from({length: levels}, (_, level) => `${level}_0/meta.json`);
  const first = new Array(levels).fill(0);
  const children = Array.from({length: leaves}, () => {
    const low = [between(-4, 4), between(-4, 4), between(-4, 4)];
    const size = random() < 0.1 ? 0 : between(0.01, 2);
    const means = {min: low, max: low.map((x) => Math.fround(x + size * random()))};
    const bound = {min: low.map((x) => Math.fround(x - 0.3 * random())),
                   max: means.max.map((x) => Math.fround(x + 0.3))};
    let count = 1 + Math.floor(8000 * random());
    const lods = {};
    for (let level = 0; level < levels; ++level, count = Math.max(Math.floor(count / 4), 1)) {
      if (gaps && random() < 0.3 && !(level === levels - 1 && Object.keys(lods).length === 0)) continue;
      lods[level] = {file: level, offset: first[level], count};
      first[level] += count;
    }
    return {bound, ...(gaps ? {} : {TG_means: means}), lods};
  });
  return {lodLevels: levels, filenames: files, tree: {bound: {min: [-9, -9, -9], max: [9, 9, 9]}, children}};
}

// In the file's axes, from the world to the camera, as the C++ library has it.
function randomCamera() {
  const q = [0, 0, 0, 0].map(() => random() - 0.5), length = Math.sqrt(q.reduce((sum, x) => sum + x * x, 0));
  const [x, y, z, w] = q.map((v) => v / length);
  const [width, height] = [640, 480], fx = between(200, 900);
  return {
    right: [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
    down: [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
    forward: [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
    translation: [between(-5, 5), between(-5, 5), between(-5, 5)], width, height, fx, fy: between(0.9, 1.1) * fx,
    cx: between(300, 340), cy: between(220, 260),
  };
}

const turned = ([x, y, z]) => [-x, -y, z];  // the file's axes to those of models here

function chosen(scene, camera, budget) {
  const {right, down, forward, translation: [x, y, z]} = camera;
  const eye = [0, 1, 2].map((k) => -(right[k] * x + down[k] * y + forward[k] * z));
  return chooseLevels(scene, {...camera, eye: turned(eye), axes: [right, down, forward].map(turned)}, budget).levels;
}

async function makeCuts() {
  const scenes = [];
  for (const [leaves, levels, gaps] of [[40, 4, false], [40, 4, true], [150, 6, false], [1, 1, false]]) {
    const meta = randomScene(leaves, levels, gaps);
    const scene = await parseLodMeta(bytesOf(meta));
    const cuts = Array.from({length: 12}, (_, i) => {
      const camera = randomCamera(), budget = [0, 5000, 50000, 1000000][i % 4];
      return {camera, budget, levels: [...chosen(scene, camera, budget)]};
    });
    scenes.push({meta, cuts});
  }
  return scenes;
}

const path = process.argv[2];
if (process.argv[3] === '--make') {
  writeFileSync(path, `[\n${(await makeCuts()).map((scene) => JSON.stringify(scene)).join(',\n')}\n]\n`);
  process.exit(0);
}

const scenes = JSON.parse(readFileSync(path, 'utf8'));
let differing = 0;
for (const {meta, cuts} of scenes) {
  const scene = await parseLodMeta(bytesOf(meta));
  const countOf = (levels) => scene.leaves.reduce((sum, leaf, i) => sum + leaf.levels[levels[i]].count, 0);
  const coarsest = countOf(scene.leaves.map(() => scene.levels - 1));
  for (const {camera, budget, levels} of cuts) {
    const found = chosen(scene, camera, budget);
    expect('levels are as before', String([...found]) === String(levels), `${[...found]} (expected ${levels})`);
    expect('the budget is kept', countOf(found) <= Math.max(budget, coarsest), countOf(found));
    differing += new Set(levels).size > 1;
  }
}
expect('the cases tell levels apart', scenes.length > 0 && differing > 10, differing);

// What is missing at a level is shown by the next finer one, else by the next coarser.
const gap = await parseLodMeta(bytesOf({
  lodLevels: 4, filenames: ['a/meta.json', 'b/meta.json'],
  tree: {bound: {min: [0, 0, 0], max: [1, 1, 1]}, lods: {1: {file: 0, offset: 0, count: 9}, 2: {file: 1, count: 2}}},
}));
expect('levels are filled', gap.leaves[0].levels.map(({level}) => level).join() === '1,1,2,2', gap.leaves[0].levels);
const {box, means} = gap.leaves[0];
expect('a box is turned, and stands for that of the means', box === means && box.low.join() === '-1,-1,0' &&
  box.high.join() === '0,0,1', box.low);

// A small file is no large scene: ranges of a file's Gaussians do not overlap, but those of one leaf.
{
  const bound = {min: [0, 0, 0], max: [1, 1, 1]};
  const scene = (...leaves) => parseLodMeta(bytesOf({lodLevels: 2, filenames: ['a/meta.json', 'b/meta.json'],
                                                     tree: {children: leaves.map((lods) => ({bound, lods}))}}))
    .then(({count}) => count, (error) => error.message);
  const range = (file, offset, count) => ({file, offset, count});
  const beside = await scene({0: range(0, 0, 9), 1: range(1, 0, 3)}, {0: range(0, 9, 4), 1: range(1, 3, 2)});
  expect('ranges beside one another', beside === 13, beside);
  const twice = await scene({0: range(0, 0, 9), 1: range(0, 0, 9)});
  expect('a range for two levels of a leaf', twice === 9, twice);
  const overlap = await scene({0: range(0, 0, 9), 1: range(1, 0, 3)}, {0: range(0, 5, 5), 1: range(1, 3, 2)});
  const words = (end, first) =>
    `lod-meta.json: /tree: ranges of Gaussians overlap in a/meta.json (expected one from ${end} on, found ${first})`;
  expect('ranges that overlap', overlap === words(9, 5), overlap);
  const same = await scene({0: range(0, 0, 9)}, {0: range(0, 0, 9)}, {0: range(0, 18, 9)});
  expect('ranges that overlap as much as they leave out', same === words(9, 0), same);
  const named = (name) => parseLodMeta(bytesOf({lodLevels: 1, filenames: ['a/meta.json', 'b/meta.json', name],
                                                tree: {bound, lods: {0: range(0, 0, 9)}}}))
    .then(() => 'read', (error) => error.message);
  for (const name of ['a/meta.json', './a/meta.json']) {
    const again = await named(name);
    expect('a file under two names', again ===
      'lod-meta.json: /filenames/2: names a file a second time (expected each once, found "a/meta.json")', again);
  }
  for (const name of ['a/./meta.json', 'b/../a/meta.json', '././a/meta.json', 'a\\meta.json', 'a/meta.json#1',
                      'a/meta.json?', 'a/meta.jso%6e', 'a//meta.json', ' /../a', '/a', '', 'a/', 'https://a/b',
                      '.hidden/meta.json', 'a\x1b[m', 'a\x9b[m', 'a\ud800', 'a'.repeat(5000)]) {
    const other = await named(name);
    expect('a name that is none in the folder', other.startsWith('lod-meta.json: /filenames/2: leaves the folder'),
           [name, other]);
  }
  const unusual = await named('a b (1)+2/m\u00e9ta \u96ea.json');
  expect('names of other signs', unusual === 'read', unusual);
  const apart = await scene({0: range(0, 10, 5)}, {0: range(0, 0, 9)});
  expect('ranges with a gap', apart === 14, apart);
}

// Of coarsest levels in many files a few are fetched at a time, and all of them, whichever fail.
{
  globalThis.document = {baseURI: 'http://server/'};
  const names = Array.from({length: 50}, (_, i) => `${i}/meta.json`), bound = {min: [0, 0, 0], max: [1, 1, 1]};
  const scene = await parseLodMeta(bytesOf({lodLevels: 1, filenames: names, tree: {
    children: names.map((_, file) => ({bound, lods: {0: {file, count: 1}}}))}}));
  const fetchWith = async (fails, stop) => {
    const stream = new LodStream(scene, 'lod-meta.json', 1);
    let now = 0, most = 0, begun = 0;
    stream.loader.load = async ({address}, signal) => {
      most = Math.max(most, ++now);
      if (++begun === 10 && stop) stop.abort();
      await new Promise((done) => setTimeout(done));
      --now;
      signal.throwIfAborted();
      if (fails(Number(address.split('/').at(-2)))) throw new Error(address);
      return {chunk: {textures: []}, mode: 0};
    };
    const {signal} = stop || new AbortController();
    const found = await stream.loadCoarsest(signal).then(
      ({chunks, errors}) => [chunks.map(({file}) => names.indexOf(file.name)), errors.length], (error) => error.name);
    return {most, found, begun};
  };
  const {most, found} = await fetchWith((file) => file % 3 === 0);
  expect('files of the coarsest levels at a time', most === 4, most);
  expect('those that came, in their order', found[1] === 17 && String(found[0]) ===
    String(names.map((_, i) => i).filter((i) => i % 3 !== 0)), JSON.stringify(found));
  const none = await fetchWith(() => true);
  expect('where the first ones fail no more are fetched', none.begun < 8 && none.found[1] === none.begun,
         JSON.stringify(none));
  const late = await fetchWith((file) => file < 4);
  expect('where one under way comes all are', late.begun === 50 && late.found[0].length === 46, JSON.stringify(late));
  const stopped = await fetchWith(() => false, new AbortController());
  expect('fetching that is stopped', stopped.found === 'AbortError', JSON.stringify(stopped));
}

// A larger budget gets no less room, and what the device has none for gets the most that there is.
for (const side of [2048, 4096, 8192, 16384]) {
  for (const [all, least, files] of [[2e7, 20480, 400], [2e7, 20480, side - 100], [2e7, 20480, side + 1],
                                     [1e6, 1e5, 40], [500, 20, 3]]) {
    for (const shCoefficients of [0, 15]) {
      const needs = {all, least, files, shCoefficients}, name = `${JSON.stringify(needs)} at ${side}`;
      let before = 0;
      for (let asked = 1000; asked < 1e8; asked *= 1.3) {
        const {perRow, rows, budget, most} = planPool(side, needs, Math.ceil(asked));
        const given = `${budget} for ${Math.ceil(asked)}, ${most} at most, ${rows} rows of ${perRow}`;
        expect(`no less of ${name}`, budget >= before && budget >= Math.min(Math.ceil(asked), most), given);
        expect(`a device has it: ${name}`, rows <= side && perRow * Math.max(5, shCoefficients) <= side, given);
        const places = Math.min(all, least + 1.5 * budget);
        expect(`room for ${name}`, rows >= Math.min(places / perRow + files, side), given);
        before = budget;
      }
      const fits = all <= (side - files) * Math.floor(side / Math.max(5, shCoefficients));
      expect(`all of ${name}`, fits === (before === Infinity), before);
    }
  }
}
expect('of the largest textures hardly anything is left', planPool(8192, {all: 2e7, least: 20480, files: 400,
       shCoefficients: 15}, 1e8).budget > 2.8e6);
{
  let told = '';
  try {
    planPool(1024, {all: 1e6, least: 1e5, files: 1, shCoefficients: 15}, 1);
  } catch (error) {
    told = error.message;
  }
  expect('coarsest levels that are too many', told.startsWith('100000 Gaussians are too many for this device'), told);
}

// What else goes wrong while a scene is put on a device takes no room from it, and where there is none that is told.
{
  const stream = new LodStream(gap, 'lod-meta.json', 1000);
  stream.first = [];
  const renderer = {gl: {getParameter: () => 4096, isContextLost: () => false},
                    linked: async () => { throw new Error('no shaders'); }};
  const told = await stream.open(renderer, {}, {}).then(() => 'opened', (error) => error.message);
  expect('a device without shaders', told === 'no shaders' && stream.memory === Infinity, [told, stream.memory]);

  const notes = [];
  for (const [budget, mostBudget] of [[5000, 3000], [5000, 0], [1000000, 3000], [5000, 6000]]) {
    StreamedSplats.prototype.tellRoom.call({stream: {budget, usualBudget: 1000000}, gpu: {mostBudget},
                                            model: {notes: []}, onNote: (words) => notes.push(words)});
  }
  expect('how much room there is', notes.join(' ') ===
    'This device has room for 3000 Gaussians of the scene at a time. ' +
    'This device has room for no more than the coarsest level of the scene at a time.', notes);
}

// Spoilt ones are refused with a sentence, never by a slip of the reader's own.
const good = randomScene(5, 3, false);
const own = {version: 1, sh_degree: 3, texture_mode: 'rgba', intersection: 'plane', outside: 'base',
             background: [0, 0, 0]};
const deep = (depth) => {
  let tree = good.tree.children[0];
  for (let i = 0; i < depth; ++i) tree = {bound: tree.bound, children: [tree]};
  return tree;
};
expect('a deep tree is read', (await parseLodMeta(bytesOf({...good, tree: deep(2000)}))).leaves.length === 1);
expect('what is ours is read', (await parseLodMeta(bytesOf({...good, TG_levels_of_detail: own}))).own.mode === 3);
const {background, ...unknown} = own;
expect('of a model that knows no background none is needed',
       (await parseLodMeta(bytesOf({...good, TG_levels_of_detail: unknown}))).own.background === undefined);
expect('a later version is passed over',
       (await parseLodMeta(bytesOf({...good, TG_levels_of_detail: {...own, version: 2}}))).own === null);
const changed = (path, value) => {
  const copy = structuredClone(good);
  const keys = path.split('/'), last = keys.pop();
  keys.reduce((at, key) => at[key], copy)[last] = value;
  return copy;
};
const spoilt = [
  'null', '{}', '{"lodLevels": 1', {...good, lodLevels: 0}, {...good, lodLevels: 1e9}, {...good, lodLevels: '3'},
  {...good, filenames: []}, {...good, filenames: [1]}, {...good, filenames: {}}, {...good, tree: null},
  {...good, tree: []}, {...good, tree: {children: []}}, {...good, tree: {children: 'x'}}, {...good, tree: {children: {length: 1e9}}},
  changed('tree/children/0/bound', {min: [1, 1, 1], max: [0, 0, 0]}), changed('tree/children/0/bound', {}),
  changed('tree/children/1/bound/min/0', null), 
  changed('tree/children/1/TG_means', {min: [0, 0, 0]}), changed('tree/children/1/bound/max', [1, 2]),
  changed('tree/children/0/lods/0/file', 3), changed('tree/children/0/lods/0/file', -1),
  changed('tree/children/0/lods/0/file', 'constructor'), changed('tree/children/0/lods/0/count', -5),
  changed('tree/children/0/lods/0/count', 1e300), changed('tree/children/0/lods/0/count', 1.5),
  changed('tree/children/0/lods/0/offset', -1), changed('tree/children/0/lods/0/offset', 2 ** 40),
  ...[['sh_degree', 4], ['texture_mode', 'toString'], ['intersection', 'x'], ['outside', 0], ['background', ['x', 0, 0]],
      ['cameras', 3]]
    .map(([key, value]) => ({...good, TG_levels_of_detail: {...own, [key]: value}})),
];
for (const [index, meta] of spoilt.entries()) {
  let told = null;
  try {
    await parseLodMeta(bytesOf(meta));
  } catch (error) {
    told = error;
  }
  const isOwn = told instanceof SyntaxError ||
    (told && told.constructor === Error && told.message.startsWith('lod-meta.json'));
  expect(`spoilt scene ${index}`, isOwn, told ? told.stack : 'is read');
}
expect('a lod-meta.json is known', isLodMeta(bytesOf(good)) && isLodMeta(bytesOf(` ${JSON.stringify(good)}`)));
expect('a glTF is none', !isLodMeta(bytesOf({asset: {version: '2.0'}})) && !isLodMeta(new Uint8Array(0)));

// Addresses stay in the scene's folder, whatever names say.
const folder = 'https://server/scenes/fox/';
expect('a chunk', addressIn(folder, `${folder}lod-meta.json`, '0_0/meta.json') === `${folder}0_0/meta.json`);
expect('an image', addressIn(folder, `${folder}0_0/meta.json`, 'sh0.webp') === `${folder}0_0/sh0.webp`);
for (const name of ['../x.webp', '/x', '//evil/scenes/fox/x', 'https://evil/x', 'data:,x', '%2e%2e/x', '.%2E/x',
                    '..\\x', '\t../x', 'a/../../x', 'https://server/scenes/foxes/x', 'http://server/scenes/fox/x',
                    'blob:x', 'http://[']) {
  let told = '';
  try { told = `is ${addressIn(folder, `${folder}lod-meta.json`, name)}`; } catch (error) { told = error.message; }
  expect(`the address ${name}`, /leads out|no address/.test(told), told);
}

const [camera] = readCameraFile(bytesOf([
  {img_name: 'a', width: 640, height: 480, fx: 500, fy: 510, position: [1, 2, 3],
   rotation: [[1, 0, 0], [0, 0, -1], [0, 1, 0]], split: 'test'},
  {width: 640}, null,
  {width: -1, height: 1, fx: 1, fy: 1, position: [0, 0, 0], rotation: [[1, 0, 0], [0, 1, 0], [0, 0, 1]]},
]));
expect('a camera is read', camera.test && camera.cx === 320 && camera.eye.join() === '-1,-2,3' &&
  camera.axes.flat().every((x, k) => x === [-1, 0, 0, 0, 0, 1, 0, 1, 0][k]), JSON.stringify(camera));
for (const none of [[null, {}], {}, 3]) {
  expect('what is no camera is left out', readCameraFile(bytesOf(none)).length === 0, JSON.stringify(none));
}

console.log(failures.join('\n') || `${scenes.length} scenes, ${spoilt.length} spoilt ones refused`);
process.exit(failures.length > 0 ? 1 : 0);

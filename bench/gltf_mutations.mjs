// SPDX-License-Identifier: Apache-2.0
// `tgconvert check` and Khronos' validator on seeded mutations of the JSON of sound GLB files: where one of them finds
// an error and the other none.
// In a folder with `npm install gltf-validator`: node .../bench/gltf_mutations.mjs TGCONVERT COUNT SEED GLB... [--keep FOLDER]
// COUNT mutations go round the files, one each. Prints a line for each that the two disagree on, then how many of each
// kind. FOLDER keeps the copies. Exit code 1 when `check` passes a copy that the validator refuses.
import fs from 'node:fs';
import os from 'node:os';
import path from 'node:path';

import { beside, glb, partsOf } from './gltf_beside.mjs';

const given = process.argv.slice(2);
const at = given.indexOf('--keep');
const kept = at < 0 ? null : given.splice(at, 2)[1];
const [program, count, seed, ...files] = given;
const folder = kept ?? fs.mkdtempSync(path.join(os.tmpdir(), 'gltf-mutations-'));
fs.mkdirSync(folder, { recursive: true });

// mulberry32: the same numbers everywhere.
let state = Number(seed);
function random(below) {
  state = (state + 0x6d2b79f5) | 0;
  let t = Math.imul(state ^ (state >>> 15), 1 | state);
  t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
  return Math.floor((((t ^ (t >>> 14)) >>> 0) / 4294967296) * below);
}
const pick = (list) => list[random(list.length)];

// Every place of the JSON but what is an application's own: its holder, key and pointer.
function places(value, pointer = '') {
  if (value === null || typeof value !== 'object') return [];
  return Object.keys(value).filter((key) => key !== 'extras').flatMap(
    (key) => [{ holder: value, key, pointer: `${pointer}/${key}` }, ...places(value[key], `${pointer}/${key}`)]);
}

// Places are drawn by the pointer without its indices first: else most were coordinates of cameras.
function pickPlace(json, fits) {
  const kinds = new Map();
  for (const place of places(json)) {
    if (!fits(place.holder[place.key], place)) continue;
    const kind = place.pointer.replaceAll(/\d+/g, '#');
    kinds.set(kind, [...(kinds.get(kind) ?? []), place]);
  }
  return kinds.size === 0 ? null : pick(pick([...kinds.values()]));
}

const isNumber = (value) => typeof value === 'number';
const isList = (value) => Array.isArray(value);
const anything = () => true;
const others = [null, true, -1, 1.5, 'x', {}, [], 1e30];
// name: [which values, what becomes of one].
const mutations = {
  drop: [anything, ({ holder, key }) => (isList(holder) ? holder.splice(key, 1) : delete holder[key])],
  type: [anything, ({ holder, key }) => {
    const fits = (value) => typeof value !== typeof holder[key] || isList(value) !== isList(holder[key]);
    holder[key] = structuredClone(pick(others.filter(fits)));
  }],
  dangling: [Number.isInteger, ({ holder, key }) => (holder[key] += 1000)],
  negative: [isNumber, ({ holder, key }) => (holder[key] = -Math.abs(holder[key]) - 4)],
  off_by_one: [Number.isInteger, ({ holder, key }) => (holder[key] += pick([-1, 1]))],
  not_whole: [Number.isInteger, ({ holder, key }) => (holder[key] += 0.5)],
  huge: [isNumber, ({ holder, key }) => (holder[key] = pick([2 ** 31, 2 ** 40, 1e300]))],
  zero: [isNumber, ({ holder, key }) => (holder[key] = 0)],
  nudged: [(value) => isNumber(value) && !Number.isInteger(value), ({ holder, key }) => (holder[key] *= 1.1)],
  text: [(value) => typeof value === 'string', ({ holder, key }) => (holder[key] += pick(['x', ' ', '_2']))],
  empty: [(value) => value !== null && typeof value === 'object' && Object.keys(value).length > 0,
          ({ holder, key }) => (holder[key] = isList(holder[key]) ? [] : {})],
  longer: [(value) => isList(value) && value.length > 0,
           ({ holder, key }) => holder[key].push(structuredClone(pick(holder[key])))],
  shorter: [(value) => isList(value) && value.length > 0, ({ holder, key }) => holder[key].pop()],
  renamed: [(value, { holder }) => !isList(holder), ({ holder, key }) => {
    holder[`${key}x`] = holder[key];
    delete holder[key];
  }],
};

const sources = files.map((file) => ({ name: path.basename(file, '.glb'), ...partsOf(file) }));
const tally = { both: 0, neither: 0, MISSED: 0, ours: 0 };
for (let k = 0; k < Number(count); ++k) {
  const source = sources[k % sources.length];
  const json = JSON.parse(source.text);
  const [name, [fits, mutate]] = pick(Object.entries(mutations));
  const place = pickPlace(json, fits);
  if (place === null) continue;
  const before = JSON.stringify(place.holder[place.key]);
  mutate(place);
  const after = JSON.stringify(place.holder[place.key]) ?? 'nothing';
  const file = path.join(folder, `${k}.glb`);
  fs.writeFileSync(file, glb(json, source.bin));
  const { theirs, ours } = await beside(program, file);
  const kind = theirs.length > 0 ? (ours.length > 0 ? 'both' : 'MISSED') : ours.length > 0 ? 'ours' : 'neither';
  ++tally[kind];
  if (kind === 'both' || kind === 'neither') continue;
  const said = kind === 'MISSED' ? `validator ${theirs[0].code} ${theirs[0].pointer}` :
      `check ${ours[0].pointer}: ${ours[0].message}`;
  console.log(`${kind} ${k} ${source.name} ${name} ${place.pointer}: ${before.slice(0, 40)} -> ${after.slice(0, 40)}; ${said}`);
}
console.log(`${Object.values(tally).reduce((a, b) => a + b)} files: both find an error in ${tally.both}, neither in ` +
            `${tally.neither}, check alone in ${tally.ours}, the validator alone in ${tally.MISSED}`);
if (!kept) fs.rmSync(folder, { recursive: true });
process.exit(tally.MISSED > 0 ? 1 : 0);

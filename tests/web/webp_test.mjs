// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files - whole, cut off, spoilt, and as no encoder writes them - are read as libwebp reads them, and
// refused with a sentence where it refuses them: `node webp_test.mjs tg_webp_cases` (webp_cases.cpp).
import {spawnSync} from 'node:child_process';
import {decodeWebp} from '../../web/src/webp.js';

const {stdout: cases, status, error: trouble} = spawnSync(process.argv[2], {maxBuffer: 1 << 28});
if (status !== 0) throw trouble || new Error(`${process.argv[2]} ended with ${status}`);
const failures = [];
let read = 0, refused = 0;
for (let at = 0; at < cases.length;) {
  const [nameSize, size, width, height] = [0, 4, 8, 12].map((k) => cases.readUInt32LE(at + k));
  const name = cases.toString('utf8', at += 16, at += nameSize);
  const file = cases.subarray(at, at += size), rgba = cases.subarray(at, at += 4 * width * height);
  try {
    const picture = await decodeWebp(file);
    const sides = `${picture.width} x ${picture.height}`, expected = `${width} x ${height}`;
    if (sides !== expected) {
      failures.push(`${name}: ${sides} (expected ${width > 0 ? expected : 'to be refused'})`);
    } else if (Buffer.compare(picture.samples, rgba) !== 0) {
      failures.push(`${name}: other numbers, from byte ${rgba.findIndex((x, i) => x !== picture.samples[i])} on`);
    }
    ++read;
  } catch (error) {
    if (width > 0 || !error.message.startsWith('WebP: ')) failures.push(`${name}: ${error.stack}`);
    ++refused;
  }
}
if (read < 1000 || refused < 1000) failures.push('too few files of a kind');
console.log(failures.slice(0, 20).join('\n') || `${read} files read, ${refused} refused, as libwebp does`);
process.exit(failures.length === 0 ? 0 : 1);

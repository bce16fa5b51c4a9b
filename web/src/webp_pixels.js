// SPDX-License-Identifier: Apache-2.0
// Pixels of lossless WebP files: VP8L as RFC 9649, section 3, defines it. Browsers' own decoders do not always give a
// file's numbers: some multiply colours by alpha whatever they are told, some add noise to what a page reads back.
import {breathe} from './breathe.js';

const HEADER_BITS = 8 + 2 * 14;   // signature and sides, which webp.js reads
const MOST_VP8L_BYTES = 1 << 29;  // positions have 32 bits; 2^26 pixels take at most 60 each
const PIXELS_AT_A_TIME = 65536;   // between two looks at the clock
const ROOT_BITS = 8;              // of a code that are looked up at once
const LONGEST = 15;               // [bits] of a code
const MOST_ENTRIES = 1 << 25;     // of all tables, of 2 bytes each
const LITERALS = 256, LENGTHS = 24, DISTANCES = 40, LENGTH_KINDS = 19, MOST_CACHE_BITS = 11;
const MOST_SYMBOLS = LITERALS + LENGTHS + (1 << MOST_CACHE_BITS);
const GROUP = 5;                  // codes: green with lengths and cached colours, red, blue, alpha, distance
const KIND_ORDER = [17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
const HASH = 0x1E35A7BD;
const BLACK = 0xFF000000 | 0;

// The 120 nearest places of pixels before one, {x to the left, y up}, in the order of their codes.
const NEAREST = Array.from({length: 128}, (_, i) => ({x: 8 - i % 16, y: Math.floor(i / 16)}))
  .filter(({x, y}) => x > 0 || y > 0)
  .sort((a, b) => a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y || Math.abs(a.x) - Math.abs(b.x) || b.x - a.x);

const broken = (what) => new Error(`WebP: ${what}`);

// 32 bits from bit `at` on; `words` has one more.
const bitsAt = (words, at) => words[at >>> 5] >>> at | words[(at >>> 5) + 1] << 1 << ~at;

class Vp8lBits {
  constructor(bytes) {
    if (bytes.length > MOST_VP8L_BYTES) throw broken(`${bytes.length} bytes (expected at most ${MOST_VP8L_BYTES})`);
    this.words = new Int32Array((bytes.length >> 2) + 4);
    new Uint8Array(this.words.buffer).set(bytes);
    this.end = 8 * bytes.length;
    this.at = HEADER_BITS;
  }

  moveTo(at) {
    if (at > this.end) throw broken('the file ends early');
    this.at = at;
  }

  read(count) {
    const bits = bitsAt(this.words, this.at) & (1 << count) - 1;
    this.moveTo(this.at + count);
    return bits;
  }

  symbol(tables, code) {
    const entry = lookUp(tables.entries, code >>> 4, (1 << (code & 15)) - 1, bitsAt(this.words, this.at));
    this.moveTo(this.at + (entry & 15));
    return entry >> 4;
  }
}

// symbol << 4 | length of the code that `bits` begin with.
function lookUp(entries, table, mask, bits) {
  const entry = entries[table + (bits & mask)], length = entry & 15;
  if (length <= ROOT_BITS) return entry;
  return entries[table + (entry >> 4) + (bits >>> ROOT_BITS & (1 << length - ROOT_BITS) - 1)];
}

// Tables of canonical codes, one behind the other. A code is named by place << 4 | bits that its first table takes. Its
// entries are what lookUp() gives; for codes of more than ROOT_BITS the first table has where their second one begins,
// counted from the first one, << 4 | bits of the longest of them.
class PrefixTables {
  constructor() {
    this.entries = new Uint16Array(1 << 14);
    this.used = 0;
    this.lengths = new Uint8Array(MOST_SYMBOLS);  // of the code to be added
    this.sorted = new Uint16Array(MOST_SYMBOLS);  // its symbols, short codes first
    this.codes = new Uint16Array(MOST_SYMBOLS);   // theirs, the first bit lowest
    this.counts = new Uint16Array(LONGEST + 1);
    this.starts = new Uint16Array(LONGEST + 2);
    this.deepest = new Uint8Array(1 << ROOT_BITS);
  }

  take(count) {
    const place = this.used;
    this.used += count;
    if (this.used > MOST_ENTRIES) throw broken(`codes take too much room (expected at most ${MOST_ENTRIES} entries)`);
    if (this.used > this.entries.length) {
      const larger = new Uint16Array(2 * this.entries.length);  // no code has more than 4096
      larger.set(this.entries);
      this.entries = larger;
    }
    return place;
  }

  // Sorts the symbols that have a length, and returns how many there are.
  sort(symbols) {
    const {lengths, sorted, counts, starts} = this;
    counts.fill(0);
    for (let s = 0; s < symbols; ++s) ++counts[lengths[s]];
    starts[1] = 0;
    let room = 1 << LONGEST;
    for (let length = 1; length <= LONGEST; ++length) {
      starts[length + 1] = starts[length] + counts[length];
      room -= counts[length] << LONGEST - length;
    }
    const coded = starts[LONGEST + 1];
    if (coded !== 1 && room !== 0) throw broken('lengths that make no prefix code');
    for (let s = 0; s < symbols; ++s) {
      if (lengths[s] > 0) sorted[starts[lengths[s]]++] = s;
    }
    return coded;
  }

  // The code of lengths [0, symbols).
  add(symbols) {
    const {lengths, sorted, codes, deepest} = this, coded = this.sort(symbols);
    if (coded === 1) {  // takes no bits
      const only = this.take(1);
      this.entries[only] = sorted[0] << 4;
      return only << 4;
    }
    // The next code, first bit lowest, is one more from its last bit on; longer ones go on with zeros.
    const rootBits = Math.min(lengths[sorted[coded - 1]], ROOT_BITS);
    let size = 1 << rootBits;
    deepest.fill(0);
    for (let i = 0, code = 0; i < coded; ++i) {
      const length = lengths[sorted[i]];
      codes[i] = code;
      if (length > ROOT_BITS) deepest[code & 0xFF] = length;
      let carry = 1 << length - 1;
      while (code & carry) carry >>= 1;
      code = code & carry - 1 | carry;
    }
    for (const length of deepest) size += length > 0 ? 1 << length - ROOT_BITS : 0;
    const root = this.take(size), {entries} = this;
    for (let i = 0, next = 1 << rootBits; i < deepest.length; ++i) {
      if (deepest[i] === 0) continue;
      entries[root + i] = next << 4 | deepest[i];
      next += 1 << deepest[i] - ROOT_BITS;
    }
    for (let i = 0; i < coded; ++i) {
      const length = lengths[sorted[i]], start = codes[i] & 0xFF;
      const skipped = length > ROOT_BITS ? ROOT_BITS : 0, step = 1 << length - skipped;
      const table = skipped > 0 ? root + (entries[root + start] >> 4) : root;
      const end = 1 << (skipped > 0 ? deepest[start] - ROOT_BITS : rootBits);
      for (let j = codes[i] >> skipped; j < end; j += step) entries[table + j] = sorted[i] << 4 | length;
    }
    return root << 4 | rootBits;
  }

  // A code as files have them, for symbols [0, symbols).
  read(stream, symbols) {
    const {lengths} = this;
    lengths.fill(0);
    if (stream.read(1) === 1) {
      const two = stream.read(1);
      lengths[stream.read(stream.read(1) === 1 ? 8 : 1)] = 1;
      if (two === 1) lengths[stream.read(8)] = 1;
      return this.add(symbols);
    }
    const kinds = 4 + stream.read(4);
    for (let i = 0; i < kinds; ++i) lengths[KIND_ORDER[i]] = stream.read(3);
    const mark = this.used, kindCode = this.add(LENGTH_KINDS);
    let left = stream.read(1) === 1 ? 2 + stream.read(2 + 2 * stream.read(3)) : symbols;
    if (left > symbols) throw broken(`a code of ${left} lengths (expected at most ${symbols})`);
    lengths.fill(0);
    for (let s = 0, previous = 8; s < symbols && left > 0; --left) {
      const kind = stream.symbol(this, kindCode);
      if (kind <= LONGEST) {
        lengths[s++] = kind;
        if (kind > 0) previous = kind;
        continue;
      }
      const count = kind === 16 ? 3 + stream.read(2) : kind === 17 ? 3 + stream.read(3) : 11 + stream.read(7);
      if (s + count > symbols) throw broken(`a code of ${s + count} lengths (expected at most ${symbols})`);
      if (kind === 16) lengths.fill(previous, s, s + count);
      s += count;
    }
    this.used = mark;
    return this.add(symbols);
  }
}

// Colours that were there lately, by their hashes.
function cacheColors(image, end) {
  const {pixels, cache, cacheShift} = image;
  for (let i = image.cached; i < end; ++i) cache[Math.imul(HASH, pixels[i]) >>> cacheShift] = pixels[i];
  image.cached = end;
}

// The number that a prefix of lengths or distances and the bits behind it stand for; and how many bits these are.
const extraBits = (prefix) => (prefix < 4 ? 0 : prefix - 2 >> 1);
function prefixed(prefix, bits) {
  if (prefix < 4) return prefix + 1;
  const extra = extraBits(prefix);
  return (2 + (prefix & 1) << extra) + (bits & (1 << extra) - 1) + 1;
}

// Copies image.copied pixels to pixel `at` from before it, as the bits from `from` on say, behind which the stream then
// stands.
function copyPixels(stream, tables, image, prefix, from, at) {
  const {words} = stream, {pixels} = image;
  const length = prefixed(prefix, bitsAt(words, from));
  stream.moveTo(from + extraBits(prefix));
  const far = stream.symbol(tables, image.distanceCode), code = prefixed(far, bitsAt(words, stream.at));
  stream.moveTo(stream.at + extraBits(far));
  let distance = code - NEAREST.length;
  if (distance <= 0) distance = Math.max(NEAREST[code - 1].x + NEAREST[code - 1].y * image.width, 1);
  if (distance > at || length > pixels.length - at) throw broken('a copy from or to outside of the picture');
  if (distance === 1) {
    pixels.fill(pixels[at - 1], at, at + length);
  } else {
    for (let i = at, end = at + length; i < end; ++i) pixels[i] = pixels[i - distance];
  }
  image.copied = length;
}

// Decodes pixels of an image from image.at on up to `until`, or further, where a copy leads there.
function decodeSome(stream, tables, image, until) {
  const {words} = stream, {entries} = tables, {pixels, width, cache, codes, blocks, blockBits, across} = image;
  let at = image.at, from = stream.at;
  while (at < until) {
    let end = until, group = 0;
    if (blocks !== null) {
      const y = at / width | 0, x = at - y * width;
      group = GROUP * blocks[(y >> blockBits) * across + (x >> blockBits)];
      end = Math.min(at - x + Math.min((x >> blockBits) + 1 << blockBits, width), until);
    }
    const green = codes[group] >>> 4, greenMask = (1 << (codes[group] & 15)) - 1;
    const red = codes[group + 1] >>> 4, redMask = (1 << (codes[group + 1] & 15)) - 1;
    const blue = codes[group + 2] >>> 4, blueMask = (1 << (codes[group + 2] & 15)) - 1;
    const alpha = codes[group + 3] >>> 4, alphaMask = (1 << (codes[group + 3] & 15)) - 1;
    image.distanceCode = codes[group + 4];
    while (at < end) {
      let bits = bitsAt(words, from), entry = lookUp(entries, green, greenMask, bits);
      const symbol = entry >> 4;
      from += entry & 15;
      if (symbol < LITERALS) {
        entry = lookUp(entries, red, redMask, bits >>> (entry & 15));  // two codes have at most 30 bits
        const rest = symbol << 8 | entry >> 4 << 16;
        from += entry & 15;
        bits = bitsAt(words, from);
        entry = lookUp(entries, blue, blueMask, bits);
        const last = lookUp(entries, alpha, alphaMask, bits >>> (entry & 15));
        from += (entry & 15) + (last & 15);
        pixels[at++] = last >> 4 << 24 | rest | entry >> 4;
      } else if (symbol < LITERALS + LENGTHS) {
        copyPixels(stream, tables, image, symbol - LITERALS, from, at);
        from = stream.at;
        at += image.copied;
      } else {
        cacheColors(image, at);
        pixels[at++] = cache[symbol - LITERALS - LENGTHS];
      }
    }
    stream.moveTo(from);
  }
  if (cache !== null) cacheColors(image, at);  // now, so that no call has more of that to do than of pixels
  image.at = at;
}

const blocksOf = (side, bits) => (side - 1 >> bits) + 1;

// Which codes hold in which block. Files may have codes that no block names: those that are named get places in a list,
// so that there are no more of them than blocks. Returns the place of each number, -1 without one, and their count.
async function readBlocks(stream, tables, image, height) {
  const blockBits = stream.read(3) + 2, {width} = image;
  image.across = blocksOf(width, blockBits);
  image.blockBits = blockBits;
  const down = blocksOf(height, blockBits), numbers = new Int32Array(image.across * down);
  await readImage(stream, tables, numbers, image.across, down, false);
  const places = new Int32Array(1 << 16).fill(-1);
  let used = 0, largest = 0;
  image.blocks = new Uint16Array(numbers.length);
  for (let i = 0; i < numbers.length; ++i) {
    if (i % PIXELS_AT_A_TIME === 0) await breathe();
    const number = numbers[i] >>> 8 & 0xFFFF;
    if (places[number] < 0) places[number] = used++;
    image.blocks[i] = places[number];
    largest = Math.max(largest, number);
  }
  return {places: places.subarray(0, largest + 1), used};
}

// Fills `pixels` (ARGB, the highest byte first) with an image of the stream.
async function readImage(stream, tables, pixels, width, height, isPicture) {
  const image = {pixels, width, at: 0, copied: 0, distanceCode: 0, cache: null, cacheShift: 0, cached: 0, codes: null,
                 blocks: null, blockBits: 0, across: 0};
  let cached = 0;
  if (stream.read(1) === 1) {
    const bits = stream.read(4);
    if (bits < 1 || bits > MOST_CACHE_BITS) throw broken(`a cache of ${bits} bits (expected 1 to ${MOST_CACHE_BITS})`);
    cached = 1 << bits;
    image.cache = new Int32Array(cached);
    image.cacheShift = 32 - bits;
  }
  const {places, used} = isPicture && stream.read(1) === 1 ? await readBlocks(stream, tables, image, height)
                                                           : {places: [0], used: 1};
  image.codes = new Int32Array(GROUP * used);
  tables.used = 0;
  for (const place of places) {
    await breathe();
    const mark = tables.used;
    for (let k = 0; k < GROUP; ++k) {
      const code = tables.read(stream, k === 0 ? LITERALS + LENGTHS + cached : k < 4 ? LITERALS : DISTANCES);
      if (place >= 0) image.codes[GROUP * place + k] = code;
    }
    if (place < 0) tables.used = mark;
  }
  while (image.at < pixels.length) {
    await breathe();
    decodeSome(stream, tables, image, Math.min(image.at + PIXELS_AT_A_TIME, pixels.length));
  }
}

// Four channels at a time: sums modulo 256, and means that are rounded down.
const addChannels = (a, b) =>
  (a & 0xFF00FF00) + (b & 0xFF00FF00) & 0xFF00FF00 | (a & 0xFF00FF) + (b & 0xFF00FF) & 0xFF00FF;
const halfSum = (a, b) => (a & b) + ((a ^ b) >>> 1 & 0x7F7F7F7F) | 0;

const channelsApart = (a, b) =>
  Math.abs((a >>> 24) - (b >>> 24)) + Math.abs((a >>> 16 & 0xFF) - (b >>> 16 & 0xFF)) +
  Math.abs((a >>> 8 & 0xFF) - (b >>> 8 & 0xFF)) + Math.abs((a & 0xFF) - (b & 0xFF));
const clampedByte = (x) => (x < 0 ? 0 : x > 255 ? 255 : x);
const sumAt = (a, b, c, shift) =>
  clampedByte((a >>> shift & 0xFF) + (b >>> shift & 0xFF) - (c >>> shift & 0xFF)) << shift;
const clampedSum = (a, b, c) => sumAt(a, b, c, 24) | sumAt(a, b, c, 16) | sumAt(a, b, c, 8) | sumAt(a, b, c, 0);
function beyondAt(a, b, shift) {
  const x = a >>> shift & 0xFF;
  return clampedByte(x + ((x - (b >>> shift & 0xFF)) / 2 | 0)) << shift;
}
const clampedBeyond = (a, b) => beyondAt(a, b, 24) | beyondAt(a, b, 16) | beyondAt(a, b, 8) | beyondAt(a, b, 0);

// By mode: adds to pixels [i, end) of a row of `w` what those before them predict. Each mode has its own loop, as
// engines make that fast.
const PREDICTORS = [
  (p, i, end) => { for (; i < end; ++i) p[i] = addChannels(p[i], BLACK); },
  (p, i, end) => { for (; i < end; ++i) p[i] = addChannels(p[i], p[i - 1]); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], p[i - w]); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], p[i - w + 1]); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], p[i - w - 1]); },
  (p, i, end, w) => {
    for (; i < end; ++i) p[i] = addChannels(p[i], halfSum(halfSum(p[i - 1], p[i - w + 1]), p[i - w]));
  },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], halfSum(p[i - 1], p[i - w - 1])); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], halfSum(p[i - 1], p[i - w])); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], halfSum(p[i - w - 1], p[i - w])); },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], halfSum(p[i - w], p[i - w + 1])); },
  (p, i, end, w) => {
    for (; i < end; ++i) {
      p[i] = addChannels(p[i], halfSum(halfSum(p[i - 1], p[i - w - 1]), halfSum(p[i - w], p[i - w + 1])));
    }
  },
  (p, i, end, w) => {
    for (; i < end; ++i) {
      const left = p[i - 1], top = p[i - w], corner = p[i - w - 1];
      p[i] = addChannels(p[i], channelsApart(top, corner) < channelsApart(left, corner) ? left : top);
    }
  },
  (p, i, end, w) => { for (; i < end; ++i) p[i] = addChannels(p[i], clampedSum(p[i - 1], p[i - w], p[i - w - 1])); },
  (p, i, end, w) => {
    for (; i < end; ++i) p[i] = addChannels(p[i], clampedBeyond(halfSum(p[i - 1], p[i - w]), p[i - w - 1]));
  },
];

// body(first pixel, pixel behind the last, datum of the block) for each block of row `y` from column `x` on.
function eachBlock(transform, y, x, body) {
  const {width, bits} = transform, across = blocksOf(width, bits);
  for (let end = 0; x < width; x = end) {
    end = Math.min((x >> bits) + 1 << bits, width);
    body(y * width + x, y * width + end, transform.data[(y >> bits) * across + (x >> bits)]);
  }
}

function unpredict(pixels, transform, y) {
  const {width} = transform, row = y * width;
  pixels[row] = addChannels(pixels[row], y === 0 ? BLACK : pixels[row - width]);
  if (y === 0) {
    PREDICTORS[1](pixels, 1, width);
    return;
  }
  eachBlock(transform, y, 1, (begin, end, element) => {
    (PREDICTORS[element >>> 8 & 15] || PREDICTORS[0])(pixels, begin, end, width);  // what libwebp takes 14 and 15 for
  });
}

function addColors(p, i, end, element) {
  const greenToRed = element << 24 >> 24, greenToBlue = element << 16 >> 24, redToBlue = element << 8 >> 24;
  for (; i < end; ++i) {
    const argb = p[i], green = argb << 16 >> 24, red = (argb >>> 16) + (Math.imul(greenToRed, green) >> 5) & 0xFF;
    const blue = argb + (Math.imul(greenToBlue, green) >> 5) + (Math.imul(redToBlue, red << 24 >> 24) >> 5) & 0xFF;
    p[i] = argb & 0xFF00FF00 | red << 16 | blue;
  }
}

function addGreen(p, i, end) {
  for (; i < end; ++i) p[i] = addChannels(p[i], (p[i] >>> 8 & 0xFF) * 0x10001);
}

// Colours of row `y` for the indices in `packed`, several a pixel. That may be the end of `pixels`: row by row what is
// written stays behind what is read.
function putColors(pixels, packed, {width, bits, data}, y) {
  const across = blocksOf(width, bits), wide = 8 >> bits, mask = (1 << wide) - 1;
  for (let x = 0, i = y * width, from = y * across; x < width;) {
    const end = Math.min(x + (1 << bits), width);
    for (let left = packed[from++] >>> 8 & 0xFF; x < end; ++x, left >>>= wide) pixels[i++] = data[left & mask];
  }
}

const UNDO = [
  unpredict,
  (pixels, transform, y) => eachBlock(transform, y, 0, (begin, end, element) => addColors(pixels, begin, end, element)),
  (pixels, {width}, y) => addGreen(pixels, y * width, (y + 1) * width),
];
const INDEXED = 3;  // the transform that changes the width

async function readTransform(stream, tables, type, width, height) {
  if (type === 2) return {type, width};
  const isIndexed = type === INDEXED;
  let bits = 0, across = 0, down = 1;
  if (isIndexed) {
    across = stream.read(8) + 1;
    bits = across <= 2 ? 3 : across <= 4 ? 2 : across <= 16 ? 1 : 0;
  } else {
    bits = stream.read(3) + 2;
    across = blocksOf(width, bits);
    down = blocksOf(height, bits);
  }
  const data = new Int32Array(isIndexed ? 256 : across * down);  // colours that are not there are 0
  await readImage(stream, tables, data.subarray(0, across * down), across, down, false);
  for (let i = 1; isIndexed && i < across; ++i) data[i] = addChannels(data[i], data[i - 1]);
  return {type, width, bits, data};
}

// ARGB as numbers to RGBA as bytes.
function toRgba(p, i, end) {
  for (; i < end; ++i) p[i] = p[i] & 0xFF00FF00 | p[i] >>> 16 & 0xFF | (p[i] & 0xFF) << 16;
}

// RGBA of the picture whose chunk VP8L has these bytes and sides.
export async function decodeVp8l(bytes, width, height) {
  const stream = new Vp8lBits(bytes), tables = new PrefixTables(), transforms = [];
  stream.read(1);  // whether alpha is used, a hint that changes no pixel
  const version = stream.read(3);
  if (version !== 0) throw broken(`version ${version} (expected 0)`);
  let across = width;  // less where several pixels are bundled in one
  while (stream.read(1) === 1) {
    const type = stream.read(2);
    if (transforms.some((other) => other.type === type)) throw broken('a transform twice');
    transforms.push(await readTransform(stream, tables, type, across, height));
    if (type === INDEXED) across = blocksOf(width, transforms[transforms.length - 1].bits);
  }
  const whole = new Int32Array(width * height);
  let pixels = whole.subarray((width - across) * height);
  await readImage(stream, tables, pixels, across, height, true);
  const rows = Math.ceil(PIXELS_AT_A_TIME / width);
  for (const transform of transforms.reverse()) {
    for (let y = 0; y < height; ++y) {
      if (y % rows === 0) await breathe();
      if (transform.type === INDEXED) {
        putColors(whole, pixels, transform, y);
      } else {
        UNDO[transform.type](pixels, transform, y);
      }
    }
    if (transform.type === INDEXED) pixels = whole;
  }
  for (let begin = 0; begin < whole.length; begin += PIXELS_AT_A_TIME) {
    await breathe();
    toRgba(whole, begin, Math.min(begin + PIXELS_AT_A_TIME, whole.length));
  }
  return new Uint8Array(whole.buffer);
}

// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files as the numbers they hold, alpha included. The browser's own decoder gives them unchanged when it
// is told to convert nothing: WebCodecs' where a browser has it and the page's server is trusted (https, or this
// machine); else by way of a framebuffer of WebGL, as a 2D canvas would multiply colours by alpha.
import {breathe} from './breathe.js';
import {MAX_ATLAS_TEXELS} from './png.js';

const BAND_BYTES = 1 << 22;  // read back at a time
const POLL = 4;              // [ms]
let reader = null;           // a context without a picture

// The pixels of a lossless file, {begin, end} of what its chunk VP8L holds. What else may stand around them, as colour
// profiles do, is passed over.
function findPixels(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 25 || view.getUint32(0) !== 0x52494646 || view.getUint32(8) !== 0x57454250) {
    throw new Error('an image is no WebP file');
  }
  for (let at = 12; at + 8 <= bytes.length;) {
    const name = String.fromCharCode(...bytes.subarray(at, at + 4)), size = view.getUint32(at + 4, true);
    const begin = at + 8, end = begin + size;
    if (name === 'ANIM' || name === 'ANMF') throw new Error('WebP: an animation (expected a single picture)');
    if (name === 'VP8 ' || name === 'ALPH') throw new Error('WebP: lossy (expected lossless)');
    if (name === 'VP8L') {
      if (size < 5 || end > bytes.length) throw new Error('WebP: the file ends early');
      if (bytes[begin] !== 0x2F) throw new Error('WebP: its pixels have no signature (expected that of VP8L)');
      return {begin, end};
    }
    at = end + size % 2;
  }
  throw new Error('WebP: no pixels (expected a chunk VP8L)');
}

// {width, height} of a lossless file, which decoders allocate by.
export function webpSize(bytes) {
  const {begin} = findPixels(bytes);
  const sides = new DataView(bytes.buffer, bytes.byteOffset + begin + 1, 4).getUint32(0, true);  // 14 bits each, less 1
  return {width: (sides & 0x3FFF) + 1, height: (sides >> 14 & 0x3FFF) + 1};
}

// The same pixels without extras, by which a browser might convert colours.
export function plainWebp(bytes) {
  const {begin, end} = findPixels(bytes), size = end - begin;
  if (begin === 20) return bytes;
  const out = new Uint8Array(20 + size + size % 2), view = new DataView(out.buffer);
  view.setUint32(0, 0x52494646);
  view.setUint32(4, out.length - 8, true);
  view.setUint32(8, 0x57454250);
  view.setUint32(12, 0x5650384C);
  view.setUint32(16, size, true);
  out.set(bytes.subarray(begin, end), 20);
  return out;
}

function openReader() {
  if (reader && !reader.isContextLost()) return reader;
  const canvas = typeof OffscreenCanvas === 'undefined' ? document.createElement('canvas') : new OffscreenCanvas(1, 1);
  reader = canvas.getContext('webgl2', {antialias: false, depth: false});
  if (!reader) throw new Error('WebP: this browser offers no WebGL 2');
  reader.pixelStorei(reader.UNPACK_COLORSPACE_CONVERSION_WEBGL, reader.NONE);
  return reader;
}

// Rows [begin, end) of the bound framebuffer into `out`, without holding up the page.
async function readRows(gl, begin, end, width, out) {
  const buffer = gl.createBuffer();
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  gl.bufferData(gl.PIXEL_PACK_BUFFER, out.length, gl.STREAM_READ);
  gl.readPixels(0, begin, width, end - begin, gl.RGBA, gl.UNSIGNED_BYTE, 0);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
  gl.flush();
  while (gl.clientWaitSync(fence, 0, 0) === gl.TIMEOUT_EXPIRED) await new Promise((done) => setTimeout(done, POLL));
  gl.deleteSync(fence);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, buffer);
  gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, out);
  gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
  gl.deleteBuffer(buffer);
}

// The pixels of a frame as they are, or null where it has others than RGBA.
async function pixelsOf(frame, width, height) {
  if (!frame.format) return null;
  const swapped = frame.format.startsWith('BGR');
  if (!swapped && !frame.format.startsWith('RGB')) return null;
  if (frame.codedWidth !== width || frame.codedHeight !== height) {
    throw new Error('WebP: another size than its header says');
  }
  const samples = new Uint8Array(4 * width * height);
  await frame.copyTo(samples, {layout: [{offset: 0, stride: 4 * width}]});
  for (let i = 0; swapped && i < samples.length; i += 4) {
    if (i % BAND_BYTES === 0) await breathe();
    const blue = samples[i];
    samples[i] = samples[i + 2];
    samples[i + 2] = blue;
  }
  return samples;
}

// As the WebGL way; null where it cannot be told that the numbers are the file's.
async function decodeByCodec(bytes, width, height) {
  if (typeof ImageDecoder === 'undefined') return null;
  const decoder = new ImageDecoder({data: bytes, type: 'image/webp', premultiplyAlpha: 'none',
                                    colorSpaceConversion: 'none', preferAnimation: false});
  try {
    const image = await decoder.decode().then((decoded) => decoded.image, () => null);  // the WebGL way says why
    if (!image) return null;
    try {
      return await pixelsOf(image, width, height);
    } finally {
      image.close();
    }
  } finally {
    decoder.close();
  }
}

let busy = Promise.resolve();  // files are read one after the other, as they share the context

async function decode(file) {
  const {width, height} = webpSize(file), bytes = plainWebp(file);
  if (width * height > MAX_ATLAS_TEXELS) {
    throw new Error(`WebP: bad size ${width} x ${height} (expected at most ${MAX_ATLAS_TEXELS} texels)`);
  }
  const decoded = await decodeByCodec(bytes, width, height);
  if (decoded) return {width, height, channels: 4, largest: 255, samples: decoded};
  const bitmap = await createImageBitmap(new Blob([bytes], {type: 'image/webp'}),
                                         {premultiplyAlpha: 'none', colorSpaceConversion: 'none'});
  if (bitmap.width !== width || bitmap.height !== height) throw new Error('WebP: another size than its header says');
  const gl = openReader();
  if (Math.max(width, height) > gl.getParameter(gl.MAX_TEXTURE_SIZE)) {
    throw new Error(`WebP: ${width} x ${height} is too large for this device`);
  }
  const texture = gl.createTexture(), framebuffer = gl.createFramebuffer();
  gl.bindTexture(gl.TEXTURE_2D, texture);
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, bitmap);
  bitmap.close();
  gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
  gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
  const samples = new Uint8Array(4 * width * height);
  const rows = Math.max(Math.floor(BAND_BYTES / (4 * width)), 1);
  for (let row = 0; row < height; row += rows) {
    const end = Math.min(row + rows, height);
    await breathe();
    await readRows(gl, row, end, width, samples.subarray(4 * width * row, 4 * width * end));
  }
  gl.deleteFramebuffer(framebuffer);
  gl.deleteTexture(texture);
  if (gl.isContextLost()) throw new Error('WebP: the graphics device was lost');
  return {width, height, channels: 4, largest: 255, samples};
}

// As decodePng: integers from 0 to 255.
export function decodeWebp(bytes) {
  const result = busy.then(() => decode(bytes));
  busy = result.catch(() => {});
  return result;
}

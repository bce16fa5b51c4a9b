// SPDX-License-Identifier: Apache-2.0
// Lossless WebP files as the numbers they hold. Opaque ones come out of the browser's own decoder unchanged when it is
// told to convert nothing.
'use strict';

// {width, height} of a lossless file without extras, which decoders allocate by.
function webpSize(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 25 || view.getUint32(0) !== 0x52494646 || view.getUint32(8) !== 0x57454250) {
    throw new Error('an atlas is no WebP file');
  }
  if (view.getUint32(12) !== 0x5650384C || bytes[20] !== 0x2F) throw new Error('WebP: no lossless file');
  const sides = view.getUint32(21, true);  // 14 bits each, less 1
  return {width: (sides & 0x3FFF) + 1, height: (sides >> 14 & 0x3FFF) + 1};
}

// As decodePng: integers from 0 to 255.
async function decodeWebp(bytes) {
  const {width, height} = webpSize(bytes);
  if (width * height > MAX_ATLAS_TEXELS) {
    throw new Error(`WebP: bad size ${width} x ${height} (expected at most ${MAX_ATLAS_TEXELS} texels)`);
  }
  const bitmap = await createImageBitmap(new Blob([bytes], {type: 'image/webp'}),
                                         {premultiplyAlpha: 'none', colorSpaceConversion: 'none'});
  if (bitmap.width !== width || bitmap.height !== height) throw new Error('WebP: another size than its header says');
  const canvas = document.createElement('canvas');
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext('2d', {willReadFrequently: true});
  context.drawImage(bitmap, 0, 0);
  bitmap.close();
  return {width, height, channels: 4, largest: 255, samples: context.getImageData(0, 0, width, height).data};
}

// SPDX-License-Identifier: Apache-2.0
// A Gaussian as the device has it, in five texels of four numbers (web/shaders/splat.vert).

export const GAUSSIAN_NUMBERS = 20;
export const SCALE_NUMBER = 8;  // the first of its three

// Gaussian i of a model as readGlb and readSog give it, from out[at] on.
export function packGaussian({mean, rotation, scale, opacity, sh, layer}, i, out, at) {
  const dc = (layer && layer.dc) || sh[0];
  const shape = (layer && layer.scale) || scale;
  for (let k = 0; k < 3; ++k) {
    out[at + k] = mean[3 * i + k];
    out[at + SCALE_NUMBER + k] = shape[3 * i + k];
    out[at + 12 + k] = dc[3 * i + k];
    out[at + 16 + k] = sh[0][3 * i + k];
  }
  for (let k = 0; k < 4; ++k) out[at + 4 + k] = rotation[4 * i + k];
  out[at + 3] = ((layer && layer.opacity) || opacity)[i];
  out[at + 11] = layer && layer.pages ? layer.pages[i] : 0;
  out[at + 19] = opacity[i];
}

// Its SH coefficients from the second one on.
export function packSh({sh}, i, out, at) {
  for (let c = 1; c < sh.length; ++c) {
    for (let k = 0; k < 3; ++k) out[at + 3 * (c - 1) + k] = sh[c][3 * i + k];
  }
}

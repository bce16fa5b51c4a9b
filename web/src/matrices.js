// SPDX-License-Identifier: Apache-2.0
// Cameras as engines have them, two matrices, and as docs/math.md has them.
import {fitted} from './camera.js';

export const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

// a after b.
export function multiplied(a, b) {
  const out = [];
  for (let column = 0; column < 16; column += 4) {
    for (let row = 0; row < 4; ++row) {
      out.push(a[row] * b[column] + a[4 + row] * b[column + 1] + a[8 + row] * b[column + 2] + a[12 + row] * b[column + 3]);
    }
  }
  return out;
}

const UNEVEN = 1e-2;  // of scales along axes and of their angles, which no picture shows yet

const isPerspective = (p) => Math.abs(Math.abs(p[11]) - 1) <= 1e-6 && Math.abs(p[15]) <= 1e-6;

function determinant(m) {
  return m[0] * (m[5] * m[10] - m[6] * m[9]) - m[4] * (m[1] * m[10] - m[2] * m[9]) + m[8] * (m[1] * m[6] - m[2] * m[5]);
}

// Why a model cannot be drawn with these matrices, which are cameraOf's; '' where it can.
export function objection(viewFromModel, projection) {
  const m = viewFromModel, p = projection;
  if (!isPerspective(p)) return 'a camera without perspective shows no Gaussians';
  const volume = -p[11] * determinant(m);
  if (!(volume > 0)) return 'an object that is mirrored, or has no size, shows no Gaussians';
  const square = Math.cbrt(volume) ** 2;
  for (let a = 0; a < 12; a += 4) {
    for (let b = a; b < 12; b += 4) {
      const product = (m[a] * m[b] + m[a + 1] * m[b + 1] + m[a + 2] * m[b + 2]) / square;
      if (Math.abs(product - (a === b ? 1 : 0)) > UNEVEN) {
        return 'an object that is scaled otherwise along one axis than along another shows no Gaussians';
      }
    }
  }
  return '';
}

// {camera: a pinhole camera in the model's space; depth: [a, b], a normalised depth is a + b / camera z}. Matrices are 16
// numbers by columns; the model may be turned, moved and scaled uniformly, the view look along -z or +z. Null where
// objection() has one, or there is no picture.
export function cameraOf(viewFromModel, projection, width, height) {
  const m = viewFromModel, p = projection;
  if (!(width >= 1 && height >= 1) || objection(m, p)) return null;
  const ahead = p[11];  // -1: the view looks along -z; 1: along +z
  const scale = Math.cbrt(-ahead * determinant(m));
  const row = (k, sign) => [sign * m[k] / scale, sign * m[4 + k] / scale, sign * m[8 + k] / scale];
  const axes = [row(0, 1), row(1, -1), row(2, ahead)];
  // The eye: where camera_from_model gives 0.
  const t = [m[12] / scale, -m[13] / scale, ahead * m[14] / scale];
  const eye = [0, 1, 2].map((k) => -(axes[0][k] * t[0] + axes[1][k] * t[1] + axes[2][k] * t[2]));
  const camera = {
    width, height, fx: 0.5 * width * p[0], fy: 0.5 * height * p[5], cx: 0.5 * width * (1 + ahead * p[8]),
    cy: 0.5 * height * (1 - ahead * p[9]), axes, eye,
  };
  return camera.fx > 0 && camera.fy > 0 ? {camera, depth: [ahead * p[10], p[14] / scale]} : null;
}

// A camera of the model at another image size, by columns: worldFromCamera has glTF's axes (x right, y up, z back),
// projection a depth from -1 at `near` to 1 at `far`. `fovY`: [rad] where its centre is the middle.
export function matricesOf(camera, width, height, near = 0.01, far = 1000) {
  const {axes: [right, down, forward], eye, fx, fy, cx, cy} = fitted(camera, width, height);
  return {
    worldFromCamera: [...right, 0, ...down.map((x) => -x), 0, ...forward.map((x) => -x), 0, ...eye, 1],
    projection: [2 * fx / width, 0, 0, 0, 0, 2 * fy / height, 0, 0, 1 - 2 * cx / width, 2 * cy / height - 1,
                 -(far + near) / (far - near), -1, 0, 0, -2 * far * near / (far - near), 0],
    fovY: 2 * Math.atan(0.5 * height / fy),
  };
}

// What to say where a model has no camera, or view, of that number.
export function noSuchCamera(model, index, views) {
  const count = (views ? model.views : model.cameras).length, what = views ? 'view' : 'camera';
  if (count === 0) return new Error(`the model has no ${what}s`);
  return new Error(`there is no ${what} ${index} (expected 0 to ${count - 1})`);
}

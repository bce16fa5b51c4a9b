// SPDX-License-Identifier: Apache-2.0
// Cameras from a cameras.json (docs/bundle.md), whose axes become glTF's by a half turn about z.

// As readGlb gives them. What is no camera is left out.
export function readCameraFile(bytes) {
  const list = JSON.parse(new TextDecoder().decode(bytes));
  return Array.isArray(list) ? list.map(readFileCamera).filter(Boolean) : [];
}

function readFileCamera(found) {
  const {img_name: name, width, height, fx, fy, position, rotation, split} = Object(found);
  const {cx = 0.5 * width, cy = 0.5 * height} = Object(found);
  const isVector = (list) => Array.isArray(list) && list.length === 3;
  if (!isVector(position) || !isVector(rotation) || !rotation.every(isVector)) return null;
  // Columns of the rotation are the camera's axes.
  const axes = [0, 1, 2].map((k) => [-rotation[0][k], -rotation[1][k], rotation[2][k]]);
  const camera = {name: String(name || ''), test: split === 'test', width, height, fx, fy, cx, cy, axes,
                  eye: [-position[0], -position[1], position[2]]};
  const numbers = [width, height, fx, fy, cx, cy, ...axes.flat(), ...camera.eye];
  return numbers.every(Number.isFinite) && Math.min(width, height, fx, fy) > 0 ? camera : null;
}

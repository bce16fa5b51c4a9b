// SPDX-License-Identifier: Apache-2.0
// A view as a word of an address: eye, rotation x y z w from the camera's axes to the world's, vertical field of view
// [degrees], width over height of what is then in view, distance to what it turns about; behind it, where pixels are
// not square or the centre is not in the middle: fx over fy, cx over width, cy over height.

const DIGITS = 5, MOST_DIGITS = 15;
const HEIGHT = 720;
const PLAIN_LENS = [1, 0.5, 0.5];
const LEAST_SHIFT = 1e-5;

// Columns of the rotation are the camera's axes.
export function quaternionOf([a, b, c]) {
  const squares = [1 + a[0] - b[1] - c[2], 1 - a[0] + b[1] - c[2], 1 - a[0] - b[1] + c[2], 1 + a[0] + b[1] + c[2]];
  const rows = [
    [squares[0], a[1] + b[0], a[2] + c[0], b[2] - c[1]], [a[1] + b[0], squares[1], b[2] + c[1], c[0] - a[2]],
    [a[2] + c[0], b[2] + c[1], squares[2], a[1] - b[0]], [b[2] - c[1], c[0] - a[2], a[1] - b[0], squares[3]],
  ];
  const row = rows[squares.indexOf(Math.max(...squares))];
  const length = Math.hypot(...row);
  return row.map((x) => x / length);
}

export function axesOf([x, y, z, w]) {
  return [[1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
          [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
          [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]];
}

export function formatView(camera, distance) {
  const fov = 2 * Math.atan(0.5 * camera.height / camera.fy) * 180 / Math.PI;
  const numbers = [...quaternionOf(camera.axes), fov, camera.width / camera.height, distance];
  const lens = [camera.fx / camera.fy, camera.cx / camera.width, camera.cy / camera.height];
  if (lens.some((x, k) => Math.abs(x - PLAIN_LENS[k]) > LEAST_SHIFT)) numbers.push(...lens);
  const text = (x, digits) => String(Number(x.toPrecision(digits)));
  // The eye lies as exactly as is seen from the distance, however far it is from the origin.
  const digits = (x) => DIGITS + Math.max(Math.ceil(Math.log10(Math.abs(x) / distance)), 0);
  return [...camera.eye.map((x) => text(x, x === 0 ? DIGITS : Math.min(digits(x), MOST_DIGITS))),
          ...numbers.map((x) => text(x, DIGITS))].join(',');
}

// A camera with its distance, or null.
export function parseView(text) {
  const numbers = text.split(',').map((word) => (word.trim() === '' ? NaN : Number(word)));
  if (numbers.length !== 10 && numbers.length !== 13) return null;
  if (!numbers.every((x) => Number.isFinite(x) && Math.abs(x) < 1e9)) return null;
  const turn = numbers.slice(3, 7), length = Math.hypot(...turn);
  const [fov, aspect, distance] = numbers.slice(7);
  const [stretch, cx, cy] = numbers.length === 13 ? numbers.slice(10) : PLAIN_LENS;
  if (!(Math.abs(length - 1) < 0.01 && fov > 0 && fov < 180 && aspect >= 0.01 && aspect <= 100 && distance > 0)) return null;
  if (!(stretch >= 0.01 && stretch <= 100 && Math.abs(cx) <= 100 && Math.abs(cy) <= 100)) return null;
  const fy = 0.5 * HEIGHT / Math.tan(fov * Math.PI / 360), width = HEIGHT * aspect;
  return {name: '', test: false, width, height: HEIGHT, fx: stretch * fy, fy, cx: cx * width, cy: cy * HEIGHT,
          axes: axesOf(turn.map((x) => x / length)), eye: numbers.slice(0, 3), distance};
}

// SPDX-License-Identifier: Apache-2.0
// Pinhole cameras and how a hand moves them. A camera: {width, height, fx, fy, cx, cy [px], axes: camera x (right),
// y (down), z (forward) in world space, eye}.

// Of a dolly's distance, as in viewer/view/camera_controller.cpp. [world units]
const LEAST_DISTANCE = 1e-4, MOST_DISTANCE = 1e9;
const START_FOV = 0.9;     // [rad] over the height
const START_PITCH = -0.3;  // [rad] above the horizon
export const NEAR = 0.2;   // shaders/shared/limits.h kNear [world units]

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (a) => add([0, 0, 0], a, 1 / Math.hypot(...a));

// v turned by `angle` [rad] about the unit vector `axis` (Rodrigues).
export function turned(v, axis, angle) {
  const c = Math.cos(angle), s = Math.sin(angle);
  return add(add(add([0, 0, 0], v, c), cross(axis, v), s), axis, dot(axis, v) * (1 - c));
}

// The same view at another image size without distortion: the whole old image fits, more scene beside it.
export function fitted(camera, width, height) {
  const s = Math.min(width / camera.width, height / camera.height);
  return {...camera, width, height, fx: camera.fx * s, fy: camera.fy * s,
          cx: (camera.cx - 0.5 * camera.width) * s + 0.5 * width,
          cy: (camera.cy - 0.5 * camera.height) * s + 0.5 * height};
}

const MOST_LOOKED_AT = 1 << 17;  // Gaussians: sorting them all would stall the page
const INNER = 0.8;         // a share of the Gaussians: with bounds that leave the others out,
const BEYOND_INNER = 1.1;  // [reach of the inner] they are that wide
const FAR = 2;             // [reach of the inner] what is left out goes at least so far,
const LARGE = 0.05;        // [reach of the inner] and half of it has at least that standard deviation

const quantile = (sorted, q) => sorted[Math.floor(q * (sorted.length - 1))];

// A sphere around most of the Gaussians, by the rule of viewer/view/camera_controller.cpp: the median of their means,
// and the reach of 95 % of them, or little more than that of 80 % where the others are far and large.
export function sceneBounds(mean, scale) {
  const step = 3 * Math.ceil(mean.length / 3 / MOST_LOOKED_AT);
  const column = new Float32Array(Math.ceil(mean.length / step)), count = column.length;
  const center = [0, 1, 2].map((k) => {
    for (let i = 0; i < count; ++i) column[i] = mean[step * i + k];
    return quantile(column.sort(), 0.5);
  });
  const sigma = new Float32Array(count), reach = new Float32Array(count);
  for (let i = 0; i < count; ++i) {
    const at = step * i;
    sigma[i] = Math.max(scale[at], scale[at + 1], scale[at + 2]);
    reach[i] = Math.hypot(mean[at] - center[0], mean[at + 1] - center[1], mean[at + 2] - center[2]) + 2 * sigma[i];
  }
  column.set(reach);
  const inner = quantile(column.sort(), INNER);
  let radius = quantile(column, 0.95);
  if (radius > FAR * inner) {
    const beyond = sigma.filter((_, i) => reach[i] > inner).sort();
    if (quantile(beyond, 0.5) > LARGE * inner) radius = BEYOND_INNER * inner;
  }
  return {center, radius: Math.max(radius, 1e-3)};
}

// Mean of the cameras' image-up directions; y where there are none or they cancel.
export function sceneUp(cameras) {
  const sum = cameras.reduce((up, camera) => add(up, camera.axes[1], -1), [0, 0, 0]);
  return Math.hypot(...sum) > 0.1 * cameras.length ? unit(sum) : [0, 1, 0];
}

export class Orbit {
  constructor(model) {
    const {bounds, mean, scale, layer} = model;
    this.bounds = bounds || sceneBounds(mean, (layer && layer.scale) || scale);
    this.up = sceneUp(model.cameras);
    this.camera = null;
    this.first = null;  // the camera that start() made
    this.distance = 1;  // [world units] along the view axis to the point that orbits keep in place
  }

  get atStart() { return this.camera !== null && this.camera === this.first; }

  get pivot() { return add(this.camera.eye, this.camera.axes[2], this.distance); }

  // Takes a camera over as it is.
  set(camera) {
    const along = dot(add(this.bounds.center, camera.eye, -1), camera.axes[2]);
    this.camera = camera;
    this.distance = Math.max(along, 0.1 * this.bounds.radius);
  }

  // Looks along the scene's +z, somewhat down, at everything.
  start(width, height) {
    const fy = 0.5 * height / Math.tan(0.5 * START_FOV);
    const ahead = Math.abs(this.up[2]) < 0.99 ? [0, 0, 1] : [1, 0, 0];
    const right = unit(cross(ahead, this.up));
    const level = cross(this.up, right);
    const forward = turned(level, right, START_PITCH);
    this.camera = {name: '', width, height, fx: fy, fy, cx: 0.5 * width, cy: 0.5 * height,
                   axes: [right, cross(forward, right), forward], eye: [0, 0, 0]};
    this.frame(width, height);
    this.first = this.camera;
  }

  // All in view. What this asks of the lens, a square, becomes the camera's image: it fits a picture of any shape.
  frame(width, height) {
    const {fx, fy, cx, cy} = fitted(this.camera, width, height);
    const reach = Math.min(0.5 * width / fx, 0.5 * height / fy);  // at a depth of 1
    const image = {width: 2 * reach * fx, height: 2 * reach * fy};
    this.distance = Math.max(this.bounds.radius / Math.sin(Math.atan(reach)), this.bounds.radius + 1.5 * NEAR);
    this.camera = {...this.camera, ...image, fx, fy, cx: cx + 0.5 * (image.width - width),
                   cy: cy + 0.5 * (image.height - height),
                   eye: add(this.bounds.center, this.camera.axes[2], -this.distance)};
  }

  // [rad] around the pivot: about the scene's up, then about the camera's x, short of the poles.
  orbit(yaw, pitch) {
    const pivot = this.pivot;
    let axes = this.camera.axes.map((axis) => turned(axis, this.up, yaw));
    const tilted = axes.map((axis) => turned(axis, axes[0], pitch));
    const steepness = (a) => Math.abs(dot(a[2], this.up));
    if (steepness(tilted) < 0.999 || steepness(tilted) < steepness(axes)) axes = tilted;
    const forward = unit(axes[2]);
    const right = unit(cross(axes[1], forward));
    axes = [right, cross(forward, right), forward];
    this.camera = {...this.camera, axes, eye: add(pivot, forward, -this.distance)};
  }

  // [px] of a picture of the given height: what lies at the pivot follows the hand.
  pan(x, y, width, height) {
    const lens = fitted(this.camera, width, height);
    const [right, down] = this.camera.axes;
    const eye = add(add(this.camera.eye, right, -x * this.distance / lens.fx), down, -y * this.distance / lens.fy);
    this.camera = {...this.camera, eye};
  }

  dolly(factor) {
    const pivot = this.pivot;
    const most = Math.max(this.distance, MOST_DISTANCE);  // what is farther out comes nearer by steps, too
    this.distance = Math.min(Math.max(this.distance * factor, LEAST_DISTANCE), most);
    this.camera = {...this.camera, eye: add(pivot, this.camera.axes[2], -this.distance)};
  }
}

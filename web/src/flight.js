// SPDX-License-Identifier: Apache-2.0
// A camera that flies through others, round and round, smoothly.
import {axesOf, quaternionOf} from './view_text.js';

const LEG = 2500;  // [ms] from one to the next

// Catmull and Rom's curve through b and c at t of 0 to 1.
const curve = (a, b, c, d, t) =>
  0.5 * (2 * b + (c - a) * t + (2 * a - 5 * b + 4 * c - d) * t * t + (3 * b - a - 3 * c + d) * t * t * t);

// Eye, rotation, the logarithms of the focal lengths over the height, and the centre over width and height, as a list.
function numbersOf(camera, before) {
  let turn = quaternionOf(camera.axes);
  if (before && before.slice(3, 7).reduce((sum, x, k) => sum + x * turn[k], 0) < 0) turn = turn.map((x) => -x);
  return [...camera.eye, ...turn, Math.log(camera.fx / camera.height), Math.log(camera.fy / camera.height),
          camera.cx / camera.width, camera.cy / camera.height];
}

export class Flight {
  // Begins at the one that is nearest to `camera`.
  constructor(stops, camera) {
    this.stops = stops;
    const far = (stop) => Math.hypot(...stop.eye.map((x, k) => x - camera.eye[k]));
    this.first = stops.reduce((best, stop, i) => (far(stop) < far(stops[best]) ? i : best), 0);
    this.start = null;
  }

  // time: as requestAnimationFrame tells it.
  at(time) {
    if (this.start === null) this.start = time;
    const {stops} = this;
    const whole = Math.max(time - this.start, 0) / LEG, leg = Math.floor(whole), t = whole - leg;
    const around = [];
    for (let k = -1; k <= 2; ++k) {
      const stop = stops[(this.first + leg + k + stops.length) % stops.length];
      around.push(numbersOf(stop, around[around.length - 1]));
    }
    const numbers = around[0].map((_, k) => curve(...around.map((list) => list[k]), t));
    const turn = numbers.slice(3, 7), length = Math.hypot(...turn);
    const {width, height} = stops[this.first];
    const [fx, fy] = numbers.slice(7, 9).map((x) => Math.exp(x) * height);
    return {name: '', test: false, width, height, fx, fy, cx: numbers[9] * width, cy: numbers[10] * height,
            axes: axesOf(turn.map((x) => x / length)), eye: numbers.slice(0, 3)};
  }
}

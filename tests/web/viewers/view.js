// SPDX-License-Identifier: Apache-2.0
// What every page shows: a file and a camera from the address, on a background.
const query = new URLSearchParams(location.search);
const vector = (name) => query.get(name).split(',').map(Number);

// World space is the file's (y up); fov is vertical.
export const view = {
  file: query.get('file'), plain: query.has('plain'), width: innerWidth, height: innerHeight, eye: vector('eye'),
  target: vector('target'), up: vector('up'), fovDegrees: Number(query.get('fov')), background: vector('background'),
};

export function canvas() {
  const element = document.createElement('canvas');
  element.width = view.width;
  element.height = view.height;
  element.style.cssText = `display: block; width: ${view.width}px; height: ${view.height}px`;
  document.body.append(element);
  return element;
}

// Runs `show` and tells the test how it went. Drawing goes on: the test waits until the picture rests.
export function start(show) {
  show().then((facts) => { window.__done = facts || {}; },
              (error) => { window.__done = {error: String(error && error.message || error)}; });
}

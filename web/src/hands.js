// SPDX-License-Identifier: Apache-2.0
// Drags, wheel, fingers and arrow keys move a viewer's camera.

const TURN = 0.09;                // [rad] an arrow key
const STEP = 0.05;                // of the picture's height, of an arrow key with Shift
const ZOOM = 1.1;
const MOST_PIXELS = 4000;         // of a wheel's event, which in a slow frame stands for many
const MOST_PINCHED = 300;         // of one with Ctrl, which may be a notch of a mouse's wheel
const ARROWS = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]};

// Whether fingers have enlarged the page: its reader may see the canvas alone.
function pageIsEnlarged() {
  const {clientWidth} = document.scrollingElement || document.documentElement;  // the body in quirks mode
  return visualViewport.width < 0.99 * clientWidth;
}

// Until the function that it returns is called, or the viewer is disposed of.
export function listenToHands(viewer) {
  const {canvas} = viewer, {touchAction} = canvas.style;
  const end = new AbortController();
  const stop = () => {
    end.abort();
    canvas.style.touchAction = touchAction;
  };
  const listen = (name, call, options) => canvas.addEventListener(name, call, {...options, signal: end.signal});
  viewer.end.signal.addEventListener('abort', stop, {signal: end.signal});
  const pointers = new Map();
  const middle = () => {
    const points = [...pointers.values()];
    const x = points.reduce((sum, p) => sum + p.x, 0) / points.length;
    const y = points.reduce((sum, p) => sum + p.y, 0) / points.length;
    return {x, y, spread: points.length < 2 ? 0 : Math.hypot(points[0].x - points[1].x, points[0].y - points[1].y)};
  };
  const size = () => [canvas.clientWidth, canvas.clientHeight];
  const moved = () => {
    viewer.moved();
    viewer.changed(true);
  };
  // Two fingers are the page's while it is enlarged: else there may be no way back.
  const shareFingers = () => { canvas.style.touchAction = pageIsEnlarged() ? 'pinch-zoom' : touchAction; };
  visualViewport.addEventListener('resize', shareFingers, {signal: end.signal});
  shareFingers();
  listen('pointerdown', (event) => {
    if (event.isPrimary) pointers.clear();  // of those that are left the end has not come
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
  });
  listen('pointermove', (event) => {
    if (event.buttons === 0) pointers.delete(event.pointerId);  // it was let go elsewhere
    if (!pointers.has(event.pointerId) || !viewer.model) return;
    const before = middle();
    pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
    if (pointers.size > 1 && pageIsEnlarged()) return;  // the browser is about to take them
    const after = middle();
    const dx = after.x - before.x, dy = after.y - before.y;
    if (dx === 0 && dy === 0 && after.spread === before.spread) return;
    if (pointers.size > 1) {
      viewer.orbit.pan(dx, dy, ...size());
      if (after.spread > 0 && before.spread > 0) viewer.orbit.dolly(before.spread / after.spread);
    } else if (event.shiftKey || event.buttons & 6) {
      viewer.orbit.pan(dx, dy, ...size());
    } else {
      const turn = Math.PI / Math.max(Math.min(...size()), 1);  // half a turn for the shorter side
      viewer.orbit.orbit(-dx * turn, -dy * turn);
    }
    moved();
  });
  for (const name of ['pointerup', 'pointercancel', 'lostpointercapture']) {
    listen(name, (event) => pointers.delete(event.pointerId));
  }
  listen('contextmenu', (event) => event.preventDefault());
  listen('mousedown', (event) => {
    if (event.button !== 1 || !viewer.model) return;
    event.preventDefault();  // browsers begin to scroll the page by it, and give the focus
    canvas.focus({preventScroll: true});
  });
  listen('wheel', (event) => {
    // Where there is nothing to zoom the page scrolls. A gesture that began so cannot be taken later.
    if (!viewer.model || !event.cancelable || (event.ctrlKey && pageIsEnlarged())) return;
    event.preventDefault();
    if (event.deltaY === 0) return;
    // A pinch on a trackpad comes as a wheel with Ctrl, in steps of a few pixels.
    const pixels = event.deltaY * (event.deltaMode === 0 ? 1 : 16) * (event.ctrlKey ? 8 : 1);
    const most = event.ctrlKey ? MOST_PINCHED : MOST_PIXELS;
    viewer.orbit.dolly(Math.exp(0.0015 * Math.max(-most, Math.min(most, pixels))));
    moved();
  }, {passive: false});
  return stop;
}

// Whether a key moved the camera: arrows turn it, with Shift they push it aside, + and - zoom.
export function moveByKey(viewer, {key, shiftKey}) {
  if (!viewer.model) return false;
  const arrow = ARROWS[key];
  const {clientWidth: width, clientHeight: height} = viewer.canvas;
  if (arrow && shiftKey) viewer.orbit.pan(-arrow[0] * STEP * height, -arrow[1] * STEP * height, width, height);
  else if (arrow) viewer.orbit.orbit(arrow[0] * TURN, arrow[1] * TURN);
  else if (key === '+' || key === '=') viewer.orbit.dolly(1 / ZOOM);
  else if (key === '-') viewer.orbit.dolly(ZOOM);
  else return false;
  viewer.moved();
  viewer.changed(true);
  return true;
}

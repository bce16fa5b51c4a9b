// SPDX-License-Identifier: Apache-2.0
// The viewer of web/src without a browser: what it does to a canvas and a model, on a clock that this file moves.
import {Orbit} from '../../web/src/camera.js';
import {fetchBytes} from '../../web/src/fetch.js';
import {listenToHands} from '../../web/src/hands.js';
import {Viewer} from '../../web/src/viewer.js';

const failures = [];
function expect(what, ok, found) {
  if (!ok) failures.push(`${what}: found ${JSON.stringify(found)}`);
}

// The browser: time, timers and a screen's frames. [ms]
let now = 1000, period = 1000 / 60, timers = [], number = 0;
Object.defineProperty(globalThis, 'performance', {value: {now: () => now}});
globalThis.setTimeout = (call, wait = 0) => timers.push({call, at: now + wait, id: ++number}) && number;
globalThis.clearTimeout = (id) => { timers = timers.filter((timer) => timer.id !== id); };
globalThis.requestAnimationFrame = (call) => {
  const at = period * (Math.floor(now / period + 1e-6) + 1);
  timers.push({call: () => call(now), at, id: ++number});
};
const queries = [];  // of the screen
const context = {drawImage() {}};
globalThis.document = {hidden: false, createElement: () => ({getContext: () => context}),
                       documentElement: {clientWidth: 390}};
globalThis.visualViewport = Object.assign(new EventTarget(), {width: 390});
globalThis.window = {
  devicePixelRatio: 1,
  matchMedia(media) {
    queries.push({media, onchange: null});
    return queries.at(-1);
  },
};

function waitUntil(end) {
  for (;;) {
    const next = timers.filter(({at}) => at <= end).sort((a, b) => a.at - b.at)[0];
    if (!next) break;
    timers = timers.filter((timer) => timer !== next);
    now = Math.max(now, next.at);
    next.call();
  }
  now = end;
}

const eye = {name: '', width: 100, height: 100, fx: 100, fy: 100, cx: 50, cy: 50,
             axes: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], eye: [0, 0, -5]};

// A canvas as a page lays it out: as large as its style says, else as its pixels.
function makeCanvas() {
  return {
    width: 300, height: 150, style: {}, listeners: {}, focused: 0,
    get clientWidth() { return parseFloat(this.style.width) || this.width; },
    get clientHeight() { return parseFloat(this.style.height) || this.clientWidth * this.height / this.width; },
    addEventListener(name, call, {signal} = {}) {
      this.listeners[name] = call;
      if (signal) signal.addEventListener('abort', () => { delete this.listeners[name]; });
    },
    toDataURL() { return this.seen; },
    focus() { ++this.focused; },
  };
}

// With a model, on a device that takes `cost` ms for a frame in full resolution; `drawn`: [{width, height, at}].
class TestViewer extends Viewer {
  constructor({cost = 0, model = {cameras: [eye, eye], views: [], bounds: {center: [0, 0, 0], radius: 1}}} = {}) {
    super(makeCanvas());
    Object.assign(this, {cost, drawn: [], sorts: [], errors: []});
    this.onError = (error) => this.errors.push(error.message);
    if (model) this.open(model);
  }

  openContext() {
    let free = 0;
    this.renderer = {
      gl: {isContextLost: () => false},
      get idle() { return now >= free; },
      draw: (gpu, {width, height}) => {
        this.canvas.seen = this.settings.show;
        this.drawn.push({width, height, at: now});
        free = now + this.cost * width * height / (this.canvas.width * this.canvas.height);
      },
    };
  }

  async upload(model) {
    return {settings: {...this.settings}, sorted: true, complete: true, gpu: {}, takeOrder() {}, dispose() {},
            completed() {}, sort: (camera) => this.sorts.push(camera)};
  }
}

function dispose(viewer) {
  viewer.renderer.dispose = () => {};
  viewer.device = {loseContext() {}};
  viewer.dispose();
}

// As a page that has too many contexts does.
function release(viewer) {
  viewer.device = {loseContext: () => viewer.canvas.listeners.webglcontextlost({preventDefault() {}})};
  viewer.release();
}

async function settle(milliseconds = 1000) {
  for (let part = 0; part < 20; ++part) {
    await new Promise((done) => setImmediate(done));
    waitUntil(now + milliseconds / 20);
  }
}

async function makeViewer(given) {
  const viewer = new TestViewer(given);
  await settle();
  return viewer;
}

// The least resolution and the last one, of so many inputs.
function replay(viewer, inputs, pause) {
  let least = 1;
  for (let input = 0; input < inputs; ++input) {
    viewer.changed(true);
    waitUntil(now + pause);
    least = Math.min(least, viewer.motionScale);
  }
  return [least, viewer.motionScale];
}

for (const pause of [60, 100, 140]) {
  const [least] = replay(await makeViewer({cost: 4}), 10, pause);
  expect(`notches ${pause} ms apart on a quick device`, least === 1, least);
}
for (const cost of [80, 700]) {
  const [, last] = replay(await makeViewer({cost}), 400, 8);
  expect(`a device that takes ${cost} ms`, last < 0.9, last);
}
for (const cost of [20, 30, 40, 60, 80]) {
  const viewer = await makeViewer({cost}), scales = new Set();
  replay(viewer, 400, 8);
  for (let input = 0; input < 200; ++input) {
    replay(viewer, 1, 8);
    scales.add(viewer.motionScale);
  }
  expect(`resolutions of a long movement at ${cost} ms`, scales.size === 1, [...scales]);
}
for (const rate of [60, 50, 30]) {
  period = 1000 / rate;
  const viewer = await makeViewer({cost: 4});
  viewer.motionScale = 0.25;
  const [, last] = replay(viewer, 200, 8);
  expect(`a screen of ${rate} Hz`, last === 1, last);
}
period = 1000 / 60;

// A canvas without a size of its own, on a screen with several pixels for one of the page.
for (const ratio of [2, 1.5, 0.5]) {
  window.devicePixelRatio = ratio;
  const viewer = await makeViewer(), {canvas} = viewer;
  const sizes = () => [canvas.width, canvas.height, canvas.clientWidth, canvas.clientHeight];
  const expected = [300 * ratio, 150 * ratio, 300, 150];
  replay(viewer, 5, 40);
  expect(`a canvas at ${ratio} pixels for one`, String(sizes()) === String(expected), sizes());
  viewer.setSize('64x64');
  replay(viewer, 2, 40);
  expect('with a fixed size', String(sizes()) === String([64, 64, 64 / ratio, 64 / ratio]), sizes());
  viewer.setSize('window');
  replay(viewer, 2, 40);
  expect('and without it', String(sizes()) === String(expected), sizes());
  Object.assign(canvas.style, {width: '80px', height: '60px'});
  for (const size of ['64x64', '32x32', 'window']) viewer.setSize(size);
  replay(viewer, 2, 40);
  expect('of a style of its own', String(sizes()) === String([80 * ratio, 60 * ratio, 80, 60]), sizes());
}
window.devicePixelRatio = 1;

// The start view of a model without cameras is one of the canvas' size, whichever was before.
{
  const viewer = await makeViewer({model: {cameras: [], views: [], bounds: {center: [0, 0, 0], radius: 1}}});
  const sight = () => [viewer.orbit.camera.width, viewer.orbit.camera.height, viewer.orbit.distance];
  const before = sight();
  viewer.setSize('64x512');
  await settle();
  expect('the start view of a fixed size', sight()[1] === 64 && sight()[2] > before[2], sight());
  viewer.setSize('window');
  await settle();
  expect('that of the window once more', String(sight()) === String(before), [sight(), before]);
}

// The window on another screen, or zoomed: nothing else says so.
{
  queries.length = 0;
  const viewer = await makeViewer(), {canvas} = viewer;
  const heard = () => queries.filter(({onchange}) => onchange);
  const become = async (ratio) => {
    window.devicePixelRatio = ratio;
    for (const {onchange} of heard()) onchange();
    await settle();
  };
  Object.assign(canvas.style, {width: '300px', height: '150px'});
  await settle();
  for (const ratio of [2, 3, 1]) {
    await become(ratio);
    const {width, height} = viewer.sorts.at(-1), listens = heard().map(({media}) => media).join();
    expect(`a picture at ${ratio} pixels for one`, canvas.width === 300 * ratio && width === 300 * ratio &&
      height === 150 * ratio, [canvas.width, width, height]);
    expect('the ratio that is listened for', listens === `(resolution: ${ratio}dppx)`, listens);
  }
  expect('the size of its own', canvas.style.width === '300px', canvas.style);
  viewer.setSize('64x64');
  await become(2);
  expect('one of a fixed size keeps its pixels', canvas.width === 64 && canvas.style.width === '32px', canvas.style);
  release(viewer);
  expect('a viewer without a context does not listen', heard().length === 0, heard().length);
  await become(4);
  await viewer.resume();
  expect('one that has it back has the size of the screen that is now', heard().length === 1 && canvas.width === 64 &&
    canvas.style.width === '16px', [heard().length, canvas.style]);
  dispose(viewer);
  expect('a viewer that was disposed of listens no more', heard().length === 0, heard().length);
  window.devicePixelRatio = 1;
}

// A larger picture is sorted anew, and its levels chosen; then nothing more is drawn.
{
  const viewer = await makeViewer();
  Object.assign(viewer.canvas.style, {width: '900px', height: '600px'});
  viewer.changed();
  await settle();
  const {width, height} = viewer.sorts.at(-1), drawn = viewer.drawn.length;
  expect('an order for the size that is drawn', width === 900 && height === 600, [width, height]);
  await settle();
  expect('frames of a viewer at rest', viewer.drawn.length === drawn, viewer.drawn.length - drawn);
}

// The wheel is the page's own where there is nothing to zoom.
{
  const turn = (viewer, deltaY, cancelable = true, ctrlKey = false) => {
    let taken = false;
    viewer.canvas.listeners.wheel({deltaY, deltaMode: 0, cancelable, ctrlKey, preventDefault: () => { taken = true; }});
    return taken;
  };
  const empty = await makeViewer({model: null}), viewer = await makeViewer();
  for (const one of [empty, viewer]) listenToHands(one);
  expect('a wheel before there is a model', !turn(empty, 100), 'taken');
  viewer.play();
  expect('a swipe to the side during a flight', turn(viewer, 0) && viewer.playing, viewer.playing);
  expect('a wheel of a gesture that the page has', !turn(viewer, 100, false) && viewer.playing, viewer.playing);
  expect('a wheel', turn(viewer, 100) && !viewer.playing, viewer.playing);
  const far = viewer.orbit.distance;
  turn(viewer, -1200);  // as browsers join twelve of them
  for (let notch = 0; notch < 12; ++notch) turn(viewer, 100);
  const share = viewer.orbit.distance / far;
  expect('a wheel turned there and back', Math.abs(share - 1) < 1e-6, share);
  const near = viewer.orbit.distance;
  turn(viewer, 120, true, true);  // a notch, not a pinch
  const notch = viewer.orbit.distance / near;
  expect('a wheel with Ctrl', notch > 1.1 && notch < 1.6, notch);
  const scrolls = (button, {canvas} = viewer) => {
    let scrolled = true;
    canvas.listeners.mousedown({button, preventDefault: () => { scrolled = false; }});
    return scrolled;
  };
  expect('a middle button, which scrolls pages', scrolls(0) && !scrolls(1) && scrolls(2),
         [0, 1, 2].map((one) => scrolls(one)));
  expect('one before there is a model', scrolls(1, empty) && empty.canvas.focused === 0, empty.canvas.focused);
  const {focused} = viewer.canvas;
  scrolls(1);
  expect('the focus that it gives', viewer.canvas.focused === focused + 1, viewer.canvas.focused - focused);
  const own = Object.keys((await makeViewer()).canvas.listeners).join();
  const left = ({canvas}) => Object.keys(canvas.listeners).join();
  const stop = listenToHands(viewer);
  expect('hands that are listened to', left(viewer).includes('pointermove,'), left(viewer));
  if (stop) stop();
  expect('hands that are listened to no more', left(viewer) === own, left(viewer));
  listenToHands(viewer);
  dispose(viewer);
  expect('hands of a viewer that was disposed of', left(viewer) === own, left(viewer));
}

// A page that fingers have enlarged can be made smaller on the picture, too.
{
  const viewer = await makeViewer(), {canvas} = viewer;
  const stop = listenToHands(viewer);
  const enlarge = (times) => {
    visualViewport.width = 390 / times;
    visualViewport.dispatchEvent(new Event('resize'));
  };
  const pinchIsTaken = () => {
    let taken = false;
    canvas.listeners.wheel({deltaY: 5, deltaMode: 0, ctrlKey: true, cancelable: true,
                            preventDefault: () => { taken = true; }});
    return taken;
  };
  expect('a pinch', pinchIsTaken() && !canvas.style.touchAction, canvas.style);
  enlarge(2);
  expect('fingers on a page that is enlarged', canvas.style.touchAction === 'pinch-zoom', canvas.style);
  expect('a pinch of a trackpad there', !pinchIsTaken(), 'taken');
  enlarge(1);
  expect('on one that is so no more', pinchIsTaken() && !canvas.style.touchAction, canvas.style);
  enlarge(2);
  stop();
  listenToHands(viewer);
  expect('hands that are listened to there', canvas.style.touchAction === 'pinch-zoom', canvas.style);
  enlarge(1);
  dispose(viewer);
  enlarge(2);
  expect('a viewer that was disposed of there', !canvas.style.touchAction, canvas.style);
  enlarge(1);
  // Without a doctype the body is what scrolls, and the root as wide as its style says.
  document.documentElement.clientWidth = 1400;
  document.scrollingElement = {clientWidth: 390};
  const quirky = await makeViewer();
  listenToHands(quirky);
  expect('a page in quirks mode', !quirky.canvas.style.touchAction, quirky.canvas.style);
  document.documentElement.clientWidth = 390;
  delete document.scrollingElement;

  // The page's own style stays.
  for (const end of ['stop', 'dispose']) {
    const viewer = await makeViewer(), {style} = viewer.canvas, seen = [];
    style.touchAction = 'none';
    const stop = listenToHands(viewer);
    for (const times of [1, 2, 1, 2]) {
      enlarge(times);
      seen.push(style.touchAction);
    }
    if (end === 'stop') stop(); else dispose(viewer);
    seen.push(style.touchAction);
    expect(`a canvas with a style of its own to ${end}`, seen.join() === 'none,pinch-zoom,none,pinch-zoom,none', seen);
    enlarge(1);
  }

  // Of two fingers there the first steps come to the page before the browser takes them.
  const pinched = await makeViewer();
  pinched.canvas.setPointerCapture = () => {};
  listenToHands(pinched);
  const finger = (name, pointerId, clientX) => pinched.canvas.listeners[name](
    {pointerId, isPrimary: pointerId === 1, clientX, clientY: 50, buttons: 1});
  const zoomOf = (times) => {
    enlarge(times);
    const {distance} = pinched.orbit;
    finger('pointerdown', 1, 20);
    finger('pointerdown', 2, 40);
    finger('pointermove', 2, 80);
    for (const id of [1, 2]) finger('pointerup', id, 0);
    return pinched.orbit.distance / distance;
  };
  expect('two fingers', Math.abs(zoomOf(1) - 1 / 3) < 1e-6, zoomOf(1));
  expect('two on a page that is enlarged', zoomOf(2) === 1, zoomOf(2));
  enlarge(1);
}

// What there is not is told, and the view stays.
{
  const viewer = await makeViewer(), empty = await makeViewer({model: null});
  const told = (call) => {
    try {
      call();
    } catch (error) {
      return error.message;
    }
    return 'nothing';
  };
  const before = viewer.orbit.camera;
  for (const [call, words] of [
    [() => viewer.jump(99), 'there is no camera 99 (expected 0 to 1)'],
    [() => viewer.jumpToView(99), 'the model has no views'],
    [() => viewer.apply({camera: null}), 'camera=null (expected 0 to 1)'],
    [() => viewer.apply({camera: {}}), ''],
    [() => viewer.apply({camera: '0x1'}), 'camera=0x1 (expected 0 to 1)'],
    [() => viewer.apply({camera: '1e0'}), 'camera=1e0 (expected 0 to 1)'],
    [() => viewer.apply({camera: ' 1'}), 'camera= 1 (expected 0 to 1)'],
    [() => viewer.apply({size: '64x1e2'}), 'size=64x1e2 (expected WxH'],
    [() => viewer.apply({'splat-budget': '1e3'}), 'splat-budget=1e3 (expected a number of Gaussians)'],
    [() => empty.jump(0), 'there is no model yet'],
    [() => empty.jump(-1), 'there is no model yet'],
    [() => empty.jumpToView(0), 'there is no model yet'],
    [() => empty.apply({camera: 0}), 'there is no model yet'],
    [() => empty.apply({camera: eye}), 'there is no model yet'],
    [() => empty.apply({view: 0}), 'there is no model yet'],
    [() => empty.apply({'splat-budget': 5}), 'there is no model yet'],
  ]) {
    const found = told(call);
    expect(words, found.startsWith(words) && found !== 'nothing', found);
    expect(`the view after ${words}`, viewer.orbit.camera === before && viewer.cameraIndex === 0, viewer.cameraIndex);
  }
  const replaced = empty.replace({cameras: [eye], views: [], bounds: {center: [0, 0, 0], radius: 1}});
  const found = await replaced.then(() => empty.cameraIndex, (error) => error.message);
  expect('a model that replaces none', found === 0, found);
}

// A notch is a tenth of the way in scenes of all sizes.
for (const radius of [2e-3, 1, 2e6, 1e12]) {
  const orbit = new Orbit({cameras: [], bounds: {center: [0, 0, 0], radius}});
  orbit.start(640, 480);
  const before = orbit.distance;
  orbit.dolly(0.9);
  const shares = [orbit.distance / before, Math.hypot(...orbit.camera.eye) / before];
  expect(`a notch at a radius of ${radius}`, shares.every((share) => Math.abs(share - 0.9) < 1e-6), shares);
}

// Every picture is of its own settings, and what was set before something that cannot be is seen.
{
  const viewer = await makeViewer(), wanted = ['alpha', 'nonsense', 'depth', 'final'];
  const pictures = Promise.all(wanted.map((show) => viewer.picture({show}).catch((error) => error.message)));
  await settle();
  const found = await Promise.race([pictures, ['none']]);
  expect('pictures asked for at once', found.length === 4 && found[1].startsWith('show=nonsense') &&
    [0, 2, 3].every((k) => found[k] === wanted[k]), found);
  const drawn = viewer.drawn.length;
  try {
    viewer.apply({show: 'alpha', camera: 99});
  } catch {
    await settle();
  }
  expect('what was set before', viewer.canvas.seen === 'alpha' && viewer.drawn.length > drawn, viewer.canvas.seen);
}

// A picture of which nothing comes is told, and the next one is not held up; where something may come it is waited for.
{
  const outcomes = (viewer, wanted) => {
    const found = wanted.map(() => 'waits');
    for (const [k, show] of wanted.entries()) {
      viewer.picture({show}).then((seen) => { found[k] = seen; }, (error) => { found[k] = error.message; });
    }
    return found;
  };
  const viewer = await makeViewer();
  viewer.splats.sorted = false;
  const found = outcomes(viewer, ['alpha', 'depth']);
  await settle(50000);
  expect('a picture that takes long', String(found) === 'waits,waits', found);
  await settle(15000);
  viewer.splats.sorted = true;
  expect('a picture that never stands', found[0].startsWith('No picture'), found);
  await settle();
  viewer.changed();
  await settle();
  expect('the one after it', found[1] === 'depth', found);

  const moved = await makeViewer();
  moved.splats.sorted = false;
  const later = outcomes(moved, ['base']);
  for (let part = 0; part < 8; ++part) {
    moved.changed();
    await settle(20000);
  }
  expect('a picture of which something comes', later[0] === 'waits', later);
  moved.splats.sorted = true;
  moved.changed();
  await settle();
  expect('until it stands', later[0] === 'base', later);

  const {requestAnimationFrame: usual} = globalThis, held = [];
  const unseen = await makeViewer();
  globalThis.requestAnimationFrame = (call) => held.push(call);
  const there = outcomes(unseen, ['normal']);
  await settle(200000);
  expect('a picture on a page that is not seen', there[0] === 'waits', there);
  globalThis.requestAnimationFrame = usual;
  for (const call of held) usual(call);
  await settle();
  expect('once it is seen', there[0] === 'normal' && unseen.watchTimer === 0, [there, unseen.watchTimer]);

  // A device that is lost is, one that was given back is not.
  const lost = await makeViewer();
  lost.renderer.gl.isContextLost = () => true;
  globalThis.document.hidden = true;
  const gone = outcomes(lost, ['alpha']);
  await settle(200000);
  expect('a picture of a lost device on a page that is not seen', gone[0] === 'waits', gone);
  globalThis.document.hidden = false;
  await settle(58000);
  expect('on one that is seen, for a while', gone[0] === 'waits', gone);
  await settle(4000);
  expect('for long', gone[0].startsWith('The browser has taken the graphics device away'), gone);

  const released = await makeViewer(), {gl} = released.renderer, is = gl.isContextLost;
  release(released);
  gl.isContextLost = () => true;
  const wanted = outcomes(released, ['depth']);
  await settle(200000);
  expect('a picture of a viewer without a context', wanted[0] === 'waits', wanted);
  gl.isContextLost = is;
  await released.resume();
  await settle();
  expect('once it has one', wanted[0] === 'depth', wanted);
}

// A model whose device is lost while it is put there, and for good, holds up nobody; one that is released meanwhile
// waits.
{
  const outcome = (promise) => {
    const found = {};
    promise.then(() => { found.is = 'done'; }, (error) => { found.is = error.message; found.isLoss = error.isLoss; });
    return found;
  };
  const {cameras, views, bounds} = (await makeViewer()).model, model = () => ({cameras, views, bounds});
  for (const first of [true, false]) {
    const viewer = await makeViewer(first ? {model: null} : {}), {gl} = viewer.renderer, before = viewer.model;
    const {upload} = viewer;
    viewer.upload = Viewer.prototype.upload;
    gl.isContextLost = () => true;
    const opened = outcome(viewer.open(model())), waits = outcome(viewer.settled());
    globalThis.document.hidden = true;
    await settle(100000);
    globalThis.document.hidden = false;
    await settle(50000);
    expect('a model whose device was lost a while ago', opened.is === undefined, opened);
    await settle(15000);
    expect('one whose device stays away', opened.isLoss && opened.is.startsWith('The browser has taken'), opened);
    if (first) expect('who waits for its picture', waits.is === opened.is, waits);
    expect('the model before it', viewer.model === before && viewer.uploads === 0, viewer.uploads);
    const again = outcome(viewer.open(model()));
    await settle(10000);
    gl.isContextLost = () => false;
    viewer.upload = upload;
    viewer.openContext();
    viewer.goOn();
    await settle(1000);
    expect('one whose device comes back', again.is === 'done', again);
    await settle(100000);
    expect('looks for a device that is there', timers.length === 0, timers.length);
  }
  const viewer = await makeViewer();
  viewer.upload = Viewer.prototype.upload;
  release(viewer);
  viewer.renderer.gl.isContextLost = () => true;
  const opened = outcome(viewer.open(model()));
  await settle(200000);
  expect('one of a viewer without a context', opened.is === undefined, opened);
  dispose(viewer);
}

// Who waits for the picture of a first model is told that there is none.
{
  const viewer = await makeViewer({model: null});
  let told = 'nothing';
  viewer.settled().catch((error) => { told = error.message; });
  viewer.upload = async () => { throw new Error('does not fit'); };
  viewer.open({cameras: [eye], views: [], bounds: {center: [0, 0, 0], radius: 1}}).catch(() => {});
  await settle();
  expect('a first model that cannot be shown', told === 'does not fit' && viewer.watchTimer === 0, told);
}

// An answer that is silent for long is given up, one that is slow is not.
{
  let send = null, ended = null;
  globalThis.fetch = async (_, {signal}) => new Response(new ReadableStream({
    start(controller) {
      send = () => signal.aborted || controller.enqueue(new Uint8Array(10));
      ended = () => signal.aborted || controller.close();
      signal.addEventListener('abort', () => controller.error(signal.reason));
    },
  }));
  const outcome = (options) => {
    const found = {};
    fetchBytes('http://server/a', options).then(({length}) => { found.is = length; },
                                                (error) => { found.is = error.message || error; });
    return found;
  };
  const slow = outcome();
  for (let part = 0; part < 5; ++part) {
    await settle(40000);
    send();
  }
  await settle(40000);
  ended();
  await settle();
  expect('a slow answer', slow.is === 50, slow);
  const silent = outcome();
  await settle(59000);
  expect('one that is silent for a while', silent.is === undefined, silent);
  await settle(8000);
  expect('one that is silent', silent.is === 'http://server/a: no bytes for 60 s', silent);
  const stop = new AbortController(), stopped = outcome({signal: stop.signal});
  await settle();
  stop.abort('enough');
  await settle();
  expect('one that is stopped', stopped.is === 'enough' && timers.length === 0, [stopped, timers.length]);

  // A browser sends some requests at a time; those that it keeps back are not silent.
  const {fetch} = globalThis, connections = 6, kept = [], sent = [];
  globalThis.fetch = (...asked) => new Promise((done, no) => {
    asked[1].signal.addEventListener('abort', () => no(asked[1].signal.reason));
    kept.push(() => {
      done(fetch(...asked));
      sent.push({send, ended});
    });
    if (kept.length <= connections) kept[kept.length - 1]();
  });
  const many = Array.from({length: 8}, () => outcome());
  for (let part = 0; part < 4; ++part) {
    await settle(40000);
    for (const one of sent) one.send();
  }
  expect('more requests than connections', many.every(({is}) => is === undefined), many);
  for (const one of sent.splice(0)) one.ended();
  for (const begin of kept.slice(connections)) begin();
  await settle();
  for (const one of sent) one.ended();
  await settle();
  expect('once all were sent', String(many.map(({is}) => is)) === '40,40,40,40,40,40,0,0', many);
  globalThis.fetch = fetch;

  // A page that stood still hears of what came meanwhile after its timers.
  const frozen = outcome();
  await settle(30000);
  now += 3600000;
  await settle(25000);
  send();
  await settle(50000);
  expect('an answer on a page that was frozen', frozen.is === undefined, frozen);
  await settle(20000);
  expect('that is silent from then on', frozen.is === 'http://server/a: no bytes for 60 s', frozen);
}

console.log(failures.join('\n') || 'the viewer does what it is to do');
process.exit(failures.length > 0 ? 1 : 0);

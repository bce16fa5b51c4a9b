// SPDX-License-Identifier: Apache-2.0
// The page that holds its model, or streams a scene beside it: loads, unpacks and shows it, and takes what the address
// asks for.

const WATCH = 100;                         // [ms] between two looks at what has come of the page
const STALLED = 10000;                     // [ms] without more of it that are spoken of
const PIECE = 1 << 19;                     // characters of base64 at a time
const SHARES = {come: 0.6, unpacked: 0.7, read: 0.85};  // of the bar, when that is done

let watching = 0;

function showLoading(share) {
  const bar = element('loading');
  bar.firstElementChild.style.width = `${100 * share}%`;
  bar.setAttribute('aria-valuenow', String(Math.round(100 * share)));
  bar.hidden = share >= 1;
}

// Of a model of `total` characters of base64, of which so many have come.
function cutOff(come, total) {
  const bytes = (characters) => Math.floor(characters * 3 / 4);
  return 'This file is cut off' + (come < total ? ` (${bytes(come)} of ${bytes(total)} bytes of its model)` : '') +
    ': copy or export it again.';
}

// While the model, `total` characters, comes. Browsers do not say that a connection broke.
function watchLoading(total) {
  for (const id of ['cut', 'barred']) element(id).remove();  // also where styles, which hide them, are forbidden
  let before = -1, since = 0, told = false;
  watching = setInterval(() => {
    let come = 0;
    for (const node of document.querySelectorAll('script.model')) {
      for (const part of node.childNodes) come += part.length;
    }
    if (document.readyState !== 'loading') {  // and startViewer(), at the end of the page, was not called
      fail(new Error(location.protocol === 'file:' ? cutOff(come, Number(total))
                                                   : 'This page has not come as a whole: reload it.'));
      return;
    }
    if (come !== before) {
      [before, since] = [come, performance.now()];
      if (told) showMessage('');
      told = false;
    } else if (!told && performance.now() - since > STALLED) {
      told = true;
      showMessage('Nothing more of this page comes: wait, or reload it where the connection is gone.');
    }
    showLoading(SHARES.come * Math.min(come / Math.max(Number(total), 1), 1));
  }, WATCH);
}

function fail(error) {
  clearInterval(watching);
  showLoading(1);
  showMessage(error.message);
  window.__done = {error: error.message};
}

// The model in the page: base64 of a gzip stream, in elements that are dropped as they are read.
async function unpackPayload() {
  const nodes = [...document.querySelectorAll('script.model')];
  if (nodes.length === 0) return null;
  let text = '', at = 0;
  const source = new ReadableStream({
    async pull(controller) {
      await breathe();
      if (at >= text.length) {
        const node = nodes.shift();
        if (!node) {
          controller.close();
          return;
        }
        text = node.textContent.trim();
        at = 0;
        node.remove();
      }
      const bits = atob(text.slice(at, at + PIECE));
      at += PIECE;
      const bytes = new Uint8Array(bits.length);
      for (let i = 0; i < bytes.length; ++i) bytes[i] = bits.charCodeAt(i);
      controller.enqueue(bytes);
    },
  });
  const stream = source.pipeThrough(new DecompressionStream('gzip'));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// The address of a scene with levels of detail that the page shows in place of a model of its own, or null.
function streamedAddress() {
  const node = document.querySelector('script.stream');
  if (!node) return null;
  if (location.protocol === 'file:') {
    throw new Error('This page streams its scene, which browsers do from a server only: "python3 -m http.server" in ' +
                    'its folder, then localhost:8000 in the browser.');
  }
  return JSON.parse(node.textContent);
}

async function readPayload() {
  const bytes = await unpackPayload().catch(() => {
    throw new Error('The model in this page is damaged.');
  });
  if (!bytes) throw new Error('The page holds no model.');
  showLoading(SHARES.unpacked);
  return readModel(bytes);
}

// Why nothing is opened of what was dropped, or ''.
function refusalOf(files, entry) {
  if (files.length > 1) return `and ${files.length - 1} more at once (expected one .glb or .sog)`;
  return entry && entry.isDirectory ? 'a folder (expected a .glb or .sog)' : '';
}

// Another file dropped on the page. A broken one is reported and leaves the old model.
function listenToDrops(viewer, panel) {
  let drops = 0, lines = 0;
  addEventListener('drop', async (event) => {
    const {files, items} = event.dataTransfer, [file] = files;
    if (!file) return;
    const [entry] = [...items].map((item) => item.webkitGetAsEntry()).filter(Boolean);  // none once the event is over
    const refusal = refusalOf(files, entry), line = ++lines;
    showMessage(refusal && `${file.name}: ${refusal}`);
    if (refusal) return;
    const own = ++drops;
    try {
      showLoading(SHARES.come);
      const model = await readModel(new Uint8Array(await file.arrayBuffer()));
      if (own !== drops) return;  // a later one is wanted
      showLoading(SHARES.read);
      await viewer.open(model);
      if (viewer.model !== model) return;
      if (line === lines && model.notes.length > 0) showMessage(model.notes.join(' '), 'note');
      panel.name = document.title = file.name;
      panel.fromAddress = false;
      panel.fill();
    } catch (error) {
      if (own === drops) showMessage(`${file.name}: ${error.message}`);
    } finally {
      if (own === drops) showLoading(1);
    }
  });
}

// Settings of tgview's picture that pages do not have.
const ONLY_TGVIEW = ['sort', 'texture-filter', 'antialiasing', 'opacity-scale', 'splat-scale', 'sh-degree', 'near',
                     'crop', 'exposure', 'gain', 'colors', 'range'];

// Why what an address says beside the viewer's settings is not done. Names that are nobody's here may be for the page's
// server, or for who counts its visitors.
function refusals({lod}, wanted) {
  const reasons = ONLY_TGVIEW.filter((key) => wanted[key] !== undefined)
    .map((key) => `${key}=${wanted[key]} (pages do not have this setting of tgview's)`);
  if (wanted.panel !== undefined && !['on', 'off'].includes(wanted.panel)) {
    reasons.push(`panel=${wanted.panel} (expected on, off)`);
  }
  if (wanted['splat-budget'] !== undefined && !lod) {
    reasons.push(`splat-budget=${wanted['splat-budget']} (expected none: the model has no levels of detail)`);
  }
  return reasons;
}

// What the address says of the view; what cannot be is named, and the rest is done.
function takeAddress(viewer) {
  const words = (text) => Object.fromEntries(new URLSearchParams(text));
  const first = words(location.search), then = words(location.hash.slice(1));
  if (then.camera !== undefined || then.view !== undefined) {
    delete first.camera;
    delete first.view;
  }
  const wanted = {...first, ...then};
  const reasons = [...viewer.applyWhatCan(wanted), ...refusals(viewer.model, wanted)];
  const notes = [...viewer.model.notes, ...reasons.map((reason) => `The address: ${reason}.`)];
  showMessage(notes.join(' '), 'note');
  return wanted;
}

// Called at the end of the page. Sets window.__done to {gaussians} when the first picture stands, or to {error}.
// window.tgViewer offers picture(), apply() and settled() to tests; the address takes apply()'s settings and panel=off.
async function startViewer() {
  clearInterval(watching);
  for (const name of ['dragover', 'drop']) addEventListener(name, (event) => event.preventDefault());  // leaves no page
  try {
    if (typeof DecompressionStream === 'undefined') throw new Error('This browser is too old: no DecompressionStream.');
    const viewer = openViewer();
    showLoading(SHARES.come);
    const streamed = streamedAddress();
    const splatBudget = wholeNumber(new URLSearchParams(location.search).get('splat-budget')) || undefined;
    const model = streamed ? await loadModel(streamed, {splatBudget}) : await readPayload();
    showLoading(SHARES.read);
    await viewer.open(model);
    const panel = new Panel(viewer, document.title);
    const {panel: wanted} = takeAddress(viewer);
    panel.fill();
    if (wanted === 'off') panel.showBar(false);
    listenToHands(viewer);
    listenToDrops(viewer, panel);
    addEventListener('resize', () => viewer.changed());
    addEventListener('hashchange', () => {
      viewer.settings = {...Splats.settingsOf(viewer.model)};  // an address names what differs from these
      takeAddress(viewer);
      panel.fill();
    });
    window.tgViewer = viewer;
    await viewer.settled();
    showLoading(1);
    window.__done = {gaussians: (model.lod || model).count};
  } catch (error) {
    fail(error);
  }
}

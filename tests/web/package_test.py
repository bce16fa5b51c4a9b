#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the pictures of the npm package in web/ against tgview's: its examples, as they are, in a headless Chromium.

    tests/web/package_test.py BIN [MODEL [NAME...]]   NAME: of element three babylon playcanvas; default: all

BIN is the folder of tgconvert and tgview, default model docs/sample.tgz. Engines come from where viewers_test.py looks
for them; without them the element is shown alone. TG_WEB_PICTURES=FOLDER keeps the pictures. Skips (exit code 77)
without Chromium.
"""
import functools
import http.server
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import threading
import time

from chromium import Chromium, Difference, find_chromium, from_data_url
from viewer_pages import find_packages

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
LEAST_DB = 38.0  # what the package promises
SIDE = 160       # [px]
LIMIT_SECONDS = 240
ENGINES = ["three", "babylon", "playcanvas"]
CAMERAS = [0, 36]
failures = []


def expect(what, ok, found=""):
    print(f"{'ok' if ok else 'FAILED'}: {what}{f': {found}' if str(found) else ''}", flush=True)
    if not ok:
        failures.append(what)


class Server:
    """web/ with a model beside its examples; what they take from unpkg.com comes from the packages that are here."""

    def __init__(self, modules, models):
        class Handler(http.server.SimpleHTTPRequestHandler):
            extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".mjs": "text/javascript"}

            def do_GET(self):
                if not self.path.endswith(".html"):
                    return super().do_GET()
                text = (REPOSITORY / self.path[1:]).read_text().replace("https://unpkg.com/", "/packages/").encode()
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(text)))
                self.end_headers()
                self.wfile.write(text)

            def translate_path(self, path):
                path = path.split("?")[0]
                if path.startswith("/packages/"):
                    return str(modules / re.sub(r"@\d[^/]*", "", path.removeprefix("/packages/")))
                name = path.rsplit("/", 1)[1]
                return str(models / name) if name.startswith("scene") else str(REPOSITORY / path[1:])

            def log_message(self, *_):
                pass
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_port}/web/examples"


def until(browser, expression):
    end = time.monotonic() + LIMIT_SECONDS
    while time.monotonic() < end:
        found = browser.evaluate(expression)
        if found:
            return found
        time.sleep(0.2)
    raise RuntimeError(f"{expression}: not within {LIMIT_SECONDS} s; {browser.log}")


def at_rest(browser):
    """The window, once what is in it has been drawn in the right order and then once more."""
    until(browser, "new Promise((done) => { let settled = 0; const look = () => { settled = example.gaussians.settled ? "
          "settled + 1 : 0; if (settled > 2) done(true); else requestAnimationFrame(look); }; look(); })")
    return browser.screenshot()


def keep(name, picture):
    if "TG_WEB_PICTURES" in os.environ:
        pathlib.Path(os.environ["TG_WEB_PICTURES"], f"{name}.png").write_bytes(picture)


def compare(browser, name, picture, reference):
    keep(name, picture)
    found = Difference(browser, picture, reference)
    expect(f"{name} against tgview, at least {LEAST_DB:.0f} dB", found.psnr >= LEAST_DB, found)


def show_element(browser, address, references):
    browser.page("Page.navigate", url=f"{address}/element.html")
    until(browser, "Boolean((document.querySelector('textured-gaussians') || {}).model)")
    loaded = "document.querySelector('textured-gaussians')"
    for file, camera in references:
        picture = browser.evaluate(f"""(async (element) => {{
            element.viewer.setSize('{SIDE}x{SIDE}');
            if (element.src !== '{file}') {{
              const loaded = new Promise((done, no) => {{
                element.addEventListener('load', done, {{once: true}});
                element.addEventListener('error', ({{detail}}) => no(detail.error), {{once: true}});
              }});
              element.src = '{file}';
              await loaded;
            }}
            return element.picture({{camera: window.cameras ? window.cameras[{camera}] : {camera}, background: 'white'}});
        }})({loaded})""")
        browser.evaluate(f"window.cameras = window.cameras || {loaded}.model.cameras; 0")
        compare(browser, f"element, {file}, camera {camera}", from_data_url(picture), references[file, camera])
    given_back = browser.evaluate(f"""(async (element) => {{
        const own = JSON.stringify(element.viewer.settings);
        for (const [name, value] of [['show', 'alpha'], ['textures', 'off'], ['intersection', 'plane'],
                                     ['outside', 'clip'], ['background', '0.2,0.4,0.6']]) {{
          element.setAttribute(name, value);
          await element.picture();
          if (JSON.stringify(element.viewer.settings) === own) return `${{name}} does nothing`;
          element.removeAttribute(name);
          await element.picture();
          const now = JSON.stringify({{...element.viewer.settings, background: JSON.parse(own).background}});
          if (now !== own) return `${{name}}: ${{now}}, not ${{own}}`;
        }}
        return String(element.viewer.settings.background) === String(element.model.background) ||
          `background ${{element.viewer.settings.background}}`;
    }})({loaded})""")
    expect("an attribute that is taken away gives the model's own back", given_back is True, given_back)
    expect("the element takes arrow keys", browser.evaluate(f"""(({{viewer}}) => {{
        const before = viewer.viewText;
        viewer.canvas.dispatchEvent(new KeyboardEvent('keydown', {{key: 'ArrowLeft', bubbles: true}}));
        return viewer.viewText !== before;
    }})({loaded})"""))
    told = browser.evaluate("""(async () => {
        const element = document.createElement('textured-gaussians');
        window.named = element;
        const sources = ['a/sc%C3%A9ne%201.glb?token=abc#x', 'city/lod-meta.json', '100%.sog', 'data:,x', ''];
        const names = sources.map((src) => {
          element.src = src;
          return element.canvas.ariaLabel;
        });
        element.title = 'a title';
        names.push(element.canvas.ariaLabel);
        element.setAttribute('alt', 'a fox');
        document.body.append(element);
        return [...names, element.canvas.ariaLabel];
    })()""")
    view = [f"3D view of {name}" for name in ("sc\u00e9ne 1.glb", "city", "100%.sog", "a model", "a model")]
    expect("an element is called by its text, its title or its file", told == [*view, "a title", "a fox"], told)
    took = browser.evaluate("""(async () => {
        const element = document.createElement('textured-gaussians'), began = performance.now();
        for (const begin of ['data:model/gltf-binary;base64,', '']) {
          element.src = begin + `${'A'.repeat(500)}/`.repeat(1e4);
        }
        return performance.now() - began;
    })()""")
    expect("which takes no time from a long address", took < 500, took)
    names = browser.pictures_told()
    expect("and is a picture to screen readers", "a fox" in names and len(names) == 2, names)
    browser.evaluate("named.canvas.focus({focusVisible: true})")
    rings = browser.evaluate("[getComputedStyle(named.canvas).outlineStyle,"
                             " getComputedStyle(named.shadowRoot.querySelector('i')).display]")
    expect("that shows where the keyboard is, by a light ring and a dark one", rings == ["solid", "block"], rings)
    browser.page("Emulation.setEmulatedMedia", features=[{"name": "forced-colors", "value": "active"}])
    dark = browser.evaluate("getComputedStyle(named.shadowRoot.querySelector('i')).borderTopColor")
    expect("which stays dark in colours of the system's own", dark == "rgb(16, 17, 20)", dark)
    browser.page("Emulation.setEmulatedMedia", features=[])
    high = browser.evaluate("""(() => {
        Object.assign(named.style, {height: '40px', aspectRatio: 'auto'});
        named.words.textContent = 'a word';
        return named.words.clientHeight - 16;
    })()""")
    expect("a line of its words is seen in a small one", high >= 18, high)
    browser.evaluate("named.canvas.blur()")
    dark = browser.evaluate("getComputedStyle(named.shadowRoot.querySelector('i')).display")
    expect("and that it is not", dark == "none", dark)
    browser.evaluate("named.remove()")
    # An element of a fixed size on another screen; Chromium says nothing of one that is as wide.
    browser.evaluate(f"{loaded}.viewer.setSize('window'); {loaded}.style.width = '100px'; {loaded}.viewer.settled()")
    for ratio in (2, 1):
        browser.page("Emulation.setDeviceMetricsOverride", width=SIDE + 10 * (ratio - 1), height=SIDE,
                     deviceScaleFactor=ratio, mobile=False)
        until(browser, f"{loaded}.canvas.width === {100 * ratio}")
    browser.page("Emulation.setDeviceMetricsOverride", width=SIDE, height=SIDE, deviceScaleFactor=2, mobile=False)
    found = browser.evaluate("""(async () => {
        const {Viewer, loadModel} = await import('/web/src/index.js');
        const canvas = document.createElement('canvas'), viewer = new Viewer(canvas), seen = [];
        document.body.append(canvas);
        const look = async () => {
          viewer.changed();
          for (let i = 0; i < 2; ++i) await viewer.settled();
          seen.push([canvas.width, canvas.height, canvas.clientWidth, canvas.clientHeight]);
        };
        await viewer.open(await loadModel('scene.glb'));
        await look();
        viewer.setSize('64x64');
        await look();
        viewer.setSize('window');
        await look();
        const host = document.createElement('div');
        host.attachShadow({mode: 'open'}).append(canvas);
        document.body.append(host);
        await look();
        seen.push(document.adoptedStyleSheets.length);
        viewer.dispose();
        host.remove();
        return seen;
    })()""")
    own = [600, 300, 300, 150]
    expect("a canvas without a size keeps its own, wherever it stands", found == [own, [64, 64, 32, 32], own, own, 0],
           found)
    browser.page("Emulation.setDeviceMetricsOverride", width=SIDE, height=SIDE, deviceScaleFactor=1, mobile=False)
    told = browser.evaluate(f"""(async (element) => {{
        const failed = new Promise((done) => element.addEventListener('error', ({{detail}}) => done(detail.error.message)));
        element.src = 'scene.none';
        return await failed;
    }})({loaded})""")
    expect("and says what it cannot show", "404" in told, told)
    told = browser.evaluate(f"""(async (element) => {{
        element.setAttribute('view', '0');
        await element.picture();
        return element.words.textContent;
    }})({loaded})""")
    expect("and a view that there is not", "the model has no views" in told, told)
    told = browser.evaluate("""(async () => {
        const element = document.createElement('textured-gaussians');
        const failed = new Promise((done) => element.addEventListener('error', ({detail}) => done(detail.error.message)));
        element.src = 'http://localhost:1/' + 'a'.repeat(9999);
        document.body.append(element);
        const told = await failed;
        element.remove();
        return [told.length < 400, /: no answer/.test(told), element.viewer === null];
    })()""")
    expect("an address that does not answer is told in short, without a context", told == [True] * 3, told)


MANY = 20
WITH_CONTEXT = "elements.filter(({viewer}) => viewer && !viewer.renderer.gl.isContextLost()).length"
LOOK_AT = """(async (index) => {
  const element = elements[index];
  element.scrollIntoView({block: 'center'});
  while (!element.model || element.still || !element.viewer.splats || !element.viewer.splats.sorted) {
    await new Promise((done) => setTimeout(done, 20));
  }
  return element.viewer.viewText;
})"""


def show_many(browser, address, references):
    browser.page("Page.navigate", url=f"{address}/element.html")
    until(browser, "Boolean((document.querySelector('textured-gaussians') || {}).model)")
    loaded = browser.evaluate(f"""(async () => {{
        window.elements = Array.from({{length: {MANY}}}, () => document.createElement('textured-gaussians'));
        window.loads = 0;
        for (const element of elements) {{
          element.style.height = '{SIDE}px';
          element.addEventListener('load', () => ++loads);
          element.src = 'scene.glb';
        }}
        document.body.replaceChildren(...elements);
        return true;
    }})()""")
    until(browser, f"loads === {MANY}")
    browser.evaluate(f"{LOOK_AT}(0)")
    browser.evaluate("elements[0].viewer.apply({camera: 36, background: 'white'}); elements[0].viewer.settled()")
    view = browser.evaluate("elements[0].viewer.viewText")
    most = 0
    for index in range(MANY):
        browser.evaluate(f"{LOOK_AT}({index})")
        most = max(most, browser.evaluate(WITH_CONTEXT))
    expect(f"of {MANY} elements at most 8 have a context, and each is shown", loaded and 1 < most <= 8, most)
    asleep = browser.evaluate("""(({still, viewer}) => {
        const {data} = still.getContext('2d').getImageData(0, 0, still.width, still.height);
        return [viewer.renderer.gl.isContextLost(), new Set(new Uint32Array(data.buffer)).size > 100];
    })(elements[0])""")
    expect("one that was seen before is a still picture", asleep == [True, True], asleep)
    back = browser.evaluate(f"{LOOK_AT}(0)")
    expect("and comes back with its view", back == view, [back, view])
    before = len(browser.requests)
    again = browser.evaluate(f"""(async () => {{
        const [element] = elements;
        element.remove();
        let lost = false;
        for (let left = 100; left > 0 && !lost; --left) {{
          await new Promise((done) => setTimeout(done, 50));
          lost = element.viewer.renderer.gl.isContextLost();
        }}
        document.body.prepend(element);
        await {LOOK_AT}(0);
        return [lost, element.viewer.viewText === '{view}'];
    }})()""")
    fetched = [url for url in browser.requests[before:] if "scene" in url]
    expect("one taken out and put in again goes on, without a download", again == [True, True] and not fetched,
           [again, fetched])
    woken = browser.evaluate("""(async ([element]) => {
        element.sleep();
        await new Promise((done) => setTimeout(done, 300));
        const {gl} = element.viewer.renderer, {createTexture} = gl;
        gl.createTexture = () => {
          gl.createTexture = createTexture;
          element.viewer.device.loseContext();
          setTimeout(() => element.viewer.device.restoreContext(), 200);
          return createTexture.call(gl);
        };
        const waits = new Promise((done) => setTimeout(done, 20000, 'waits'));
        return Promise.race([element.wake().then(() => element.viewer.splats !== null), waits]);
    })(elements)""")
    expect("a device that is lost while one wakes is given back to it", woken is True, woken)
    browser.evaluate(f"elements[0].viewer.setSize('{SIDE}x{SIDE}')")
    compare(browser, "element, after it gave its context back", from_data_url(browser.evaluate("elements[0].picture()")),
            references["scene.glb", 36])
    for when, pause in (("at once", ""), ("after a while", "await new Promise((done) => setTimeout(done, 100));")):
        picture = browser.evaluate(f"""(async ([element]) => {{
            const {{device}} = element.viewer;
            device.loseContext();
            setTimeout(() => device.restoreContext(), 200);
            {pause}
            return element.picture();
        }})(elements)""")
        compare(browser, f"element, asked for a picture {when} while its device is lost", from_data_url(picture),
                references["scene.glb", 36])
    expect("no word on the element's console", not browser.log, browser.log[:3])


# What comes of a promise, or that it does not end.
ENDS = """const ends = (promise) => Promise.race([promise.then(() => 'done', (error) => error.message),
    new Promise((done) => setTimeout(done, 20000, 'does not end'))]);
const make = async (src) => {
  const element = document.createElement('textured-gaussians');
  element.told = [];
  element.addEventListener('error', ({detail}) => element.told.push(detail.error.message));
  element.style.height = '160px';
  const loaded = new Promise((done) => ['load', 'error'].forEach((name) => element.addEventListener(name, done)));
  element.src = src;
  document.body.prepend(element);
  await ends(loaded);
  return element;
};"""
# The numbers of a lossless WebP that the browser wrote, and of its pixels in a file with a colour profile.
PROFILED = """(async () => {
  const {decodeWebp} = await import('/web/src/webp.js');
  const canvas = new OffscreenCanvas(7, 5), context = canvas.getContext('2d');
  for (let i = 0; i < 35; ++i) {
    context.fillStyle = `rgb(${7 * i}, ${255 - 7 * i}, ${i % 5 * 50})`;
    context.fillRect(i % 7, Math.floor(i / 7), 1, 1);
  }
  const plain = new Uint8Array(await (await canvas.convertToBlob({type: 'image/webp', quality: 1})).arrayBuffer());
  const text = (words) => [...new TextEncoder().encode(words)], size = (bytes) => [bytes & 255, bytes >> 8, 0, 0];
  const chunk = (name, bytes) => [...text(name), ...size(bytes.length), ...bytes, ...(bytes.length % 2 ? [0] : [])];
  const at = plain.findIndex((_, i) => String.fromCharCode(...plain.subarray(i, i + 4)) === 'VP8L');
  const body = [...text('WEBP'), ...chunk('VP8X', [0x20, 0, 0, 0, 6, 0, 0, 4, 0, 0]),
                ...chunk('ICCP', new Uint8Array(131)), ...plain.subarray(at)];
  const profiled = Uint8Array.from([...text('RIFF'), ...size(body.length), ...body]);
  const pictures = [await decodeWebp(plain), await decodeWebp(profiled)];
  const {data} = context.getImageData(0, 0, 7, 5);
  return [...pictures.map(({samples}) => String(samples) === String(data)), new Set(data).size > 30];
})()"""


def show_trouble(browser, address):
    """Elements whose picture cannot be made: they say so, and hold up no other one."""
    browser.page("Page.navigate", url=f"{address}/element.html")
    until(browser, "Boolean((document.querySelector('textured-gaussians') || {}).model)")
    browser.evaluate(f"{ENDS} window.ends = ends; window.make = make; 0")
    told = browser.evaluate("""(async () => {
        const element = await make('scene.glb');
        element.viewer.draw = () => { throw new Error('drawn badly'); };
        const words = [await ends(element.viewer.settled()), await ends(element.picture()), ...element.told];
        delete element.viewer.draw;
        return [...words, await ends(element.viewer.settled()), (await make('scene.glb')).model !== null];
    })()""")
    expect("a picture that cannot be drawn is told to who waits for it", told == ["drawn badly"] * 2 + ["done", True],
           told)
    told = browser.evaluate("""(async () => {
        const [element] = document.querySelectorAll('textured-gaussians');
        const {viewer} = element, {worker} = viewer.splats.sorter;
        viewer.orbit.orbit(1, 0);
        const waits = ends(viewer.settled());
        worker.terminate();
        worker.onerror(new Event('error'));
        const words = [await waits, await ends(viewer.settled()), await ends(viewer.splats.completed())];
        viewer.changed();
        return [new Set(words).size === 1, words[0], element.told.length];
    })()""")
    words = "The sorting worker failed: the page must allow worker-src blob:"
    expect("so is a worker that ends", told == [True, words, 0], told)
    told = browser.evaluate("""(async () => {
        const {viewer} = await make('scene.glb');
        viewer.orbit.orbit(1, 0);
        const waits = ends(viewer.settled());
        viewer.dispose();
        return [await waits, await ends(viewer.settled())];
    })()""")
    expect("so is a viewer that is disposed of", told == ["the viewer was disposed of"] * 2, told)
    told = browser.evaluate("""(async () => {
        const element = await make('scene.glb');
        let tries = 0;
        const {open} = element.viewer;
        element.viewer.open = () => { ++tries; return Promise.reject(new Error('does not fit')); };
        const failed = new Promise((done) => element.addEventListener('error', done, {once: true}));
        element.src = 'scene.glb?larger';
        await failed;
        const turned = () => new WheelEvent('wheel', {deltaY: 10, cancelable: true});
        for (let i = 0; i < 3; ++i) element.canvas.dispatchEvent(turned());
        element.canvas.dispatchEvent(new Event('focus'));
        const asked = await ends(element.picture());
        const before = [tries, element.told.length, asked];
        element.viewer.open = open;
        const loaded = new Promise((done) => element.addEventListener('load', () => done(true), {once: true}));
        element.src = 'scene.glb?other';
        const words = [...before, await ends(loaded), element.model === element.loaded.model];
        element.sleep();
        element.viewer.open = () => Promise.reject(new Error('does not fit'));
        element.src = 'scene.glb?largest';
        await new Promise((done) => element.addEventListener('error', done, {once: true}));
        words.push(element.model !== null, element.still === null, element.shadowRoot.querySelector('.still') === null);
        element.viewer.open = open;
        element.setAttribute('alt', 'a fox');
        return [...words, element.canvas.getAttribute('aria-label')];
    })()""")
    expect("a model that was refused is put on the device once, the next one is shown, no still picture hides the one "
           "before, and a new name is told",
           told == [1, 1, "does not fit", "done", True, True, True, True, "a fox"], told)
    flights = browser.evaluate("""(async () => {
        const {viewer} = await make('scene.glb');
        const stops = [() => viewer.play(false), () => viewer.jump(0), () => viewer.moved(), () => {}], flown = [];
        for (const stop of stops) {
          const waits = viewer.settled();
          const told = [viewer.play(), viewer.playing];
          stop();
          await waits;
          await new Promise((done) => setTimeout(done, 100));
          flown.push([...told, viewer.playing, viewer.flight !== null]);
          viewer.play(false);
        }
        return flown;
    })()""")
    expect("a flight that waits for a picture is given up like one that flies",
           flights == [[True, True, False, False]] * 3 + [[True] * 4], flights)
    # A button that goes down on an element and up while it is away.
    x, y = browser.middle("textured-gaussians")
    browser.page("Input.dispatchMouseEvent", type="mousePressed", x=x, y=y, button="left", buttons=1, clickCount=1)
    heard = browser.evaluate("""(() => {
        window.taken = document.querySelector('textured-gaussians');
        const turned = () => !taken.canvas.dispatchEvent(new WheelEvent('wheel', {deltaY: 1, cancelable: true}));
        const there = turned();
        taken.remove();
        return [there, turned()];
    })()""")
    expect("an element that is taken out listens to hands no more", heard == [True, False], heard)
    browser.page("Input.dispatchMouseEvent", type="mouseReleased", x=x, y=y, button="left", clickCount=1)
    browser.evaluate("document.body.prepend(taken); window.text = taken.viewer.viewText; 0")
    for step in (10, 20, 30):
        browser.page("Input.dispatchMouseEvent", type="mouseMoved", x=x + step, y=y)
    expect("a hand without a button turns nothing", browser.evaluate("taken.viewer.viewText === text"))
    browser.drag(x, y, 20, 0)
    expect("one with a button does", browser.evaluate("taken.viewer.viewText !== text"))
    found = browser.evaluate(PROFILED)
    expect("a WebP has its numbers, with a colour profile or without", found == [True] * 3, found)
    told = browser.evaluate("""(async () => {
        const meta = document.createElement('meta');
        meta.httpEquiv = 'Content-Security-Policy';
        meta.content = "worker-src 'none'";
        document.head.append(meta);
        return [await make('scene.glb'), await make('scene.glb')].map(({told}) => told[0]);
    })()""")
    expect("a page that allows no worker is told what to allow", told == [words] * 2, told)


# Means of what Splats draw in a context of an engine's, and after it was lost and is there again.
LOSE_CONTEXT = """(async () => {
  const {Splats, loadModel, matricesOf} = await import('/web/src/index.js');
  const canvas = document.createElement('canvas');
  canvas.width = canvas.height = SIDE;
  const gl = canvas.getContext('webgl2', {preserveDrawingBuffer: true});
  const model = await loadModel('scene.glb');
  const {worldFromCamera: m, projection} = matricesOf(model.cameras[0], SIDE, SIDE);
  const axes = [0, 4, 8].map((at) => m.slice(at, at + 3));
  const eye = axes.map((axis) => -axis.reduce((sum, x, k) => sum + x * m[12 + k], 0));
  const viewFromModel = [...[0, 1, 2].flatMap((k) => [...axes.map((axis) => axis[k]), 0]), ...eye, 1];
  const mean = async () => {
    const splats = await Splats.inContext(gl, model);
    do {
      await new Promise((done) => setTimeout(done, 20));
      gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    } while (!splats.drawInto({viewFromModel, projection, viewport: [0, 0, SIDE, SIDE]}));
    const pixels = new Uint8Array(4 * SIDE * SIDE);
    gl.readPixels(0, 0, SIDE, SIDE, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
    splats.dispose();
    splats.dispose();
    return pixels.reduce((sum, x) => sum + x, 0) / pixels.length;
  };
  const kept = {};  // of what was made and not deleted
  for (const kind of ['Texture', 'Framebuffer', 'Renderbuffer', 'Buffer', 'VertexArray']) {
    const create = gl[`create${kind}`], remove = gl[`delete${kind}`], there = new Set();
    gl[`create${kind}`] = () => { const made = create.call(gl); there.add(made); return made; };
    gl[`delete${kind}`] = (made) => { there.delete(made); return remove.call(gl, made); };
    Object.defineProperty(kept, kind, {get: () => there.size, enumerable: true});
  }
  const other = await Splats.inContext(gl, model);
  const means = [await mean()];
  const shared = kept.Framebuffer;  // the other one's, too
  other.dispose();
  const left = {...kept};
  const device = gl.getExtension('WEBGL_lose_context');
  const event = (name) => new Promise((done) => canvas.addEventListener(name, (event) => {
    event.preventDefault();
    setTimeout(done, 50);
  }, {once: true}));
  const lost = event('webglcontextlost'), back = event('webglcontextrestored');
  device.loseContext();
  await lost;
  device.restoreContext();
  await back;
  return [...means, await mean(), shared, left];
})()""".replace("SIDE", str(SIDE))


# Red squares that face the camera: a near one on the left, one behind all on the right.
THREE_MESHES = """(({THREE, scene, camera, draw}) => {
  const add = (distance, side) => {
    const mesh = new THREE.Mesh(new THREE.PlaneGeometry(distance / 4, distance / 4),
                                new THREE.MeshBasicMaterial({color: 0xff0000, toneMapped: false}));
    mesh.position.set(side * distance / 6, 0, -distance).applyMatrix4(camera.matrixWorld);
    mesh.quaternion.copy(camera.quaternion);
    scene.add(mesh);
  };
  add(0.5, -1);
  add(50, 1);
  draw();
})(example)"""
# The object and the camera moved alike: the same picture.
THREE_MOVE = """(({THREE, scene, camera, gaussians, draw}) => {
  const move = new THREE.Matrix4().compose(new THREE.Vector3(3, -1, 2), new THREE.Quaternion(0.6, 0, 0, 0.8),
                                           new THREE.Vector3(2, 2, 2));
  gaussians.applyMatrix4(move);
  camera.matrix.premultiply(move).decompose(camera.position, camera.quaternion, new THREE.Vector3());
  camera.updateMatrixWorld();
  draw();
})(example)"""
# As if the model had been photographed with z up: as its cameras' up.
THREE_UP = """(({camera, gaussians}) => {
  const upright = gaussians.model.cameras[0];
  gaussians.model.cameras = [{...upright, axes: [[1, 0, 0], [0, 0, -1], [0, 1, 0]]}];
  gaussians.placeCamera(camera, 0);
})(example)"""
PIXEL = """(async (url, at) => {
  const image = new Image();
  image.src = url;
  await image.decode();
  const context = new OffscreenCanvas(1, 1).getContext('2d');
  context.drawImage(image, -at[0] * image.width, -at[1] * image.height);
  return [...context.getImageData(0, 0, 1, 1).data.slice(0, 3)];
})"""


def pixel(browser, picture, x, y):
    import base64
    url = "data:image/png;base64," + base64.b64encode(picture).decode()
    return browser.evaluate(f"{PIXEL}({json.dumps(url)}, [{x}, {y}])")


def show_engine(browser, address, name, references):
    browser.page("Page.navigate", url=f"{address}/{name}.html")
    until(browser, "Boolean(window.example)")
    camera_of = {"three": "example.camera", "babylon": "example.camera", "playcanvas": "example.camera"}[name]
    for camera in CAMERAS:
        browser.evaluate(f"example.gaussians.placeCamera({camera_of}, {camera}); if (example.draw) example.draw(); 0")
        picture = at_rest(browser)
        compare(browser, f"{name}, camera {camera}", picture, references["scene.glb", camera])
    if name == "three":
        browser.evaluate(THREE_MOVE)
        compare(browser, "three, moved along with the camera", at_rest(browser), references["scene.glb", CAMERAS[-1]])
        browser.evaluate("example.gaussians.matrix.identity().decompose(example.gaussians.position, "
                         f"example.gaussians.quaternion, example.gaussians.scale); example.gaussians.placeCamera({camera_of}, 0)")
        browser.evaluate(THREE_MESHES)
        picture = at_rest(browser)
        keep("three, meshes", picture)
        near, far = pixel(browser, picture, 0.32, 0.5), pixel(browser, picture, 0.6, 0.55)
        expect("a mesh that is nearer hides the model", near == [255, 0, 0], near)
        expect("the model hides one that is farther", far != [255, 0, 0], far)
        browser.evaluate(THREE_UP)
        up = browser.evaluate("example.camera.up.toArray().map((x) => Math.round(1000 * x))")
        expect("placeCamera gives controls the model's up", up == [0, 0, 1000], up)
    if name == "babylon":
        told = browser.evaluate("""(async () => {
            const {ArcRotateCamera} = await import('@babylonjs/core/Cameras/arcRotateCamera.js');
            const {Vector3} = await import('@babylonjs/core/Maths/math.vector.js');
            try {
              example.gaussians.placeCamera(new ArcRotateCamera('arc', 0, 1, 3, Vector3.Zero(), example.scene), 0);
            } catch (error) { return error.message; }
        })()""")
        expect("placeCamera refuses an ArcRotateCamera", "ArcRotateCamera" in (told or ""), told)
    expect(f"no word on {name}'s console", not browser.log, browser.log[:3])
    browser.evaluate("example.gaussians.settings.textures = 'rbga'; if (example.draw) example.draw(); 0")
    until(browser, "new Promise((done) => setTimeout(() => done(true), 300))")
    told = [line.splitlines()[0] for line in browser.log if "rbga" in line]
    expect("a setting that there is not is told once", len(told) == 1 and "expected rgba" in told[0], told)
    if name == "three":
        browser.evaluate("example.gaussians.settings.textures = 'rgba'; example.gaussians.scale.set(1, 2, 1); "
                         "example.draw(); example.draw(); 0")
        told = [line.splitlines()[0] for line in browser.log if "scaled otherwise" in line]
        expect("so is uneven scale", len(told) == 1, told)


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    model = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else REPOSITORY / "docs/sample.tgz").resolve()
    wanted = sys.argv[3:] or ["element", *ENGINES]
    find_chromium()
    modules = find_packages(programs)
    run = lambda *arguments: subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.DEVNULL)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run(programs / "tgconvert", model, folder / "scene.glb", "--quiet")
        run(programs / "tgconvert", model, folder / "scene.sog", "--quiet")
        run(programs / "tgconvert", model, folder / "scene_shared.sog", "--share-textures", "24", "--quiet")
        run(programs / "tgconvert", model, folder / "cameras.glb", "--quiet")
        references = {}
        for file in ("scene.glb", "scene.sog", "scene_shared.sog"):
            for camera in CAMERAS:
                # A SOG holds no cameras: the model's, in the file's place.
                source = folder / file
                if file.endswith(".sog"):
                    run(programs / "tgconvert", source, folder / "back.tgz", "--overwrite", "--quiet")
                    source = folder / "back.tgz"
                out = folder / "reference.png"
                cameras = folder / f"camera_{camera}.json"
                write_camera(model, camera, cameras)
                run(programs / "tgview", source, "--render", out, "--size", f"{SIDE}x{SIDE}", "--backend", "cpu",
                    "--camera", cameras, "--background", "white")
                references[file, camera] = out.read_bytes()
        server = Server(modules or folder, folder)
        for name in wanted:
            if name in ENGINES and not modules:
                print(f"not shown: {name} (scripts/test_browsers.sh installs the engines)")
                continue
            with Chromium() as browser:
                browser.page("Emulation.setDeviceMetricsOverride", width=SIDE, height=SIDE, deviceScaleFactor=1,
                             mobile=False)
                if name == "element":
                    show_element(browser, server.address, references)
                    show_many(browser, server.address, references)
                    before, after, shared, left = browser.evaluate(LOSE_CONTEXT)
                    nothing = {"Texture": 0, "Framebuffer": 0, "Renderbuffer": 0, "Buffer": 0, "VertexArray": 1}
                    expect("the last splats of a context that go leave nothing there but programs",
                           shared == 1 and left == nothing, [shared, left])
                    expect("splats made anew in a context that was lost are seen", before > 10 and before == after,
                           [before, after])
                    show_trouble(browser, server.address)
                else:
                    show_engine(browser, server.address, name, {k: v for k, v in references.items()})
    return 1 if failures else 0


def write_camera(model, index, out):
    """One camera of a bundle as a file of its own."""
    import io
    import tarfile
    with tarfile.open(model) as archive:
        cameras = json.load(io.TextIOWrapper(archive.extractfile("cameras.json")))
    out.write_text(json.dumps([cameras[index]]))


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Streams a scene with levels of detail in a headless Chromium: from a server that is slow, that breaks chunks off,
under a budget; what is seen meanwhile, and in the end against tgview.

    tests/web/lod_test.py BIN [MODEL]        BIN: folder of tgconvert and tgview; default docs/sample.tgz
    tests/web/lod_test.py --measure FOLDER [BUDGET]    how soon, in 640 x 480, a FOLDER with lod-meta.json is seen

Engines come from where viewers_test.py looks for them. TG_WEB_PICTURES=FOLDER keeps the pictures. Skips (exit code 77)
where there is no Chromium.
"""
import io
import json
import os
import pathlib
import re
import subprocess
import sys
import tarfile
import tempfile
import time

import lod_scene
from chromium import LAG, STALL, Chromium, Difference, find_chromium, from_data_url
from viewer_pages import find_packages

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
LEAST_DB = 38.0  # what the package promises
SIDE = 160       # [px]
LIMIT_SECONDS = 240
FULL, COARSEST = 5000, 300
ENGINES = ["three", "babylon", "playcanvas"]
failures = []

PAGE = """<!doctype html><meta charset="utf-8"><body style="margin:0"><script type="module">
import '/web/src/element.js';
window.open_scene = async ({address, camera, budget, show = 'final'}) => {
  const element = document.createElement('textured-gaussians');
  element.style.cssText = 'width: 160px; height: 160px';
  if (budget) element.setAttribute('splat-budget', budget);
  element.setAttribute('background', 'white');
  element.setAttribute('show', show);
  window.element = element;
  window.told = [];
  window.frames_seen = [];
  element.addEventListener('error', ({detail}) => told.push(detail.error.message));
  const loaded = new Promise((done) => {
    element.addEventListener('load', () => done(true), {once: true});
    element.addEventListener('error', () => done(false), {once: true});
  });
  element.src = address;
  document.body.replaceChildren(element);
  if (!await loaded) return false;
  const {viewer} = element;
  const draw = viewer.draw.bind(viewer);
  viewer.draw = (scale) => {
    draw(scale);
    const {splats} = viewer;
    frames_seen.push({picture: viewer.canvas.toDataURL(), shown: element.model.lod.shown,
                      holes: splats.shown.filter((piece) => !splats.held.has(piece)).length});
  };
  viewer.apply({size: '160x160', camera});
  return true;
};
window.all_there = async () => {
  await element.picture();
  const {splats} = element.viewer;
  const {lod} = element.model;
  return {shown: lod.shown, wanted: lod.wanted, count: lod.count, complete: splats.complete, told: [...told],
          levels: splats.shown.map(({level}) => level),
          held: [...splats.held.keys()].reduce((sum, {count}) => sum + count, 0), room: splats.gpu.count};
};
// Of each picture how many pixels are emptier than both the first and the last one, by a quarter of what there may be.
// Where a fine leaf meets a coarse one a few are.
window.holes_seen = async () => {
  const pixels = async (url) => {
    const image = new Image();
    image.src = url;
    await image.decode();
    const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height).data.filter((_, i) => i % 4 === 0);
  };
  const urls = frames_seen.map(({picture}) => picture).filter((url, i, all) => i === 0 || url !== all[i - 1]);
  const pictures = await Promise.all(urls.map(pixels));
  const first = pictures[0], last = pictures[pictures.length - 1];
  return pictures.map((picture) => picture.reduce((sum, x, i) => sum + (x < Math.min(first[i], last[i]) - 64), 0));
};
window.__done = {};
</script>"""
# Times [ms] are from the moment in which the page has an element with the address.
MEASURE = """(async (budget) => {
  const element = document.createElement('textured-gaussians');
  element.style.cssText = 'width: 640px; height: 480px; aspect-ratio: auto';
  element.setAttribute('splat-budget', budget);
  const begin = performance.now(), since = () => Math.round(performance.now() - begin);
  const loaded = new Promise((done, no) => {
    element.addEventListener('load', done, {once: true});
    element.addEventListener('error', ({detail}) => no(detail.error), {once: true});
  });
  element.src = '/scene/lod-meta.json';
  document.body.replaceChildren(element);
  await loaded;
  const {viewer, model} = element;
  await viewer.renderer.finished();
  const first = since(), shown = model.lod.shown;
  do {  // as picture() waits, without reading the picture, which stops the page until the device is done
    await viewer.splats.completed();
    await viewer.settled();
  } while (!viewer.splats.complete);
  await viewer.renderer.finished();
  return {first, gaussians: shown, all: since(), drawn: model.lod.shown, of: model.lod.count,
          room: viewer.splats.gpu.count};
})"""


def expect(what, ok, found=""):
    print(f"{'ok' if ok else 'FAILED'}: {what}{f': {found}' if str(found) else ''}", flush=True)
    if not ok:
        failures.append(what)


def keep(name, picture):
    if "TG_WEB_PICTURES" in os.environ:
        pathlib.Path(os.environ["TG_WEB_PICTURES"], f"{name}.png").write_bytes(picture)


class Scene:
    """The page with a scene, its server as one is told."""

    def __init__(self, browser, server, camera):
        self.browser, self.server, self.camera = browser, server, camera

    def open(self, slow=None, broken=(), gone=(), **more):
        self.server.slow, self.server.broken, self.server.gone = slow or {}, list(broken), list(gone)
        self.server.asked.clear()
        self.browser.page("Network.clearBrowserCache")
        wanted = {"address": "/scene/lod-meta.json", "camera": self.camera, **more}
        return self.browser.evaluate(f"open_scene({json.dumps(wanted)})")

    def all_there(self):
        return self.browser.evaluate("all_there()")

    def picture(self, name):
        picture = from_data_url(self.browser.evaluate("element.picture()"))
        keep(name, picture)
        return picture


def check_streaming(scene, reference):
    expect("a scene opens", scene.open(slow={"/scene/0_": 0.3, "/scene/1_": 0.3}, show="alpha"))
    found = scene.all_there()
    expect("all of it is shown in the end", found["shown"] == found["count"] == FULL and not found["told"], found)
    seen = scene.browser.evaluate("frames_seen.map(({shown, holes}) => [shown, holes])")
    expect("it begins with the coarsest level", seen[0][0] == COARSEST, seen[0])
    expect("finer ones come one after the other", len({shown for shown, _ in seen}) > 2, sorted({s for s, _ in seen}))
    expect("what is shown is on the device", all(holes == 0 for _, holes in seen))
    holes = scene.browser.evaluate("holes_seen()")
    expect("no picture has a hole that neither level has", len(holes) > 2 and max(holes) <= 64, holes)
    scene.browser.evaluate("element.setAttribute('show', 'final')")
    picture = scene.picture("lod, full")
    found = Difference(scene.browser, picture, reference)
    expect(f"in the end it is tgview's picture, at least {LEAST_DB:.0f} dB", found.psnr >= LEAST_DB, found)
    back = scene.browser.evaluate("""(async () => {
        element.viewer.release();
        await element.viewer.resume();
        return element.picture();
    })()""")
    found = Difference(scene.browser, from_data_url(back), picture)
    expect("a context that was given back leaves the picture as it was", found.psnr > 60, found)


def check_budget(scene):
    budget = 2000
    scene.open(budget=budget)
    found = scene.all_there()
    expect("a budget is kept", COARSEST < found["shown"] == found["wanted"] <= budget, found)
    scene.browser.evaluate("element.setAttribute('splat-budget', '900')")
    found = scene.all_there()
    expect("one that is lowered, too", COARSEST < found["shown"] <= 900, found)
    scene.browser.evaluate("element.setAttribute('splat-budget', '4000')")
    scene.browser.evaluate("new Promise((done) => setTimeout(done, 300))")
    found = scene.all_there()
    expect("one that is raised gets more room", 2000 < found["shown"] <= 4000, found)
    scene.browser.evaluate("element.removeAttribute('splat-budget')")
    scene.browser.evaluate("new Promise((done) => setTimeout(done, 300))")
    found = scene.all_there()
    expect("without one there is the usual room", found["shown"] > 4000, found)
    scene.browser.evaluate("element.setAttribute('splat-budget', '0')")
    told = scene.browser.evaluate("new Promise((done) => setTimeout(() => done(element.words.textContent), 300))")
    expect("what is no budget is told", "splat-budget=0 (expected a number of Gaussians)" in told, told)

    # From within each leaf in turn, twice: together their finest levels are more than there is room for.
    scene.open(budget=2000)
    first_round = 0
    for turn in range(8):
        x, y = ((1, 1), (1, -1), (-1, -1), (-1, 1))[turn % 4]
        ahead, right = [x / 2 ** 0.5, y / 2 ** 0.5, 0], [y / 2 ** 0.5, -x / 2 ** 0.5, 0]
        camera = {"name": "", "test": False, "width": SIDE, "height": SIDE, "fx": 140, "fy": 140, "cx": SIDE / 2,
                  "cy": SIDE / 2, "axes": [right, [0, 0, -1], ahead], "eye": [0.3 * x, 0.3 * y, 0]}
        scene.browser.evaluate(f"element.viewer.apply({{camera: {json.dumps(camera)}}})")
        found = scene.all_there()
        expect(f"in leaf {turn % 4} it alone is at its finest", sorted(found["levels"]) == [0, 2, 2, 2] and
               found["shown"] == found["wanted"] <= 2000 and not found["told"], found)
        expect("and no more is held than there is room for", found["held"] <= found["room"] < FULL, found)
        if turn == 3:
            first_round = len(scene.server.asked)
    expect("chunks that were given up are asked for again", len(scene.server.asked) > first_round)


# Textures of at most `side` texels a side, and none of more rows than `tallest`.
SMALL_DEVICE = """{ const {prototype} = WebGL2RenderingContext, {getParameter, getError, texStorage2D} = prototype;
const asked = new URLSearchParams(location.search), tallest = Number(asked.get('tallest')) || Infinity;
let full = false;
prototype.getParameter = function(name) {
  return name === this.MAX_TEXTURE_SIZE ? Number(asked.get('side')) : getParameter.call(this, name);
};
prototype.texStorage2D = function(target, levels, format, width, height) {
  full = full || height > tallest;
  return texStorage2D.call(this, target, levels, format, width, height);
};
prototype.getError = function() {
  const error = full ? this.OUT_OF_MEMORY : getError.call(this);
  full = false;
  return error;
}; }"""


def check_small_device(scene, address):
    """A budget that the device has no room for: 6,500 Gaussians, 300 of them coarsest, in 12 files."""
    seen = "[element.viewer.openings, element.model.lod.shown, element.words.textContent]"
    for what, query, most in (("textures", "side=256", 2565), ("memory", "side=4096&tallest=60", 3250)):
        with scene.browser.before_pages(SMALL_DEVICE):
            scene.browser.open(f"{address}?{query}", 320, 240)
        opened = scene.open(budget=100000)
        found = scene.all_there()
        words = f"This device has room for {most} Gaussians of the scene at a time."
        openings, shown, told = scene.browser.evaluate(seen)
        expect(f"a device of small {what} shows as much as it has room for", opened and 1200 < shown <= most, found)
        expect("put there once", openings == 1, openings)
        expect("and says so once", told == words and not found["told"], [told, found["told"]])
        for budget in (200000, most + 1):
            scene.browser.evaluate(f"element.setAttribute('splat-budget', '{budget}')")
            found = scene.all_there()
        expect("a larger budget changes nothing",
               scene.browser.evaluate(seen) == [1, shown, words] and not found["told"], scene.browser.evaluate(seen))
        scene.browser.evaluate("element.setAttribute('splat-budget', '2000')")
        found = scene.all_there()
        expect("a smaller one is kept", found["shown"] <= 2000, found)
    scene.browser.evaluate("element.removeAttribute('splat-budget')")
    opened = scene.open(budget=1500)
    scene.all_there()
    scene.browser.evaluate("element.setAttribute('splat-budget', '90000')")
    told, end = "", time.monotonic() + LIMIT_SECONDS
    while "does not fit" not in told and time.monotonic() < end:
        time.sleep(0.05)
        told = scene.browser.evaluate(seen)[2]
    found = scene.all_there()
    expect("one that cannot be raised leaves the scene as it is", COARSEST < found["shown"] <= 1500 and
           "does not fit" in told, [found, told])


def check_faults(scene):
    for what, fault in (("cut off", {"broken": ["/scene/0_1/sh0"]}), ("not given", {"gone": ["/scene/0_1/"]}),
                        ("spoilt", {"broken": ["/scene/0_1/texture_texels"]})):
        scene.open(**fault)
        found = scene.all_there()
        expect(f"where a chunk is {what} the coarser level stays", sorted(found["levels"]) == [0, 0, 0, 1], found)
        expect("and one line says which", len(found["told"]) == 1 and "/scene/0_1/" in found["told"][0] and
               "\n" not in found["told"][0], found["told"])
        asked = sum("/scene/0_1/meta.json" in path for path in scene.server.asked)
        expect("after three tries", asked == 3, asked)
    scene.open(gone=["/scene/2_3/"])
    found = scene.all_there()
    expect("where a coarsest one is not given finer ones are shown", found["levels"] == [0, 0, 0, 0], found)
    expect("nothing is left out", found["shown"] == FULL)
    notes = scene.browser.evaluate("element.words.textContent")
    expect("and that is told", "/scene/2_3/meta.json: 503" in notes, notes)

    chunk = scene.server.folder / "0_1/meta.json"
    text = chunk.read_text()
    meta = json.loads(text)
    textures = meta["TG_gaussian_splatting_texture"]
    textures["intersection"] = "plane" if textures["intersection"] == "maxResponse" else "maxResponse"
    chunk.write_text(json.dumps(meta))
    scene.open()
    found = scene.all_there()
    chunk.write_text(text)
    expect("one with another intersection model is not mixed in", sorted(found["levels"]) == [0, 0, 0, 1] and
           len(found["told"]) == 1 and "/scene/0_1/meta.json: another intersection" in found["told"][0], found)

    def told(change, name):
        meta = json.loads((scene.server.folder / "lod-meta.json").read_text())
        change(meta)
        (scene.server.folder / "spoilt.json").write_text(json.dumps(meta))
        opened = scene.open(address="/scene/spoilt.json")
        words = scene.browser.evaluate("[...told]")
        expect(f"{name} is refused with a line", not opened and len(words) == 1 and "\n" not in words[0], words)

    def lead_out(meta):
        meta["filenames"][11] = "../web/package.json"

    def too_many(meta):
        meta["tree"]["children"][0]["lods"]["2"]["count"] = 2 ** 31 + 1

    told(lead_out, "a name that leads out of the folder")
    told(too_many, "a count that cannot be")
    (scene.server.folder / "spoilt.json").write_bytes((scene.server.folder / "lod-meta.json").read_bytes()[:700])
    opened = scene.open(address="/scene/spoilt.json")
    words = scene.browser.evaluate("[...told]")
    expect("a lod-meta.json that is cut off is refused with a line", not opened and len(words) == 1, words)


def check_page(browser, server, programs, reference):
    """The page that tgconvert writes beside a scene."""
    folder = server.folder
    subprocess.run([str(programs / "tgconvert"), str(folder / "lod-meta.json"), str(folder / "page.html"), "--quiet"],
                   check=True, stdout=subprocess.DEVNULL)
    server.slow, server.broken, server.gone = {}, [], []
    done = browser.open(f"{server.address}/scene/page.html?camera=0&size={SIDE}x{SIDE}&splat-budget=6000")
    expect("a page opens that streams the scene beside it", done == {"gaussians": FULL}, done)
    picture = from_data_url(browser.evaluate("tgViewer.picture()"))
    keep("lod, page", picture)
    found = Difference(browser, picture, reference)
    expect(f"it shows tgview's picture, at least {LEAST_DB:.0f} dB", found.psnr >= LEAST_DB, found)
    facts = browser.evaluate("document.getElementById('facts').textContent")
    expect("it tells how many are drawn", facts.startswith("5,000 of 5,000 Gaussians, SH degree 3, rgba"), facts)
    scripts = browser.evaluate("performance.getEntriesByType('resource').map(({name}) => name.split('/').pop())")
    expect("it fetches nothing but the scene", not [name for name in scripts if name.endswith(".js")], scripts)
    server.broken = ["/scene/0_1/quats"]
    browser.page("Network.clearBrowserCache")
    browser.open(f"{server.address}/scene/page.html?camera=0&size={SIDE}x{SIDE}&show=base")
    browser.evaluate("tgViewer.picture()")
    words = browser.evaluate("document.getElementById('message').textContent")
    expect("a broken chunk is told on it", "/scene/0_1/meta.json: quats.webp:" in words, words)
    server.broken = []

    def look():
        browser.page("Network.clearBrowserCache")
        browser.open(f"{server.address}/scene/page.html?size=320x240")
        browser.evaluate("(async () => { do await tgViewer.splats.completed(); while (!tgViewer.splats.complete); })()")

    browser.watch_stalls()
    longest, busy = browser.longest_stall(look)
    if busy:
        print(busy)
    else:
        expect(f"once there is a context nothing stalls it for more than {STALL} ms", longest <= STALL, longest)
    done = browser.open((folder / "page.html").as_uri())
    expect("from disk it says what it needs", "http.server" in done.get("error", ""), done)
    expect("no word on the page's console", not browser.log, browser.log[:3])


PLAYCANVAS = """<!doctype html><meta charset="utf-8"><body style="margin:0">
<script type="importmap">{"imports": {"playcanvas": "/packages/playcanvas/build/playcanvas.mjs"}}</script>
<script type="module">
import * as pc from 'playcanvas';
const canvas = document.createElement('canvas');
document.body.append(canvas);
const app = new pc.Application(canvas);
app.setCanvasFillMode(pc.FILLMODE_FILL_WINDOW);
app.setCanvasResolution(pc.RESOLUTION_AUTO);
app.start();
const camera = new pc.Entity();
camera.addComponent('camera', {clearColor: new pc.Color(1, 1, 1), nearClip: 0.05});
camera.setPosition(0, 1.5, 3.5);
camera.lookAt(pc.Vec3.ZERO);
app.root.addChild(camera);
const asset = new pc.Asset('scene', 'gsplat', {url: '/scene/lod-meta.json'});
asset.on('load', () => {
  const entity = new pc.Entity();
  entity.addComponent('gsplat', {asset, unified: true});
  entity.setLocalEulerAngles(0, 0, 180);
  app.root.addChild(entity);
  window.octree = asset.resource.octree;
});
app.assets.add(asset);
app.assets.load(asset);
window.__done = {};
</script>"""


def show_foreign_engine(browser, server, pages):
    """PlayCanvas' own engine, which streams the same form by itself."""
    (pages / "foreign.html").write_text(PLAYCANVAS)
    browser.open(f"{server.address}/page/foreign.html", 320, 240)
    blank = browser.screenshot()
    found, end = [], time.monotonic() + LIMIT_SECONDS
    while len(found) < 4 and time.monotonic() < end:
        time.sleep(0.5)
        found = browser.evaluate("window.octree ? [...octree.fileResources.keys()].filter((i) => "
                                 "octree.files[i].lodLevel === 0) : []")
    expect("PlayCanvas' engine loads the finest level of all leaves", len(found) == 4, found)
    picture, changed = browser.screenshot(), 0
    while changed < 30000 and time.monotonic() < end:
        time.sleep(0.5)
        picture = browser.screenshot()
        changed = Difference(browser, picture, blank).count
    keep("lod, PlayCanvas' engine", picture)
    expect("and shows it", changed >= 30000, changed)
    expect("without a word on the console", not browser.log, browser.log[:3])


def measure(folder, budget):
    with tempfile.TemporaryDirectory() as pages, Chromium() as browser:
        (pathlib.Path(pages) / "page.html").write_text(PAGE)
        server = lod_scene.Server({"scene": folder, "page": pages, "web": REPOSITORY / "web"})
        browser.watch_stalls()
        for _ in range(3):
            browser.page("Network.clearBrowserCache")
            browser.page("Page.navigate", url="about:blank")
            lag = browser.evaluate(LAG)
            browser.open(f"{server.address}/page/page.html", 640, 480)
            found = browser.evaluate(f"{MEASURE}({budget})")
            stalls = [round(x) for x in browser.evaluate("stalls") if x > STALL]
            print(f"{found}; held up for more than {STALL} ms once there was a context: {stalls or 'never'} "
                  f"(an empty page lags by {lag:.0f} ms)", flush=True)


def show_engine(browser, server, name, pages, reference):
    """The package's example with the scene in place of its model."""
    text = (REPOSITORY / f"web/examples/{name}.html").read_text()
    text = re.sub(r"https://unpkg.com/([^'\"]*)", lambda m: "/packages/" + re.sub(r"@\d[^/]*", "", m[1]), text)
    text = text.replace("../src/", "/web/src/").replace("scene.glb", "/scene/lod-meta.json")
    (pages / f"{name}.html").write_text(text)
    browser.page("Emulation.setDeviceMetricsOverride", width=SIDE, height=SIDE, deviceScaleFactor=1, mobile=False)
    browser.page("Page.navigate", url=f"{server.address}/page/{name}.html")
    end = time.monotonic() + LIMIT_SECONDS
    settled = "example.gaussians.settled && example.gaussians.splats.complete"
    while (browser.evaluate(f"window.example && {settled} && example.gaussians.model.lod.shown || 0") != FULL and
           time.monotonic() < end):
        time.sleep(0.2)
    browser.evaluate("example.gaussians.placeCamera(example.camera, 0); if (example.draw) example.draw(); 0")
    while not browser.evaluate(settled) and time.monotonic() < end:
        time.sleep(0.2)
    browser.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    picture = browser.screenshot()
    keep(f"lod, {name}", picture)
    found = Difference(browser, picture, reference)
    expect(f"{name} against tgview, at least {LEAST_DB:.0f} dB", found.psnr >= LEAST_DB, found)
    expect(f"no word on {name}'s console", not browser.log, browser.log[:3])


def main():
    if sys.argv[1] == "--measure":
        return measure(pathlib.Path(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 1000000)
    programs = pathlib.Path(sys.argv[1]).resolve()
    model = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else REPOSITORY / "docs/sample.tgz").resolve()
    find_chromium()
    modules = find_packages(programs)
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "scene").mkdir()
        (folder / "page").mkdir()
        finest = lod_scene.make(programs, model, folder / "scene")
        (folder / "page/page.html").write_text(PAGE)
        with tarfile.open(model) as archive:
            camera = json.load(io.TextIOWrapper(archive.extractfile("cameras.json")))[0]
        (folder / "camera.json").write_text(json.dumps([camera]))
        subprocess.run([str(programs / "tgview"), str(finest), "--render", str(folder / "reference.png"), "--size",
                        f"{SIDE}x{SIDE}", "--backend", "cpu", "--camera", str(folder / "camera.json"), "--background",
                        "white"], check=True, stdout=subprocess.DEVNULL)
        server = lod_scene.Server({"scene": folder / "scene", "page": folder / "page", "web": REPOSITORY / "web",
                                   **({"packages": modules} if modules else {})})
        server.folder = folder / "scene"
        with Chromium() as browser:
            browser.open(f"{server.address}/page/page.html", 320, 240)
            scene = Scene(browser, server, in_page_axes(camera))
            check_streaming(scene, (folder / "reference.png").read_bytes())
            check_budget(scene)
            check_small_device(scene, f"{server.address}/page/page.html")
            browser.open(f"{server.address}/page/page.html", 320, 240)
            expect("no word on the console", not browser.log, browser.log[:3])
            check_faults(scene)
            check_page(browser, server, programs, (folder / "reference.png").read_bytes())
        server.broken, server.gone = [], []
        for name in ENGINES if modules else []:
            with Chromium() as browser:
                show_engine(browser, server, name, folder / "page", (folder / "reference.png").read_bytes())
        if modules:
            with Chromium() as browser:
                show_foreign_engine(browser, server, folder / "page")
        if not modules:
            print("not shown: engines (scripts/test_browsers.sh installs them)")
    return 1 if failures else 0


def in_page_axes(camera):
    """A camera of a cameras.json as the package has it: a half turn about z, columns of the rotation as axes."""
    turn = lambda v: [-v[0], -v[1], v[2]]
    axes = [turn([row[k] for row in camera["rotation"]]) for k in range(3)]
    return {**{key: camera[key] for key in ("width", "height", "fx", "fy", "cx", "cy")}, "name": "", "test": False,
            "axes": axes, "eye": turn(camera["position"])}


if __name__ == "__main__":
    sys.exit(main())

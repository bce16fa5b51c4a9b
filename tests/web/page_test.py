#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The page that tgconvert writes under hands: keys, mouse and fingers, at a desk's and a phone's size.

    tests/web/page_test.py BIN [MODEL]     BIN: folder of tgconvert and tgview; default docs/sample.tgz

Skips (exit code 77) where there is no Chromium. TG_WEB_PICTURES=FOLDER keeps screenshots.
"""
import html
import http.server
import io
import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tarfile
import tempfile
import threading
import time

import clouds
from chromium import STALL, Chromium, Difference, from_data_url
from lod_scene import Server

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
TARGET = 44    # [px] of what a finger is to hit
SHIFT = 8
DRIP = 64     # bytes
failures = []
# [px] from the left and the top to the right and the bottom of what is lit in a picture.
LIT = """(async (url) => {
  const image = new Image();
  image.src = url;
  await image.decode();
  const context = new OffscreenCanvas(image.width, image.height).getContext('2d');
  context.drawImage(image, 0, 0);
  const {data} = context.getImageData(0, 0, image.width, image.height);
  const x = [], y = [];
  for (let i = 0; i < image.width * image.height; ++i) {
    if (data[4 * i] + data[4 * i + 1] + data[4 * i + 2] < 72) continue;
    x.push(i % image.width);
    y.push(Math.floor(i / image.width));
  }
  const ends = (list) => list.reduce(([low, high], v) => [Math.min(low, v), Math.max(high, v)], [Infinity, -Infinity]);
  return [ends(x)[0], ends(y)[0], ends(x)[1], ends(y)[1]];
})"""
# Takes a page's device away while its model is uploaded, once or, with `always` in the address, every time, and gives it
# back as many ms later as `back` there says.
LOSE = """{ const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function(...given) {
  const gl = getContext.apply(this, given);
  const createTexture = gl.createTexture;
  const asked = new URLSearchParams(location.search);
  if (this.id === 'picture' && (!window.giveBack || asked.has('always'))) gl.createTexture = function() {
    gl.createTexture = createTexture;
    const device = gl.getExtension('WEBGL_lose_context');
    window.giveBack = () => device.restoreContext();
    device.loseContext();
    if (asked.has('back')) setTimeout(giveBack, Number(asked.get('back')));
    return createTexture.call(gl);
  };
  return gl;
}; }"""


def expect(what, ok, found=""):
    print(f"{'ok' if ok else 'FAILED'}: {what}{f': {found}' if str(found) else ''}", flush=True)
    if not ok:
        failures.append(what)


class SlowServer:
    """Serves a file, half of it at once and the rest when `go` is set. Until then it drips, as networks do: a browser
    may keep what came last until more comes."""

    def __init__(self, data, torn=False, headers=()):
        """torn: the connection ends instead of the rest."""
        self.go = threading.Event()
        outer = self

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self):
                self.send_response(200)
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.send_header("Content-Length", str(len(data)))
                for name, value in headers:
                    self.send_header(name, value)
                self.end_headers()
                at = len(data) // 2
                self.wfile.write(data[:at])
                for _ in range(600):
                    if outer.go.wait(0.1):
                        break
                    self.wfile.write(data[at:at + DRIP])
                    at += DRIP
                if torn:
                    self.wfile.flush()
                    time.sleep(1)  # what is under way comes
                    self.connection.shutdown(socket.SHUT_RDWR)
                else:
                    self.wfile.write(data[at:])

            def log_message(self, *_):
                pass
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_port}/page.html"


def keep(browser, name):
    if "TG_WEB_PICTURES" in os.environ:
        pathlib.Path(os.environ["TG_WEB_PICTURES"], f"{name}.png").write_bytes(browser.screenshot())


def until(browser, expression, seconds=20):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if browser.evaluate(expression):
            return True
        time.sleep(0.05)
    return False


def at_a_desk(browser, page):
    browser.open(page, 640, 480)
    keep(browser, "desk")
    scheme = browser.evaluate("getComputedStyle(document.getElementById('camera')).colorScheme")
    expect("what the browser draws by itself is dark, too", scheme == "dark", scheme)
    told = browser.pictures_told()
    expect("a screen reader has the picture with the model's name", told == ["3D view of page"], told)
    camera = "tgViewer.cameraIndex"
    expect("the bar is gone once the picture stands", browser.evaluate("document.getElementById('loading').hidden"))
    first = browser.evaluate(camera)
    browser.press(" ", "Space")
    expect("Space goes to the next camera", browser.evaluate(camera) == first + 1)
    browser.press(" ", "Space", SHIFT)
    expect("with Shift to the one before", browser.evaluate(camera) == first)
    browser.evaluate("document.querySelector('#show button:nth-child(2)').focus()")
    browser.press("Tab")
    browser.press("Tab", modifiers=SHIFT)
    ring = browser.evaluate("getComputedStyle(document.activeElement).outlineStyle + document.activeElement.textContent")
    expect("a button that has the focus shows it", ring == "solidbase", ring)
    keep(browser, "focus")
    browser.evaluate("document.getElementById('picture').focus({focusVisible: true})")
    rings = browser.evaluate("[getComputedStyle(document.activeElement).outlineColor, ...(({borderTopStyle, inset, "
                             "borderTopColor}) => [borderTopStyle, borderTopColor, inset])"
                             "(getComputedStyle(document.getElementById('stage'), '::after'))]")
    keep(browser, "focus_picture")
    expect("the picture has a light ring and a dark one within", rings == ["rgb(143, 178, 255)", "solid",
           "rgb(16, 17, 20)", "2px"], rings)
    browser.evaluate("document.querySelector('#show button:nth-child(2)').focus({focusVisible: true})")
    browser.press(" ", "Space")
    state = browser.evaluate(f"[tgViewer.settings.show, {camera}]")
    expect("there Space presses it, and the camera stays", state == ["base", first], state)
    browser.page("Emulation.setEmulatedMedia", features=[{"name": "forced-colors", "value": "active"}])
    keep(browser, "forced-colors")
    grounds = browser.evaluate("[...document.querySelectorAll('#show button')].map((b) => "
                               "[b.getAttribute('aria-pressed'), getComputedStyle(b).backgroundColor])")
    pressed = {ground for state, ground in grounds if state == "true"}
    expect("in colours of the system's own a pressed button is told from others",
           len(pressed) == 1 and pressed.isdisjoint({ground for state, ground in grounds if state == "false"}), grounds)
    browser.evaluate("document.getElementById('picture').focus({focusVisible: true})")
    inner = "getComputedStyle(document.getElementById('stage'), '::after')"
    ring = browser.evaluate(f"{inner}.borderTopColor")
    expect("the picture's inner ring stays dark there", ring == "rgb(16, 17, 20)", ring)
    browser.page("Emulation.setEmulatedMedia", media="print", features=[])
    keep(browser, "print")
    rings = browser.evaluate(f"[getComputedStyle(document.activeElement).outlineStyle, {inner}.display]")
    expect("paper has no ring of a picture that has the focus", rings == ["none", "none"], rings)
    printed = browser.evaluate("[...document.querySelectorAll('body *')].filter((e) => e.offsetHeight > 0)"
                               ".map((e) => e.id).concat(getComputedStyle(document.body).backgroundColor,"
                               " getComputedStyle(document.getElementById('picture')).objectFit)")
    expect("on paper the picture is alone, and of its own shape",
           printed == ["stage", "picture", "rgb(255, 255, 255)", "contain"], printed)
    browser.page("Emulation.setEmulatedMedia", media="", features=[])
    browser.evaluate("document.activeElement.blur()")
    browser.press("1")
    expect("1 is the final picture again", browser.evaluate("tgViewer.settings.show") == "final")

    # A list that was opened by pointer, and by keyboard; headless there is no popup to pick from.
    for begins, where in (("pointerdown", "picture"), ("keydown", "camera")):
        at = browser.evaluate(f"""(() => {{
          const list = document.getElementById('camera');
          list.focus();
          list.dispatchEvent(new Event('pointerdown'));
          list.dispatchEvent(new Event('{begins}'));
          list.value = '{first}';
          list.dispatchEvent(new Event('change'));
          return [document.activeElement.id, tgViewer.cameraIndex];
        }})()""")
        expect(f"a camera that is picked after a {begins} leaves the keys to the {where}", at == [where, first], at)
    at = browser.evaluate("""(() => {
      const field = document.getElementById('background');
      field.focus();
      for (const kind of ['pointerdown', 'change']) field.dispatchEvent(new Event(kind));
      return document.activeElement.id;
    })()""")
    expect("a colour's field stays, whose picker may be open yet", at == "background", at)
    browser.evaluate("document.activeElement.blur()")

    eye = "tgViewer.orbit.camera.eye.map((x) => x.toFixed(4)).join()"
    for key in ("ArrowLeft", "+", "-", "ArrowUp"):
        before = browser.evaluate(eye)
        browser.press(key)
        expect(f"{key} moves the camera", browser.evaluate(eye) != before)
    before = browser.evaluate(eye)
    browser.drag(520, 400, 60, 20)
    expect("so does a drag", browser.evaluate(eye) != before)
    listed = "document.getElementById('camera').selectedOptions[0].textContent"
    expect("and the list of cameras says that it is none of them",
           until(browser, f"{listed} === '(free view)'", 5), browser.evaluate(listed))

    browser.press(" ", "Space")
    now = browser.evaluate(camera)
    expect("Space goes on from the camera that was left", now == first + 1, now)
    browser.press("f")
    browser.press(" ", "Space", SHIFT)
    expect("and back", browser.evaluate(camera) == first, browser.evaluate(camera))
    browser.press("l")
    until(browser, "tgViewer.playing && tgViewer.flight")
    browser.press(" ", "Space")
    expect("a flight leaves it, too", browser.evaluate(camera) == first + 1, browser.evaluate(camera))
    browser.press("+")
    browser.evaluate("window.shown = tgViewer.model")
    gone = browser.evaluate("tgViewer.open({...shown, cameras: [], views: []}).then(() => tgViewer.last)")
    expect("another model knows nothing of it", gone == {"camera": -1, "view": -1}, gone)
    browser.evaluate("tgViewer.open(shown)")
    browser.drag(520, 400, 60, 20)

    told = "document.getElementById('message')"
    leads = f"{told}.textContent.includes('leads to this view') && !{told}.hidden"
    browser.press("c")
    expect("C puts the view into the address", until(browser, "location.hash.startsWith('#view=')"))
    expect("and says so", until(browser, leads, 5))
    expect("which is no warning", browser.evaluate(f"{told}.className") == "done")
    browser.press("ArrowLeft")
    expect("nor true of another view", until(browser, f"{told}.hidden", 2))
    browser.press("c")
    expect("the word of the next one", until(browser, leads, 5))
    expect("goes by itself", until(browser, f"{told}.hidden", 10))
    link = browser.evaluate("location.href")
    shown = from_data_url(browser.evaluate("tgViewer.picture()"))
    browser.page("Page.navigate", url="about:blank")
    browser.open(link, 640, 480)
    same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), shown)
    expect("and that address shows it again, at least 38 dB", same.psnr >= 38, same)
    browser.press("2")
    other = browser.evaluate("tgViewer.settings.show")
    browser.evaluate("location.hash = '#camera=1'")
    expect("an address that comes later shows what it names, and else what the model says",
           other == "base" and until(browser, "tgViewer.settings.show === 'final' && tgViewer.cameraIndex === 1"), other)
    browser.evaluate("tgViewer.settled().then(() => { window.stood = true; }), tgViewer.play()")
    expect("a flight waits for the picture that somebody waits for, and begins",
           until(browser, "window.stood === true && tgViewer.playing"))
    browser.press("l")
    expect("and L ends it", until(browser, "!tgViewer.playing"))

    browser.page("Page.navigate", url="about:blank")
    browser.open(f"{page}?show=alpha", 640, 480)
    asked = browser.evaluate("tgViewer.settings.show")
    browser.press("1")
    browser.press("c")
    expect("it names what the page's query asks for", until(browser, "location.hash.includes('show=final')"), asked)
    link = browser.evaluate("location.href")
    browser.page("Page.navigate", url="about:blank")
    browser.open(link, 640, 480)
    expect("and goes before it", asked == "alpha" and browser.evaluate("tgViewer.settings.show") == "final")

    browser.page("Page.navigate", url="about:blank")
    browser.open(f"{page}?exposure=2&panel=maybe&splat-budget=5&utm_source=a&show=alpha", 640, 480)
    words = browser.evaluate(f"{told}.textContent")
    expect("what the page does not have is named", all(word in words for word in
           ("exposure=2 (pages do not", "panel=maybe (expected on, off)", "splat-budget=5 (expected none")), words)
    expect("what is not for it is passed over, and the rest done",
           "utm" not in words and browser.evaluate("tgViewer.settings.show") == "alpha", words)
    browser.page("Page.navigate", url="about:blank")
    browser.open(f"{page}?panel=on", 640, 480)
    expect("and nothing of what it has", browser.evaluate(f"{told}.hidden"))

    # Who shares a view does not share a key.
    secrets = ("token=tok", "X-Amz-Signature=abc", "X-Amz-Credential=abc", "sig=abc", "api_key=abc", "accessToken=abc",
               "%74oken=tok", "Key-Pair-Id=abc", "PHPSESSID=abc", "session_id=abc", "hdnts=abc", "hdnea=abc")
    open_to_all = ("author=me", "monkey=1", "scene=a%20b", "assignment=2", "show=alpha", "flag", "", "utm=1", "side=1",
                   "mission_id=2", "hd=1", "a=1")
    asked = "&".join(x for pair in zip(secrets, open_to_all) for x in pair)
    browser.page("Page.navigate", url="about:blank")
    browser.open(f"{page}?{asked}", 640, 480)
    browser.evaluate("navigator.clipboard.writeText = async (text) => { window.copied = text; }, 0")
    browser.press("c")
    until(browser, f"!{told}.hidden", 5)
    copied, words = browser.evaluate("[window.copied, document.getElementById('message').textContent]")
    expect("a link without what looks secret is copied",
           copied.startswith(f"{page}?{'&'.join(open_to_all)}#view="), copied)
    expect("and that is told", "is copied, but for what looks secret (token, X-Amz-Signature" in words, words)
    expect("the page keeps its own address", browser.evaluate("location.search") == f"?{asked}")
    browser.evaluate("navigator.clipboard.writeText = () => Promise.reject(new Error('forbidden')), 0")
    browser.press("c")
    shown = f"{told}.textContent.includes(' (token') && {told}.textContent.includes('/page.html?author=me&')"
    expect("where it cannot be copied it is shown without it", until(browser, shown, 5),
           browser.evaluate(f"{told}.textContent"))
    browser.page("Page.navigate", url="about:blank")
    browser.open(page, 640, 480)

    browser.click(*browser.middle("#play"))
    before = browser.evaluate(eye)
    expect("the camera flies", until(browser, f"{eye} !== '{before}'") and browser.evaluate("tgViewer.playing"))
    browser.drag(520, 400, 30, 0)
    expect("until a hand takes it", not browser.evaluate("tgViewer.playing"))
    browser.press("h")
    expect("H hides the panel", browser.evaluate("document.getElementById('panel').hidden"))
    browser.click(*browser.middle("#fullscreen"))
    expect("one button fills the screen", until(browser, "document.fullscreenElement !== null", 5))
    browser.evaluate("document.exitFullscreen()")


def on_a_phone(browser, page):
    browser.fingers(5)
    browser.open(f"{page}?camera=999", 390, 780)
    keep(browser, "phone")
    hidden = "document.getElementById('panel').hidden"
    expect("on a phone the panel waits", browser.evaluate(hidden))
    tap = lambda selector: browser.touch([browser.middle(selector)])
    tap("#toggle")
    expect("a tap opens it", until(browser, f"!{hidden}", 5))
    keep(browser, "phone_panel")
    names = browser.evaluate("""[...document.querySelectorAll('#panel [role="group"]')].map((row) =>
        document.getElementById(row.getAttribute('aria-labelledby')))
        .map((name) => [name.textContent, name.offsetHeight > 0])""")
    expect("every row of buttons has its name above it",
           names == [[name, True] for name in ("Show", "Textures", "Beyond textures", "Intersection")], names)
    small = browser.evaluate(f"""[...document.querySelectorAll('button, select, input')].filter((e) => e.offsetWidth > 0)
        .map((e) => [e.id || e.textContent, e.offsetWidth, e.offsetHeight]).filter(([, w, h]) => w < {TARGET} || h < {TARGET})""")
    expect(f"nothing to tap is smaller than {TARGET} px", not small, small)
    wide = browser.evaluate("document.documentElement.scrollWidth")
    expect("nothing stands beside the screen", wide <= 390, wide)
    tap("#show button:nth-child(4)")
    expect("a tap chooses an output", until(browser, "tgViewer.settings.show === 'alpha'", 5))
    tap("#toggle")
    expect("and one hides the panel", until(browser, hidden, 5))
    told = "document.getElementById('message').hidden"
    expect("the bad address is named", not browser.evaluate(told))
    tap("#message button")
    expect("and its note goes with a tap", until(browser, told, 5))
    browser.evaluate("showMessage('long '.repeat(2000), 'note')")
    tap("#message button")
    expect("a long one goes, too", until(browser, told, 5), browser.middle("#message button"))
    eye, distance = "tgViewer.orbit.camera.eye.join()", "tgViewer.orbit.distance"
    before = browser.evaluate(eye)
    browser.touch([(200, 500), (230, 510), (260, 520)])
    expect("a finger turns the model", browser.evaluate(eye) != before)
    before = browser.evaluate(distance)
    browser.touch([(180, 400), (160, 380), (120, 340)], [(220, 440), (240, 460), (280, 500)])
    expect("two come nearer", browser.evaluate(distance) < 0.6 * before)

    browser.page("Emulation.setDeviceMetricsOverride", width=390, height=780, deviceScaleFactor=1, mobile=True)
    enlarged = "visualViewport.scale"
    tap("#toggle")
    until(browser, f"!{hidden}", 5)
    browser.touch([(100 - 3 * k, 250) for k in range(11)], [(200 + 3 * k, 250) for k in range(11)])
    expect("on the panel two enlarge the page", until(browser, f"{enlarged} > 1.2", 5), browser.evaluate(enlarged))
    browser.evaluate("document.getElementById('panel').hidden = true")
    before = browser.evaluate(distance)
    browser.touch([(60 + 11 * k, 600) for k in range(11)], [(330 - 11 * k, 600) for k in range(11)])
    expect("and on the picture two make it as large as it was", until(browser, f"{enlarged} === 1", 5),
           browser.evaluate(enlarged))
    expect("and the model as far", browser.evaluate(distance) == before, [before, browser.evaluate(distance)])
    browser.touch([(60 + 11 * k, 600) for k in range(11)], [(330 - 11 * k, 600) for k in range(11)])
    expect("where they zoom again", until(browser, f"{distance} > 1.5 * {before}", 5), browser.evaluate(distance))
    browser.fingers(0)


def in_frames(browser, folder):
    """The page in a frame, whose address nobody sees, and in one without an address."""
    page = (folder / "page.html").read_text()
    frames = {"framed": '<iframe src="page.html"', "srcdoc": f'<iframe srcdoc="{html.escape(page)}"'}
    for name, frame in frames.items():
        (folder / f"{name}.html").write_text(f'<!doctype html><body>{frame} width="600" height="440"></iframe>')
    server = Server({"pages": folder})
    inner = "window[0]"
    told = f"{inner}.document.getElementById('message')"
    words = f"{told}.firstElementChild.textContent"

    def open_frame(name):
        browser.log = []
        browser.page("Page.navigate", url=f"{server.address}/pages/{name}.html")
        expect(f"{name}: the page shows its model",
               until(browser, f"{inner} && {inner}.__done && {inner}.__done.gaussians > 0", 60))

    def press_c():
        browser.evaluate(f"{inner}.document.body.dispatchEvent(new {inner}.KeyboardEvent('keydown', "
                         "{key: 'c', bubbles: true, cancelable: true}))")

    open_frame("framed")
    browser.evaluate(f"{inner}.navigator.clipboard.writeText = () => Promise.reject(new Error('forbidden')), 0")
    press_c()
    link = f"A link to this view: {server.address}/pages/page.html#view="
    expect("in a frame that may not copy C shows the link", until(browser, f"{words}.startsWith('{link}')", 5),
           browser.evaluate(words))
    keep(browser, "framed")
    browser.evaluate(f"({inner}.tgViewer.orbit.orbit(0.3, 0), {inner}.tgViewer.changed(), 0)")
    expect("until the view is another", until(browser, f"{told}.hidden", 5))
    browser.evaluate(f"{inner}.navigator.clipboard.writeText = async (text) => {{ window.copied = text; }}, 0")
    press_c()
    expect("in one that may it is copied", until(browser, f"{words} === 'A link to this view is copied.'", 5),
           browser.evaluate(words))
    copied = browser.evaluate("window.copied")
    expect("and that is the frame's own address", copied.startswith(link.split(": ")[1]), copied)
    open_frame("srcdoc")
    expect("a frame without an address has no button for a link",
           browser.evaluate(f"{inner}.document.getElementById('link').hidden"))
    press_c()
    expect("and says so to C", until(browser, f"!{told}.hidden && {words}.includes('no address')", 5),
           browser.evaluate(words))
    browser.evaluate("new Promise((done) => setTimeout(done, 200))")
    expect("without an error", not browser.log, browser.log[:3])


def drop(browser, *files):
    data = dict(items=[], files=[str(file) for file in files], dragOperationsMask=1)
    for kind in ("dragEnter", "dragOver", "drop"):
        browser.page("Input.dispatchDragEvent", type=kind, x=400, y=300, data=data)


def dropped(browser, page, file):
    browser.page("Page.navigate", url="about:blank")
    browser.open(page, 640, 480)
    words = "document.getElementById('message').firstElementChild.textContent"
    told = lambda text: until(browser, f"{words} === {json.dumps(text)}", 5)
    drop(browser, file.parent)
    expect("a dropped folder is told", told(f"{file.parent.name}: a folder (expected a .glb or .sog)"),
           browser.evaluate(words))
    drop(browser, file, file)
    expect("so are two files at once", told(f"{file.name}: and 1 more at once (expected one .glb or .sog)"),
           browser.evaluate(words))
    browser.evaluate("(window.bar = [], new MutationObserver(() => bar.push(document.getElementById('loading').hidden))"
                     ".observe(document.getElementById('loading'), {attributes: true}), 0)")
    drop(browser, file)
    expect("a dropped file is opened, and named by the tab", until(browser, f"document.title === '{file.name}'", 30),
           browser.evaluate(f"[document.title, {words}]"))
    bar = browser.evaluate("[bar[0], bar.at(-1)]")
    expect("and a bar shows that it is read", bar == [False, True], bar)
    browser.press("c")
    expect("no link leads to it", until(browser, f"{words}.startsWith('No link: ')", 5) and
           browser.evaluate("location.hash") == "", browser.evaluate(f"[location.hash, {words}]"))

    # Two at once: what is shown is named, and what was refused is told.
    broken = file.with_name("broken.glb")
    broken.write_bytes(b"no model")
    title = "document.title"
    for later, refusal in ((broken, f"{broken.name}: "), (file.parent, f"{file.parent.name}: a folder")):
        browser.page("Page.navigate", url="about:blank")
        browser.open(page, 640, 480)
        browser.evaluate("""(() => {
          const open = tgViewer.open.bind(tgViewer);
          tgViewer.open = async (model) => {
            window.began = true;
            await new Promise((done) => { window.goOn = done; });
            await open(model);
          };
        })()""")
        drop(browser, file)
        until(browser, "window.began")
        drop(browser, later)
        refused = until(browser, f"{words}.startsWith({json.dumps(refusal)})", 5)
        browser.evaluate("goOn()")
        named = until(browser, f"{title} === '{file.name}'", 10)
        found = browser.evaluate(f"[{title}, {words}]")
        expect(f"a model that is opened while {later.name if later == broken else 'a folder'} is refused has its name, "
               "and the refusal stays", refused and named and found[1].startswith(refusal), found)


def device_lost(browser, page, size):
    """The page without its device: while it loads, afterwards, and for long."""
    whole = f"{page}?size={size}"
    browser.open(whole)
    shown = from_data_url(browser.evaluate("tgViewer.picture()"))
    told = "document.getElementById('message')"
    browser.evaluate("tgViewer.device.loseContext(), 0")
    browser.evaluate("new Promise((done) => setTimeout(done, 300))")
    browser.evaluate("tgViewer.device.restoreContext(), 0")
    expect("a device that is lost and comes back has its picture again",
           until(browser, "tgViewer.splats && !tgViewer.renderer.gl.isContextLost()"))
    same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), shown)
    expect("the same one", same.largest == 0, same)
    browser.evaluate("tgViewer.device.loseContext(), 0")
    expect("one that stays away is spoken of", until(browser, f"{told}.textContent.includes('taken')"))
    browser.evaluate("tgViewer.device.restoreContext(), 0")
    expect("until it is back", until(browser, f"{told}.hidden && tgViewer.splats"))
    with browser.before_pages(LOSE):
        found = browser.open(f"{whole}&back=300")
        expect("so does one that is lost while the model is uploaded", found.get("gaussians", 0) > 0, found)
        same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), shown)
        expect("with the same picture", same.largest == 0, same)
        expect("and without a word", browser.evaluate(f"{told}.hidden"), browser.evaluate(f"{told}.textContent"))
        browser.page("Page.navigate", url=f"{whole}&lost")
        expect("also one that stays away then", until(browser, f"{told} && {told}.textContent.includes('taken')"))
        browser.evaluate("giveBack(), 0")
        expect("and the page goes on when it comes", until(browser, "window.__done && __done.gaussians > 0", 60))
        found = browser.open(f"{whole}&back=100&always")
        expect("a model that always takes the device away is given up", "whenever" in found.get("error", ""), found)
    browser.open(whole)
    gone = browser.evaluate("((model) => { tgViewer.dispose(); tgViewer.dispose();"
                            " return tgViewer.open(model).catch((error) => error.message); })(tgViewer.model)")
    expect("a viewer that was disposed of says so", "disposed" in gone, gone)


def turned(browser, page):
    """A model without cameras on a phone that is turned, before and after a finger has moved it."""
    shapes = [(390, 780), (780, 390)]
    look = "(tgViewer.orbit.orbit(0.4, 0.1), tgViewer.moved(), 0)"

    def lit():
        return browser.evaluate(f"tgViewer.picture().then({LIT})")

    def turn(width, height):
        browser.page("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                     mobile=False)
        return until(browser, f"tgViewer.canvas.width === {width} && tgViewer.canvas.height === {height}")

    fresh, moved = {}, {}
    for shape in shapes:
        browser.page("Page.navigate", url="about:blank")
        browser.open(page, *shape)
        fresh[shape] = from_data_url(browser.evaluate("tgViewer.picture()"))
        browser.evaluate(look)
        moved[shape] = lit()
    for before, after in (shapes, shapes[::-1]):
        name = f"{before[0]} x {before[1]} turned to {after[0]} x {after[1]}"
        browser.page("Page.navigate", url="about:blank")
        browser.open(page, *before)
        there = turn(*after)
        same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), fresh[after])
        expect(f"{name} the page shows what it starts with there", there and same.psnr > 45, same)
        keep(browser, f"turned_{after[0]}")
        turn(*before)
        browser.evaluate(look)
        here = lit()
        turn(*after)
        found = lit()
        expect(f"{name} a model that was moved stays as large",
               all(abs((found[k + 2] - found[k]) / (here[k + 2] - here[k]) - 1) < 0.02 for k in (0, 1)), (here, found))
        # The lens of a portrait is longer: what is near is less enlarged by it.
        wide = (found[2] - found[0]) / (moved[after][2] - moved[after][0])
        expect(f"{name} nearly as large as on a new page", 0.9 < wide < 1.1, wide)
    link = browser.evaluate("(document.getElementById('link').click(), location.hash)")
    aspect = float(link.split(",")[8])
    expect("a link to such a view asks for a square", abs(aspect - 1) < 1e-3, link)


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    model = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else REPOSITORY / "docs/sample.tgz").resolve()
    run = lambda *arguments: subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.DEVNULL)
    with Chromium() as browser, tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run(programs / "tgconvert", model, folder / "page.html", "--quiet")
        browser.watch_stalls()
        page = (folder / "page.html").as_uri()
        longest, busy = browser.longest_stall(lambda: browser.open(page, 320, 240))
        if busy:
            print(busy)
        else:
            expect(f"once there is a context nothing stalls the page for more than {STALL} ms", longest <= STALL, longest)
        at_a_desk(browser, page)
        on_a_phone(browser, page)
        device_lost(browser, page, "160x160")
        run(programs / "tgconvert", model, folder / "other.glb", "--quiet")
        dropped(browser, page, folder / "other.glb")
        in_frames(browser, folder)
        clouds.write(folder / "cloud.ply")
        run(programs / "tgconvert", folder / "cloud.ply", folder / "cloud.html", "--quiet")
        turned(browser, (folder / "cloud.html").as_uri())

        # A newer one of the same model keeps what the hand chose, as far as it goes for it.
        browser.open(page, 320, 240)
        found = browser.evaluate("""(async () => {
          const was = tgViewer.model, last = was.cameras.length - 1, own = tgViewer.settings.textures;
          tgViewer.jump(last);
          tgViewer.settings.textures = 'off';
          await tgViewer.replace({...was});
          const same = [tgViewer.cameraIndex === last, tgViewer.settings.textures];
          await tgViewer.replace({...was, cameras: was.cameras.slice(0, 1), layer: {...was.layer, mode: MODES.alpha}});
          return [own, ...same, tgViewer.cameraIndex, tgViewer.settings.textures];
        })()""")
        expect("a newer model keeps camera and textures where it has them", found == ["rgba", True, "off", -1, "alpha"],
               found)

        # Bookmarks of tgview are views.
        with tarfile.open(model) as archive:
            cameras = json.load(io.TextIOWrapper(archive.extractfile("cameras.json")))
        views = [{**cameras[5], "img_name": "the front"}, {**cameras[40], "img_name": "from behind"}]
        (folder / "views.json").write_text(json.dumps(views))
        run(programs / "tgconvert", model, folder / "views.html", "--views", folder / "views.json", "--quiet")
        size = "160x160"
        address = f"{(folder / 'views.html').as_uri()}?size={size}"
        browser.open(address)
        run(programs / "tgview", model, "--render", folder / "reference.png", "--size", size, "--backend", "cpu",
            "--camera", 5)
        reference = (folder / "reference.png").read_bytes()
        same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), reference)
        expect("the page starts with the first view, at least 38 dB", same.psnr >= 38, same)
        listed = browser.evaluate("[...document.querySelectorAll('#camera optgroup:first-child option')]"
                                  ".map((o) => o.textContent)")
        expect("and lists them by name", listed == ["the front", "from behind"], listed)
        browser.press(" ", "Space")
        expect("Space goes through them", browser.evaluate("tgViewer.viewIndex") == 1)
        browser.press("ArrowLeft")
        browser.press(" ", "Space", SHIFT)
        expect("and on from the one that was left", browser.evaluate("tgViewer.viewIndex") == 0)
        browser.open(address + "&view=from+behind")
        expect("an address names one", browser.evaluate("tgViewer.viewIndex") == 1)
        # A model that is turned takes them along.
        run(programs / "tgconvert", model, folder / "turned.html", "--views", folder / "views.json", "--rotate",
            "0,0,1,90", "--scale", "2", "--quiet")
        browser.open(f"{(folder / 'turned.html').as_uri()}?size={size}")
        same = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture()")), reference)
        expect("views stay where they are on a model that is turned, at least 34 dB", same.psnr >= 34, same)

        slow = SlowServer((folder / "page.html").read_bytes())
        browser.page("Page.navigate", url=slow.address)
        now = "Number((document.getElementById('loading') || {getAttribute: () => 0}).getAttribute('aria-valuenow'))"
        expect("while the page comes its bar shows how far it is", until(browser, f"{now} > 20 && {now} < 40"),
               browser.evaluate(now))
        keep(browser, "loading")
        slow.go.set()
        expect("and it shows its model when all is there", until(browser, "window.__done && __done.gaussians > 0", 60))
        expect("no word on the console", not browser.log, browser.log[:3])

        cut = (folder / "page.html").read_bytes()
        (folder / "cut.html").write_bytes(cut[:len(cut) // 2])
        found = browser.open((folder / "cut.html").as_uri())
        counts = re.search(r"cut off \((\d+) of (\d+) bytes of its model\): copy", found.get("error", ""))
        expect("a page that is cut off says so", counts and 0 < int(counts[1]) < int(counts[2]) < len(cut), found)
        held = sum(len(part) * 3 // 4 - part.count(b"=") for part in re.findall(rb'class="model">([^<]*)<', cut))
        expect("in bytes", counts and held <= int(counts[2]) <= held + 2, (held, found))
        for keep_bytes in (cut.rindex(b"</body>"), cut.rindex(b"<i id=\"end\"")):
            (folder / "end.html").write_bytes(cut[:keep_bytes].replace(b"<script>startViewer", b"<i"))
            found = browser.open((folder / "end.html").as_uri())
            expect("without counts where all of its model has come",
                   found.get("error") == "This file is cut off: copy or export it again.", found)
        dead = browser.evaluate("[...document.querySelectorAll('button')].filter((e) => e.offsetHeight > 0)"
                                ".map((e) => e.getAttribute('aria-label'))")
        expect("and has no buttons that do nothing", dead == ["close"], dead)
        (folder / "torso.html").write_bytes(cut[:20000])
        browser.page("Page.navigate", url=(folder / "torso.html").as_uri())
        said = "document.getElementById('cut')"
        expect("one that ends within its script, too",
               until(browser, f"{said} !== null && getComputedStyle({said}).visibility === 'visible'"))
        keep(browser, "torso")
        (folder / "torso.html").write_bytes(cut[:20000].replace(b":has(", b":unknown("))
        browser.page("Page.navigate", url=(folder / "torso.html").as_uri())
        until(browser, f"{said} !== null && getComputedStyle({said}).visibility === 'visible'")
        shown = browser.evaluate("[...document.querySelectorAll('.late')].filter((e) => e.offsetHeight > 0)"
                                 ".map((e) => e.id)")
        expect("and says so alone in a browser without :has()", shown == ["cut"], shown)
        # Its scripts are forbidden, as some servers do: it is whole, and says why it shows nothing.
        barred = SlowServer(cut, headers=[("Content-Security-Policy", "script-src 'none'")])
        barred.go.set()
        browser.page("Page.navigate", url=barred.address)
        seen = """[...document.querySelectorAll('.late')].filter((e) => getComputedStyle(e).visibility === 'visible' &&
            e.offsetHeight > 0).map((e) => e.id + e.role).join()"""
        expect("one whose scripts are forbidden says so alone", until(browser, f"({seen}) === 'barredalert'"),
               browser.evaluate(seen))
        policy = "default-src 'none'; script-src 'unsafe-inline'; worker-src blob:"
        plain = SlowServer(cut, headers=[("Content-Security-Policy", policy)])
        plain.go.set()
        found = browser.open(plain.address)
        said = browser.evaluate("document.body.innerText")
        words = [word for word in ("This page has not come", "The scripts of this page") if word in said]
        expect("one whose styles alone are forbidden shows its model without a word of that",
               found.get("gaussians", 0) > 0 and not words, (found, words))
        short = SlowServer(cut[:len(cut) // 2])
        short.go.set()
        found = browser.open(short.address)
        expect("one from a server is to be loaded again", "whole: reload it" in found.get("error", ""), found)
        torn = SlowServer(cut, torn=True)
        torn.go.set()
        browser.page("Page.navigate", url=torn.address)
        told = "(document.getElementById('message') || {}).textContent"
        expect("where the connection breaks it says that nothing comes", until(browser, f"`${{{told}}}`.includes('gone')", 30),
               browser.evaluate(told))
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

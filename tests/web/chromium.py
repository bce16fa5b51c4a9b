# SPDX-License-Identifier: Apache-2.0
"""Drives a headless Chromium through its debugging pipe, with nothing but Python; and compares its pictures."""
import base64
import contextlib
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time

SKIPPED = 77  # ctest's SKIP_RETURN_CODE
STALL = 100   # [ms] that nothing may hold up a page
BUSY = 20     # [ms] that a page with nothing to do lags where stalls cannot be told from a machine with other work
LAG = """new Promise((done) => {
  let last = performance.now(), lag = 0, left = 100;
  const next = () => {
    const now = performance.now();
    lag = Math.max(lag, now - last - 5);
    last = now;
    if (--left > 0) setTimeout(next, 5); else done(lag);
  };
  setTimeout(next, 5);
})"""
WATCH = """window.stalls = [];
let context = 0;  // when it came: that takes as long as the browser takes to begin with the device
const getContext = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function(...given) {
  const found = getContext.apply(this, given);
  if (found.getExtension) found.getExtension('EXT_color_buffer_float');
  context = performance.now();
  return found;
};
new PerformanceObserver((list) => stalls.push(...list.getEntries().filter((e) => e.startTime > context)
    .map((e) => e.duration))).observe({entryTypes: ['longtask']});"""
FLAGS = ["--headless=new", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking",
         "--disable-component-update", "--disable-sync", "--disable-extensions", "--hide-scrollbars",
         "--force-device-scale-factor=1", "--force-color-profile=srgb", "--use-angle=swiftshader",
         "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--remote-debugging-pipe"]


def skip(why):
    print(f"skipped: {why}")
    sys.exit(SKIPPED)


def find_chromium():
    """Skips the test where there is none."""
    names = [os.environ.get("CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome"]
    for name in filter(None, names):
        path = shutil.which(name)
        if path:
            return path
    skip("no Chromium here (apt-get install chromium, or set CHROMIUM)")


class Chromium:
    """`with Chromium() as browser:`; nothing of it is left afterwards. It never asks the network for anything but what
    a page it is told to open names."""

    def __init__(self, flags=()):
        self.program = find_chromium()
        self.flags = [*FLAGS, *flags]

    def __enter__(self):
        self.profile = tempfile.mkdtemp(prefix="tg-chromium-")
        to_browser, self.out = os.pipe()
        self.inp, from_browser = os.pipe()

        def pipes():  # the browser reads from 3 and writes to 4
            a, b = os.dup(to_browser), os.dup(from_browser)
            os.dup2(a, 3)
            os.dup2(b, 4)

        self.process = subprocess.Popen([self.program, *self.flags, f"--user-data-dir={self.profile}", "about:blank"],
                                        preexec_fn=pipes, close_fds=False, stdin=subprocess.DEVNULL,
                                        stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(to_browser)
        os.close(from_browser)
        self.number = 0
        self.unread = b""
        self.log = []  # console warnings, errors and exceptions of the page
        self.requests = []  # URLs
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network"):
            self.page(f"{domain}.enable")
        return self

    def __exit__(self, *_):
        try:
            self.call("Browser.close")
            self.process.wait(10)
        except Exception:
            self.process.kill()
            self.process.wait()
        os.close(self.out)
        os.close(self.inp)
        shutil.rmtree(self.profile, ignore_errors=True)

    def receive(self):
        while b"\0" not in self.unread:
            data = os.read(self.inp, 1 << 20)
            if not data:
                raise RuntimeError("Chromium ended")
            self.unread += data
        message, self.unread = self.unread.split(b"\0", 1)
        return json.loads(message)

    def note(self, message):
        method, params = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            details = params["exceptionDetails"]
            self.log.append(details.get("exception", {}).get("description", details["text"]))
        elif method == "Runtime.consoleAPICalled" and params["type"] in ("error", "warning"):
            self.log.append(" ".join(str(a.get("value", a.get("description", ""))) for a in params["args"]))
        elif method == "Network.requestWillBeSent":
            self.requests.append(params["request"]["url"])

    def send(self, method, session=None, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if session:
            message["sessionId"] = session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.out, data):]
        while True:
            answer = self.receive()
            if answer.get("id") == self.number:
                if "error" in answer:
                    raise RuntimeError(f"{method}: {answer['error'].get('message')}")
                return answer["result"]
            self.note(answer)

    def call(self, method, **params):
        return self.send(method, **params)

    def page(self, method, **params):
        return self.send(method, session=self.session, **params)

    def evaluate(self, expression):
        """The value of a JavaScript expression in the page; promises are awaited."""
        result = self.page("Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise RuntimeError(details.get("exception", {}).get("description", details["text"]))
        return result["result"].get("value")

    def open(self, url, width=800, height=600, seconds=120):
        """Opens a page and waits until it sets window.__done; returns that."""
        self.log, self.requests = [], []
        self.page("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        self.page("Page.navigate", url=url)
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            done = self.evaluate(f"location.href === {json.dumps(url)} && window.__done || null")
            if done is not None:
                return done
            time.sleep(0.1)
        raise RuntimeError(f"{url}: no picture after {seconds} s; {self.log}")

    def watch_stalls(self):
        """Of pages that are opened from now on: window.stalls, [ms] of what held them up once they had a context."""
        self.page("Page.addScriptToEvaluateOnNewDocument", source=WATCH)

    @contextlib.contextmanager
    def before_pages(self, script):
        """Pages that are opened meanwhile run the script first."""
        added = self.page("Page.addScriptToEvaluateOnNewDocument", source=script)["identifier"]
        yield
        self.page("Page.removeScriptToEvaluateOnNewDocument", identifier=added)

    def longest_stall(self, use):
        """[ms] that a page was held up while `use()` opens it, the least of three tries that are more than STALL, as what
        else runs on the machine may stop the browser, too; and why that tells nothing, "" if it does."""
        longest = []
        for _ in range(3):
            self.page("Page.navigate", url="about:blank")
            lag = self.evaluate(LAG)
            use()
            longest.append(max(self.evaluate("stalls"), default=0))
            if longest[-1] <= STALL or lag > BUSY:
                break
        busy = f"not measured: stalls (an empty page lags by {lag:.0f} ms: the machine is busy)" if lag > BUSY else ""
        return min(longest), busy

    def press(self, key, code=None, modifiers=0):
        """A key as a keyboard sends it; of those without a letter by its name ("Tab", "ArrowLeft")."""
        text = {"Enter": "\r"}.get(key, key if len(key) == 1 else "")
        number = {"Tab": 9, "Enter": 13, "ArrowLeft": 37, "ArrowUp": 38, "ArrowRight": 39, "ArrowDown": 40}.get(key)
        number = number or ord(key.upper())
        named = dict(key=key, code=code or key, windowsVirtualKeyCode=number, modifiers=modifiers)
        self.page("Input.dispatchKeyEvent", type="keyDown" if text else "rawKeyDown", text=text, **named)
        self.page("Input.dispatchKeyEvent", type="keyUp", **named)

    def click(self, x, y):
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            self.page("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)

    def drag(self, x, y, dx, dy, steps=5):
        point = lambda k: dict(x=x + dx * k / steps, y=y + dy * k / steps)
        self.page("Input.dispatchMouseEvent", type="mousePressed", button="left", buttons=1, clickCount=1, **point(0))
        for k in range(1, steps + 1):
            self.page("Input.dispatchMouseEvent", type="mouseMoved", button="left", buttons=1, **point(k))
        self.page("Input.dispatchMouseEvent", type="mouseReleased", button="left", clickCount=1, **point(steps))

    def touch(self, *fingers):
        """Fingers that come down together, each a list of points, move along them and go."""
        for k in range(len(fingers[0])):
            points = [dict(x=finger[k][0], y=finger[k][1], id=n) for n, finger in enumerate(fingers)]
            self.page("Input.dispatchTouchEvent", type="touchMove" if k else "touchStart", touchPoints=points)
        self.page("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def pictures_told(self):
        """The names of pictures that have one, as a screen reader has them."""
        nodes = self.page("Accessibility.getFullAXTree")["nodes"]
        names = [node["name"]["value"] for node in nodes if node.get("role", {}).get("value") in ("img", "image")]
        return [name for name in names if name]

    def middle(self, selector):
        """Of an element, in the window."""
        return self.evaluate(f"(({{x, y, width, height}}) => [x + width / 2, y + height / 2])"
                             f"(document.querySelector({json.dumps(selector)}).getBoundingClientRect())")

    def fingers(self, count):
        """Makes it a device with a touch screen, or 0: with a mouse."""
        self.page("Emulation.setTouchEmulationEnabled", enabled=count > 0, maxTouchPoints=max(count, 1))

    def screenshot(self):
        """The window as it is on the screen, a PNG's bytes."""
        return base64.b64decode(self.page("Page.captureScreenshot", format="png")["data"])


def from_data_url(url):
    return base64.b64decode(url.split(",", 1)[1])


COMPARE = """(async (a, b) => {
  const pixels = async (url) => {
    const image = new Image();
    image.src = url;
    await image.decode();
    const canvas = new OffscreenCanvas(image.width, image.height);
    const context = canvas.getContext('2d', {willReadFrequently: true});
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, image.width, image.height);
  };
  const x = await pixels(a), y = await pixels(b);
  if (x.width !== y.width || x.height !== y.height) {
    throw new Error(`the pictures differ in size: ${x.width} x ${x.height} and ${y.width} x ${y.height}`);
  }
  let squares = 0, largest = 0, count = 0;
  for (let i = 0; i < x.data.length; ++i) {
    const d = Math.abs(x.data[i] - y.data[i]);
    squares += d * d;
    largest = Math.max(largest, d);
    count += d > 0;
  }
  return {error: squares / (x.width * x.height * 3), largest, count};
})"""


class Difference:
    """Of two opaque pictures (PNG bytes): `psnr` [dB] over 8-bit RGB values, `largest` difference, `count` of values
    that differ. The browser decodes them."""

    def __init__(self, browser, a, b):
        urls = ["data:image/png;base64," + base64.b64encode(data).decode() for data in (a, b)]
        result = browser.evaluate(f"{COMPARE}({json.dumps(urls[0])}, {json.dumps(urls[1])})")
        self.largest, self.count = result["largest"], result["count"]
        self.psnr = math.inf if result["error"] == 0 else 10 * math.log10(255 ** 2 / result["error"])

    def __str__(self):
        return f"{self.psnr:.2f} dB, largest difference {self.largest}"

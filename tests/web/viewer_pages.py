# SPDX-License-Identifier: Apache-2.0
"""Pages that show a GLB in three.js, PlayCanvas and Babylon.js, in a Chromium that is driven."""
import functools
import http.server
import json
import math
import os
import pathlib
import subprocess
import threading
import time
import urllib.parse

from chromium import Difference, skip

HERE = pathlib.Path(__file__).resolve().parent
VIEWERS = ["three", "playcanvas", "babylon"]
REST_SECONDS = 2.0  # without a change, after which a picture counts as finished
LIMIT_SECONDS = 150


def find_packages(programs):
    """Where the viewers are installed; None: nowhere."""
    for folder in (os.environ.get("TG_WEB_PACKAGES", ""), programs.parent / "web_packages"):
        modules = pathlib.Path(folder) / "node_modules"
        if folder and (modules / "three").is_dir():
            return modules
    return None


def needed_packages(programs):
    return find_packages(programs) or skip("no packages of the viewers here (scripts/test_browsers.sh installs them)")


class Server:
    """Serves a folder on 127.0.0.1."""

    def __init__(self, folder):
        class Quiet(http.server.SimpleHTTPRequestHandler):
            def log_message(self, *_):
                pass
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Quiet, directory=folder))
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_port}"


class View:
    """Where a picture is taken, in the file's axes: eye, right, up and forward; its vertical angle is fov [degrees]."""

    def __init__(self, eye, right, up, forward, fov, size):
        self.eye, self.right, self.up, self.forward = eye, right, up, forward
        self.fov, self.size = fov, size  # width, height [px]

    def as_query(self):
        text = lambda v: ",".join(map(str, v))
        target = [e + f for e, f in zip(self.eye, self.forward)]
        return {"eye": text(self.eye), "target": text(target), "up": text(self.up), "fov": self.fov}

    def as_camera(self):
        """The same for tgview: INRIA's layout, in the model's axes (a half turn about z from the file's)."""
        turn = lambda v: [-v[0], -v[1], v[2]]
        axes = [turn(v) for v in (self.right, [-x for x in self.up], self.forward)]
        width, height = self.size
        focal = 0.5 * height / math.tan(math.radians(self.fov) / 2)
        return json.dumps([{"id": 0, "img_name": "", "width": width, "height": height, "fx": focal, "fy": focal,
                            "position": turn(self.eye),
                            "rotation": [[axes[c][r] for c in range(3)] for r in range(3)]}])


def css_color(rgb):
    """Of r, g, b from 0 to 1."""
    return f"rgb({','.join(f'{100 * c:g}%' for c in rgb)})"


class Pages:
    """Writes a page of each viewer into `folder`, and shows files that lie there. `background`: r, g, b from 0 to 1."""

    def __init__(self, browser, modules, folder, background=(0, 0, 0)):
        self.browser, self.background = browser, ",".join(f"{c:g}" for c in background)
        color = css_color(background)
        for viewer in VIEWERS:
            subprocess.run([str(modules / ".bin/esbuild"), str(HERE / f"viewers/{viewer}.js"), "--bundle",
                            "--format=iife", "--log-level=error", f"--outfile={folder / viewer}.js"],
                           check=True, env={**os.environ, "NODE_PATH": str(modules)})
            (folder / f"{viewer}.html").write_text("<!doctype html><meta charset=utf-8><body style='margin:0;"
                                                   f"background:{color}'><script src={viewer}.js></script>")
        (folder / "blank.html").write_text(f"<!doctype html><body style='background:{color}'>"
                                           "<script>__done = {}</script>")
        self.address = Server(folder).address

    def show(self, viewer, file, view, **more):
        """What the page says of itself."""
        query = urllib.parse.urlencode({"file": file, "background": self.background, **view.as_query(), **more})
        done = self.browser.open(f"{self.address}/{viewer}.html?{query}", *view.size, LIMIT_SECONDS)
        if "error" in done:
            raise RuntimeError(f"{viewer}, {file}: {done['error']}")
        return done

    def picture(self, viewer, file, view):
        """The window, PNG bytes, once it has not changed for REST_SECONDS."""
        self.browser.open(f"{self.address}/blank.html", *view.size)
        blank = self.browser.screenshot()
        self.show(viewer, file, view)
        last, since, end = self.browser.screenshot(), time.monotonic(), time.monotonic() + LIMIT_SECONDS
        while time.monotonic() < end:
            time.sleep(0.5)
            now = self.browser.screenshot()
            if now != last:
                last, since = now, time.monotonic()
            elif time.monotonic() - since > REST_SECONDS and Difference(self.browser, now, blank).count > 0:
                return now
        raise RuntimeError(f"the picture does not come to rest in {LIMIT_SECONDS} s")

# SPDX-License-Identifier: Apache-2.0
"""The page of tgtrain --serve, in Chromium while a run trains: newer models, curves, numbers; on a desk and a phone.

    live_test.py FOLDER_OF_PROGRAMS
"""
import pathlib
import subprocess
import sys
import tempfile
import time

from chromium import Chromium, find_chromium

find_chromium()
tgtrain = pathlib.Path(sys.argv[1]) / "tgtrain"
if not tgtrain.exists():
    sys.exit(f"{tgtrain}: not there (expected the build's programs)")


def until(what, condition, seconds=120):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.2)
    sys.exit(f"{what}: not within {seconds} s")


def check(ok, what):
    if not ok:
        sys.exit(f"wrong: {what}")


with tempfile.TemporaryDirectory(prefix="tg-live-") as folder:
    subprocess.run([tgtrain, "make-sample", f"{folder}/scene", "--size", "64", "--views", "8", "--test-views", "2",
                    "--points", "400", "--supersampling", "1"], check=True)
    command = [tgtrain, f"{folder}/scene", "--run", f"{folder}/run", "--densification", "none", "--threads", "1",
               "--iterations", "300", "--texture-iterations", "1000000", "--eval-every", "100", "--serve", "0",
               "--serve-token", "a-token-for-this-test"]
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        url = until("an address", lambda: run.stdout.readline().strip()).removeprefix("serving ")
        with Chromium() as browser:
            browser.page("Emulation.setDeviceMetricsOverride", width=1280, height=800, deviceScaleFactor=1, mobile=False)
            browser.page("Page.navigate", url=url)
            until("a first model", lambda: browser.evaluate("window.__shown"))
            until("a newer model", lambda: browser.evaluate("window.__shown > 1"))
            until("textures", lambda: browser.evaluate("tgViewer.model.layer !== null"))
            until("curves", lambda: browser.evaluate("document.querySelectorAll('#psnr path').length > 0"))
            until("test scores", lambda: browser.evaluate("document.querySelectorAll('#psnr circle').length > 1"))
            until("the stage", lambda: "stage textured" in browser.evaluate("document.body.innerText"))
            until("a held-out pair", lambda: browser.evaluate("document.getElementById('rendering').naturalWidth") == 64)
            bar = browser.evaluate("(({role, ariaLabel, ariaValueNow}) => [role, ariaLabel, ariaValueNow])"
                                   "(document.getElementById('progress'))")
            check(bar[0] == "progressbar" and bar[1] and 0 <= int(bar[2]) <= 100, bar)
            # Axes say what they measure: two numbers each at least, all different, and the unit of the iterations.
            axes = browser.evaluate("[[24.13, 24.31], [0.0312, 0.0388], [25.12, 25.1205], [1.2341e6, 1.2349e6]]"
                                    ".map(([low, high]) => labelsOf(ticks(low, high, 3)))")
            check(all(len(set(axis)) == len(axis) >= 2 for axis in axes), axes)
            counts = browser.evaluate("[...Array(2000).keys()].map((i) => ticks(i / 7, i / 7 + 1 + i % 97 / 10, 3))"
                                      ".map((axis) => axis.length)")
            check(2 <= min(counts) and max(counts) <= 5, (min(counts), max(counts)))
            texts = browser.evaluate("[...document.querySelectorAll('#loss text')].map((e) => e.textContent)")
            check("iteration 0" in texts and len(texts) >= 4, texts)
            until("how much of the run is done", lambda: "\u00a0% of the run's time" in browser.evaluate(
                "document.getElementById('stage-line').textContent"))
            # Labels stand inside of the picture, however long, also where the axis ends with one.
            outside = browser.evaluate("""(() => {
              const box = document.body.appendChild(document.createElement('div'));
              box.className = 'chart';
              box.style.width = '340px';
              const chart = new Chart(box), beyond = [];
              const curves = [[1234210, 1234219, 1e6], [0.0312, 0.0388, 7000], [25.12, 25.1205, 30000]];
              for (const [low, high, last] of curves) {
                chart.set([{color: 'red', values: [[0, low], [last, high]]}], []);
                const frame = box.firstElementChild.getBoundingClientRect();
                for (const text of box.querySelectorAll('text')) {
                  const {left, right, width} = text.getBoundingClientRect();
                  if (!(left >= frame.left && right <= frame.right && width > 0)) beyond.push(text.textContent);
                }
              }
              box.remove();
              return beyond;
            })()""")
            check(not outside, f"labels beyond the picture: {outside}")
            text = browser.evaluate("document.getElementById('run').innerText")
            check("scene" in text and "dB" in text and "it/s" in text, text)
            # Of a run that was paused its seconds say nothing.
            stage_line = "document.getElementById('stage-line').textContent"
            phase = lambda: browser.evaluate("document.getElementById('phase').textContent")
            control = pathlib.Path(folder) / "run/control"
            control.write_text("pause\n")
            until("a pause", lambda: phase() == "paused")
            check("run's time" not in browser.evaluate(stage_line), browser.evaluate(stage_line))
            control.write_text("go\n")
            until("the end of it", lambda: phase() == "training")
            check("run's time" not in browser.evaluate(stage_line), browser.evaluate(stage_line))
            # The view stays where a hand has put it while models come.
            browser.evaluate("tgViewer.orbit.orbit(0.3, 0.1); tgViewer.changed(); 0")
            eye = browser.evaluate("tgViewer.orbit.camera.eye.join()")
            shown = browser.evaluate("window.__shown")
            until("a model after that", lambda: browser.evaluate("window.__shown") > shown)
            check(browser.evaluate("tgViewer.orbit.camera.eye.join()") == eye, "the view moved")
            # A button, and what has the keyboard, outlive a newer model.
            browser.evaluate("document.getElementById('camera').firstElementChild.kept = true; 0")
            browser.click(*browser.middle("#toggle"))
            x, y = browser.middle("#show button:nth-child(5)")
            press = lambda kind: browser.page("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
            press("mousePressed")
            shown = browser.evaluate("window.__shown")
            until("a model below a press", lambda: browser.evaluate("window.__shown") > shown)
            press("mouseReleased")
            check(browser.evaluate("tgViewer.settings.show") == "depth", "the press was lost")
            check(browser.evaluate("document.activeElement.textContent") == "depth", "the keyboard's place was lost")
            check(browser.evaluate("document.getElementById('camera').firstElementChild.kept"), "the list was made anew")
            for width, height in ((1280, 800), (390, 780)):
                browser.page("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1,
                             mobile=width < 600)
                wide = browser.evaluate("document.documentElement.scrollWidth")
                check(wide <= width, f"{wide} px in a window of {width}")
                boxes = browser.evaluate("['stage', 'run'].map((id) => document.getElementById(id)"
                                         ".getBoundingClientRect()).map((r) => [r.width, r.height])")
                check(all(w > 300 and h > 200 for w, h in boxes), f"{boxes} at {width} x {height}")
            check(all(request.startswith(url.split("?")[0]) or request.startswith(("blob:", "data:"))
                      for request in browser.requests), f"other places: {set(browser.requests)}")
            check(not browser.log, browser.log)
            # A file that is dropped on the page does not take its place.
            taken = browser.evaluate("['dragover', 'drop'].map((name) => !document.body.dispatchEvent("
                                     "new DragEvent(name, {bubbles: true, cancelable: true})))")
            check(taken == [True, True], f"drops are the browser's: {taken}")
            # A picture of which nothing comes is given up, and asked for again; time passes quicker here.
            browser.evaluate("window.fetched = window.fetch; window.held = 0; window.later = window.setTimeout;"
                             "window.setTimeout = (call, time) => later(call, time === 30000 ? 1500 : time);"
                             "window.fetch = (address, options) => {"
                             "if (held || !String(address).includes('picture.png')) return fetched(address, options);"
                             "held = 1; return new Promise((_, fail) => options.signal?.addEventListener('abort', () =>"
                             "fail(options.signal.reason))); };"
                             "window.pictures = 0; document.getElementById('rendering').onload = () => ++pictures; 0")
            until("a picture that is silent", lambda: browser.evaluate("held"))
            line = lambda: browser.evaluate("document.getElementById('stage-line').textContent")
            before = line()
            until("words after it", lambda: line() != before)
            until("a picture after it", lambda: browser.evaluate("pictures"))
            browser.evaluate("window.fetch = fetched; window.setTimeout = later; 0")
            # Words come while a model that takes long is on its way, the last ones, too.
            browser.evaluate("window.fetched = window.fetch; window.asked = 0; window.fetch = async (address, options) => {"
                             "if (!String(address).includes('model.glb')) return fetched(address, options);"
                             "++asked; await new Promise((done) => setTimeout(done, 8000));"
                             "return fetched(address, options); }; 0")
            until("a model that takes long", lambda: browser.evaluate("asked"))
            time.sleep(6)  # longer than a page may be silent
            (pathlib.Path(folder) / "run/control").write_text("stop\n")
            until("the end", lambda: phase() == "interrupted", 30)
            check(run.wait(30) == 130, "tgtrain's exit code")
            # A run that is resumed goes on in the page as it is.
            browser.evaluate("window.fetch = fetched; tgViewer.orbit.orbit(0.2, 0); tgViewer.changed(); 0")
            kept = "[tgViewer.orbit.camera.eye.join(), tgViewer.settings.show, document.getElementById('panel').hidden]"
            before, shown = browser.evaluate(kept), browser.evaluate("window.__shown")
            check(before[1:] == ["depth", False], before)
            port = url.split("?")[0].rstrip("/").rsplit(":", 1)[1]
            run = subprocess.Popen([*command[:command.index("--serve")], "--serve", port, "--serve-token",
                                    "a-token-for-this-test", "--resume"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
            until("the run that goes on", lambda: phase() == "training", 60)
            until("a model of it", lambda: browser.evaluate("window.__shown") > shown)
            check(browser.evaluate(kept) == before, "the view or the panel was not kept")
            until("curves of before", lambda: browser.evaluate("document.querySelectorAll('#psnr circle').length > 1"))
            check(not browser.log, browser.log)
            # That nobody answers is said once, also while it lasts longer, and stays closed.
            run.kill()
            run.wait()
            message = "document.getElementById('message')"
            until("a word of silence", lambda: browser.evaluate(f"!{message}.hidden && {message}.textContent"
                                                                ".startsWith('No answer since')"), 30)
            browser.evaluate(f"window.changes = 0; new MutationObserver(() => ++changes).observe({message}, "
                             "{childList: true, subtree: true, characterData: true, attributes: true}); 0")
            browser.click(*browser.middle("#message button"))
            until("its end", lambda: browser.evaluate(f"{message}.hidden"), 5)
            time.sleep(3)
            check(browser.evaluate("changes") == 1, "the word came again")
            # Another data set at that address, whose name is the same, has a page of its own; so has another page.
            subprocess.run([tgtrain, "make-sample", f"{folder}/other/scene", "--size", "64", "--views", "8",
                            "--test-views", "2", "--points", "400", "--supersampling", "1"], check=True)
            browser.evaluate("location.hash = 'view=0,0,9,0,0,0,1,50,1,4'; window.old = true; 0")
            other = [tgtrain, f"{folder}/other/scene", "-o", f"{folder}/other/model.tgz", *command[4:]]
            run = subprocess.Popen([*other[:other.index("--serve")], "--serve", port, "--serve-token",
                                    "a-token-for-this-test"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            until("a page of its own", lambda: browser.evaluate("!window.old && window.__shown"))
            found = browser.evaluate("[location.hash, tgViewer.settings.show, document.getElementById('panel').hidden]")
            check(found == ["", "final", True], found)
            browser.evaluate("location.hash = 'show=depth'; window.old = true; window.fetched = window.fetch;"
                             "window.fetch = async (address, options) => {"
                             "if (!String(address).includes('state.json')) return fetched(address, options);"
                             "const state = await (await fetched(address, options)).json();"
                             "return new Response(JSON.stringify({...state, start: 1, page: 'another'})); }; 0")
            until("the page of another build", lambda: browser.evaluate("!window.old && window.__shown"))
            check(browser.evaluate("tgViewer.settings.show") == "depth", "its address was not kept")
            run.terminate()
            until("its end", lambda: phase() == "interrupted", 30)
        check(run.wait(30) == 143, "tgtrain's exit code")
    finally:
        run.kill()
        run.wait()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the page that tgconvert writes against tgview's pictures, in a headless Chromium without a GPU.

    tests/web/html_test.py BIN [MODEL [WIDTHxHEIGHT]]     BIN: folder of tgconvert and tgview; default docs/sample.tgz

Prints the PSNR of every picture and fails below the limits. Skips (exit code 77) where there is no Chromium.
"""
import base64
import gzip
import io
import json
import math
import pathlib
import re
import struct
import subprocess
import sys
import tarfile
import tempfile

import clouds
from chromium import Chromium, Difference, from_data_url

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
FINAL_DB = 38.0   # what the page promises of the picture
OUTPUT_DB = 45.0  # one output has fewer terms
FAR_DB = 25.0     # of depths from afar: 31 of 32-bit floats, where a pixel of an outline comes or goes, 12 of halves
START_DB = 50.0   # the same view, of Gaussians without textures
# Settings under tgview's names, for the model's first camera; then other cameras with none.
VARIANTS = [{}, {"show": "base"}, {"show": "texture"}, {"show": "alpha"}, {"show": "normal"}, {"textures": "off"},
            {"textures": "alpha"}, {"intersection": "plane"}, {"background": "0.2,0.4,0.6"}, {"outside": "clip"},
            {"outside": "edge"}]
# Models without cameras, which start with everything in view: what clouds.write() takes.
CLOUDS = {"a subject": {}, "a subject with far floaters": {"far_every": 30, "far": 40},
          "a subject before a background of large Gaussians": {"far_every": 7, "far": 12, "sigma": 0.3},
          "a head with a sparse body": {"far_every": 5, "far": 4}}
SHAPES = ["160x160", "160x90", "90x160"]
failures = []


def with_outside(model, copy, value):
    """The bundle with another "outside" in its manifest."""
    with tarfile.open(model) as archive, tarfile.open(copy, "w:gz") as out:
        for entry in archive:
            content = archive.extractfile(entry).read()
            if entry.name == "manifest.json":
                content = json.dumps({**json.loads(content), "outside": value}).encode()
            entry.size = len(content)
            out.addfile(entry, io.BytesIO(content))


THIN = [-5, -46, -100, -1000]  # ln sigma
PLY = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1",
       "rot_2", "rot_3"]
CAMERA = {"id": 0, "img_name": "a", "width": 320, "height": 120, "fx": 200, "fy": 200, "cx": 160, "cy": 60,
          "position": [0, 0, -9], "rotation": [[1, 0, 0], [0, 1, 0], [0, 0, 1]]}


def write_thin(folder):
    """PLYs of discs, of needles, of one Gaussian as wide as everything, and of walls that face the camera; and the
    camera that sees them."""
    turn = (math.cos(0.25), 0.6 * math.sin(0.25), 0.8 * math.sin(0.25), 0)
    row = lambda scale: [(3 * i - 4.5, 0, 0, 1, 0.2 * i, -1, 3, *scale(s), *turn) for i, s in enumerate(THIN)]
    scenes = {"discs": row(lambda s: (math.log(0.8), math.log(0.6), s)), "needles": row(lambda s: (s, -0.2, s)),
              "wide": [(0, 0, 0, 1, 0, -1, 0, 45, -1, -2, *turn)],
              # 6e5, 6e8, 6e11 and 1e19 px to the side: from small to beyond what the squares of a turned quad hold.
              "walls": [(0, 0, i, 1 - i, 0, i - 1, 0, s, s - 2, -5, 1, 0, 0, 0) for i, s in enumerate((9, 16, 23, 40))]}
    for name, splats in scenes.items():
        head = "".join(f"property float {p}\n" for p in PLY)
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(splats)}\n{head}end_header\n"
        body = b"".join(struct.pack("<14f", *splat) for splat in splats)
        (folder / f"{name}.ply").write_bytes(head.encode() + body)
    (folder / "cameras.json").write_text(json.dumps([CAMERA]))
    return list(scenes)


def with_zero_scales(glb):
    """The GLB with SCALE.z 0 in every splat."""
    content = bytearray(glb)
    length = struct.unpack_from("<I", content, 12)[0]
    gltf = json.loads(content[20:20 + length])
    index = gltf["meshes"][0]["primitives"][0]["attributes"]["KHR_gaussian_splatting:SCALE"]
    accessor = gltf["accessors"][index]
    view = gltf["bufferViews"][accessor["bufferView"]]
    first = 28 + length + view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    for i in range(accessor["count"]):
        struct.pack_into("<f", content, first + i * view.get("byteStride", 12) + 8, 0)
    return bytes(content)


def expect(what, ok, found=""):
    print(f"{'ok' if ok else 'FAILED'}: {what}{f': {found}' if str(found) else ''}", flush=True)
    if not ok:
        failures.append(what)


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    model = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else REPOSITORY / "docs/sample.tgz").resolve()
    size = sys.argv[3] if len(sys.argv) > 3 else "160x160"
    with Chromium() as browser, tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        run = lambda *arguments: subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.DEVNULL)
        run(programs / "tgconvert", model, folder / "model <1>.html", "--quiet")
        page = (folder / "model <1>.html").as_uri()

        def reference(settings, camera=None):
            out = folder / "reference.png"
            # tgview refuses what changes nothing in the output.
            idle = [] if settings["show"] in ("final", "base") else ["background"]
            flags = [x for key, value in settings.items() if key not in idle for x in (f"--{key}", value)]
            if camera is not None:
                flags += ["--camera", camera]
            run(programs / "tgview", model, "--render", out, "--size", size, "--backend", "cpu", *flags)
            return out.read_bytes()

        done = browser.open(f"{page}?camera=0&size={size}&panel=off")
        expect("the page opens", done.get("gaussians", 0) > 0, done)
        expect("its title is the file's name", browser.evaluate("document.title") == "model <1>")
        own = {"show": "final",
               "intersection": browser.evaluate("tgViewer.model.intersection ? 'maxResponse' : 'plane'"),
               "background": browser.evaluate("tgViewer.model.background.join(',')"),
               "textures": browser.evaluate("tgViewer.settings.textures"), "outside": "base"}
        cameras = browser.evaluate("tgViewer.model.cameras.length")
        jobs = [(0, variant) for variant in VARIANTS] + [(cameras // 2, {}), (cameras - 1, {})]
        for camera, variant in jobs:
            wanted = {**own, "camera": camera, "size": size, **variant}
            picture = from_data_url(browser.evaluate(f"tgViewer.picture({json.dumps(wanted)})"))
            difference = Difference(browser, picture, reference({**own, **variant}, camera))
            limit = FINAL_DB if variant.get("show", "final") == "final" else OUTPUT_DB
            name = " ".join(f"{k} {v}" for k, v in variant.items()) or "final"
            expect(f"camera {camera}, {name}, at least {limit:.0f} dB", difference.psnr >= limit, difference)

        beyond = [browser.evaluate(f"tgViewer.picture({json.dumps({**own, 'camera': 0, 'size': size, **variant})})")
                  for variant in ({}, {"outside": "clip"}, {"outside": "edge"})]
        expect("each treatment beyond textures has its picture", len(set(beyond)) == 3)

        # From far and from farther, through a lens as long: there halves of floats have steps as large as the model.
        far = browser.evaluate("""(async (size) => {
          const near = tgViewer.model.cameras[0], {center} = tgViewer.orbit.bounds, [, , ahead] = near.axes;
          const reach = ahead.reduce((sum, x, k) => sum + x * (center[k] - near.eye[k]), 0);
          const pictures = [];
          for (const times of [100, 1000]) {
            const eye = near.eye.map((x, k) => x - (times - 1) * reach * ahead[k]);
            const camera = {...near, eye, fx: times * near.fx, fy: times * near.fy};
            pictures.push(await tgViewer.picture({camera, size, show: 'depth'}));
          }
          await tgViewer.picture({camera: 0, show: 'final'});
          return [...pictures, tgViewer.renderer.gl.getSupportedExtensions().includes('EXT_float_blend')];
        })('%s')""" % size)
        if far[2]:
            same = Difference(browser, *map(from_data_url, far[:2]))
            expect(f"depths from farther are told apart as well, at least {FAR_DB:.0f} dB", same.psnr >= FAR_DB, same)
        else:
            print("not measured: depths from farther (no EXT_float_blend here)")

        # By hand: the same camera again, and away from it.
        turned = browser.evaluate("""(async () => {
          const before = await tgViewer.picture({camera: 0});
          tgViewer.orbit.orbit(0.3, 0.1);
          tgViewer.orbit.pan(5, -3, 100, 100);
          tgViewer.orbit.dolly(0.9);
          const away = await tgViewer.picture();
          return [away !== before, before === await tgViewer.picture({camera: 0})];
        })()""")
        expect("orbit, pan and zoom change the picture, and a camera brings it back", turned == [True, True], turned)

        # A GLB dropped on the page; a broken one leaves the model and says why.
        run(programs / "tgconvert", model, folder / "dropped.glb", "--quiet")
        dropped = list((folder / "dropped.glb").read_bytes())
        result = browser.evaluate("""(async (bytes, broken) => {
          const drop = async (content, name) => {
            const data = new DataTransfer();
            data.items.add(new File([content], name));
            document.body.dispatchEvent(new DragEvent('drop', {dataTransfer: data, bubbles: true}));
            await new Promise((resolve) => setTimeout(resolve, 300));
          };
          const first = tgViewer.openings;
          await drop(new Uint8Array(bytes.slice(0, 1000)), 'short.glb');
          const told = document.querySelector('#message span').textContent, kept = tgViewer.openings === first;
          await drop(new Uint8Array(bytes), 'dropped.glb');
          for (let i = 0; i < 100 && tgViewer.openings === first; ++i) await new Promise((r) => setTimeout(r, 100));
          const message = document.querySelector('#message span').textContent;
          return {told, kept, opened: tgViewer.openings === first + 1, message};
        })(%s)""" % json.dumps(dropped))
        expect("a dropped GLB that is cut off is refused with a word",
               f"short.glb: the GLB is cut off (1000 of {len(dropped)} bytes): copy" in result["told"],
               result["told"])
        expect("and leaves the old model", result["kept"])
        expect("a whole one is opened", result["opened"] and result["message"] == "", result["message"])
        picture = from_data_url(browser.evaluate(f"tgViewer.picture({json.dumps({**own, 'camera': 0, 'size': size})})"))
        expect("and shown", Difference(browser, picture, reference(own, 0)).psnr >= FINAL_DB)
        asked = [url for url in browser.requests if not url.startswith(("file:", "blob:", "data:"))]
        expect("nothing was asked of a network", not asked, asked[:3])
        expect("no word on the console", not browser.log, browser.log[:3])

        # The page's WebP atlases are the numbers of its PNG ones.
        run(programs / "tgconvert", model, folder / "webp.html", "--atlas", "webp", "--quiet")
        expect("WebP makes the page smaller",
               (folder / "webp.html").stat().st_size < (folder / "model <1>.html").stat().st_size)
        seen = []
        for name in ("model <1>.html", "webp.html"):
            browser.open(f"{(folder / name).as_uri()}?camera=0&size={size}&panel=off")
            seen.append(browser.evaluate("tgViewer.picture({show: 'final'})"))
        expect("and leaves its picture", seen[0] == seen[1])

        # Packed in steps, it shows what tgview shows of the same GLB.
        steps = ["--steps", "1", "--atlas", "webp", "--quiet"]
        run(programs / "tgconvert", model, folder / "steps.html", *steps)
        run(programs / "tgconvert", model, folder / "steps.glb", *steps)
        expect("steps make the page smaller by half",
               (folder / "steps.html").stat().st_size < 0.5 * (folder / "webp.html").stat().st_size)
        browser.open(f"{(folder / 'steps.html').as_uri()}?camera=0&size={size}&panel=off")
        run(programs / "tgview", folder / "steps.glb", "--render", folder / "steps.png", "--size", size, "--backend",
            "cpu", "--camera", 0)
        difference = Difference(browser, from_data_url(browser.evaluate("tgViewer.picture({show: 'final'})")),
                                (folder / "steps.png").read_bytes())
        expect(f"and the picture is that of the GLB, at least {FINAL_DB:.0f} dB", difference.psnr >= FINAL_DB,
               difference)

        for name, cloud in CLOUDS.items():
            clouds.write(folder / "cloud.ply", **cloud)
            run(programs / "tgconvert", folder / "cloud.ply", folder / "cloud.html", "--quiet", "--overwrite")
            browser.page("Page.navigate", url="about:blank")
            browser.open(f"{(folder / 'cloud.html').as_uri()}?panel=off")
            for shape in SHAPES if not cloud else SHAPES[:1]:
                run(programs / "tgview", folder / "cloud.ply", "--render", folder / "cloud.png", "--size", shape,
                    "--backend", "cpu")
                picture = from_data_url(browser.evaluate(f"tgViewer.picture({json.dumps({'size': shape})})"))
                difference = Difference(browser, picture, (folder / "cloud.png").read_bytes())
                expect(f"{name} starts at {shape} as in tgview, at least {START_DB:.0f} dB",
                       difference.psnr >= START_DB, difference)

        # Sigmas beyond what squares of floats hold, and such as no model has.
        for name in write_thin(folder):
            for end in ("glb", "html"):
                run(programs / "tgconvert", folder / f"{name}.ply", folder / f"{name}.{end}", "--views",
                    folder / "cameras.json", "--quiet")
            if name == "discs":
                zero = with_zero_scales((folder / "discs.glb").read_bytes())
                (folder / "zero.glb").write_bytes(zero)
                packed = base64.b64encode(gzip.compress(zero)).decode()
                (folder / "zero.html").write_text(re.sub('(class="model">)[^<]*', lambda found: found[1] + packed,
                                                         (folder / "discs.html").read_text(), count=1))
        for file in ("discs.ply", "needles.ply", "wide.ply", "walls.ply", "zero.glb"):
            browser.open(f"{(folder / file).with_suffix('.html').as_uri()}?size=320x120&panel=off")
            for intersection in ("plane", "maxResponse"):
                run(programs / "tgview", folder / file, "--render", folder / "thin.png", "--backend", "cpu", "--camera",
                    folder / "cameras.json", "--intersection", intersection)
                picture = browser.evaluate(f"tgViewer.picture({{intersection: '{intersection}'}})")
                difference = Difference(browser, from_data_url(picture), (folder / "thin.png").read_bytes())
                expect(f"{file}, {intersection}, at least {FINAL_DB:.0f} dB", difference.psnr >= FINAL_DB, difference)

        # A model that says itself what lies beyond its textures.
        if model.suffix == ".tgz":
            with_outside(model, folder / "clip.tgz", "clip")
            run(programs / "tgconvert", folder / "clip.tgz", folder / "clip.html", "--quiet")
            browser.open(f"{(folder / 'clip.html').as_uri()}?camera=0&size={size}&panel=off")
            own_outside = browser.evaluate("tgViewer.settings.outside")
            same = browser.evaluate("tgViewer.picture()") == browser.evaluate("tgViewer.picture({outside: 'clip'})")
            expect("a page takes what its model says of it", own_outside == "clip" and same, own_outside)

        # The ways to have nothing to show.
        text = (folder / "model <1>.html").read_text()
        (folder / "broken.html").write_text(text.replace('class="model">H4sI', 'class="model">H4sJ', 1))
        done = browser.open((folder / "broken.html").as_uri())
        shown = browser.evaluate("!document.getElementById('message').hidden")
        expect("a damaged page says so", "damaged" in done.get("error", "") and shown, done)
        done = browser.open(f"{page}?camera=100000&show=nothing&size={size}&background=red")
        told = browser.evaluate("document.getElementById('message').innerText")
        limit = browser.evaluate("(() => { try { tgViewer.setSize('9000x10'); } catch (e) { return e.message; } })()")
        expect("a size beyond the limit names it", limit.startswith("size=9000x10") and "8192" in limit, limit)
        named = all(word in told for word in ("camera=100000", "show=nothing", "background=red"))
        expect("a bad address is named, and the rest of it done", named and done.get("gaussians", 0) > 0 and
               browser.evaluate("tgViewer.canvas.width") == int(size.split("x")[0]), f"{done} {told}")
    with Chromium(["--disable-3d-apis"]) as browser:
        with tempfile.TemporaryDirectory() as folder:
            run(programs / "tgconvert", model, pathlib.Path(folder) / "a.html", "--quiet")
            done = browser.open((pathlib.Path(folder) / "a.html").as_uri())
            expect("without WebGL 2 the page says so", "WebGL 2" in done.get("error", ""), done)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

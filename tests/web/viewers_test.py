#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Shows our GLB in three.js, PlayCanvas and Babylon.js, and asks Khronos' validator about it.

    tests/web/viewers_test.py BIN [MODEL [CAMERA]]       default: the last camera of docs/sample.tgz

BIN is the folder of tgconvert, tgview and tg_show_as. The viewers' packages (tests/web/viewers/package.json) are looked for in
$TG_WEB_PACKAGES, then in web_packages beside BIN; scripts/test_browsers.sh installs them. Skips (exit code 77) without
them or without Chromium.

Each viewer must show the textured file as the same file without the texture extension, to the last bit; its picture
is then held against our CPU render of that base, on black and, in three.js, with a linear output, and against what the
emulated viewer draws. Fails below BASE_DB and EMULATED_DB. A file that is made for the viewer must come nearer to our
CPU render with textures, and one that is made to look like our base lie at AIMED_DB from it.
"""
import json
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

from chromium import Chromium, Difference
from viewer_pages import HERE, VIEWERS, Pages, View, needed_packages

REPOSITORY = HERE.parents[1]
BASE_DB = {"three": 34.0, "playcanvas": 35.0, "babylon": 35.0}  # three.js cuts splats at 2 sigma
EMULATED_DB = {"three": 48.0, "playcanvas": 36.0, "babylon": 40.0}  # PlayCanvas sorts so few splats very coarsely
SIZE, FOV = (640, 480), 50.0
AIMED_DB = 35.0
KHR, TG = "KHR_gaussian_splatting", "TG_gaussian_splatting_texture"
failures = []


def expect(what, ok, found=""):
    print(f"{'ok' if ok else 'FAILED'}: {what}{f': {found}' if str(found) else ''}", flush=True)
    if not ok:
        failures.append(what)


def without_textures(data):
    """The GLB less everything of our extension; the buffer stays as it is."""
    size, = struct.unpack("<I", data[12:16])
    gltf = json.loads(data[20:20 + size])
    primitive = gltf["meshes"][0]["primitives"][0]
    del primitive["extensions"][KHR]["extensions"]
    primitive["attributes"] = {k: v for k, v in primitive["attributes"].items() if not k.startswith(TG)}
    gltf["extensionsUsed"].remove(TG)
    for key in ("images", "textures", "samplers"):
        del gltf[key]
    text = json.dumps(gltf).encode()
    text += b" " * (-len(text) % 4)
    rest = data[20 + size:]
    return struct.pack("<IIIII", 0x46546C67, 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def view_of(data, index):
    """A camera node of a GLB. glTF's cameras look along -z."""
    size, = struct.unpack("<I", data[12:16])
    node = [n for n in json.loads(data[20:20 + size])["nodes"] if "camera" in n][index]
    x, y, z, w = node["rotation"]
    return View(node["translation"], [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
                [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
                [-2 * (x * z + w * y), -2 * (y * z - w * x), -1 + 2 * (x * x + y * y)], FOV, SIZE)


def validate(modules, files):
    run = subprocess.run(["node", str(HERE / "viewers/validate.js"), *map(str, files)], capture_output=True, text=True,
                         check=True, env={**os.environ, "NODE_PATH": str(modules)})
    return [json.loads(line) for line in run.stdout.splitlines()]


def check_validator(modules, folder, glb):
    for report in validate(modules, [glb]):
        expect("Khronos' validator has nothing to say about the GLB", not report["left"],
               report["left"] or report["dropped"])
    subprocess.run([sys.executable, str(REPOSITORY / "scripts/make_conformance.py"), str(folder / "conformance")],
                   check=True, stdout=subprocess.DEVNULL)
    index = json.loads((folder / "conformance/index.json").read_text())
    # A file that only our readers find odd, or may refuse, is valid glTF too; the others are broken on purpose.
    valid = [folder / "conformance" / f"{entry['name']}.glb" for entry in index if entry["verdict"] == "valid"]
    reports = validate(modules, valid)
    bad = {pathlib.Path(report["file"]).name: report["left"] for report in reports if report["left"]}
    expect(f"nor about the {len(reports)} conformance files that keep all rules", reports and not bad, bad or "")


def main():
    programs = pathlib.Path(sys.argv[1]).resolve()
    model = pathlib.Path(sys.argv[2] if len(sys.argv) > 2 else REPOSITORY / "docs/sample.tgz").resolve()
    modules = needed_packages(programs)
    with Chromium() as browser, tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        run = lambda *arguments: subprocess.run([str(a) for a in arguments], check=True, stdout=subprocess.DEVNULL)
        run(programs / "tgconvert", model, folder / "textured.glb", "--quiet")
        (folder / "base.glb").write_bytes(without_textures((folder / "textured.glb").read_bytes()))
        index = int(sys.argv[3]) if len(sys.argv) > 3 else -1
        view = view_of((folder / "textured.glb").read_bytes(), index)
        (folder / "camera.json").write_text(view.as_camera())

        def rendered(name):
            run(programs / "tgview", folder / f"{name}.glb", "--render", folder / "ours.png", "--backend", "cpu",
                "--camera", folder / "camera.json", "--background", "black")
            return (folder / "ours.png").read_bytes()

        ours, with_textures = rendered("base"), rendered("textured")
        check_validator(modules, folder, folder / "textured.glb")
        pages = Pages(browser, modules, folder)
        done = pages.show("three", "textured.glb", view, plain=1)
        attributes = [a for object_ in done["found"] if object_["type"] == "Points" for a in object_["attributes"]]
        expect("a plain GLTFLoader shows points and hands our attributes on",
               any(a.startswith(TG.lower()) for a in attributes), attributes)
        for viewer in VIEWERS:
            pictures = []
            for file in ("base.glb", "textured.glb"):
                pictures.append(pages.picture(viewer, file, view))
                if "TG_WEB_PICTURES" in os.environ:
                    pathlib.Path(os.environ["TG_WEB_PICTURES"], f"{viewer}_{file}.png").write_bytes(pictures[-1])
            same = Difference(browser, *pictures)
            expect(f"{viewer} shows the textured file exactly as the base", same.count == 0, same)
            against = Difference(browser, pictures[0], ours)
            expect(f"{viewer}'s base against our CPU render, at least {BASE_DB[viewer]:.0f} dB",
                   against.psnr >= BASE_DB[viewer], against)
            run(programs / "tg_show_as", folder / "base.glb", viewer, folder / "camera.json", folder / "emulated.png")
            emulated = Difference(browser, pictures[0], (folder / "emulated.png").read_bytes())
            expect(f"{viewer} emulated, at least {EMULATED_DB[viewer]:.0f} dB", emulated.psnr >= EMULATED_DB[viewer],
                   emulated)
            run(programs / "tgconvert", model, folder / "made.glb", "--for", viewer, "--quiet", "--overwrite")
            made = Difference(browser, pages.picture(viewer, "made.glb", view), with_textures)
            untouched = Difference(browser, pictures[0], with_textures)
            expect(f"{viewer} shows a file that is made for it nearer to our render of the textures",
                   made.psnr > untouched.psnr, f"{untouched} without, {made} with --for")
            run(programs / "tgconvert", model, folder / "made.glb", "--for", viewer, "--for-aim", "base", "--quiet",
                "--overwrite")
            made = Difference(browser, pages.picture(viewer, "made.glb", view), ours)
            expect(f"{viewer} shows one that is made for it to look like our base so, at least {AIMED_DB:.0f} dB",
                   made.psnr >= AIMED_DB, made)
        if "TG_WEB_PICTURES" in os.environ:
            pathlib.Path(os.environ["TG_WEB_PICTURES"], "ours.png").write_bytes(ours)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())

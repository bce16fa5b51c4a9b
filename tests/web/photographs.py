#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds what other people's viewers show of a model against photographs: the table of docs/lab/browsers.md.

    tests/web/photographs.py BIN MODEL DATASET [--viewer NAME]... [--views N] [--for-aim AIM] [--made FOLDER]
                             [--keep FOLDER]

BIN is the folder of tgtrain, tgconvert and tgview; the viewers' packages are looked for as in viewers_test.py. N test
views of DATASET, evenly spread (default 4), at the photographs' own size and over the model's background, in
three.js, PlayCanvas and Babylon.js: of the GLB as it is, and of one that `tgconvert --for` makes for the viewer. Prints
means over the views of PSNR [dB] against the photographs and against our CPU render of the base, how much less than
that render comes near to the photographs, and bytes and processor seconds of the conversion. FOLDER of --made has, or
gets, the files MODEL_VIEWER.glb; that of --keep gets the pictures.

Photographs are those that training sees (`tgtrain undistort`), transparent ones over the model's background. Exit code 1
where a bar of docs/lab/browsers.md is missed, 77 without Chromium or the packages.
"""
import argparse
import base64
import json
import math
import os
import pathlib
import struct
import subprocess
import sys
import tempfile

from chromium import Chromium, Difference, from_data_url
from viewer_pages import VIEWERS, Pages, View, css_color, needed_packages

FLATTEN = """(async (url, color) => {
  const image = new Image();
  image.src = url;
  await image.decode();
  const canvas = document.createElement('canvas');
  [canvas.width, canvas.height] = [image.width, image.height];
  const context = canvas.getContext('2d');
  context.fillStyle = color;
  context.fillRect(0, 0, image.width, image.height);
  context.drawImage(image, 0, 0);
  return canvas.toDataURL();
})"""
LESS_DB = 0.4  # than our base, against photographs
BASE_DB = 35.0


def run(*command):
    """Processor seconds."""
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        raise SystemExit(f"failed: {' '.join(map(str, command))}")
    return usage.ru_utime + usage.ru_stime


def test_views(folder, count):
    """(View, photograph's path) of a data set in nerfstudio's layout."""
    data = json.loads((folder / "transforms.json").read_text())
    frames = {frame["file_path"]: frame for frame in data["frames"]}
    names = data["test_filenames"]
    count = min(count, len(names))
    views = []
    for name in [names[k * len(names) // count] for k in range(count)]:
        frame = frames[name]
        if abs(frame["cx"] / frame["w"] - 0.5) > 1e-3 or abs(frame["cy"] / frame["h"] - 0.5) > 1e-3 or \
                abs(frame["fl_x"] / frame["fl_y"] - 1) > 1e-3:
            raise SystemExit(f"{name}: not in the middle of its axis, which the pages' cameras cannot be told")
        rows = frame["transform_matrix"]  # from camera to world; x right, y up, looks along -z
        axis = lambda k, sign=1: [-sign * rows[0][k], -sign * rows[1][k], sign * rows[2][k]]  # in the file's axes
        fov = math.degrees(2 * math.atan(0.5 * frame["h"] / frame["fl_y"]))
        views.append((View(axis(3), axis(0), axis(1), axis(2, -1), fov, (frame["w"], frame["h"])), folder / name))
    return views


def background_of(glb):
    """As the converter keeps it."""
    data = glb.read_bytes()
    size, = struct.unpack("<I", data[12:16])
    extras = json.loads(data[20:20 + size])["asset"].get("extras", {}).get("textured_gaussians", {})
    return extras.get("background", [0, 0, 0])


def flattened(browser, path, background):
    """A photograph over the background, PNG bytes."""
    url = "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()
    return from_data_url(browser.evaluate(f"{FLATTEN}({json.dumps(url)}, {json.dumps(css_color(background))})"))


def mean(values):
    values = list(values)
    return sum(values) / len(values)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("model", type=pathlib.Path)
    parser.add_argument("dataset", type=pathlib.Path)
    parser.add_argument("--viewer", action="append", choices=VIEWERS, help="default: each")
    parser.add_argument("--views", type=int, default=4)
    parser.add_argument("--for-aim", default="textures", choices=["textures", "base"])
    parser.add_argument("--made", type=pathlib.Path)
    parser.add_argument("--keep", type=pathlib.Path)
    options = parser.parse_args()
    programs = options.bin.resolve()
    modules = needed_packages(programs)

    with Chromium() as browser, tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        run(programs / "tgtrain", "undistort", options.dataset, folder / "straight", "--quiet")
        run(programs / "tgconvert", options.model, folder / "textured.glb", "--quiet", "--no-psnr")
        run(programs / "tgconvert", folder / "textured.glb", folder / "base.glb", "--base-only", "--quiet", "--no-psnr")
        background = background_of(folder / "textured.glb")
        views = test_views(folder / "straight", options.views)
        pages = Pages(browser, modules, folder, background)

        def keep(name, k, picture):
            if options.keep:
                (options.keep / f"{name}_{k}.png").write_bytes(picture)
            return picture

        def rendered(name):
            """Ours, of every view."""
            pictures = []
            for k, (view, _) in enumerate(views):
                (folder / "camera.json").write_text(view.as_camera())
                run(programs / "tgview", folder / f"{name}.glb", "--render", folder / "ours.png", "--backend", "cpu",
                    "--camera", folder / "camera.json", "--background", ",".join(map(str, background)))
                pictures.append(keep(name, k, (folder / "ours.png").read_bytes()))
            return pictures

        photographs = [keep("photograph", k, flattened(browser, path, background))
                       for k, (_, path) in enumerate(views)]
        near = lambda pictures, others: mean(Difference(browser, a, b).psnr for a, b in zip(pictures, others))
        base = rendered("base")
        ours = near(base, photographs)
        print(f"{options.model.name}, {len(views)} test views; ours against the photographs: {ours:.2f} dB, with textures "
              f"{near(rendered('textured'), photographs):.2f} dB", flush=True)
        print(f"{'':12}{'as it is: photographs, base':>30}{'--for: photographs, base':>28}{'less':>7}{'bytes':>11}"
              f"{'cpu s':>7}", flush=True)
        missed = False
        for viewer in options.viewer or VIEWERS:
            made = (options.made or folder) / f"{options.model.stem}_{viewer}.glb"
            seconds = math.nan
            if not made.exists():
                seconds = run(programs / "tgconvert", options.model, made, "--for", viewer, "--for-aim",
                              options.for_aim, "--quiet", "--no-psnr")
            (folder / "made.glb").write_bytes(made.read_bytes())
            figures = []
            for file in ("textured", "made"):
                pictures = [keep(f"{viewer}_{file}", k, pages.picture(viewer, f"{file}.glb", view))
                            for k, (view, _) in enumerate(views)]
                figures += [near(pictures, photographs), near(pictures, base)]
            print(f"{viewer:12}{figures[0]:19.2f}, {figures[1]:9.2f}{figures[2]:17.2f}, {figures[3]:9.2f}"
                  f"{ours - figures[2]:7.2f}{made.stat().st_size:11}{seconds:7.0f}", flush=True)
            missed |= ours - figures[2] > LESS_DB or figures[3] < BASE_DB
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Who may include whom: a folder includes itself, rooms that stand before its room, and of its own room what is listed.

    tests/arrows_test.py [FOLDER]     names every include of the tree that breaks this; --draw prints the arrows there are
"""
import collections
import pathlib
import re
import sys

ROOMS = ["shaders", "web", "core", "render", "converter", "training", "viewer", "library"]
STRANGERS = {("viewer", "training"), ("library", "viewer")}
PROGRAMS = "training"  # the one folder of its room that knows the converter's formats
LEFT = {
    "shaders": ["shaders/shared"],
    "web": [],
    "core/file": ["core/system"],
    "core/run": ["core/system", "core/file"],
    "core/image": ["core/system", "core/file"],
    "core/model": ["core/system", "core/file", "core/image"],
    "core/merge": ["core/system", "core/file", "core/image", "core/model"],
    "core/bundle": ["core/system", "core/file", "core/image", "core/model"],
    "render/reference": ["render"],
    "render/affine": ["render"],
    "render/cpu": ["render"],
    "render/gpu": ["render"],
    "render/vulkan": ["render", "render/gpu"],
    "render/gl": ["render", "render/gpu"],
    "render/devices": ["render", "render/gpu", "render/vulkan", "render/gl"],
    "training/photos": ["training/data"],
    "training/step": ["training/settings", "training/data"],
    "training/cpu": ["training/settings", "training/data", "training/step"],
    "training/cuda": ["training/settings", "training/data", "training/step"],
    "training/mpi": ["training/settings", "training/data", "training/step", "training/cpu"],
    "training/score": ["training/settings", "training/data", "training/step"],
    "training/run": ["training/settings", "training/data", "training/step", "training/score"],
    "training/figures": ["training/settings", "training/data", "training/step", "training/score"],
    "training/farm": ["training/photos", "training/figures"],
    "training": ["training/settings", "training/data", "training/step", "training/cpu", "training/cuda", "training/mpi",
                 "training/score", "training/figures", "training/run", "training/photos", "training/farm"],
    "converter/gltf": ["converter/formats"],
    "converter/sog": ["converter/formats", "converter/gltf"],
    "converter/lod": ["converter/formats", "converter/gltf", "converter/sog"],
    "converter/html": ["converter/formats", "converter/gltf"],
    "converter/serve": ["converter/formats", "converter/gltf", "converter/html"],
    "converter/registry": ["converter/formats", "converter/gltf", "converter/sog", "converter/lod", "converter/html"],
    "converter/edit": ["converter/formats", "converter/gltf", "converter/sog", "converter/lod", "converter/html",
                       "converter/registry"],
    "converter": ["converter/formats", "converter/gltf", "converter/sog", "converter/lod", "converter/html",
                  "converter/registry", "converter/edit", "converter/serve"],
    "viewer/script": ["viewer/view"],
    "viewer/model": ["viewer/view"],
    "viewer/picture": ["viewer/view"],
    "viewer/panels": ["viewer/view"],
    "viewer/headless": ["viewer/view", "viewer/model", "viewer/picture"],
    "viewer/window": ["viewer/view", "viewer/script", "viewer/model", "viewer/picture", "viewer/panels"],
    "viewer": ["viewer/view", "viewer/script", "viewer/model", "viewer/picture", "viewer/panels", "viewer/headless",
               "viewer/window"],
}
BESIDE = {"tests", "support", "bench", "fuzz"}  # no product includes what only tests, benchmarks and fuzz targets do
SOURCE = {".h", ".cpp", ".cu", ".comp", ".glsl"}


def includes(root):
    """(folder, file:line, included folder) of every include of one of the rooms' files by another folder of theirs."""
    files = [f for room in ROOMS for f in (root / room).rglob("*") if f.suffix in SOURCE]
    known = {str(f.relative_to(root)) for f in files}
    for file in sorted(files):
        folder = str(file.parent.relative_to(root))
        for number, line in enumerate(file.read_text().splitlines(), 1):
            found = re.match(r'\s*#\s*include\s+"([^"]+)"', line)
            if not found:
                continue
            name = found[1] if found[1] in known else "shaders/" + found[1]
            if found[1].split("/")[0] in BESIDE:
                yield folder, f"{file.relative_to(root)}:{number}", found[1].split("/")[0]
            if name in known and str(pathlib.PurePath(name).parent) != folder:
                yield folder, f"{file.relative_to(root)}:{number}", str(pathlib.PurePath(name).parent)


def allowed(folder, other):
    room, other_room = folder.split("/")[0], other.split("/")[0]
    if other_room in BESIDE:
        return False
    if room == other_room:
        return other in LEFT.get(folder, [])
    if (room, other_room) == ("training", "converter"):
        return folder == PROGRAMS
    return ROOMS.index(other_room) < ROOMS.index(room) and (room, other_room) not in STRANGERS


def main():
    arguments = [a for a in sys.argv[1:] if a != "--draw"]
    root = pathlib.Path(arguments[0] if arguments else __file__ + "/../..").resolve()
    arrows = list(includes(root))
    if not arrows:
        sys.exit(f"{root}: no includes found (expected the project's folder)")
    if "--draw" in sys.argv:
        drawn = collections.Counter((folder, other) for folder, _, other in arrows)
        for (folder, other), count in sorted(drawn.items()):
            print(f"{folder} -> {other}: {count}")
    wrong = [f"{place}: {folder} may not include {other} (tests/arrows_test.py says what it may)"
             for folder, place, other in arrows if not allowed(folder, other)]
    print("\n".join(wrong) or f"{len(arrows)} includes between folders, all in the right direction")
    sys.exit(bool(wrong))


main()

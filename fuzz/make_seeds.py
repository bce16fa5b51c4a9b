#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What a corpus begins from, where there is none yet: make_seeds.py BIN FOLDER

BIN holds tgtrain and tgconvert. FOLDER gets a folder a target (read_ply, ...) of small files, all made by these
programs, by scripts/make_conformance.py or here, with the bytes in front by which a target chooses its reader.
Photographs come from ffmpeg and heif-enc where these are."""
import gzip
import json
import pathlib
import shutil
import struct
import subprocess
import sys
import tarfile
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
WRITTEN = ("ply", "compressed.ply", "spz", "sog", "splat", "glb", "html")
BLOCKS = ("gaussians.ply", "rects.npy", "atlas_id.npy", "atlas_000.exr", "cameras.json", "preview.png")
SCRIPTS = ("wait 2\norbit 10 0\ndolly 0.5\nfly on\nup -y\nturntable on\nbookmark\ngo-bookmark 0\ncamera 1\n",
           "add-key\norbit 30 5\nadd-key\nkey-seconds 0 2\nplay on\nseek 0.5\npath-lines on\nshow-key 1\ndelete-key 0\n",
           "select all\nselect opacity<0.1\nselect-rectangle 0 0 1 0.5\nselect-sphere 0,0,0,2\nselect-mode add\n"
           "move-selection 1,0,0\nturn-selection 0,90,0\nscale-selection 2\ndelete-selection\nundo\nredo\n",
           "output depth\ntextures off\nbackground white\nfov 60\ncrop -1,-1,-1,1,1,1\ncrop fit\nresolution 0.5\n"
           "compare wipe\ncompare-with 1\ndivider 0.3\ndifference signed 4\ntab edit\nkey Ctrl+Z\nsize 80x60\n",
           "inspect 3 4\npick 0\nisolate on\nclear-inspection\npanel off\nhelp on\ndocument 1\nclose-document 0\nkey F1\n")


def call(*command):
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def ksplat(level):
    """Two splats of SH degree 1 in a section of one bucket, after docs/formats.md."""
    layout = {0: "<3f3f4f4B9f", 1: "<3H3e4e4B9e", 2: "<3H3e4e4B9B"}[level]
    place = (0.5, -0.25, 1.0) if level == 0 else (40000, 20000, 32767)
    band = (0,) * 9 if level == 2 else (0.25,) * 9
    splat = struct.pack(layout, *place, 0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 0.0, 200, 100, 50, 255, *band)
    header = struct.pack("<2B2x4IH14x2f", 0, 1, 1, 1, 2, 2, level, -1.5, 1.5)
    section = struct.pack("<4IfH2xI4x2IH", 2, 2, 256, 1, 5.0, 12, 32767, 0, 1, 1)
    bucket = b"" if level == 0 else struct.pack("<I3f", 2, 0.0, 0.0, 0.0)
    return header.ljust(4096, b"\0") + section.ljust(1024, b"\0") + bucket + 2 * splat


def safetensors(*tensors):
    """tensors: (name, type, shape, bytes)"""
    header, data = {"__metadata__": {"format": "pt"}}, b""
    for name, kind, shape, content in tensors:
        header[name] = {"dtype": kind, "shape": shape, "data_offsets": [len(data), len(data) + len(content)]}
        data += content
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + data


def exif(order):
    """Orientation 6, a camera's name, a focal length and a place, in either order of bytes."""
    def entry(tag, kind, count, value):
        return struct.pack(order + "HHI", tag, kind, count) + (value if isinstance(value, bytes) else
                                                              struct.pack(order + "I", value)).ljust(4, b"\0")
    short = lambda number: struct.pack(order + "H", number)
    rational = lambda *numbers: b"".join(struct.pack(order + "II", int(number * 100), 100) for number in numbers)
    lists = [[entry(0x10F, 2, 3, b"TG\0"), entry(0x110, 2, 4, b"One\0"), entry(0x112, 3, 1, short(6))],
             [entry(0xA405, 3, 1, short(28))],
             [entry(1, 2, 2, b"S\0"), entry(3, 2, 2, b"W\0")]]
    sizes = [2 + 12 * (5, 2, 4)[k] + 4 for k in range(3)]
    at = [8, 8 + sizes[0], 8 + sizes[0] + sizes[1]]
    data_at = at[2] + sizes[2]
    lists[0] += [entry(0x8769, 4, 1, at[1]), entry(0x8825, 4, 1, at[2])]
    lists[1].insert(0, entry(0x920A, 5, 1, data_at))
    lists[2][1:1] = [entry(2, 5, 3, data_at + 8)]
    lists[2] += [entry(4, 5, 3, data_at + 32)]
    body = b"".join(short(len(entries)) + b"".join(entries) + bytes(4) for entries in lists)
    head = (b"II" if order == "<" else b"MM") + struct.pack(order + "HI", 42, 8)
    return b"Exif\0\0" + head + body + rational(4.2) + rational(48, 7, 30.5) + rational(11, 34, 0)


def with_exif(jpeg, order):
    block = exif(order)
    return jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(block) + 2) + block + jpeg[2:]


def levels(scene):
    """The same scene as two leaves of two levels in three files."""
    leaf = lambda low, high, offset: {"bound": {"min": [low, -4, -5], "max": [high, 5, 5]}, "lods": {
        "0": {"file": 0, "offset": offset, "count": 6}, "1": {"file": 1 + offset // 6, "offset": 0, "count": 2}}}
    scene["tree"] = {"bound": scene["tree"]["bound"], "children": [leaf(-4, 0, 0), leaf(0, 4, 6)]}
    return scene | {"lodLevels": 2, "count": 12, "counts": [12, 4],
                    "filenames": ["0/0_0/meta.json", "1/0_0/meta.json", "1/0_1/meta.json"]}


class Seeds:
    def __init__(self, programs, out):
        self.programs, self.out = programs, out

    def add(self, target, name, content):
        folder = self.out / f"read_{target}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)

    def models(self, work):
        tgtrain, tgconvert = self.programs / "tgtrain", self.programs / "tgconvert"
        call(tgtrain, "make-sample", work / "scene", "--views", 3, "--test-views", 1, "--size", 16)
        call(tgtrain, work / "scene", "--run", work / "run", "--iterations", 3, "--texture-iterations", 2, "--gaussians",
             12, "--texture-size", 2, "--device", "cpu", "--threads", 1, "--quiet")
        made = {}
        for kind in WRITTEN:
            call(tgconvert, "--quiet", work / "run/model.tgz", work / f"model.{kind}")
            made[kind] = (work / f"model.{kind}").read_bytes()
        for name, options in {"steps": ["--steps", 2, "--atlas", "webp"], "meshopt": ["--quantize", "--meshopt"],
                              "exr": ["--atlas", "exr"], "lean": ["--lean"]}.items():
            call(tgconvert, "--quiet", work / "run/model.tgz", work / f"{name}.glb", *options)
            made[name] = (work / f"{name}.glb").read_bytes()
        call(tgconvert, "--quiet", work / "run/model.tgz", work / "three.spz", "--spz-version", 3)
        made["three"] = (work / "three.spz").read_bytes()
        call(tgconvert, "--quiet", ROOT / "docs/sample.tgz", work / "city/lod-meta.json")
        call(tgconvert, "--quiet", work / "run/model.tgz", work / "small/lod-meta.json")
        return made

    def write(self):
        with tempfile.TemporaryDirectory() as name:
            work = pathlib.Path(name)
            made = self.models(work)
            self.add("ply", "model", made["ply"])
            self.add("ply", "points", (work / "scene/points3d.ply").read_bytes()[:4096])
            for k, kind in enumerate(("spz", "compressed.ply", "sog", "ksplat", "splat", "ply")):
                for number, content in enumerate({"ksplat": [ksplat(level) for level in range(3)],
                                                  "ply": [made["ply"][:-4] + b"\xff\xff\xff\x7f"],
                                                  "spz": [made["spz"], made["three"]]}.get(kind) or [made[kind]]):
                    self.add("splats", f"{kind}{number}", bytes([k]) + content)
            glbs = {kind: made[kind] for kind in ("glb", "steps", "meshopt", "exr", "lean")}
            call(sys.executable, ROOT / "scripts/make_conformance.py", work / "conformance")
            glbs |= {file.stem: file.read_bytes() for file in (work / "conformance").glob("*.glb")}
            for name, content in glbs.items():
                self.add("gltf", name, content)
            call(self.programs / "tgconvert", "--quiet", ROOT / "docs/sample.tgz", work / "tiles/tileset.json")
            self.add("gltf", "tileset", (work / "tiles/tileset.json").read_bytes())
            self.add("html", "page", made["html"])
            for kind in ("glb", "meshopt", "exr"):
                self.add("html", kind, b"G" + made[kind])
            for folder in ("city", "small"):
                self.add("lod", folder, (work / folder / "lod-meta.json").read_bytes())
            self.add("lod", "levels", json.dumps(levels(json.loads((work / "small/lod-meta.json").read_text()))).encode())
            self.bundles(work)
            self.add("checkpoint", "run", (work / "run/checkpoint").read_bytes())
            self.datasets(work)
            self.viewer_files(work)
            self.pictures(work, made)
            floats = struct.pack("<6f", *range(6))
            self.add("safetensors", "two", safetensors(("a", "F32", [2, 3], floats), ("b", "F16", [2], bytes(4))))
            self.add("safetensors", "one", safetensors(("x", "I64", [], bytes(8)), ("y", "BF16", [0, 4], b"")))

    def bundles(self, work):
        tar = gzip.decompress((work / "run/model.tgz").read_bytes())
        self.add("bundle", "tar", tar)
        with tarfile.open(work / "run/model.tgz") as bundle:
            held = {entry.name: bundle.extractfile(entry).read() for entry in bundle}
        blocks = b"".join(struct.pack("<H", len(held.get(name, b""))) + held.get(name, b"") for name in BLOCKS)
        self.add("bundle", "blocks", b"B" + blocks)

    def datasets(self, work):
        text = [b"1 OPENCV 64 48 60 60 32 24 0.1 0.01 0.001 0.001\n2 PINHOLE 64 48 60 60 32 24\n",
                b"# images\n1 1 0 0 0 0 0 0 1 a.png\n3 4 1\n2 0.7 0.7 0 0 1 2 3 2 b.png\n\n",
                b"1 0 0 1 255 0 0 0.5 1 0 2 1\n2 1 2 3 0 9 9 0\n"]
        binary = [struct.pack("<QIiQQ8d", 1, 1, 4, 64, 48, 60, 60, 32, 24, 0.1, 0.01, 0.001, 0.001),
                  struct.pack("<QI7dI", 1, 1, 1, 0, 0, 0, 0, 0, 1, 1) + b"a.png\0" + struct.pack("<Qddq", 1, 3, 4, -1),
                  struct.pack("<QQ3d3BdQII", 1, 1, 0, 0, 1, 255, 0, 0, 0.5, 1, 1, 0)]
        for k, content in enumerate(text + binary):
            self.add("dataset", f"colmap{k}", bytes([k]) + content)
        for k, model in enumerate(("SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL", "OPENCV_FISHEYE", "FULL_OPENCV", "FOV")):
            self.add("dataset", f"camera{k}", b"\0" + f"1 {model} 64 48 60 60 32 24 0.1 0.01 0 0 0 0\n".encode())
        self.add("dataset", "blender", b"\6" + (work / "scene/transforms_train.json").read_bytes())
        frame = {"file_path": "a.png", "transform_matrix": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 4], [0, 0, 0, 1]]}
        nerf = {"camera_model": "OPENCV", "fl_x": 60, "fl_y": 60, "cx": 32, "cy": 24, "w": 64, "h": 48, "k1": 0.1, "k2": 0,
                "p1": 0.001, "p2": 0, "frames": [frame, frame | {"fl_x": 50}]}
        self.add("dataset", "nerfstudio", b"\6" + json.dumps(nerf).encode())

    def viewer_files(self, work):
        session = {"format": "tgview-session", "version": 1, "window": [640, 480], "panel": True, "panel_width": 300,
                   "tab": "view", "output": "final", "textures": "on", "speed": 1.0, "fly": False, "recent": ["/a.tgz"],
                   "bookmarks": [{"model": "/a.tgz", "cameras": []}]}
        keys = [{"time": 0, "position": [0, 0, -4], "rotation": [1, 0, 0, 0], "fov_y": 45},
                {"time": 2.5, "position": [3, 0, -2], "rotation": [0.924, 0, -0.383, 0], "fov_y": 45, "pixel_aspect": 1.1,
                 "shift": [0.1, 0]}]
        path = {"format": "tgview-path", "version": 1, "aspect": 1.7778, "closing": 0, "keys": keys}
        with tarfile.open(work / "run/model.tgz") as bundle:
            cameras = bundle.extractfile("cameras.json").read()
        session["bookmarks"][0]["cameras"] = json.loads(cameras)[:1]
        self.add("viewer_files", "session", b"\0" + json.dumps(session).encode())
        self.add("viewer_files", "path", b"\1" + json.dumps(path).encode())
        self.add("viewer_files", "cameras", b"\1" + cameras)
        for k, script in enumerate(SCRIPTS):
            self.add("viewer_files", f"script{k}", b"\2" + script.encode())

    def pictures(self, work, made):
        png = work / "scene/train/r_0.png"
        self.add("image", "png", png.read_bytes())
        self.add("photograph", "png", png.read_bytes())
        with tarfile.open(work / "run/model.tgz") as bundle:
            for entry in bundle:
                if entry.name.endswith((".png", ".exr")):
                    self.add("image", entry.name, bundle.extractfile(entry).read())
        if shutil.which("ffmpeg"):
            for kind, options in {"jpg": [], "grey.jpg": ["-pix_fmt", "gray"], "webp": ["-pix_fmt", "yuv420p"]}.items():
                call("ffmpeg", "-y", "-i", png, *options, "-frames:v", 1, work / f"photo.{kind}")
                self.add("photograph", kind, (work / f"photo.{kind}").read_bytes())
            for kind in ("jpg", "grey.jpg", "webp"):
                self.add("image", kind, (work / f"photo.{kind}").read_bytes())
            for k, order in enumerate("<>"):
                self.add("photograph", f"exif{k}", with_exif((work / "photo.jpg").read_bytes(), order))
        if shutil.which("heif-enc"):
            call("heif-enc", "-q", 40, "-o", work / "photo.heic", png)
            self.add("photograph", "heic", (work / "photo.heic").read_bytes())


def main():
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    Seeds(pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()).write()


main()

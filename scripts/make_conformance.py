#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes the files of docs/gltf-extension/conformance.md: for every rule one that keeps it and ones that break it.

    scripts/make_conformance.py FOLDER                      writes the files and FOLDER/index.json
    scripts/make_conformance.py FOLDER --check tgconvert    and holds a program's verdicts against the index
    scripts/make_conformance.py --table                     prints the table of conformance.md
    scripts/make_conformance.py --sample FILE               writes docs/gltf-extension/sample.glb

The files are made here, byte by byte, from four splats with 4 x 4 textures; no other program has a part in them.
"""
import argparse
import copy
import json
import pathlib
import struct
import subprocess
import sys
import zlib

KHR = "KHR_gaussian_splatting"
TG = "TG_gaussian_splatting_texture"
PRIMITIVE = "/meshes/0/primitives/0"
LAYER = f"{PRIMITIVE}/extensions/{KHR}/extensions/{TG}"
FLOAT, USHORT, UBYTE = 5126, 5123, 5121
COUNT = 4


def png(width, height, channels, pixels, depth=8):
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    row = width * channels * depth // 8
    raw = b"".join(b"\0" + pixels[y * row:(y + 1) * row] for y in range(height))
    head = struct.pack(">IIBBBBB", width, height, depth, 2 if channels == 3 else 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")


def riff(kind, data):
    chunk = kind + struct.pack("<I", len(data)) + data.ljust((len(data) + 1) // 2 * 2, b"\0")
    return b"RIFF" + struct.pack("<I", 4 + len(chunk)) + b"WEBP" + chunk


def webp(width, height, channels, pixels):
    """A lossless WebP without transforms, whose codes have 8 bits each (RFC 9649, section 3)."""
    bits = []

    def put(value, count):
        bits.extend(value >> k & 1 for k in range(count))

    put(0x2F, 8)
    put(width - 1, 14)
    put(height - 1, 14)
    put(0, 1 + 3)  # no alpha; version
    put(0, 1 + 1 + 1)  # no transform, no colour cache, one group of codes
    for lengths in (280, 256, 256):  # green with run lengths, red, blue: literals of 8 bits, nothing else
        put(0, 1)  # code lengths are coded
        put(12 - 4, 4)
        for symbol in (17, 18, 0, 1, 2, 3, 4, 5, 16, 6, 7, 8):
            put(1 if symbol in (0, 8) else 0, 3)
        put(0, 1)  # all lengths follow
        for k in range(lengths):
            put(1 if k < 256 else 0, 1)
    put(0b1, 1), put(0, 1), put(1, 1), put(255, 8)  # alpha: always 255
    put(0b1, 1), put(0, 1), put(0, 1), put(0, 1)  # distances: never
    for i in range(len(pixels) // channels):
        rgb = pixels[i * channels:(i + 1) * channels] if channels == 3 else pixels[i:i + 1] * 3
        for value in (rgb[1], rgb[0], rgb[2]):
            put(int(f"{value:08b}"[::-1], 2), 8)
    bits.extend([0] * (-len(bits) % 8))
    return riff(b"VP8L", bytes(sum(bits[k + j] << j for j in range(8)) for k in range(0, len(bits), 8)))


def lossy_webp(width, height):
    """The header of a lossy WebP (RFC 6386, section 9.1) and no picture."""
    return riff(b"VP8 ", struct.pack("<I", 1 << 4 | 4 << 5)[:3] + b"\x9d\x01\x2a" + struct.pack("<HH", width, height) +
                bytes(8))


class Glb:
    """A file as JSON and a list of bufferViews' bytes."""

    def __init__(self):
        self.json = {"asset": {"version": "2.0", "generator": "make_conformance.py"}, "buffers": [{}],
                     "bufferViews": [], "accessors": [], "images": [], "textures": [],
                     "samplers": [{"magFilter": 9729, "minFilter": 9729, "wrapS": 33071, "wrapT": 33071}],
                     "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
                     "meshes": [{"primitives": [{"mode": 0, "attributes": {}, "extensions": {}}]}],
                     "extensionsUsed": [KHR, TG]}
        self.views = []
        self.header_length = None  # another number than the right one

    @property
    def primitive(self):
        return self.json["meshes"][0]["primitives"][0]

    @property
    def splatting(self):
        return self.primitive["extensions"][KHR]

    @property
    def layer(self):
        return self.splatting["extensions"][TG]

    @property
    def atlas(self):
        return self.layer["atlases"][0]

    def accessor(self, semantic):
        return self.json["accessors"][self.primitive["attributes"][semantic]]

    def add_view(self, data, stride=None):
        view = {"buffer": 0}
        if stride:
            view["byteStride"] = stride
        self.json["bufferViews"].append(view)
        self.views.append(data)
        return len(self.views) - 1

    def remove(self, semantic):
        """With its accessor and bufferView: validators report what nobody uses."""
        gone = self.primitive["attributes"].pop(semantic)
        view = self.json["accessors"].pop(gone)["bufferView"]
        del self.views[view], self.json["bufferViews"][view]
        for name, index in self.primitive["attributes"].items():
            self.primitive["attributes"][name] = index - (index > gone)
        for user in self.json["accessors"] + self.json["images"]:
            user["bufferView"] -= user["bufferView"] > view

    def set(self, semantic, kind, component, values, normalized=False):
        """values: one tuple per element."""
        if semantic in self.primitive["attributes"]:
            self.remove(semantic)
        code = {FLOAT: "f", USHORT: "H", UBYTE: "B", 5120: "b", 5125: "I"}[component]
        element = struct.calcsize(code) * len(values[0])
        stride = (element + 3) // 4 * 4
        data = b"".join(struct.pack(f"<{len(v)}{code}", *v).ljust(stride, b"\0") for v in values)
        accessor = {"bufferView": self.add_view(data, stride if stride != element else None),
                    "componentType": component, "type": kind, "count": len(values)}
        self.json["bufferViews"][-1]["target"] = 34962  # ARRAY_BUFFER
        if normalized:
            accessor["normalized"] = True
        if semantic == "POSITION":
            accessor["min"] = [min(v[k] for v in values) for k in range(3)]
            accessor["max"] = [max(v[k] for v in values) for k in range(3)]
        self.json["accessors"].append(accessor)
        self.primitive["attributes"][semantic] = len(self.json["accessors"]) - 1

    def add_image(self, data, mime="image/png"):
        """Returns the index of a texture."""
        self.json["images"].append({"bufferView": self.add_view(data), "mimeType": mime})
        self.json["textures"].append({"source": len(self.json["images"]) - 1, "sampler": 0})
        return len(self.json["textures"]) - 1

    def to_webp(self, texture, data):
        """The texture's image becomes a WebP file, by EXT_texture_webp and without a PNG."""
        image = self.json["textures"][texture].pop("source")
        self.json["images"][image]["mimeType"] = "image/webp"
        self.views[self.json["images"][image]["bufferView"]] = data
        self.json["textures"][texture]["extensions"] = {"EXT_texture_webp": {"source": image}}
        self.json["extensionsUsed"] = [KHR, TG, "EXT_texture_webp"]

    def bytes(self):
        root = copy.deepcopy(self.json)
        binary = b""
        for view, data in zip(root["bufferViews"], self.views):
            view.setdefault("byteOffset", len(binary))
            view.setdefault("byteLength", len(data))
            binary += data.ljust((len(data) + 3) // 4 * 4, b"\0")
        root["buffers"][0].setdefault("byteLength", len(binary))
        text = json.dumps(root).encode()
        text = text.ljust((len(text) + 3) // 4 * 4, b" ")
        chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
        length = 12 + len(chunks) if self.header_length is None else self.header_length
        return b"glTF" + struct.pack("<II", 2, length) + chunks


def base():
    """Four flat splats side by side, facing +z, each with its own quarter of an 8 x 8 atlas."""
    glb = Glb()
    h = 0.5 ** 0.5
    glb.set("POSITION", "VEC3", FLOAT, [(-0.75, 0.0, 0.0), (-0.25, 0.0, 0.0), (0.25, 0.0, 0.0), (0.75, 0.0, 0.0)])
    glb.set(f"{KHR}:ROTATION", "VEC4", FLOAT, [(0.0, 0.0, 0.0, 1.0), (0.0, 0.0, h, h)] * 2)
    glb.set(f"{KHR}:SCALE", "VEC3", FLOAT, [(0.15, 0.1, 0.001)] * COUNT)
    glb.set(f"{KHR}:OPACITY", "SCALAR", FLOAT, [(0.6,)] * COUNT)
    glb.set(f"{KHR}:SH_DEGREE_0_COEF_0", "VEC3", FLOAT, [(0.5, 0.0, -0.5)] * COUNT)
    glb.set("COLOR_0", "VEC4", FLOAT, [(0.36, 0.21, 0.10, 0.6)] * COUNT)
    glb.set(f"{TG}:RECT", "VEC4", USHORT, [(0, 0, 4, 4), (4, 0, 4, 4), (0, 4, 4, 4), (4, 4, 4, 4)])
    glb.set(f"{TG}:OPACITY", "SCALAR", FLOAT, [(0.8,)] * COUNT)
    glb.set(f"{TG}:SH_DEGREE_0_COEF_0", "VEC3", FLOAT, [(0.4, 0.1, -0.4)] * COUNT)
    color = bytes((x * 32 if c == 0 else y * 32 if c == 1 else 128) for y in range(8) for x in range(8) for c in range(3))
    alpha = bytes(255 if (x + y) % 2 else 128 for y in range(8) for x in range(8))
    glb.primitive["extensions"][KHR] = {
        "kernel": "ellipse", "colorSpace": "srgb_rec709_display", "extensions": {TG: {
            "mode": "rgba", "intersection": "plane", "extent": 3.0, "filter": "bilinear",
            "atlases": [{"color": glb.add_image(png(8, 8, 3, color)), "alpha": glb.add_image(png(8, 8, 1, alpha)),
                         "scale": [0.8, 0.8, 0.8, 1.0],
                         "offset": [-0.8 * 128 / 255] * 3 + [0.0]}]}}}
    return glb


CASES = []


def case(rule, name, verdict, where, said):
    """verdict: valid, warning, error, or unsupported (valid, but no reader needs to know it). where: the JSON pointer that
    a message names; said: a part of tgconvert's message."""
    def add(change):
        CASES.append({"rule": rule, "name": f"{rule}_{name}", "verdict": verdict, "pointer": where, "message": said,
                      "change": change, "text": (change.__doc__ or "").strip()})
        return change
    return add


def valid(rule, name):
    return case(rule, name, "valid", "", "")


def attribute(semantic):
    return f"{PRIMITIVE}/attributes/{semantic}"


# The layer's place.
@valid("T01", "inside")
def _(g):
    "the extension inside KHR_gaussian_splatting"


@case("T01", "primitive", "error", f"{PRIMITIVE}/extensions/{TG}", "wrong place")
def _(g):
    "on the primitive itself"
    g.primitive["extensions"][TG] = g.splatting["extensions"].pop(TG)


@case("T01", "root", "error", f"/extensions/{TG}", "wrong place")
def _(g):
    "at the root"
    g.json["extensions"] = {TG: g.layer}


@case("T02", "required", "valid", "", "")
def _(g):
    "listed in extensionsRequired: discouraged, and read by those who know it"
    g.json["extensionsRequired"] = [KHR, TG]


# Properties.
@valid("T03", "alpha")
def _(g):
    "mode alpha with an alpha image alone"
    g.layer["mode"] = "alpha"
    del g.atlas["color"]


@valid("T03", "rgb")
def _(g):
    "mode rgb with a colour image alone"
    g.layer["mode"] = "rgb"
    del g.atlas["alpha"]


@case("T03", "unknown", "error", LAYER, "unknown \"mode\"")
def _(g):
    "an unknown mode"
    g.layer["mode"] = "rgbx"


@case("T03", "missing", "error", LAYER, "unknown \"mode\"")
def _(g):
    "no mode"
    del g.layer["mode"]


@valid("T04", "maxResponse")
def _(g):
    "intersection maxResponse"
    g.layer["intersection"] = "maxResponse"


@valid("T04", "default")
def _(g):
    "no intersection: plane"
    del g.layer["intersection"]


@case("T04", "unknown", "error", LAYER, "unknown \"intersection\"")
def _(g):
    "an unknown intersection"
    g.layer["intersection"] = "sphere"


@valid("T05", "default")
def _(g):
    "no extent: 3"
    del g.layer["extent"]


@case("T05", "other", "unsupported", LAYER, "\"extent\" is not supported")
def _(g):
    "extent 2.5"
    g.layer["extent"] = 2.5


@case("T05", "zero", "error", LAYER, "\"extent\"")
def _(g):
    "extent 0"
    g.layer["extent"] = 0


@case("T05", "text", "error", LAYER, "\"extent\"")
def _(g):
    "an extent that is no number"
    g.layer["extent"] = "3"


@case("T06", "nearest", "unsupported", LAYER, "\"filter\" is not supported")
def _(g):
    "filter nearest"
    g.layer["filter"] = "nearest"


@case("T06", "unknown", "error", LAYER, "\"filter\"")
def _(g):
    "an unknown filter"
    g.layer["filter"] = "cubic"


@valid("T07", "two")
def _(g):
    "two atlases, chosen by ATLAS"
    g.layer["atlases"].append(copy.deepcopy(g.atlas))
    g.set(f"{TG}:ATLAS", "SCALAR", UBYTE, [(0,), (1,)] * 2)


@case("T07", "none", "error", LAYER, "\"atlases\" is wrong")
def _(g):
    "an empty list of atlases"
    g.layer["atlases"] = []


@case("T07", "many", "error", LAYER, "\"atlases\" is wrong")
def _(g):
    "256 atlases"
    g.layer["atlases"] *= 256


@case("T08", "missing", "error", f"{LAYER}/atlases/0", "\"color\" is missing")
def _(g):
    "no colour image in a mode that needs it"
    del g.atlas["color"]


@case("T08", "dangling", "error", f"{LAYER}/atlases/0", "\"color\" names no texture")
def _(g):
    "a colour texture that is not there"
    g.atlas["color"] = 9


@case("T08", "no_source", "error", f"{LAYER}/atlases/0", "has no source image")
def _(g):
    "a texture without an image"
    del g.json["textures"][0]["source"]


@case("T09", "missing", "error", f"{LAYER}/atlases/0", "\"alpha\" is missing")
def _(g):
    "no alpha image in a mode that needs it"
    del g.atlas["alpha"]


@valid("T10", "default")
def _(g):
    "no scale and no offset: 1 and 0"
    del g.atlas["scale"], g.atlas["offset"]


@case("T10", "three", "error", f"{LAYER}/atlases/0", "\"scale\" is wrong")
def _(g):
    "three numbers of scale"
    g.atlas["scale"] = [1, 1, 1]


@case("T10", "infinite", "error", f"{LAYER}/atlases/0", "\"offset\" is wrong")
def _(g):
    "an offset beyond floating point"
    g.atlas["offset"] = [0, 0, 1e300, 0]


@case("T11", "kernel", "error", f"{PRIMITIVE}/extensions/{KHR}", "\"kernel\" is not supported")
def _(g):
    "another kernel under the layer"
    g.splatting["kernel"] = "disc"


# Attributes.
@case("T12", "rect", "error", attribute(f"{TG}:RECT"), "the count differs")
def _(g):
    "a rectangle too few"
    g.accessor(f"{TG}:RECT")["count"] = COUNT - 1


@case("T12", "opacity", "error", attribute(f"{TG}:OPACITY"), "the count differs")
def _(g):
    "an opacity too few"
    g.accessor(f"{TG}:OPACITY")["count"] = COUNT - 1


@valid("T13", "untextured")
def _(g):
    "a rectangle of width 0: a splat without a texture"
    g.set(f"{TG}:RECT", "VEC4", USHORT, [(0, 0, 4, 4), (60000, 60000, 0, 7), (1, 1, 2, 3), (7, 7, 1, 1)])


@case("T13", "missing", "error", f"{PRIMITIVE}/attributes", f"{TG}:RECT is missing")
def _(g):
    "no rectangles"
    del g.primitive["attributes"][f"{TG}:RECT"]


@case("T13", "type", "error", attribute(f"{TG}:RECT"), "wrong type")
def _(g):
    "rectangles of bytes"
    g.set(f"{TG}:RECT", "VEC4", UBYTE, [(0, 0, 4, 4)] * COUNT)


@case("T13", "normalized", "error", attribute(f"{TG}:RECT"), "wrong type")
def _(g):
    "rectangles that are normalised"
    g.accessor(f"{TG}:RECT")["normalized"] = True


@case("T14", "type", "error", attribute(f"{TG}:ATLAS"), "wrong type")
def _(g):
    "atlas indices of 16 bit"
    g.set(f"{TG}:ATLAS", "SCALAR", USHORT, [(0,)] * COUNT)


@valid("T15", "bytes")
def _(g):
    "opacities of normalised bytes"
    g.set(f"{TG}:OPACITY", "SCALAR", UBYTE, [(200,)] * COUNT, normalized=True)


@valid("T15", "absent")
def _(g):
    "no attribute for opacity: KHR_gaussian_splatting's"
    g.remove(f"{TG}:OPACITY")


@case("T15", "type", "error", attribute(f"{TG}:OPACITY"), "wrong type")
def _(g):
    "opacities that are not normalised"
    g.set(f"{TG}:OPACITY", "SCALAR", UBYTE, [(1,)] * COUNT)


@case("T15", "range", "repaired", PRIMITIVE, "an opacity outside [0, 1]")
def _(g):
    "an opacity of 1.5"
    g.set(f"{TG}:OPACITY", "SCALAR", FLOAT, [(1.5,)] + [(0.5,)] * (COUNT - 1))


@case("T16", "type", "error", attribute(f"{TG}:SH_DEGREE_0_COEF_0"), "wrong type")
def _(g):
    "coefficients of bytes"
    g.set(f"{TG}:SH_DEGREE_0_COEF_0", "VEC3", UBYTE, [(1, 1, 1)] * COUNT, normalized=True)


@valid("T17", "shared")
def _(g):
    "rectangles that share texels"
    g.set(f"{TG}:RECT", "VEC4", USHORT, [(0, 0, 8, 8)] * COUNT)


@case("T17", "outside", "error", attribute(f"{TG}:RECT"), "splat 2: the rectangle leaves its atlas")
def _(g):
    "a rectangle that ends one texel beyond"
    g.set(f"{TG}:RECT", "VEC4", USHORT, [(0, 0, 4, 4), (4, 4, 4, 4), (5, 4, 4, 4), (0, 0, 1, 1)])


@case("T18", "index", "error", attribute(f"{TG}:ATLAS"), "splat 3 names no atlas")
def _(g):
    "an atlas index too large"
    g.set(f"{TG}:ATLAS", "SCALAR", UBYTE, [(0,), (0,), (0,), (1,)])


# Images.
@case("T19", "size", "error", f"{LAYER}/atlases/0", "the images differ in size")
def _(g):
    "colour 8 x 8, alpha 8 x 4"
    g.atlas["alpha"] = g.add_image(png(8, 4, 1, bytes(32)))


@valid("T20", "deep")
def _(g):
    "an alpha image of 16 bit"
    g.atlas["alpha"] = g.add_image(png(8, 8, 1, bytes(range(128)), depth=16))


@case("T20", "jpeg", "error", "/images/0", "an atlas of another type")
def _(g):
    "an image declared as JPEG"
    g.json["images"][0]["mimeType"] = "image/jpeg"


@case("T20", "magic", "error", "/images/0", "the image is no PNG")
def _(g):
    "bytes that are no PNG"
    g.views[g.json["images"][0]["bufferView"]] = b"GIF89a" + bytes(60)


@case("T20", "broken", "error", "/images/0", "")
def _(g):
    "a PNG that ends early"
    view = g.json["images"][0]["bufferView"]
    g.views[view] = g.views[view][:50]


@case("T20", "huge", "error", "/images/0", "the atlas is too large")
def _(g):
    "a PNG of 70 bytes that claims 2^31 texels"
    g.views[g.json["images"][0]["bufferView"]] = png(65536, 32768, 3, b"")


@valid("T20", "webp")
def _(g):
    "WebP images by EXT_texture_webp"
    g.to_webp(0, webp(8, 8, 3, bytes(range(192))))
    g.to_webp(1, webp(8, 8, 1, bytes(range(64))))


@case("T20", "webp_lossy", "error", "/images/0", "a lossy WebP")
def _(g):
    "a lossy WebP"
    g.to_webp(0, lossy_webp(8, 8))


@case("T20", "webp_source", "error", "/images/0", "an atlas of another type")
def _(g):
    "a WebP as a texture's own source"
    g.to_webp(0, webp(8, 8, 3, bytes(192)))
    g.json["textures"][0] = {"source": 0}


@case("T20", "webp_broken", "error", "/images/0", "")
def _(g):
    "a WebP that ends early"
    g.to_webp(0, webp(8, 8, 3, bytes(192))[:150])


@case("T20", "webp_huge", "error", "/images/0", "the atlas is too large")
def _(g):
    "a WebP that claims 2^28 texels"
    g.to_webp(0, webp(16384, 16384, 3, bytes(192)))


@case("T20", "webp_dangling", "error", "/textures/0/extensions/EXT_texture_webp/source", "")
def _(g):
    "a WebP that is not there"
    g.to_webp(0, webp(8, 8, 3, bytes(192)))
    g.json["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 9


@case("T21", "axes", "repaired", PRIMITIVE, "whose SCALE.z is not the smallest")
def _(g):
    "a normal along a longer axis"
    g.set(f"{KHR}:SCALE", "VEC3", FLOAT, [(0.1, 0.001, 0.15)] + [(0.15, 0.1, 0.001)] * (COUNT - 1))


@valid("T22", "own")
def _(g):
    "scales to use with the texture, beside ones whose normal is a longer axis"
    g.set(f"{KHR}:SCALE", "VEC3", FLOAT, [(0.1, 0.001, 0.15)] * COUNT)
    g.set(f"{TG}:SCALE", "VEC3", FLOAT, [(0.15, 0.1, 0.001)] * COUNT)


@case("T22", "type", "error", attribute(f"{TG}:SCALE"), "wrong type")
def _(g):
    "scales of 16 bit"
    g.set(f"{TG}:SCALE", "VEC3", USHORT, [(1, 1, 1)] * COUNT, normalized=True)


@case("T22", "axes", "repaired", PRIMITIVE, "whose SCALE.z is not the smallest")
def _(g):
    "a normal along a longer axis of the scales to use with the texture"
    g.set(f"{TG}:SCALE", "VEC3", FLOAT, [(0.1, 0.001, 0.15)] + [(0.15, 0.1, 0.001)] * (COUNT - 1))


# KHR_gaussian_splatting and glTF itself, as far as the Khronos validator does not look or a loader must not crash.
@case("K01", "mode", "error", f"{PRIMITIVE}/mode", "wrong mode for splats")
def _(g):
    "triangles"
    g.primitive["mode"] = 4


@case("K02", "kernel", "error", f"{PRIMITIVE}/extensions/{KHR}", "\"kernel\" is missing")
def _(g):
    "an extension object without keys"
    g.splatting.clear()


@case("K03", "missing", "error", f"{PRIMITIVE}/attributes", f"{KHR}:ROTATION is missing")
def _(g):
    "no rotations"
    del g.primitive["attributes"][f"{KHR}:ROTATION"]


@valid("K04", "degree1")
def _(g):
    "a complete degree 1"
    for k in range(3):
        g.set(f"{KHR}:SH_DEGREE_1_COEF_{k}", "VEC3", FLOAT, [(0.1, 0.2, 0.3)] * COUNT)


@case("K04", "gap", "error", f"{PRIMITIVE}/attributes", "SH degree 1 is incomplete")
def _(g):
    "two of three coefficients of degree 1"
    for k in range(2):
        g.set(f"{KHR}:SH_DEGREE_1_COEF_{k}", "VEC3", FLOAT, [(0.1, 0.2, 0.3)] * COUNT)


@case("K05", "count", "error", attribute(f"{KHR}:SCALE"), "the count differs")
def _(g):
    "a scale too few"
    g.accessor(f"{KHR}:SCALE")["count"] = COUNT - 1


@case("K06", "type", "error", attribute(f"{KHR}:SH_DEGREE_0_COEF_0"), "wrong type")
def _(g):
    "coefficients of 16 bit"
    g.set(f"{KHR}:SH_DEGREE_0_COEF_0", "VEC3", USHORT, [(1, 1, 1)] * COUNT, normalized=True)


@case("K07", "unit", "repaired", PRIMITIVE, "a quaternion that is not of unit length")
def _(g):
    "a quaternion of length 1.02"
    g.set(f"{KHR}:ROTATION", "VEC4", FLOAT, [(0.0, 0.0, 0.0, 1.02)] + [(0.0, 0.0, 0.0, 1.0)] * (COUNT - 1))


@case("K08", "opacity", "repaired", PRIMITIVE, "an opacity outside [0, 1]")
def _(g):
    "an opacity of -0.25"
    g.set(f"{KHR}:OPACITY", "SCALAR", FLOAT, [(-0.25,)] + [(0.5,)] * (COUNT - 1))
    del g.primitive["attributes"][f"{TG}:OPACITY"]


@case("K09", "scale", "repaired", PRIMITIVE, "a negative scale")
def _(g):
    "a scale of -0.15"
    g.set(f"{KHR}:SCALE", "VEC3", FLOAT, [(-0.15, 0.1, 0.001)] + [(0.15, 0.1, 0.001)] * (COUNT - 1))


@case("K10", "nan", "repaired", PRIMITIVE, "not finite")
def _(g):
    "a coefficient that is not a number"
    g.set(f"{KHR}:SH_DEGREE_0_COEF_0", "VEC3", FLOAT, [(float("nan"), 0.0, 0.0)] + [(0.0, 0.0, 0.0)] * (COUNT - 1))


@case("K11", "bounds", "repaired", attribute("POSITION"), "no min and max")
def _(g):
    "POSITION without min and max"
    del g.accessor("POSITION")["min"]


@case("K12", "space", "warning", f"{PRIMITIVE}/extensions/{KHR}", "unknown colorSpace")
def _(g):
    "an unknown colour space"
    g.splatting["colorSpace"] = "acescg"


@case("K13", "required", "error", "/extensionsRequired/0", "the file requires")
def _(g):
    "a required extension that nobody knows"
    g.json["extensionsRequired"] = ["VND_unheard_of"]


@case("K14", "view", "error", "/bufferViews/0", "leaves buffer 0")
def _(g):
    "a bufferView whose end overflows 64 bits"
    g.json["bufferViews"][0].update({"byteOffset": 16, "byteLength": 2 ** 64 - 8})


@case("K15", "accessor", "error", "/accessors/0", "leaves its bufferView")
def _(g):
    "an accessor longer than its bufferView"
    g.json["accessors"][0]["count"] = COUNT + 1


@case("K16", "external", "error", "/buffers/0/uri", "no name of a file beside this one")
def _(g):
    "a buffer outside the file"
    g.json["buffers"][0]["uri"] = "../secret.bin"


@case("K17", "length", "error", "", "the length in the header is not the file's")
def _(g):
    "a GLB header with another length"
    g.header_length = 100


def sample():
    """The file that the others change, with a camera."""
    glb = base()
    glb.json["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.6, "aspectRatio": 2.0, "znear": 0.01}}]
    glb.json["nodes"].append({"name": "front", "camera": 0, "translation": [0, 0, 2]})
    glb.json["scenes"][0]["nodes"].append(1)
    return glb.bytes()


def made(entry):
    glb = base()
    entry["change"](glb)
    return glb.bytes()


def table():
    print("| rule | file | the file | verdict | place |\n|---|---|---|---|---|")
    for entry in CASES:
        place = entry["pointer"].replace(LAYER, "LAYER").replace(PRIMITIVE, "PRIMITIVE") or ("" if entry["verdict"] == "valid" else "file")
        print(f"| {entry['rule']} | `{entry['name']}.glb` | {entry['text']} | {entry['verdict']} | {f'`{place}`' if place else ''} |")


def check(folder, program):
    """The number of files on which the program's verdict is another than the index's."""
    wrong = 0
    for entry in CASES:
        path = folder / f"{entry['name']}.glb"
        run = subprocess.run([program, str(path), "--info"], capture_output=True, text=True)
        checked = subprocess.run([program, "check", str(path)], capture_output=True, text=True)
        read = {0: "warning" if "warning:" in run.stderr else "valid", 3: "error"}.get(run.returncode, "crash")
        found = "repaired" if (read, checked.returncode) == ("warning", 3) else read
        expected = "error" if entry["verdict"] == "unsupported" else entry["verdict"]
        told = expected == "valid" or (entry["pointer"] in run.stderr and entry["message"] in run.stderr)
        code = 3 if expected in ("error", "repaired") else 0
        if found != expected or not told or checked.returncode != code:
            wrong += 1
            print(f"{path.name}: expected {expected} at {entry['pointer']} ({entry['message']}), "
                  f"found {found}: {run.stderr.strip()}, and of check code {checked.returncode}: "
                  f"{(checked.stdout + checked.stderr).strip()}", file=sys.stderr)
    print(f"{len(CASES) - wrong} of {len(CASES)} verdicts as expected")
    return wrong


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=pathlib.Path)
    parser.add_argument("--check", metavar="PROGRAM")
    parser.add_argument("--table", action="store_true")
    parser.add_argument("--sample", type=pathlib.Path)
    arguments = parser.parse_args()
    if arguments.table:
        return table()
    if arguments.sample:
        arguments.sample.write_bytes(sample())
        return 0
    if arguments.folder is None:
        parser.error("FOLDER is missing")
    arguments.folder.mkdir(parents=True, exist_ok=True)
    index = []
    for entry in CASES:
        (arguments.folder / f"{entry['name']}.glb").write_bytes(made(entry))
        index.append({key: entry[key] for key in ("rule", "name", "text", "verdict", "pointer")})
    (arguments.folder / "index.json").write_text(json.dumps(index, indent=1) + "\n")
    return 1 if arguments.check and check(arguments.folder, arguments.check) else 0


if __name__ == "__main__":
    sys.exit(main())

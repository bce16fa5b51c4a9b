#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times `tgconvert check` on GLB files with very many of one thing each.

    bench/check_bench.py GLB [--bin FOLDER] [--count N] [--nodes N] [--only NAME] [--keep FOLDER]

Every file is GLB (docs/gltf-extension/sample.glb, say) with N more nodes, accessors, ... that break no rule, or one
each, and the same with half as many. Prints processor seconds (user + system) of both, the largest resident set [MiB]
and how many errors `check` counts. Twice as many that take more than twice as long would be more than linear.
"""
import argparse
import json
import os
import pathlib
import struct
import subprocess
import tempfile


def parts(data):
    """The JSON of a GLB and the content of its BIN chunk."""
    size, = struct.unpack("<I", data[12:16])
    return json.loads(data[20:20 + size]), data[20 + size + 8:]


def glb(gltf, binary):
    text = json.dumps(gltf, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", len(binary), 0x004E4942) + binary
    return struct.pack("<III", 0x46546C67, 2, 12 + len(chunks)) + chunks


def grown(gltf, key, values):
    """Adds to a list at the top; the index of the first one added."""
    first = len(gltf.setdefault(key, []))
    gltf[key].extend(values)
    return first


def add_nodes(gltf, count):
    first = grown(gltf, "nodes", ({"translation": [1, 2, 3]} for _ in range(count)))
    gltf["scenes"][0]["nodes"].extend(range(first, first + count))


def add_chain(gltf, count):
    first = len(gltf["nodes"])
    grown(gltf, "nodes", ({"children": [first + k + 1]} for k in range(count - 1)))
    gltf["nodes"].append({})
    gltf["scenes"][0]["nodes"].append(first)


def add_fan(gltf, count):
    first = grown(gltf, "nodes", ({} for _ in range(count)))
    gltf["nodes"].append({"children": list(range(first, first + count))})
    gltf["scenes"][0]["nodes"].append(first + count)


def add_accessors(gltf, count):
    grown(gltf, "accessors", ({"bufferView": 0, "componentType": 5126, "count": 1, "type": "SCALAR"}
                              for _ in range(count)))


def add_views(gltf, count):
    grown(gltf, "bufferViews", ({"buffer": 0, "byteOffset": 4, "byteLength": 8} for _ in range(count)))


def add_attributes(gltf, count):
    """One primitive of so many attributes."""
    accessor = gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
    gltf["meshes"][0]["primitives"][0]["attributes"].update((f"_A{k}", accessor) for k in range(count))


def add_meshes(gltf, count):
    attributes = {"POSITION": gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"]}
    grown(gltf, "meshes", ({"primitives": [{"attributes": attributes, "mode": 0}]} for _ in range(count)))


def add_shown_meshes(gltf, count):
    """Meshes without splats that nodes show: reading warns of each."""
    first = len(gltf["meshes"])
    add_meshes(gltf, count)
    node = grown(gltf, "nodes", ({"mesh": first + k} for k in range(count)))
    gltf["scenes"][0]["nodes"].extend(range(node, node + count))


def add_primitives(gltf, count):
    attributes = {"POSITION": gltf["meshes"][0]["primitives"][0]["attributes"]["POSITION"]}
    gltf["meshes"][0]["primitives"].extend({"attributes": attributes, "mode": 0} for _ in range(count))


def add_materials(gltf, count):
    grown(gltf, "materials", ({"pbrMetallicRoughness": {"baseColorFactor": [1, 1, 1, 1]}} for _ in range(count)))


def add_textures(gltf, count):
    grown(gltf, "textures", ({"source": 0} for _ in range(count)))


def add_cameras(gltf, count):
    grown(gltf, "cameras", ({"type": "perspective", "perspective": {"yfov": 1, "znear": 1}} for _ in range(count)))


def add_skins(gltf, count):
    grown(gltf, "skins", ({"joints": [0]} for _ in range(count)))


def add_joints(gltf, count):
    """One skin of so many joints."""
    first = grown(gltf, "nodes", ({} for _ in range(count)))
    grown(gltf, "skins", [{"joints": list(range(first, first + count))}])


def sampler():
    return {"input": 0, "output": 0}


def channel(k):
    return {"sampler": k, "target": {"node": 0, "path": "scale"}}


def add_animations(gltf, count):
    grown(gltf, "animations", ({"samplers": [sampler()], "channels": [channel(0)]} for _ in range(count)))


def add_channels(gltf, count):
    """One animation of so many channels and samplers."""
    grown(gltf, "animations", [{"samplers": [sampler() for _ in range(count)],
                                "channels": [channel(k) for k in range(count)]}])


def add_extensions(gltf, count):
    """Names that are used and listed."""
    names = [f"TG_{k}" for k in range(count)]
    gltf["extensions"] = {name: {} for name in names}
    gltf["extensionsUsed"].extend(names)


def add_extras(gltf, count):
    gltf["asset"]["extras"] = [{"a": k} for k in range(count)]


def add_errors(gltf, count):
    """An error each, of one kind."""
    grown(gltf, "materials", ({"alphaCutoff": -1} for _ in range(count)))


def add_kinds(gltf, count):
    """An error each, of as many kinds."""
    letters = str.maketrans("0123456789", "abcdefghij")
    attributes = gltf["meshes"][0]["primitives"][0]["attributes"]
    attributes.update((f"K{k}".translate(letters), attributes["POSITION"]) for k in range(count))


FILES = {name[4:].replace("_", " "): add for name, add in globals().items() if name.startswith("add_")}
OF_NODES = ("nodes", "chain", "fan", "joints")


def measure(command):
    """Processor seconds, peak resident MiB and the output of one run."""
    process = subprocess.Popen(command, stdout=subprocess.PIPE)
    output = process.stdout.read()
    _, status, usage = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 3):
        raise SystemExit(f"{' '.join(map(str, command))}: exit code {os.waitstatus_to_exitcode(status)}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024, json.loads(output)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("glb", type=pathlib.Path)
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/bin"), help="where tgconvert lies")
    parser.add_argument("--count", type=int, default=300_000)
    parser.add_argument("--nodes", type=int, default=1_500_000, help="the same for nodes")
    parser.add_argument("--only", action="append", choices=FILES, help="these files alone")
    parser.add_argument("--keep", type=pathlib.Path, help="a folder that keeps the files")
    options = parser.parse_args()

    source = options.glb.read_bytes()
    print(f"{'':16}{'count':>9}{'bytes':>12}{'half: cpu s':>13}{'cpu s':>8}{'MiB':>7}  errors")
    with tempfile.TemporaryDirectory(dir=options.keep) as name:
        for kind in options.only or FILES:
            count = options.nodes if kind in OF_NODES else options.count
            seconds = []
            for many in (count // 2, count):
                gltf, binary = parts(source)
                FILES[kind](gltf, many)
                path = (options.keep or pathlib.Path(name)) / f"{kind.replace(' ', '_')}.glb"
                path.write_bytes(glb(gltf, binary))
                cpu, memory, report = measure([options.bin / "tgconvert", "check", path, "--json"])
                seconds.append(cpu)
            errors = sum(1 + entry.get("more", 0) for entry in report["errors"])
            print(f"{kind:16}{count:9}{path.stat().st_size:12}{seconds[0]:13.2f}{seconds[1]:8.2f}{memory:7.0f}  {errors}",
                  flush=True)


if __name__ == "__main__":
    main()

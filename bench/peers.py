#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times other renderers beside this one: processor time of a frame, both sides turn about in one run.

    bench/peers.py SCENE.ply... --size 800x600 1280x720 --peer NAME="COMMAND" [--ours vulkan cpu] [--json FILE]

COMMAND starts a renderer that draws {frames} pictures of the PLY file {ply} at {width} x {height} px and ends; it is
split as a shell would, but run without one (`env NAME=VALUE program` sets variables). Which camera it takes is its
own affair: render_bench takes camera 0 of SCENE.cameras.json, with the same horizontal field of view at every size.

Every command runs twice, for fewer and for more frames (--frames). The difference of the two, over the difference in
frames, is what a frame costs: reading the file, compiling shaders and growing buffers are in both and drop out. So does
what a program does once at its end. Printed are medians over the rounds of processor time (user + system, all threads)
and of wall time [ms], and the largest resident set [MiB]. With --json every sample is added to those in FILE, and the
medians are over all of FILE: a long comparison can be made of short calls.
"""
import argparse
import json
import os
import pathlib
import shlex
import statistics
import subprocess
import tempfile
import time

from reproduce import write


def run(command):
    """Processor and wall milliseconds and peak resident MiB of a process and those it waited for."""
    with tempfile.TemporaryFile() as output:
        start = time.monotonic()
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=output)
        _, status, usage = os.wait4(process.pid, 0)
        wall = time.monotonic() - start
        if status != 0:
            output.seek(0)
            raise SystemExit(f"{shlex.join(command)}: status {status}\n{output.read().decode(errors='replace')}")
    return 1e3 * (usage.ru_utime + usage.ru_stime), 1e3 * wall, usage.ru_maxrss / 1024


def frame_cost(template, values, frames):
    """One sample: what a frame costs between frames[0] and frames[1] of them."""
    few, many = (run([part.format(**values, frames=n) for part in shlex.split(template)]) for n in frames)
    return {
        "processor_ms": (many[0] - few[0]) / (frames[1] - frames[0]),
        "wall_ms": (many[1] - few[1]) / (frames[1] - frames[0]),
        "mib": many[2],
        "frames": frames,
    }


def size_of(text):
    width, height = (int(side) for side in text.split("x"))
    return width, height


def peer_of(text):
    name, command = text.split("=", 1)
    return name, command


def print_table(rows):
    """Markdown: a line per scene and size, a column per renderer in the order in which it came."""
    names = list(dict.fromkeys(name for samples in rows.values() for name in samples))
    print("| scene | picture | " + " | ".join(names) + " |")
    print("|---|---|" + "---|" * len(names))
    for row, samples in rows.items():
        cells = []
        for name in names:
            if name in samples:
                cpu, wall, mib = (statistics.median(s[key] for s in samples[name])
                                  for key in ("processor_ms", "wall_ms", "mib"))
                cells.append(f"{cpu:.0f} ({wall:.0f} wall, {mib:.0f} MiB, {len(samples[name])} runs)")
            else:
                cells.append("")
        print(f"| {' | '.join(row.split(' '))} | {' | '.join(cells)} |")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--size", nargs="+", type=size_of, default=[(1280, 720)], metavar="WxH")
    parser.add_argument("--peer", action="append", type=peer_of, default=[], metavar="NAME=COMMAND")
    parser.add_argument("--ours", nargs="*", default=["vulkan"], metavar="BACKEND", help="vulkan, opengl, cpu")
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/bin"), help="where render_bench lies")
    parser.add_argument("--frames", nargs=2, type=int, default=[2, 8], metavar=("FEW", "MANY"))
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json", type=pathlib.Path)
    options = parser.parse_args()
    if not 0 < options.frames[0] < options.frames[1]:
        parser.error("--frames: expected two numbers, the second greater")

    bench = shlex.quote(str(options.bin / "render_bench"))
    jobs = {backend: f"{bench} {{ply}} --backend {backend} --size {{width}}x{{height}} --frames {{frames}} --frames-only"
            for backend in options.ours}
    jobs.update(options.peer)
    rows = json.loads(options.json.read_text()) if options.json and options.json.exists() else {}
    for _ in range(options.rounds):
        for scene in options.scenes:
            for width, height in options.size:
                row = rows.setdefault(f"{scene.stem} {width}x{height}", {})
                for name, template in jobs.items():
                    sample = frame_cost(template, {"ply": scene, "width": width, "height": height}, options.frames)
                    row.setdefault(name, []).append(sample)
                    if options.json:
                        write(options.json, rows)
    print_table(rows)


if __name__ == "__main__":
    main()

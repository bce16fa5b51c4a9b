#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Times tgconvert beside a plain copy and beside PlayCanvas' splat-transform, PLY to GLB, turn about in one run.

    bench/convert_bench.py SCENE.ply... [--splat-transform PATH] [--folder FOLDER] [--runs N]

Copies every SCENE into FOLDER first, so that input and output lie on one file system and the input in the page cache.
Prints medians over the runs of wall seconds, of processor seconds (user + system), the largest resident set [MiB] and
the bytes that were written. tgconvert and `cp + sync` wait for the disk (fsync); cp and splat-transform do not.
splat-transform comes from `npm install @playcanvas/splat-transform`; without it the other lines are printed.
"""
import argparse
import os
import pathlib
import shutil
import statistics
import subprocess
import tempfile
import time


def measure(command, output):
    """Wall and processor seconds, peak resident KiB and bytes written by one run."""
    if output.exists():
        output.unlink()
    start = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    message = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    wall = time.monotonic() - start
    if status != 0:
        raise SystemExit(f"{' '.join(map(str, command))}: {message.decode(errors='replace')}")
    return wall, usage.ru_utime + usage.ru_stime, usage.ru_maxrss, output.stat().st_size


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", type=pathlib.Path)
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/bin"), help="where tgconvert lies")
    parser.add_argument("--splat-transform", help="its program, started by node")
    parser.add_argument("--folder", type=pathlib.Path, default=pathlib.Path(tempfile.gettempdir()))
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()

    with tempfile.TemporaryDirectory(dir=options.folder) as name:
        folder = pathlib.Path(name)
        print(f"{'':28}{'wall s':>8}{'cpu s':>8}{'MiB':>8}{'bytes':>12}   wall / cp   cpu / cp")
        for scene in options.scenes:
            source, copy, glb = folder / "in.ply", folder / "copy.ply", folder / "out.glb"
            shutil.copyfile(scene, source)
            tgconvert = [options.bin / "tgconvert", source, glb]
            jobs = {
                "cp": (["cp", source, copy], copy),
                "cp + sync": (["sh", "-c", f"cp '{source}' '{copy}' && sync '{copy}'"], copy),
                "tgconvert": (tgconvert, glb),
                "tgconvert --lean": (tgconvert + ["--lean"], glb),
            }
            if options.splat_transform:
                jobs["splat-transform"] = (["node", options.splat_transform, source, glb, "-w"], glb)
            samples = {job: [] for job in jobs}
            for _ in range(options.runs):
                for job, (command, output) in jobs.items():
                    samples[job].append(measure(command, output))
            copied = [statistics.median(s[k] for s in samples["cp"]) for k in (0, 1)]
            print(scene.name)
            for job, runs in samples.items():
                wall, cpu = (statistics.median(s[k] for s in runs) for k in (0, 1))
                print(f"  {job:26}{wall:8.3f}{cpu:8.3f}{max(s[2] for s in runs) / 1024:8.0f}{runs[0][3]:12}"
                      f"{wall / copied[0]:11.1f}{cpu / copied[1]:11.1f}")


if __name__ == "__main__":
    main()

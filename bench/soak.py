#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Does the viewer's memory stay flat? soak.py TGVIEW MODEL MODEL [--actions N] [--backend NAME] [--seed S] [--loads-only]

A window under Xvfb goes through N random actions of a script (docs/viewer.md, Scripts): camera, outputs, sizes, pages,
inspection, selections and edits with undo, comparisons, and models opened and closed; --loads-only: nothing but these.
What does not fit one script is the same again, at most ROUND actions at a time. Prints one JSON: actions, loads,
seconds, memory [MiB] after a tenth of the time and at the end, and the slope of a line through what lies between [KiB
an hour, bytes an action]; on standard error the memory every ten minutes. Exit code 1 where the viewer did not end well.
"""
import argparse
import json
import pathlib
import random
import shutil
import subprocess
import sys
import tempfile
import time

EVERY_S = 0.5
TELL_S = 600
ROUND = 2000  # actions
OUTPUTS = ["final", "base", "texture", "alpha", "depth", "normal", "overdraw"]


def reopen(models, between=()):
    """The other one is opened, shown beside the first, which is closed."""
    models.reverse()
    return [f"open {models[0]}", *between, "close-document 0"]


def action(rng, models):
    x, y = rng.random() * 0.7, rng.random() * 0.7
    part = f"select-rectangle {x:.3f} {y:.3f} {x + 0.3:.3f} {y + 0.3:.3f}"
    return rng.choice([
        lambda: [f"orbit {rng.uniform(-40, 40):.1f} {rng.uniform(-20, 20):.1f}"],
        lambda: [f"dolly {rng.uniform(0.8, 1.25):.3f}"],
        lambda: [f"camera {rng.randrange(3)}"],
        lambda: [f"output {rng.choice(OUTPUTS)}"],
        lambda: [f"textures {rng.choice(['rgba', 'rgb', 'alpha', 'off'])}"],
        lambda: [f"intersection {rng.choice(['plane', 'maxResponse'])}"],
        lambda: [f"resolution {rng.choice([0.25, 0.5, 1.0])}"],
        lambda: [f"size {rng.choice(['320x240', '400x300', '360x280'])}"],
        lambda: [f"tab {rng.choice(['view', 'camera', 'path', 'inspect', 'edit', 'time'])}"],
        lambda: ["panel off", "wait 2", "panel on"],
        lambda: [f"inspect {rng.randrange(20, 200)} {rng.randrange(20, 200)}", "wait 2", "clear-inspection"],
        lambda: [part, "wait 1", "delete-selection", "wait 1", "undo", "select none"],
        lambda: [part, "move-selection 0.1,0,0", "turn-selection 0,10,0", "undo", "redo", "undo", "undo", "select none"],
        lambda: ["crop fit", "wait 1", "crop off"],
        lambda: ["add-key", "orbit 20 0", "add-key", "play on", "wait 3", "play off", "clear-path"],
        lambda: reopen(models, [f"compare {rng.choice(['side', 'wipe', 'difference'])}", "wait 1", "compare off"]),
    ])()


def script(options, rng):
    """The lines of a script, how many actions a round has, and how many rounds there are."""
    models, lines = list(options.models), []
    rounds = -(-options.actions // ROUND)
    actions = -(-options.actions // rounds)
    for _ in range(actions):
        lines += reopen(models) if options.loads_only else [*action(rng, models), "wait 1"]
    if models != options.models:
        lines += reopen(models)
    return lines, actions, rounds


def memory_of(process):
    for line in pathlib.Path(f"/proc/{process}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return None


def slope(samples):
    mean_t = sum(t for t, _ in samples) / len(samples)
    mean_m = sum(m for _, m in samples) / len(samples)
    spread = sum((t - mean_t) ** 2 for t, _ in samples)
    return sum((t - mean_t) * (m - mean_m) for t, m in samples) / spread if spread > 0 else 0.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tgview", type=pathlib.Path)
    parser.add_argument("models", nargs=2, type=pathlib.Path)
    parser.add_argument("--actions", type=int, default=2000)
    parser.add_argument("--backend", default="vulkan")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--loads-only", action="store_true")
    options = parser.parse_args()
    options.models = [model.resolve() for model in options.models]
    if not shutil.which("Xvfb"):
        sys.exit("soak.py: no Xvfb here (apt-get install xvfb)")
    lines, actions, rounds = script(options, random.Random(options.seed))
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(folder) / "script.txt"
        file.write_text("\n".join([*lines, f"repeat {rounds}"]) + "\n")
        display = subprocess.Popen(["Xvfb", "-displayfd", "1", "-screen", "0", "640x480x24"], stdout=subprocess.PIPE,
                                   stderr=subprocess.DEVNULL)
        number = display.stdout.readline().decode().strip()
        began, samples, told, viewer = time.monotonic(), [], 0, None
        try:
            viewer = subprocess.Popen(["env", "-u", "WAYLAND_DISPLAY", f"DISPLAY=:{number}", options.tgview.resolve(),
                                       options.models[0], "--script", file, "--size", "320x240", "--backend",
                                       options.backend], stdout=subprocess.DEVNULL)
            while viewer.poll() is None:
                memory = memory_of(viewer.pid)
                if memory is not None:
                    samples.append((time.monotonic() - began, memory))
                    if samples[-1][0] >= told + TELL_S:
                        told = samples[-1][0]
                        print(f"{told:.0f} s: {memory:.1f} MiB", file=sys.stderr, flush=True)
                time.sleep(EVERY_S)
        finally:
            if viewer and viewer.poll() is None:
                viewer.terminate()
                viewer.wait()
            display.terminate()
            display.wait()
    if not samples:
        sys.exit("the viewer ended at once")
    seconds = time.monotonic() - began
    steady = [(t, m) for t, m in samples if t >= 0.1 * seconds]
    grows = slope(steady) if len(steady) > 1 else 0.0  # [MiB/s]
    print(json.dumps({
        "backend": options.backend, "seed": options.seed, "actions": actions * rounds,
        "loads": rounds * sum(line.startswith("open ") for line in lines), "seconds": round(seconds, 1),
        "mib_after_a_tenth": round(steady[0][1], 1) if steady else None, "mib_at_end": round(samples[-1][1], 1),
        "mib_at_most": round(max(m for _, m in samples), 1), "kib_an_hour": round(grows * 3600 * 1024, 1),
        "bytes_an_action": round(grows * seconds / (actions * rounds) * 2 ** 20, 1), "exit_code": viewer.returncode}))
    sys.exit(1 if viewer.returncode != 0 else 0)


main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains the models behind the tables of docs/lab/quality.md and prints them as Markdown.

    bench/evidence.py counts    --data DATA --out OUT     textures at 1, 5 and 20 % of the default count
    bench/evidence.py ablations --data DATA --out OUT     what each choice of the default preset is worth

DATA holds the scene folders named below. OUT keeps every model and its numbers: a run that stands there is not made
again, so an interrupted call goes on where it ended. --jobs N runs N trainings at once, one thread each.
"""
import argparse
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys

# Folder, extra flags.
SCENES = {
    "fox": ["fox_270"],
    "lego": ["lego_400", "--start", "random"],
    "printshop": ["printshop"],
}
PERCENTS = [1, 5, 20]
KINDS = ["alpha", "rgb", "rgba"]
CHANNELS = {"none": 0, "alpha": 1, "rgb": 3, "rgba": 4}
BASE_FLOATS = 59  # of a Gaussian: 3 + 4 + 3 + 1 + 48


class Runner:
    def __init__(self, options):
        self.options = options
        self.pool = concurrent.futures.ThreadPoolExecutor(options.jobs)
        self.futures = {}
        options.out.mkdir(parents=True, exist_ok=True)

    def start(self, name, scene, flags, after=()):
        """Trains OUT/name.tgz once the runs named in `after` are done; returns the name."""
        if name not in self.futures:
            self.futures[name] = self.pool.submit(self._run, name, scene, flags, [self.futures[a] for a in after])
        return name

    def _run(self, name, scene, flags, after):
        for future in after:
            future.result()
        out = self.options.out
        report = out / f"{name}.json"
        if not report.exists():
            folder, *scene_flags = SCENES[scene]
            flags = [flag() if callable(flag) else flag for flag in flags]
            command = [self.options.bin / "tgtrain", self.options.data / folder, *scene_flags, "-o", out / f"{name}.tgz",
                       "--untextured-output", out / f"{name}.plain.tgz"]
            if "--compare-untextured" not in flags:
                command = command[:-2]
            command += ["--json", out / f"{name}.partial", "--overwrite", "-q", "--threads", "1"]
            command += ["--downscale", str(self.options.downscale), *flags]
            subprocess.run([str(part) for part in command], check=True)
            os.replace(out / f"{name}.partial", report)
            print(f"done: {name}", file=sys.stderr, flush=True)
        return json.loads(report.read_text())

    def result(self, name):
        return self.futures[name].result()

    def model_bytes(self, name):
        return (self.options.out / f"{name}.tgz").stat().st_size


def steps(options, first=None, second=None):
    first = options.iterations if first is None else first
    second = options.iterations if second is None else second
    return ["--iterations", str(first), "--texture-iterations", str(second)]


def row(cells):
    return "| " + " | ".join(cells) + " |"


def score(stage):
    return f"{stage['test_psnr']:.2f} / {stage['test_ssim']:.4f}"


def counts(runner, options):
    plans = []
    for scene in options.scenes:
        default = runner.start(f"{scene}-100", scene, [*steps(options, second=0), "--texture-mode", "none"])
        for percent in PERCENTS:
            limit = ["--percent", str(percent), "--default-gaussians",
                     lambda default=default: str(runner.result(default)["gaussians"])]
            plain = runner.start(f"{scene}-{percent}-stage1", scene,
                                 [*steps(options, second=0), "--texture-mode", "none", *limit], [default])
            for kind in KINDS:
                start = ["--start-model", options.out / f"{plain}.tgz", "--texture-mode", kind, *limit]
                twin = ["--compare-untextured"] if kind == "rgba" else []
                runner.start(f"{scene}-{percent}-{kind}", scene, [*steps(options, first=0), *start, *twin], [plain])
            plans.append((scene, percent))
    print(row(["scene", "share", "Gaussians", "texels a side", "none", "alpha", "RGB", "RGBA", "parameters none / RGBA",
               "bytes none / RGBA", "seconds none / alpha / RGB / RGBA"]))
    print(row(["---"] * 11))
    for scene, percent in plans:
        reports = {kind: runner.result(f"{scene}-{percent}-{kind}") for kind in KINDS}
        rgba = reports["rgba"]
        gaussians, texels = rgba["gaussians"], rgba["texels"]
        none = rgba["stages"]["untextured"]
        stages = [none] + [reports[kind]["stages"]["textured"] for kind in KINDS]
        best = max(stage["test_psnr"] for stage in stages)
        cells = [f"**{score(s)}**" if best - s["test_psnr"] < 0.05 else score(s) for s in stages]
        parameters = [gaussians * BASE_FLOATS + texels * CHANNELS[kind] for kind in ("none", "rgba")]
        sizes = [(options.out / f"{scene}-{percent}-rgba.{which}").stat().st_size for which in ("plain.tgz", "tgz")]
        print(row([scene, f"{percent} %", f"{gaussians:,}", str(round((texels / gaussians) ** 0.5)), *cells,
                   " / ".join(f"{p / 1e6:.2f} M" for p in parameters), " / ".join(f"{s / 1e6:.2f} MB" for s in sizes),
                   " / ".join(f"{s['seconds']:.0f}" for s in stages)]))
    for scene in options.scenes:
        default = runner.result(f"{scene}-100")
        print(f"\n{scene}: default count {default['gaussians']:,}, {score(default['stages']['plain'])} after stage 1 "
              f"({default['stages']['plain']['seconds']:.0f} s)")


def ablations(runner, options):
    rows = []

    def add(scene, what, flags, after=()):
        name = f"{scene}-ablation-{what}".replace(" ", "_")
        runner.start(name, scene, flags, after)
        rows.append((scene, what, name))

    for scene in options.scenes:
        cap = ["--gaussians", str(options.gaussians)]
        both = [*steps(options), *cap]
        plain = runner.start(f"{scene}-ablation-stage1", scene,
                             [*steps(options, second=0), "--texture-mode", "none", *cap])
        second = [*steps(options, first=0), "--start-model", options.out / f"{plain}.tgz", *cap]
        add(scene, "default", [*second, "--compare-untextured"], [plain])
        add(scene, "plane in both stages", [*both, "--intersection", "plane"])
        add(scene, "plane in stage 2", [*second, "--texture-intersection", "plane"], [plain])
        add(scene, "no gradient from texture coordinates", [*second, "--texture-gradient-geometry=off"], [plain])
        add(scene, "suffix without textures", [*second, "--texture-gradient-suffix=off"], [plain])
        add(scene, "neither gradient term",
            [*second, "--texture-gradient-geometry=off", "--texture-gradient-suffix=off"], [plain])
        add(scene, "paper's first texels", [*second, "--texture-init", "paper"], [plain])
        add(scene, "texels by footprint", [*second, "--texture-sizes", "footprint"], [plain])
        add(scene, "score by magnitudes", [*both, "--densify-score", "magnitudes"])
        add(scene, "MCMC", [*both, "--densification", "mcmc"])
        add(scene, "3D filter", [*both, "--filter-3d"])
        published = ["--rate-position", "1.6e-4", "--rate-position-end", "1.6e-6", "--rate-scale", "0.005",
                     "--rate-sh-rest", "0.000125"]
        add(scene, "3DGS's rates", [*both, *published])
        for rate in ["0.001", "0.005"]:
            add(scene, f"rate-texels {rate}", [*second, "--rate-texels", rate], [plain])
        # Equal bytes: 4 a float, 4 channels a texel.
        budget = options.gaussians * (4 * BASE_FLOATS + 16 * 16)
        for size in [1, 2, 4, 8]:
            count = budget // (4 * BASE_FLOATS + 16 * size * size)
            add(scene, f"{size} x {size} texels, equal bytes",
                [*steps(options), "--gaussians", str(count), "--texture-size", str(size)])
    print(row(["scene", "variant", "Gaussians", "texels", "after stage 1", "after stage 2", "against default [dB]"]))
    print(row(["---"] * 7))
    reference = {}
    for scene, what, name in rows:
        report = runner.result(name)
        stages = report["stages"]
        stage1 = score(stages["plain"]) if stages["plain"]["iterations"] else "as default"
        if what == "default":
            reference[scene] = stages["textured"]["test_psnr"]
            stage1 = score(runner.result(f"{scene}-ablation-stage1")["stages"]["plain"])
            twin = stages["untextured"]
            print(row([scene, "no textures", f"{twin['gaussians']:,}", "0", stage1, score(twin),
                       f"{twin['test_psnr'] - reference[scene]:+.2f}"]))
        print(row([scene, what, f"{report['gaussians']:,}", f"{report['texels']:,}", stage1, score(stages["textured"]),
                   f"{stages['textured']['test_psnr'] - reference[scene]:+.2f}"]))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", choices=["counts", "ablations"])
    parser.add_argument("--data", type=pathlib.Path, required=True)
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--bin", type=pathlib.Path, default=pathlib.Path("build/bin"))
    parser.add_argument("--scenes", nargs="+", choices=SCENES, default=list(SCENES))
    parser.add_argument("--iterations", type=int, default=2000, help="of each stage")
    parser.add_argument("--gaussians", type=int, default=5000, help="ablations: the cap")
    parser.add_argument("--downscale", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    options = parser.parse_args()
    runner = Runner(options)
    {"counts": counts, "ablations": ablations}[options.table](runner, options)


if __name__ == "__main__":
    main()

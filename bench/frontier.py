#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The best picture per byte, with textures and without: trains both, writes them as .sog and scores the files.

    bench/frontier.py run    --data DATA --work WORK [--only GLOB]...
    bench/frontier.py again  --data DATA --work WORK [--only GLOB]...   files of done cells whose models WORK keeps
    bench/frontier.py frames --work WORK [--only GLOB]...     processor milliseconds a frame of what is done
    bench/frontier.py list   [--only GLOB]...         every cell, and whether it is done, or its files cut only
    bench/frontier.py report                          docs/frontier.md and docs/images/frontier.svg from the cells

A cell is SCENE/GAUSSIANS/shDEGREE/ARM/SEED: stage 1 to so many Gaussians, then as many iterations again of the arm:
plain: without textures; rgba-8: with RGBA textures of 8 texels a Gaussian in the mean (tgtrain --adaptive-texels);
shared4-64: with 64 different textures of 4 x 4 texels, which Gaussians share (--texture-dictionary). Its model is
written with several widths of steps, and with some of them trained for the file as well, if not --cut; bytes are those
of the .sog file, scores those of the file over the test views. command/SCENE/SIZE/ARM/SEED is what one command makes
of a size: tgtrain SCENE -o scene.sog --target-size SIZE --texture-mode none (plain) or rgba, scored with textures and as
viewers without them show it. One that is done leaves docs/lab/frontier/CELL.json. A call runs what is missing, in
order, and may be stopped at any moment: WORK keeps the run folders, and the same call goes on.
"""
import argparse
import fnmatch
import itertools
import json
import math
import pathlib
import statistics
import subprocess
import sys

import svg_plot
from report_document import Code, Heading, Items, Table, Text, markdown
from report_trials import NUMBER, Broken, at, check_frames, check_name, parsed, require, student
from reproduce import (FRAMES, LENGTH, ROOT, SWAPPED, Locks, Scene, add_frame, alone, commit, frames_in, machine,
                       side_by_side, write)
from reproduce import SCENES as TRIALS

CELLS = ROOT / "docs/lab/frontier"
PAGE, PICTURE = ROOT / "docs/frontier.md", ROOT / "docs/images/frontier.svg"
# sample: the scene that tgtrain make-sample writes. -full: photographs at their folder's size, degree 1 alone.
FULL = {f"{name}-full": Scene(TRIALS[name].folder, 1, *TRIALS[name].flags) for name in ("fox", "lego", "printshop")}
SCENES = {**TRIALS, "sample": Scene("sample", 1), **FULL}
COUNTS = {"sample": [850, 1700, 3400, 6800, 13600], "fox": [850, 1700, 3400, 6800, 13600, 27200],
          "lego": [620, 1250, 2500, 5000, 10000, 20000, 40000],
          "printshop": [950, 1900, 3800, 7600, 15200, 30400], "fox-full": [6800, 13600, 27200],
          "lego-full": [5000, 10000, 20000, 40000], "printshop-full": [7600, 15200, 30400]}
DEGREES = [1, 0, 3]
ARMS = ["plain", "rgba-8", "rgba-4", "rgba-2", "alpha-8", "shared4-64", "shared4-256", "shared8-16", "shared8-64",
        "shared8-256"]
SEEDS = [1, 2, 3]
REPEATED = ["plain", "rgba-4", "rgba-2", *ARMS[-5:]]  # at degree 1, what seeds beyond the first have
SIZES = [25, 50, 100, 200, 400, 800]  # [kB] of the table by size
STEPS = [1, 2, 3, 4, 6, 8]
TRAINED = [2, 4, 8]  # steps of the files that are trained for
QUANTIZE = 2 * LENGTH // 10  # iterations, as tgtrain's own choice
CODEC = 2  # of the files: 1 before Gaussians stood along a Hilbert curve with renamed axes; a cell names its own
# Bytes that its files take beside those of codec 1 (docs/lab/converter.md, "SOG"), by whether there are textures.
OF_OLD_BYTES = {False: 0.97, True: 0.99}
TEXTURED_COUNTS = 3  # with textures, that a seed has for the differences over the whole range
SIDE = 8  # [texels] of the textures that are cut
FRAME_SCALE = 4  # pixels a side of frames that are timed, for each of the photographs' at half size
PLOTS_A_ROW = 4
COMMAND = "command"
COMMAND_SIZES = {**{scene: ["25KB", "150KB"] for scene in ("fox", "lego", "printshop")},
                 **{scene: ["250KB", "500KB"] for scene in FULL}, "lego800": ["1000KB"]}
COMMAND_ARMS = {"plain": "none", "rgba": "rgba"}  # and the texture mode
# What a report must hold.
SCORES = {"gaussians": NUMBER, "texels": NUMBER, "psnr": NUMBER, "ssim": NUMBER, "flip": NUMBER}
FILE = {"bytes": NUMBER, **SCORES}
# Reports from before training.json was kept with the scores.
UNRECORDED = {f"{COMMAND}/{scene}/250KB/rgba/1" for scene in ("lego-full", "printshop-full")}
LINES = [("without textures", "twin"), ("with textures", "rgba")]


def cells():
    """In the order in which they say most: the middle counts at degree 1, plain beside 8 texels."""
    names = [f"{scene}/{count}/sh{degree}/{arm}/{seed}" for seed in SEEDS for degree in DEGREES for arm in ARMS
             for scene in COUNTS for count in COUNTS[scene]
             if (seed == 1 and scene not in FULL) or (degree == 1 and arm in REPEATED)]
    rank = {arm: place for place, arm in enumerate(ARMS)}

    def key(name):
        scene, count, degree, arm, seed = name.split("/")
        outer = COUNTS[scene].index(int(count)) not in (1, 2)
        return seed, DEGREES.index(int(degree[2:])) + outer, rank[arm] > 1, rank[arm]

    return sorted(names, key=key)


def commands():
    return ["/".join([COMMAND, scene, size, arm, str(seed)]) for seed in SEEDS for scene, sizes in COMMAND_SIZES.items()
            for size in sizes for arm in COMMAND_ARMS]


def is_command(name):
    return name.startswith(COMMAND + "/")


def is_shared(name):
    return "/shared" in name


class Driver:
    def __init__(self, options):
        self.options, self.locks = options, Locks(options.work)

    def call(self, scene, program, *arguments):
        command = [self.options.bin / program, *arguments, "--threads", self.options.threads]
        if program != "tgconvert":
            command += ["--downscale", SCENES[scene].downscale]
        subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)

    @alone
    def train(self, name, scene, *flags):
        """The model in the run folder, finished."""
        run = self.options.work / name
        done = run / "done"
        if not done.exists() or not (run / "model.tgz").exists():
            run.parent.mkdir(parents=True, exist_ok=True)
            self.call(scene, "tgtrain", self.options.data / SCENES[scene].folder, "--run", run, "--resume", "-q",
                      "--device", self.options.device, "--metrics-every", 0, "--checkpoint-every", 120, *flags)
            training = training_of(run / "model.tgz")
            if training["interrupted"]:
                sys.exit(f"{run}: interrupted")
            done.touch()
        return run / "model.tgz"

    @alone
    def run(self, name):
        path, model = self.options.cells / f"{name}.json", self.options.work / name / "model.tgz"
        report = read(path)
        if "trained" in report or (is_command(name) and report):
            print(f"{name}: done already (expected --cells FOLDER and a WORK of its own to make it again)",
                  file=sys.stderr)
            return
        if report and self.options.cut:
            return
        if report and not model.exists():
            sys.exit(f"{path}: its files are cut from a model that is not {model} (expected --cut, or the cell removed "
                     "to make it again)")
        print(name, file=sys.stderr, flush=True)
        if is_command(name):
            write(path, self.command(name))
            return
        if report:
            check_same(model, report)
            self.again(name)  # so that all files are of one codec
            report = read(path)
        else:
            report = self.cut(name)
            write(path, report)
        if not self.options.cut:
            report["trained"] = self.trained_for(name)
            write(path, report)

    def model(self, name):
        """The cell's, trained if it is not there."""
        scene, count, degree, arm, seed = name.split("/")
        common = ["--sh-degree", degree[2:], "--seed", seed]
        start = self.train(f"{scene}/{count}/{degree}/start-{seed}", scene, *SCENES[scene].flags, *common,
                           "--iterations", LENGTH, "--texture-mode", "none", "--gaussians", count, *SWAPPED)
        if arm == "plain":
            flags = ["--iterations", LENGTH, "--densification", "none", "--texture-mode", "none"]
        elif is_shared(name):
            side, textures = arm.removeprefix("shared").split("-")
            flags = ["--iterations", 0, "--texture-iterations", LENGTH, "--texture-mode", "rgba",
                     "--texture-size", side, "--texture-dictionary", textures]
        else:
            mode, texels = arm.split("-")
            flags = ["--iterations", 0, "--texture-iterations", LENGTH, "--texture-mode", mode, "--texture-size", SIDE,
                     "--adaptive-texels", texels]
        return self.train(name, scene, "--start-model", start, *common, *flags)

    def command(self, name):
        _, scene, size, arm, seed = name.split("/")
        begun, run = commit(), self.options.work / name
        file, base = run.with_suffix(".sog"), run.with_suffix(".ply")
        run.parent.mkdir(parents=True, exist_ok=True)
        self.call(scene, "tgtrain", self.options.data / SCENES[scene].folder, "-o", file, "--overwrite", "--run", run,
                  "--resume", "-q", "--device", self.options.device, "--metrics-every", 0, "--checkpoint-every", 120,
                  *SCENES[scene].flags, "--seed", seed, "--target-size", size, "--texture-mode", COMMAND_ARMS[arm])
        training = training_of(run / "model.tgz")
        report = {"cell": name, "commit": begun, "machine": machine(), "training": training, "codec": CODEC,
                  "bytes": file.stat().st_size, **self.score(scene, file, run)}
        if arm != "plain":
            subprocess.run([self.options.bin / "tgconvert", file, base, "--base-only", "--overwrite", "--quiet"],
                           check=True)
            background = ",".join(str(channel) for channel in training["background"])
            report["base"] = self.score(scene, base, run, "--background", background)
        return report

    def cut(self, name):
        """The cell's model, written with every width of steps."""
        scene, begun, run = name.split("/")[0], commit(), self.options.work / name
        model = self.model(name)
        return {"cell": name, "commit": begun, "machine": machine(), "training": training_of(model),
                "model": self.score(scene, model, run), "codec": CODEC, "files": self.files(scene, model, run)}

    def files(self, scene, model, run):
        """Of every width of steps, scored."""
        files = []
        for steps in STEPS:
            file = run / f"steps-{steps}.sog"
            subprocess.run([self.options.bin / "tgconvert", model, file, "--steps", str(steps), "--overwrite",
                            "--quiet"], check=True)
            files.append({"steps": steps, "bytes": file.stat().st_size, **self.score(scene, file, run)})
        return files

    @alone
    def again(self, name):
        """Cuts a done cell's model again, if it is there and its files are of an older codec."""
        path, run = self.options.cells / f"{name}.json", self.options.work / name
        report = read(path)
        if not report or codec_of(report) >= CODEC or not (run / "model.tgz").exists():
            return
        print(name, file=sys.stderr, flush=True)
        check_same(run / "model.tgz", report)
        files = self.files(name.split("/")[0], run / "model.tgz", run)
        write(path, {**{key: value for key, value in report.items() if key != "trained"}, "codec": CODEC,
                     "files": files})

    def trained_for(self, name):
        """The files for which its model goes on."""
        scene, _, degree, arm, seed = name.split("/")
        run, files = self.options.work / name, []
        model = run / "model.tgz"
        for steps in TRAINED:
            file = run / f"trained-{steps}.sog"
            self.call(scene, "tgtrain", self.options.data / SCENES[scene].folder, "--start-model", model,
                      "--sh-degree", degree[2:], "--seed", seed, "--iterations", 0, "--texture-iterations", 0,
                      *(["--texture-mode", "none"] if arm == "plain" else []), "--quantize-iterations", QUANTIZE,
                      "--steps", steps, "-o", file, "--overwrite", "-q", "--device", self.options.device)
            files.append({"steps": steps, "commit": commit(), "bytes": file.stat().st_size,
                          **self.score(scene, file, run)})
        return files

    @alone
    def frames(self, name):
        """Times the cell's model from its first camera; frames.json beside the cells holds what was timed."""
        cells, run = self.options.cells, self.options.work / name
        model, cell, measured = run / "model.tgz", cells / f"{name}.json", run / "frames.json"
        if name in frames_in(cells) or not (model.exists() and cell.exists()):
            return
        print(name, file=sys.stderr, flush=True)
        dataset = read(cell)["training"]["dataset"]
        scale = FRAME_SCALE // 2 if name.split("/")[0] in FULL else FRAME_SCALE
        size = f"{scale * dataset['width']}x{scale * dataset['height']}"
        command = [self.options.bin / "render_bench", model, "--backend", "cpu", "--threads", self.options.threads,
                   "--size", size, "--frames", FRAMES, "--frames-only", "--json", measured]
        subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
        frame = json.loads(measured.read_text())
        add_frame(cells, name, {"ms": frame["processor_ms"],
                                **{key: frame[key] for key in ("device", "width", "height")}})

    def score(self, scene, model, run, *flags):
        self.call(scene, "tgeval", model, self.options.data / SCENES[scene].folder, "--json", run / "eval.json",
                  "--overwrite", *flags)
        scores = json.loads((run / "eval.json").read_text())
        return {key: scores[key] for key in ("gaussians", "texels", "psnr", "ssim", "flip")}


def read(path):
    """A cell's report, or {} where there is none."""
    try:
        return parsed(path) if path.exists() else {}
    except Broken as problem:
        sys.exit(f"{path}: {problem}")


def check_same(model, report):
    """That the cell's files were cut from this model, so that more of them belong beside."""
    if training_of(model) != report["training"]:
        sys.exit(f"{model}: not the model of {report['cell']} (expected that, or the cell removed to make it again)")


def of_others(found, commanded):
    """What the report says of cells that were made otherwise than they would be now: "note" names how."""
    notes = [report["note"] for report in found.values() if "note" in report]
    text = "".join(f" {notes.count(note)} cells are of {note}." for note in sorted(set(notes)))
    old = sum(codec_of(report) < CODEC for report in found.values())
    if old:
        text += (f" Files of {old} cells are of codec 1, larger than the same models' would be now, plain ones by 2 to "
                 "4 %, those with textures by about 1 % ([lab/converter.md](lab/converter.md#sog)).")
    beside = [report["psnr"] - plotted for name, report in commanded.items()
              if (plotted := plotted_beside(found, name, report["bytes"])) is not None]
    if beside:
        text += (" Files by one command (below) lie between %+.1f and %+.1f dB beside the first seed's hull of cut "
                 "files of their arm at the same bytes (%d of %d files, where it reaches so far), with textures and "
                 "without: their Gaussians are merged from up to four times as many, where these cells keep their counts by "
                 "`--limit-by swap`; they are trained for the file (stage 3); and they are of codec %d." % (
                     min(beside), max(beside), len(beside), len(commanded), CODEC))
    return text


def codec_of(report):
    return report.get("codec", 1)


def plotted_beside(found, command, size):
    """PSNR of the first seed's hull of the arm that the command has, None where there is none of so many bytes."""
    _, scene, _, arm, _ = command.split("/")
    return height(hull(points(found, scene, SEEDS[0], arm != "plain", False)), size)


def training_of(model):
    return json.loads(subprocess.run(["tar", "xzOf", model, "training.json"], check=True, capture_output=True).stdout)


# ---- The report


def done_cells(folder):
    """Cells and what one command makes, {name: report} each, in the order of their names' lists."""
    made, names, wrong = {}, [*cells(), *commands()], []
    for path in sorted(folder.rglob("*.json")):
        name = path.relative_to(folder).with_suffix("").as_posix()
        try:
            report = parsed(path)
            if name == "frames":
                check_frames(report, names, "bench/frontier.py")
            elif name not in names:
                raise Broken("no cell of bench/frontier.py has this name")
            else:
                made[name] = checked(name, report)
        except Broken as problem:
            wrong.append(f"{path}: {problem}")
    if wrong:
        raise Broken("\n".join(wrong))
    return [{name: made[name] for name in of if name in made} for of in (cells(), commands())]


def checked(name, report):
    """The report, which holds all that its tables are made of."""
    require(report, {"commit": str, "machine.processor": str, "machine.cores": NUMBER})
    check_name(report, name)
    if name not in UNRECORDED:
        require(report, {"device": str, "seconds": NUMBER}, "training.machine.")
        if at(report, "training", "interrupted"):
            raise Broken("the run was interrupted")
    if is_command(name):
        require(report, FILE)
        if name.split("/")[3] != "plain":
            require(report, SCORES, "base.")
        return report
    require(report, SCORES, "model.")
    for kind, steps in {"files": STEPS, **({"trained": TRAINED} if "trained" in report else {})}.items():
        require(report, {kind: list})
        for file in report[kind]:
            require({kind: file}, {"steps": NUMBER, **FILE}, f"{kind}.")
        if [file["steps"] for file in report[kind]] != steps:
            raise Broken(f"{kind} are not of steps {', '.join(map(str, steps))}")
    return report


def cells_of(found, scene, seed):
    return [name for name in found if name.startswith(scene + "/") and name.endswith(f"/{seed}")]


def all_trained(found, scene, seed):
    """Whether all cells have files that were trained for, so that both arms are alike."""
    names = cells_of(found, scene, seed)
    return bool(names) and all("trained" in found[name] for name in names)


def files(cell, trained):
    return [file for file in cell["files"] if file["steps"] == 1] + cell["trained"] if trained else cell["files"]


def points(found, scene, seed, textured, trained, measure="psnr", as_now=False):
    """(bytes, score, cell, file) of every file of the scene's arm; a greater score is a better one. as_now: bytes of an
    older codec as the newest would take."""
    sign = -1 if measure == "flip" else 1

    def size(name, file):
        return file["bytes"] * (OF_OLD_BYTES[textured] if as_now and codec_of(found[name]) < CODEC else 1)

    return [(size(name, file), sign * file[measure], name, file) for name in cells_of(found, scene, seed)
            if ("/plain/" not in name) == textured for file in files(found[name], trained)]


def whole_seeds(found, scene, trained):
    """Those with a plain cell at every count: a hull with a gap would make the other arm look better."""
    return [seed for seed in SEEDS if (not trained or all_trained(found, scene, seed)) and
            all(f"{scene}/{count}/sh1/plain/{seed}" in found for count in COUNTS[scene])]


def hull(of):
    """The upper hull of scores over the logarithm of bytes."""
    chain = []
    for point in sorted(of, key=lambda p: (p[0], -p[1])):
        if chain and point[1] <= chain[-1][1]:
            continue
        while len(chain) > 1 and slope(chain[-2], chain[-1]) <= slope(chain[-1], point):
            chain.pop()
        chain.append(point)
    return chain


def slope(a, b):
    return (b[1] - a[1]) / math.log(b[0] / a[0]) if b[0] > a[0] else math.inf


def height(chain, size):
    """dB of the hull at `size` bytes; None outside it."""
    for a, b in zip(chain, chain[1:]):
        if a[0] <= size <= b[0]:
            return a[1] + slope(a, b) * math.log(size / a[0])
    return None


def size_of(chain, score):
    """Bytes at which the hull has the score; None outside it."""
    for a, b in zip(chain, chain[1:]):
        if a[1] <= score <= b[1]:
            return a[0] * math.exp((score - a[1]) / slope(a, b))
    return None


def mean_over(grid, value):
    """The mean of a function that is linear between the grid's places."""
    return sum((b - a) * (value(a) + value(b)) / 2 for a, b in zip(grid, grid[1:])) / (grid[-1] - grid[0])


def common(first, second, axis):
    """The corners of both hulls along an axis, 0: bytes, 1: scores, where both are; none where they never are."""
    low = max(first[0][axis], second[0][axis])
    high = min(first[-1][axis], second[-1][axis])
    return sorted({low, high, *(p[axis] for p in first + second if low < p[axis] < high)}) if low < high else []


def mean_gain(plain, textured):
    """Scores that textures gain, over the sizes both hulls have, in the logarithm of bytes (Bjontegaard's delta)."""
    grid = [math.log(size) for size in common(plain, textured, 0)]
    sizes = dict(zip(grid, common(plain, textured, 0)))
    return mean_over(grid, lambda at: height(textured, sizes[at]) - height(plain, sizes[at])) if grid else None


def rate(plain, textured):
    """Bytes that textures take beside the plain hull's, less 1, over the scores both have (Bjontegaard's rate)."""
    grid = common(plain, textured, 1)
    if not grid:
        return None
    return math.expm1(mean_over(grid, lambda score: math.log(size_of(textured, score) / size_of(plain, score))))


def prices(found):
    """Rows of every textured file of the first seed: what a texel of it costs, and what it may cost to pay."""
    rows = []
    for name in found:
        scene, count, degree, arm, seed = name.split("/")
        bare = f"{scene}/{count}/{degree}/plain/{seed}"
        if arm == "plain" or is_shared(name) or bare not in found or int(seed) != SEEDS[0]:
            continue
        trained = all_trained(found, scene, seed)
        chain = hull(points(found, scene, seed, False, trained))
        for file, without in zip(files(found[name], trained), files(found[bare], trained)):
            as_good = size_of(chain, file["psnr"])
            if as_good and file["steps"] <= 4:
                rows.append([scene, arm_of(name), f"{file['steps']}", f"{file['psnr'] - without['psnr']:+.2f}",
                             f"{(file['bytes'] - without['bytes']) / file['texels']:.2f}",
                             f"{(as_good - without['bytes']) / file['texels']:.2f}"])
    return rows


def codecs(found, scene, seed):
    return ", ".join(str(codec) for codec in sorted({codec_of(found[name]) for name in cells_of(found, scene, seed)}))


def hulls(found, scene, trained, measure="psnr", as_now=False):
    """{seed: (without textures, with)} of the seeds that are whole and have both."""
    both = {seed: [hull(points(found, scene, seed, arm, trained, measure, as_now)) for arm in (False, True)]
            for seed in whole_seeds(found, scene, trained)}
    return {seed: pair for seed, pair in both.items() if all(pair)}


def over_seeds(values, form):
    """Mean and, of several, half of its 95 % confidence interval."""
    if not values:
        return "-"
    text = form.format(statistics.fmean(values))
    if len(values) > 1:
        text += " +- " + form.replace("+", "").format(
            student(len(values) - 1) * statistics.stdev(values) / math.sqrt(len(values)))
    return text


def textured_counts(found, scene, seed):
    return {count for count in COUNTS[scene] for arm in ARMS
            if arm != "plain" and f"{scene}/{count}/sh1/{arm}/{seed}" in found}


def spread(found, scene, seed):
    """Whether textures have the counts of a hull: far from its counts one of a single count is not the best choice."""
    return len(textured_counts(found, scene, seed)) >= TEXTURED_COUNTS


def by_codec(found, scene, values):
    """{codecs of its cells: {seed: value}}: what was written otherwise is no sample of the same."""
    groups = {}
    for seed, value in values.items():
        groups.setdefault(codecs(found, scene, seed), {})[seed] = value
    return groups


def whole_range(found):
    rows = []
    for scene, trained in itertools.product(COUNTS, (False, True)):
        def of_range(measure="psnr", as_now=False):
            return {seed: pair for seed, pair in hulls(found, scene, trained, measure, as_now).items()
                    if spread(found, scene, seed)}

        def row(codec, seeds, as_now):
            both = [of_range(as_now=as_now)[seed] for seed in seeds]
            spans = [span for pair in both if (span := common(*pair, 0))]
            rates = [over_seeds([100 * change for seed in seeds
                                 if (change := rate(*of_range(measure, as_now)[seed])) is not None], "{:+.1f}")
                     for measure in ("psnr", "ssim", "flip")]
            return [scene, "trained for" if trained else "cut", codec, ", ".join(map(str, seeds)),
                    f"{min(s[0] for s in spans) / 1000:,.0f} to {max(s[-1] for s in spans) / 1000:,.0f} kB"
                    if spans else "-",
                    over_seeds([gain for pair in both if (gain := mean_gain(*pair)) is not None], "{:+.2f}"), *rates]

        whole = of_range()
        rows += [row(codec, seeds, False) for codec, seeds in by_codec(found, scene, whole).items()]
        if any(codecs(found, scene, seed) != str(CODEC) for seed in whole):
            rows.append(row(f"as {CODEC}", whole, True))
    return rows


def by_size(found):
    rows = []
    for scene, trained, size in itertools.product(COUNTS, (False, True), SIZES):
        ends = {seed: [height(chain, 1000 * size) for chain in pair]
                for seed, pair in hulls(found, scene, trained).items()}
        ends = {seed: pair for seed, pair in ends.items() if None not in pair}
        for codec, pairs in by_codec(found, scene, ends).items():
            counts = {len(textured_counts(found, scene, seed)) for seed in pairs}
            rows.append([scene, "trained for" if trained else "cut", codec, f"{size} kB",
                         ", ".join(map(str, pairs)), " to ".join(map(str, sorted({min(counts), max(counts)}))),
                         *(f"{statistics.fmean(column):.2f}" for column in reversed(list(zip(*pairs.values())))),
                         over_seeds([textured - plain for plain, textured in pairs.values()], "{:+.2f}")])
    return rows


def least(commanded):
    """Of what a file takes of the size that it was asked for [%]."""
    shares = [report["bytes"] / (1000 * int(name.split("/")[2].removesuffix("KB"))) for name, report in commanded.items()]
    return f"{math.floor(1000 * min(shares)) / 10:.1f}" if shares else "-"


def unrecorded(commanded):
    names = [f"`{name}`" for name, report in commanded.items() if "training" not in report]
    if names:
        yield Text(f"Of {' and '.join(names)} scores, commit and machine were kept, but no record of the training.")


def by_command(commanded):
    """Rows of scenes and sizes whose arms are both there, means over the seeds of both."""
    def text(scores):
        psnr, ssim, flip = (statistics.fmean(score[key] for score in scores) for key in ("psnr", "ssim", "flip"))
        return f"{psnr:.2f} / {ssim:.4f} / {flip:.4f}"

    rows = []
    for scene, sizes in COMMAND_SIZES.items():
        for size in sizes:
            pairs = [pair for seed in SEEDS
                     if all(pair := [commanded.get(f"{COMMAND}/{scene}/{size}/{arm}/{seed}") for arm in COMMAND_ARMS])]
            if not pairs:
                continue
            plain, textured = zip(*pairs)
            counts = [f"{statistics.fmean(report['gaussians'] for report in arm):,.0f}" for arm in (plain, textured)]
            rows.append([scene, size.replace("KB", " kB"), str(len(pairs)), *counts, text(plain), text(textured),
                         over_seeds([b["psnr"] - a["psnr"] for a, b in pairs], "{:+.2f}"),
                         text([report["base"] for report in textured])])
    return rows


def frame_times(found, timed):
    """Rows of textured cells: a frame, and one of as many plain Gaussians as come to the same PSNR."""
    seeds = {}
    for name in found:
        scene, count, degree, arm, seed = name.split("/")
        if name not in timed or arm == "plain":
            continue
        chain = hull([(timed[plain]["ms"], found[plain]["model"]["psnr"]) for plain in cells_of(found, scene, seed)
                      if "/plain/" in plain and plain in timed])
        psnr, ms = found[name]["model"]["psnr"], timed[name]["ms"]
        as_good = size_of(chain, psnr)
        if as_good:
            seeds.setdefault(name.rpartition("/")[0], []).append((psnr, ms, as_good))
    return [[cell.split("/")[0], arm_of(f"{cell}/0"), str(len(of)),
             *(f"{statistics.fmean(column):.{digits}f}" for column, digits in zip(zip(*of), (2, 1, 1))),
             over_seeds([100 * (ms / plain - 1) for _, ms, plain in of], "{:+.0f}")] for cell, of in seeds.items()]


def shrunk(textured):
    return f"{100 * (1 - OF_OLD_BYTES[textured]):.0f}"


def arm_of(name):
    _, count, degree, arm, _ = name.split("/")
    kind, _, number = arm.partition("-")
    if is_shared(name):
        side = kind.removeprefix("shared")
        textures = f", {number} shared {side} x {side}"
    else:
        textures = "" if arm == "plain" else f", {kind} {number}"
    return f"{int(count):,} Gaussians, SH {degree[2:]}{textures}"


def texels_each(name, scores):
    return "-" if is_shared(name) else f"{scores['texels'] / scores['gaussians']:.1f}"


def report(folder, page, picture):
    try:
        found, commanded = done_cells(folder)
    except Broken as problem:
        sys.exit(str(problem))
    if not found:
        sys.exit(f"{folder}: no cell is done")
    blocks = [
        Text("What a file of some size is worth: Gaussians with textures beside more Gaussians without. Every point "
             "is a .sog file ([sog.md](sog.md)); its bytes are the file's, its PSNR is the file's over the test views. "
             f"Both arms have {2 * LENGTH:,} iterations: {LENGTH:,} of stage 1, then as many with textures "
             "(`--adaptive-texels`: so many texels a Gaussian in the mean; `--texture-dictionary`: so many textures, "
             "which Gaussians share) or without. A line is the upper hull of all counts, SH degrees and steps of its "
             "arm: what the best choice reaches."),
        Text("Files are cut from the model as it is, or trained for: "
             f"{QUANTIZE:,} iterations more, with parameters as the file holds them "
             "([training.md](training.md#the-stages), stage 3); those of the finest steps are cut in any case. Of "
             "files that are trained for, only seeds count all of whose cells of a scene have them."),
        Text("![PSNR over bytes, with textures and without](images/frontier.svg)"),
        Text(f"{len(found)} of {len(cells())} cells are done. Photographs are at half size, those of -full scenes "
             "at their own (lego 400 x 400, fox 270 x 480, printshop 400 x 400). sample is the scene that "
             "`tgtrain make-sample` writes. Seeds beyond the first, and -full scenes, are of SH degree 1 and not of "
             f"every arm.{of_others(found, commanded)} One cell again:"),
        Code("bench/frontier.py run --data DATA --work WORK --cells AGAIN --only fox/1700/sh1/rgba-8/1"),
        Heading("With textures against without, over the whole range"),
        Text("Bjontegaard's differences between the two hulls, integrated exactly between their corners: PSNR gained "
             "over the sizes that both have, in the logarithm of bytes; and the bytes that textures take more at equal "
             "PSNR, SSIM and FLIP, over the scores that both have: less than 0 is better. Mean over seeds +- its 95 % "
             "confidence interval (Student's t), of those seeds that have cells of SH degree 1 at every count without "
             f"textures, and at {TEXTURED_COUNTS} counts or more with them; one seed has no interval. A hull takes the "
             "best files by the test views that they are scored on, of either arm. \"as 2\": bytes of files of codec 1 "
             f"taken as {shrunk(False)} % fewer without textures and {shrunk(True)} % fewer with, about what codec "
             f"{CODEC} would write."),
        Table(["scene", "files", "codec", "seeds", "sizes", "gain [dB]", "bytes at equal PSNR [%]", "at equal SSIM [%]",
               "at equal FLIP [%]"], whole_range(found)),
        Text("The same at some sizes [dB], of seeds with fewer counts with textures, too: far from its counts one or "
             "two of them are not at their best."),
        Table(["scene", "files", "codec", "bytes", "seeds", "counts with textures", "with textures", "without textures",
               "gain"], by_size(found)),
        Heading("By one command"),
        Text("What a user gets who names bytes and leaves the rest to the program; scores are PSNR / SSIM / FLIP of the "
             f"files, means over seeds, the gain +- its 95 % confidence interval. Files have {least(commanded)} % of "
             "their size or more. Gaussians: merged down from up to four times as many. The base is what viewers show "
             "that know no textures. One of them again, as a cell and by hand:"),
        Code("bench/frontier.py run --data DATA --work WORK --cells AGAIN --only command/lego/25KB/rgba/1\n"
             "tgtrain lego_400 --downscale 2 --start random -o scene.sog --target-size 25KB --texture-mode rgba"),
        Table(["scene", "size", "seeds", "Gaussians without textures", "with", "without textures", "with", "gain [dB]",
               "base"], by_command(commanded)),
        *unrecorded(commanded),
        Heading("The files on the hull")]
    rows, pictures = [], []
    for scene in COUNTS:
        trained = all_trained(found, scene, SEEDS[0])
        if scene in FULL and not (SEEDS[0] in whole_seeds(found, scene, trained) and spread(found, scene, SEEDS[0])):
            continue  # of few counts: a gap would make the other arm look better
        plain, textured = (hull(points(found, scene, SEEDS[0], arm, trained)) for arm in (False, True))
        for size, psnr, name, file in textured:
            other = height(plain, size)
            rows.append([scene, f"{size / 1000:,.0f} kB", arm_of(name), texels_each(name, file), f"{file['steps']}",
                         f"{psnr:.2f}", "-" if other is None else f"{other:.2f}",
                         "-" if other is None else f"{psnr - other:+.2f}"])
        lines = [svg_plot.Line(label, style, [(size / 1000, psnr) for size, psnr, *_ in chain])
                 for (label, style), chain in zip(LINES, (plain, textured))]
        pictures.append(svg_plot.plot(scene, lines, "kB", "PSNR [dB]"))
    blocks += [Text("The files on the first seed's textured hull, as in the plot; the plain hull between its files at "
                    "the same bytes, \"-\" where it has none as large. Table and plot leave out -full scenes with "
                    f"fewer than {TEXTURED_COUNTS} counts with textures."),
               Table(["scene", "bytes", "with textures", "texels a Gaussian", "steps", "PSNR", "without textures",
                      "gain"], rows),
               Heading("When a texel pays"),
               Text("A texel costs what the file has more bytes than that of the same Gaussians, trained without "
                    "textures, at the same steps. It would pay at what more Gaussians cost that bring a plain file to "
                    "the same PSNR. Gain: over as many Gaussians [dB]; where stage 1 was trained again between two files "
                    "of one number, its results differ by up to 0.3 dB."),
               Table(["scene", "with textures", "steps", "gain", "costs [bytes]", "would pay at [bytes]"],
                     prices(found)),
               Heading("A frame at equal PSNR"),
               Text("Processor milliseconds a frame of the CPU renderer, from the first camera, with "
                    f"{FRAME_SCALE} times as many pixels a side as the photographs have at half size; models before "
                    "they are cut. Plain: of as many Gaussians without textures as come to the same PSNR, between the "
                    "counts that are there. Mean over seeds, the difference +- its 95 % confidence interval."),
               Table(["scene", "with textures", "seeds", "PSNR", "ms", "plain", "difference [%]"],
                     frame_times(found, frames_in(folder))),
               Heading("Every cell"),
               Table(["cell", "texels a Gaussian", "model", *(f"steps {steps}" for steps in STEPS),
                      *(f"trained for {steps}" for steps in TRAINED)],
                     [[f"`{name}`", texels_each(name, cell["model"]), f"{cell['model']['psnr']:.2f}",
                       *(f"{file['bytes'] / 1000:,.1f} kB, {file['psnr']:.2f}" for file in cell["files"]),
                       *([f"{file['bytes'] / 1000:,.1f} kB, {file['psnr']:.2f}" for file in cell["trained"]]
                         if "trained" in cell else ["-"] * len(TRAINED))]
                      for name, cell in found.items()])]
    every = [*found.values(), *commanded.values()]
    machines = sorted({machine_of(report) for report in every})
    blocks.append(Items(f"{name}; commits " + ", ".join(sorted({f"`{c['commit']}`" for c in every
                                                                if machine_of(c) == name})) for name in machines))
    page.write_text(markdown("The best picture per byte", blocks))
    picture.write_text(standalone(pictures))


def state_of(cell):
    report = read(cell.with_name(cell.name + ".json"))
    if not report:
        return "missing"
    return "done" if "trained" in report or is_command(report.get("cell", "")) else "cut only"


def scores_of(cell):
    """Of a command's file, or of the model of any other cell."""
    report = read(cell.with_name(cell.name + ".json"))
    scores = report.get("model", report)
    return f"{scores['psnr']:.2f} dB" if scores else "nothing yet"


def machine_of(report):
    return f"{report['machine']['processor']}, {report['machine']['cores']} cores"


def standalone(pictures):
    """The plots in rows and what their lines are, in one SVG for pages that show it as an image."""
    pictures = [picture for picture in pictures if picture]
    rows = math.ceil(len(pictures) / PLOTS_A_ROW)
    width, below = min(len(pictures), PLOTS_A_ROW) * svg_plot.WIDTH, rows * svg_plot.HEIGHT + 20
    style = svg_plot.STYLE + ":root { --text: #57606a; --rule: #c5cad1 }"
    insides = [picture[picture.index(">") + 1:-len("</svg>")] for picture in pictures]
    parts = [f'<g transform="translate({place % PLOTS_A_ROW * svg_plot.WIDTH} '
             f'{place // PLOTS_A_ROW * svg_plot.HEIGHT})">{inside}</g>' for place, inside in enumerate(insides)]
    for place, (label, line) in enumerate(LINES):
        left = svg_plot.LEFT + 150 * place
        parts.append(f'<path class="curve {line}" d="M{left} {below - 8}h24"/><text x="{left + 30}" y="{below - 4}">'
                     f"{label}</text>")
    return (f'<svg xmlns="http://www.w3.org/2000/svg" class="plot" viewBox="0 0 {width} {below}" width="{width}" '
            f'height="{below}"><style>{style}</style>{"".join(parts)}</svg>\n')


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=["run", "again", "frames", "list", "report"])
    parser.add_argument("--data", type=pathlib.Path, help="where the scenes' folders are")
    parser.add_argument("--work", type=pathlib.Path, help="where runs are kept")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin")
    parser.add_argument("--only", action="append", metavar="GLOB", help="these cells")
    parser.add_argument("--threads", type=int, default=1, help="of a cell")
    parser.add_argument("--jobs", type=int, default=1, help="cells at a time")
    parser.add_argument("--cells", type=pathlib.Path, default=CELLS, help="of the report; in another folder they "
                        "are made again, from runs that WORK has")
    parser.add_argument("--page", type=pathlib.Path, default=PAGE)
    parser.add_argument("--picture", type=pathlib.Path, default=PICTURE)
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda", "auto"])
    parser.add_argument("--cut", action="store_true", help="no files that are trained for")
    options = parser.parse_args()
    if options.verb == "report":
        report(options.cells, options.page, options.picture)
        return
    names = cells() if options.verb in ("again", "frames") else [*cells(), *commands()]
    chosen = [name for name in names if any(fnmatch.fnmatch(name, glob) for glob in options.only or ["*"])]
    if not chosen:
        parser.error(f"no cell is named {' or '.join(options.only)} (see list)")
    if options.verb == "list":
        for name in chosen:
            print(f"{state_of(options.cells / name):8} {name}")
        return
    if not options.work or (options.verb in ("run", "again") and not options.data):
        parser.error("expected " + ("--work" if options.verb == "frames" else "--data and --work"))
    driver = Driver(options)
    if options.verb == "frames":
        for name in chosen:
            driver.frames(name)
        return
    side_by_side(driver.again if options.verb == "again" else driver.run, chosen, options.jobs)
    if options.cells.resolve() != CELLS:
        for name in chosen:
            print(f"{name}: {scores_of(options.cells / name)} (expected about {scores_of(CELLS / name)})")


if __name__ == "__main__":
    main()

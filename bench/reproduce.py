#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Trains what a reader asks for before "this reproduces the paper", one cell after the other.

    bench/reproduce.py run    --data DATA --work WORK [--only GLOB]...
    bench/reproduce.py frames --work WORK [--only GLOB]...      processor milliseconds a frame of what is done
    bench/reproduce.py grazing --work WORK                      pictures at flat angles, by what lies beyond +-3 sigma
    bench/reproduce.py list   [--only GLOB]...            every cell, and whether it is done
    bench/report.py [--work WORK]                         docs/results.md and WORK/results.html from the cells

A cell is one training and its evaluation; SCENE/SHARE/TEXTURES/SEED on the test views, choice/... on every 8th of the
training views. One that is done leaves docs/lab/trials/CELL.json. A call runs what is missing, in order, and may be
stopped at any moment: WORK keeps the run folders, and the same call goes on. --jobs N runs N cells at a time: small
scenes leave a GPU room for others. Two calls may share WORK: what one of them is at, the other waits for. DATA holds
the scene folders named below. --iterations and --downscale make smaller trials, for trying the driver, and write them to
WORK/trials instead.
"""
import argparse
import concurrent.futures
import contextlib
import fcntl
import fnmatch
import functools
import json
import os
import pathlib
import platform
import shutil
import subprocess
import sys
import threading

ROOT = pathlib.Path(__file__).resolve().parent.parent
TRIALS = ROOT / "docs/lab/trials"


class Scene:
    def __init__(self, folder, downscale, *flags):
        self.folder, self.downscale, self.flags = folder, downscale, flags


# Random points are the published start of NeRF-synthetic scenes. All but the anchor at half their folder's size.
SCENES = {
    "lego800": Scene("lego", 1, "--start", "random"),
    "fox": Scene("fox_270", 2),
    "lego": Scene("lego_400", 2, "--start", "random"),
    "printshop": Scene("printshop", 2),
    "fern": Scene("fern_504", 2),
}
COMPARED = ["fox", "lego", "printshop"]
LENGTH = 7000  # iterations of either stage
TIE = 0.05  # [dB]
SHARES = [1, 2, 5, 10, 20, 50, 100]  # [%] of the Gaussians, Table A.3
FRAMES = 50  # that are timed
CHECKPOINTS = {"cpu": 300, "cuda": LENGTH, "auto": 300}  # [iterations]; a stage of a small scene takes a GPU a minute
TREATMENTS = ["base", "clip", "edge"]  # of what lies beyond +-3 sigma, Figure A.3
GRAZING_CELL = "printshop/001/rgba/1"
GRAZING_ANGLES = [80, 85, 88]  # [degrees] from the vertical
KEY_SHARES = [1, 20, 100]
KINDS = ["alpha", "rgb", "rgba"]
KIND_SHARES = [1, 100]  # Table A.4
SIZES = [2, 5, 10, 20, 30]  # Figure A.5: texels a side at 1 %; the sixth, 40, is what 1 % leads to
SMALL_SHARES = [1, 5, 20]  # Figure A.6: 4 x 4 texels, which are what 100 % leads to
SEEDS = [1, 2, 3]
DEFAULT_SIZE = "-default"  # label of cells whose textures are as large as the training views allow
PAPER_TEXELS = ["--texture-init", "paper", "--rate-texels", "0.001", "--rate-texels-end", "0.001"]
SWAPPED = ["--limit-by", "swap"]  # how the cells keep their shares, whatever the default
# What is tried instead of SWAPPED and the other defaults. A stage-1 choice runs without textures, a stage-2 choice with
# 4 x 4 texels from SWAPPED's stage 1, but for that of MERGED.
MERGED = "limit-merge"
STAGE_1_CHOICES = {
    "limit-room": ["--limit-by", "room"],
    MERGED: ["--limit-by", "merge"],
    "mcmc": ["--densification", "mcmc"],
    "rates-3dgs": [*SWAPPED, "--rate-position", "1.6e-4", "--rate-position-end", "1.6e-6", "--rate-scale", "0.005",
                   "--rate-sh-rest", "1.25e-4"],
}
STAGE_2_CHOICES = {
    "default": ["--compare-untextured"],
    "position-1.6e-4": ["--rate-position-texture", "1.6e-4"],
    "texels-2.5e-3": ["--rate-texels", "2.5e-3", "--rate-texels-end", "2.5e-3"],
    "decay-0.3": ["--texel-decay", "0.3"],
    "sh-rest-2.5e-5": ["--rate-sh-rest", "2.5e-5"],  # the starts have learnt at 5e-4
}


class Cell:
    """flags: of tgtrain. start: the cell whose model stage 2 begins with. count: the cell whose Gaussians are 100 %.
    choice: made on the validation views, and not evaluated further. picture: of the first test view, for the report."""

    def __init__(self, name, scene, flags, start=None, count=None, choice=False, picture=False):
        self.name, self.scene, self.flags, self.start, self.count = name, SCENES[scene], flags, start, count
        self.choice, self.picture = choice, picture


def cells(length):
    """Every cell by name, those that others begin with first."""
    table = {}

    def add(name, *rest, **more):
        if name not in table:
            table[name] = Cell(name, *rest, **more)
        return name

    def flags_of(first, second, seed):
        return ["--iterations", str(first), "--texture-iterations", str(second), "--seed", str(seed)]

    def plain(scene, share, seed):
        name, flags = f"{scene}/{share:03}/none/{seed}", [*flags_of(length, 0, seed), "--texture-mode", "none"]
        if share == 100:
            return add(name, scene, flags, picture=seed == 1)
        return add(name, scene, [*flags, "--percent", str(share), *SWAPPED], count=plain(scene, 100, 1), picture=seed == 1)

    def textured(scene, share, kind, seed, size=None, extra=(), label=""):
        flags = [*flags_of(0, length, seed), "--texture-mode", kind, "--percent", str(share), *extra]
        if size:
            flags += ["--texture-size", str(size)]
            label = f"-{size}"
        elif label != DEFAULT_SIZE:
            flags += ["--pixels-per-texel", "0"]  # the paper's number of texels, however few the pixels
            if kind == "rgba" and not extra:
                flags.append("--compare-untextured")
        return add(f"{scene}/{share:03}/{kind}{label}/{seed}", scene, flags, start=plain(scene, share, seed),
                   count=plain(scene, 100, 1), picture=seed == 1 and not size)

    def plain_choice(scene, share, choice, extra, seed):
        whole = f"choice/{scene}/100/none/1"
        name, flags = f"choice/{scene}/{share:03}/{choice}/{seed}", [*flags_of(length, 0, seed), "--texture-mode", "none"]
        if share == 100:
            return add(name, scene, [*flags, *extra], choice=True)
        plain_choice(scene, 100, "none", [], 1)
        return add(name, scene, [*flags, "--percent", str(share), *extra], count=whole, choice=True)

    def choices(scene, share, seed):
        start = plain_choice(scene, share, "none", SWAPPED if share < 100 else [], seed)

        def textured_choice(choice, extra, start):
            add(f"choice/{scene}/{share:03}/rgba-{choice}/{seed}", scene,
                [*flags_of(0, length, seed), "--percent", str(share), "--texture-size", "4", *extra], start=start,
                count=f"choice/{scene}/100/none/1", choice=True)

        if share < 100:
            for choice, extra in STAGE_1_CHOICES.items():
                plain_choice(scene, share, choice, extra, seed)
            textured_choice(MERGED, STAGE_2_CHOICES["default"], f"choice/{scene}/{share:03}/{MERGED}/{seed}")
        for choice, extra in STAGE_2_CHOICES.items():
            textured_choice(choice, extra, start)

    # R1, the anchor.
    anchor = ["--preset", "paper", "--seed", "1"]
    start = add("lego800/paper/none/1", "lego800", [*anchor, "--texture-iterations", "0", "--texture-mode", "none"])
    add("lego800/paper/rgba/1", "lego800", [*anchor, "--iterations", "0", "--compare-untextured"], start=start)
    for scene in COMPARED:
        for share in SHARES:  # R2, Table A.3
            textured(scene, share, "rgba", 1)
        for share in KIND_SHARES:  # R3, Table A.4, and the same with the paper's texels
            for kind in KINDS:
                textured(scene, share, kind, 1)
                textured(scene, share, kind, 1, extra=PAPER_TEXELS, label="-paper")
        for size in SIZES:  # R4, Figure A.5
            textured(scene, 1, "rgba", 1, size=size)
        for share in SMALL_SHARES:  # R5, Figure A.6
            textured(scene, share, "rgba", 1, size=4)
    for scene in COMPARED:
        for share in SHARES:
            textured(scene, share, "rgba", 1, label=DEFAULT_SIZE)
    for seed in SEEDS[1:]:  # R6, the spread
        for scene in COMPARED:
            for share in KEY_SHARES:
                textured(scene, share, "rgba", seed)
            for kind in KINDS[:-1]:  # which of the two is ahead
                textured(scene, KIND_SHARES[0], kind, seed)
                textured(scene, KIND_SHARES[0], kind, seed, extra=PAPER_TEXELS, label="-paper")
    for share in KEY_SHARES:  # R8, a scene without bounds
        textured("fern", share, "rgba", 1)
    for seed in SEEDS:
        for scene in COMPARED:
            for share in KEY_SHARES:
                choices(scene, share, seed)
    return table


STOPPING = threading.Event()  # nobody waits for another call any more


def side_by_side(run, names, jobs):
    """Runs every name, so many at a time, those after one that fails as well. Exits where one failed."""
    failures = set()

    def attempt(name):
        try:
            run(name)
        except (Exception, SystemExit) as error:
            failures.add(name)
            print(f"{name}: {error}", file=sys.stderr, flush=True)

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        try:
            for done in [pool.submit(attempt, name) for name in names]:
                done.result()
        except BaseException:
            STOPPING.set()
            pool.shutdown(cancel_futures=True)
            raise
    if failures:
        sys.exit(f"{len(failures)} of {len(names)} failed: {', '.join(name for name in names if name in failures)}")


@contextlib.contextmanager
def held(file):
    """Holds a file, or a folder, against other processes that do so, too."""
    handle = os.open(file, os.O_RDONLY | (0 if file.is_dir() else os.O_CREAT), 0o666)
    try:
        while True:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
                break
            except BlockingIOError:
                if STOPPING.wait(0.2):
                    raise KeyboardInterrupt from None
        yield
    finally:
        os.close(handle)


class Lock:
    """Of one thread of all processes that name the same file, as often as it likes."""

    def __init__(self, file):
        self.file, self.threads, self.depth = file, threading.RLock(), 0

    def __enter__(self):
        self.threads.acquire()
        try:
            if not self.depth:
                self.file.parent.mkdir(parents=True, exist_ok=True)
                self.held = held(self.file)
                self.held.__enter__()
            self.depth += 1
        except BaseException:
            self.threads.release()
            raise

    def __exit__(self, *_):
        self.depth -= 1
        if not self.depth:
            self.held.__exit__(None, None, None)
        self.threads.release()


class Locks:
    """A lock a name, WORK/NAME.lock: what several cells begin with is trained by one of them, and the others wait, also
    those of another call. What failed is not tried again for them."""

    def __init__(self, work):
        self.work, self.guard, self.locks, self.failed = work, threading.Lock(), {}, {}

    def __getitem__(self, name):
        with self.guard:
            return self.locks.setdefault(name, Lock(self.work / f"{name}.lock"))


def alone(method):
    """A method of what has `locks`, for one name not twice at a time."""
    @functools.wraps(method)
    def guarded(self, name, *rest):
        with self.locks[name]:
            if name in self.locks.failed:
                raise self.locks.failed[name]
            try:
                return method(self, name, *rest)
            except (Exception, SystemExit) as error:
                self.locks.failed[name] = error
                raise

    return guarded


class Driver:
    def __init__(self, options):
        self.options, self.locks = options, Locks(options.work)
        whole = options.iterations == LENGTH and options.downscale == 1
        self.trials = options.trials if whole else options.work / "trials"
        self.cells = cells(options.iterations)

    def report(self, name):
        path = self.trials / f"{name}.json"
        return json.loads(path.read_text()) if path.exists() else None

    def published(self, name):
        """The report of the project's own cell, of as many iterations and pixels."""
        path = TRIALS / f"{name}.json"
        whole = self.options.iterations == LENGTH and self.options.downscale == 1
        return json.loads(path.read_text()) if whole and path.exists() else None

    def chosen(self):
        only = self.options.only or ["*"]
        return [name for name in self.cells if any(fnmatch.fnmatch(name, pattern) for pattern in only)]

    @alone
    def run(self, name):
        """The cell's report; runs it, and what it needs, where that is missing."""
        report = self.report(name)
        if report:
            print(f"{name}: done already (expected --trials FOLDER and a WORK of its own to train it again)",
                  file=sys.stderr)
        return report or self.write(name, self.train(name))

    @alone
    def train(self, name):
        """The cell's run folder; trains it, and what it begins with, where WORK does not have it."""
        cell = self.cells[name]
        run = self.options.work / name
        if (run / "done").exists():
            return run
        flags = [*(() if cell.start else cell.scene.flags), *cell.flags]  # how to begin, unless with a model
        if cell.count:
            flags += ["--default-gaussians", self.whole(name)]
        if cell.start:
            flags += ["--start-model", self.start(cell.start) / "model.tgz"]
        if cell.picture:
            flags += ["--preview-every", self.options.iterations]
        if "--compare-untextured" in flags:
            flags += ["--untextured-output", run / "untextured.tgz"]
        if cell.choice:
            flags.append("--validation")
        print(name, file=sys.stderr, flush=True)
        run.parent.mkdir(parents=True, exist_ok=True)
        begun = commit()
        self.call(cell, "tgtrain", "--device", self.options.device, "--run", run, "--resume", "-q",
                  "--metrics-every", "0", "--checkpoint-every", CHECKPOINTS[self.options.device], *flags)
        write_text(run / "done", begun)
        return run

    def whole(self, name):
        """How many Gaussians are 100 %: what a report says that is there, the cell's own or of what it begins with."""
        cell = self.cells[name]
        for done in filter(None, (self.report(name), cell.start and self.report(cell.start), self.published(name))):
            if done["training"]["settings"]["default-gaussians"]:
                return done["training"]["settings"]["default-gaussians"]
        return self.run(cell.count)["training"]["gaussians"]

    @alone
    def start(self, name):
        """The run folder of a cell that another begins with; one that is trained once more must score as its report."""
        run, done = self.train(name), self.report(name)
        if not done:
            self.write(name, run)
        elif "evaluation" in done:
            now, then = self.evaluate(self.cells[name], run / "model.tgz")["psnr"], done["evaluation"]["psnr"]
            if abs(now - then) > TIE:
                sys.exit(f"{self.trials / name}.json: trained once more it scores {now:.2f} dB (expected {then:.2f}): "
                         "remove it to go on from the new one")
        return run

    def write(self, name, run):
        cell = self.cells[name]
        trained_by = (run / "done").read_text()
        if not trained_by:
            sys.exit(f"{run / 'done'}: empty (expected the commit that trained it: write it, or remove the folder)")
        training = json.loads(subprocess.run(["tar", "xzOf", run / "model.tgz", "training.json"], check=True,
                                             capture_output=True).stdout)
        report = {"cell": name, "commit": trained_by, "machine": machine(), "training": training}
        if not cell.choice:
            report["evaluation"] = self.evaluate(cell, run / "model.tgz")
        if "--compare-untextured" in cell.flags and not cell.choice:
            report["untextured"] = self.evaluate(cell, run / "untextured.tgz")
            report["outside"] = {}
            for treatment in TREATMENTS[1:]:
                scores = self.evaluate(cell, run / "model.tgz", "--outside", treatment)
                report["outside"][treatment] = {metric: scores[metric] for metric in ("psnr", "ssim", "flip")}
        path = self.trials / f"{name}.json"
        if cell.picture:
            path.parent.mkdir(parents=True, exist_ok=True)
            stage = "textured" if cell.start else "plain"
            shutil.copyfile(run / f"previews/{stage}_{self.options.iterations:07}.png", path.with_suffix(".png"))
        write(path, report)
        return report

    def evaluate(self, cell, model, *more):
        scores = model.with_suffix(".eval.json")
        weights = ["--lpips", self.options.lpips] if self.options.lpips else []
        more = more or ["--effective-rank"]
        self.call(cell, "tgeval", "--json", scores, "--overwrite", *weights, *more, before=[model])
        report = json.loads(scores.read_text())
        del report["views"]
        return report

    @alone
    def frames(self, name):
        """Times the cell's model from its first camera; docs/lab/trials/frames.json holds what was timed."""
        run = self.options.work / name
        model, scores = run / "model.tgz", run / "frames.json"
        if not model.exists() or name in frames_in(self.trials):
            return
        print(name, file=sys.stderr, flush=True)
        command = [self.options.bin / "render_bench", model, "--backend", "cpu", "--threads", self.options.threads,
                   "--frames", FRAMES, "--frames-only", "--json", scores]
        subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
        measured = json.loads(scores.read_text())
        frame = {"ms": measured["processor_ms"], **{key: measured[key] for key in ("device", "width", "height")}}
        add_frame(self.trials, name, frame)

    def grazing(self):
        model = self.options.work / GRAZING_CELL / "model.tgz"
        folder = self.trials / "grazing"
        for angle in GRAZING_ANGLES:
            for treatment in TREATMENTS:
                frames = self.options.work / "grazing"
                shutil.rmtree(frames, ignore_errors=True)
                command = [self.options.bin / "tgview", model, "--backend", "cpu", "--turntable", 1, "--elevation",
                           90 - angle, "--size", "320x160", "--outside", treatment, "-o", frames]
                subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
                folder.mkdir(parents=True, exist_ok=True)
                shutil.copyfile(frames / "0000.png", folder / f"{angle}-{treatment}.png")

    def call(self, cell, program, *arguments, before=()):
        command = [self.options.bin / program, *before, self.options.data / cell.scene.folder, "--downscale",
                   cell.scene.downscale * self.options.downscale, "--threads", self.options.threads, *arguments]
        subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)


def write(path, report):
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, json.dumps(report, indent=1) + "\n")


def write_text(path, text):
    """Whole or not at all."""
    partial = path.with_suffix(".partial")
    partial.write_text(text)
    os.replace(partial, path)


def frames_in(folder):
    path = folder / "frames.json"
    return json.loads(path.read_text()) if path.exists() else {}


def add_frame(folder, name, frame):
    """To the folder's frames.json, to which others may add theirs."""
    folder.mkdir(parents=True, exist_ok=True)
    with held(folder):
        write(folder / "frames.json", {**frames_in(folder), name: frame})


def score_of(report):
    """On the views that the cell is scored on, after its last stage."""
    if not report:
        return "nothing yet"
    stages = report["training"]["stages"]
    last = stages.get("textured") or stages["plain"]
    return f"{(report.get('evaluation') or {'psnr': last['test_psnr']})['psnr']:.2f} dB"


def commit():
    """Of the tree; "+" where what is trained and written with was changed since."""
    git = ["git", "-C", ROOT]
    head = subprocess.run([*git, "rev-parse", "--short", "HEAD"], check=True, capture_output=True, text=True)
    changed = subprocess.run([*git, "diff", "--quiet", "HEAD", "--", "core", "render", "training", "shaders",
                              "converter"])
    return head.stdout.strip() + ("+" if changed.returncode else "")


def machine():
    names = [line.split(":")[1].strip() for line in pathlib.Path("/proc/cpuinfo").read_text().splitlines()
             if line.startswith("model name")]
    return {"processor": names[0] if names else platform.machine(), "cores": os.cpu_count()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("verb", choices=["run", "frames", "grazing", "list"])
    parser.add_argument("--data", type=pathlib.Path, help="where the scenes' folders are")
    parser.add_argument("--work", type=pathlib.Path, help="where runs are kept")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build/bin")
    parser.add_argument("--only", action="append", metavar="GLOB", help="these cells")
    parser.add_argument("--threads", type=int, default=1, help="of a cell")
    parser.add_argument("--jobs", type=int, default=1, help="cells at a time")
    parser.add_argument("--device", default="cpu", choices=["cpu", "cuda", "auto"])
    parser.add_argument("--lpips", type=pathlib.Path, help="weights for tgeval")
    parser.add_argument("--trials", type=pathlib.Path, default=TRIALS,
                        help="where reports are; in another folder cells are made again, from runs that WORK has")
    parser.add_argument("--iterations", type=int, default=LENGTH)
    parser.add_argument("--downscale", type=int, default=1, help="beyond the scenes' own")
    options = parser.parse_args()
    if not options.work and (options.verb != "list" or options.iterations != LENGTH or options.downscale != 1):
        parser.error("expected --work")
    driver = Driver(options)
    chosen = driver.chosen()
    if not chosen:
        parser.error(f"no cell is named {' or '.join(options.only)} (see list)")
    if options.verb == "list":
        for name in chosen:
            print("done   " if driver.report(name) else "missing", name)
        return
    if options.verb == "grazing":
        driver.grazing()
        return
    if options.verb == "frames":
        for name in chosen:
            driver.frames(name)
        return
    if not options.data:
        parser.error("expected --data")
    side_by_side(driver.run, chosen, options.jobs)
    if options.trials.resolve() != TRIALS:
        for name in chosen:
            print(f"{name}: {score_of(driver.report(name))} (expected about {score_of(driver.published(name))})")


if __name__ == "__main__":
    main()

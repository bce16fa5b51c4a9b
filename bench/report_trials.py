# SPDX-License-Identifier: Apache-2.0
"""What bench/reproduce.py left of its cells: read, checked, and as text."""
import json
import math
import statistics

from reproduce import LENGTH, SCENES, SHARES, SMALL_SHARES, cells

METRICS = {"psnr": ("PSNR", 2), "ssim": ("SSIM", 4), "flip": ("FLIP", 3), "lpips": ("LPIPS", 3)}
LABELS = {"none": "none", "alpha": "alpha", "rgb": "RGB", "rgba": "RGBA"}
# What a cell's report must hold.
NUMBER = (int, float)
TRAINED = {
    "commit": str, "machine.processor": str, "machine.cores": NUMBER, "training.dataset.name": str,
    "training.dataset.width": NUMBER, "training.dataset.height": NUMBER, "training.dataset.train_views": NUMBER,
    "training.dataset.test_views": NUMBER, "training.gaussians": NUMBER, "training.texels": NUMBER,
    "training.machine.device": str, "training.machine.peak_memory_bytes": NUMBER,
}
STAGE = {"iterations": NUMBER, "seconds": NUMBER, "test_psnr": NUMBER}
EVALUATED = {
    "psnr": NUMBER, "ssim": NUMBER, "gaussians": NUMBER, "parameters": NUMBER, "bytes": NUMBER,
    "effective_rank.mean": NUMBER, "effective_rank.needle": NUMBER, "effective_rank.flat": NUMBER,
    "effective_rank.round": NUMBER, "effective_rank.first": NUMBER, "effective_rank.bin_width": NUMBER,
    "effective_rank.bins": list,
}
WORDS = {NUMBER: "a number", str: "a text", list: "a list"}


# Student's t, two-sided at 95 %, by degrees of freedom; of more it is the last one's.
STUDENT = [12.71, 4.30, 3.18, 2.78, 2.57, 2.45, 2.36, 2.31, 2.26, 2.23, 2.20, 2.18, 2.16, 2.14, 2.13, 2.12, 2.11, 2.10,
           2.09, 2.09]


def student(freedom):
    return STUDENT[min(freedom, len(STUDENT)) - 1]


class Broken(Exception):
    """Its text says which file, and what is wrong with it."""


class Trials:
    """What is done of the driver's cells. Reading one notes that it was asked for."""

    def __init__(self, folder):
        self.folder, self.cells = folder, cells(LENGTH)
        self.scenes = [scene for scene in SCENES if self.shares(scene)]
        self.asked = set()
        self.done, wrong = {}, []
        for path in sorted(folder.rglob("*.json")):
            name = path.relative_to(folder).with_suffix("").as_posix()
            try:
                report = parsed(path)
                if name == "frames":
                    check_frames(report, self.cells, "bench/reproduce.py")
                else:
                    self.done[name] = self.checked(name, report)
            except Broken as problem:
                wrong.append(f"{path}: {problem}")
        if wrong:
            raise Broken("\n".join(wrong))
        frames = folder / "frames.json"
        self.frames = parsed(frames) if frames.exists() else {}

    def checked(self, name, report):
        if name not in self.cells:
            raise Broken("no cell of bench/reproduce.py has this name")
        cell = self.cells[name]
        parts = {"": TRAINED, f"training.stages.{'textured' if cell.start else 'plain'}.": STAGE}
        if not cell.choice:
            parts["evaluation."] = EVALUATED
            if "--compare-untextured" in cell.flags:
                parts |= {"training.stages.untextured.": STAGE, "untextured.": EVALUATED}
        for part, places in parts.items():
            require(report, places, part)
        check_name(report, name)
        if any(at(report, part, "interrupted") for part in ("training", "evaluation", "untextured")):
            raise Broken("the run was interrupted")
        return report

    def get(self, name):
        assert name in self.cells, name
        self.asked.add(name)
        return self.done.get(name)

    def trained(self, scene, share, kind, seed=1):
        return self.get(f"{scene}/{share:03}/{kind}/{seed}")

    def shares(self, scene):
        return [share for share in SHARES if f"{scene}/{share:03}/rgba/1" in self.cells]


def require(report, places, part=""):
    """That something of its kind lies at each of the places, {keys with dots between: kind}, all of them under part."""
    for place, kind in places.items():
        value = at(report, *(part + place).split("."))
        if not isinstance(value, kind) or isinstance(value, bool) or kind is NUMBER and not math.isfinite(value):
            raise Broken(f"{part}{place} is {json.dumps(value)} (expected {WORDS[kind]})")
        if value == "":
            raise Broken(f"{part}{place} is empty")


def check_name(report, name):
    if at(report, "cell") != name:
        raise Broken(f"cell is {json.dumps(at(report, 'cell'))} (expected the file's own, {name})")


def check_frames(frames, cells, driver):
    for name, frame in frames.items():
        if name not in cells:
            raise Broken(f"{name} is no cell of {driver}")
        if not isinstance(at(frame, "ms"), NUMBER) or not isinstance(at(frame, "device"), str):
            raise Broken(f"{name} lacks a number ms or a text device")


def parsed(path):
    try:
        report = json.loads(path.read_text())
    except ValueError as problem:
        raise Broken(f"is no JSON: {problem}") from None
    if not isinstance(report, dict):
        raise Broken("holds no object")
    return report


def at(report, *keys):
    """What lies at these keys, or None where one is missing."""
    for key in keys:
        report = report.get(key) if isinstance(report, dict) else None
    return report


# Scores are {metric: value}; an empty one is missing.
def score(report, *part):
    evaluation = at(report, *(part or ["evaluation"])) or {}
    return {metric: evaluation[metric] for metric in METRICS if metric in evaluation}


def twin(report):
    return score(report, "untextured")


def begun(report):
    """The score of stage 1 that a cell with textures began with: another machine's or recipe's is another."""
    plain = at(report, "training", "stages", "plain") or {}
    scores = {metric: plain.get(f"test_{metric}") for metric in ("psnr", "ssim")}
    return {} if None in scores.values() else scores


def gain(better, worse):
    return {metric: better[metric] - worse[metric] for metric in ("psnr", "ssim") if better and worse}


def mean(scores):
    """Of all, or of nothing where one is missing."""
    return {metric: statistics.fmean(s[metric] for s in scores) for metric in scores[0]} if all(scores) else {}


def published(pair):
    return dict(zip(("psnr", "ssim"), pair))


def number(value, digits=0):
    return "-" if value is None else f"{value:,.{digits}f}"


def signed(value, digits=2):
    return "-" if value is None else f"{round(value, digits) + 0.0:+.{digits}f}"  # no -0.00


def shown(values, metrics=("psnr", "ssim"), write=number):
    return " / ".join(write(values.get(m), METRICS[m][1]) for m in metrics) if values else "-"


def scaled(value, unit, digits):
    return number(None if value is None else value / unit, digits)


def percent(part):
    return "-" if part is None else f"{100 * part:.1f} %"


def couple(values, write):
    """"a / b", or one "-" where nothing is known."""
    texts = [write(value) for value in values]
    return " / ".join(texts) if any(text != "-" for text in texts) else "-"


def side(report):
    """Texels a side."""
    return number(math.sqrt(report["training"]["texels"] / report["training"]["gaussians"])) if report else "-"


def used_metrics(trials):
    return [m for m in METRICS if m in ("psnr", "ssim") or any(m in score(report) for report in trials.done.values())]


def small_kind(share):
    """The cells with 4 x 4 texels; at 100 % the fixed number of texels leads to them."""
    return "rgba-4" if share in SMALL_SHARES else "rgba"


def ranks_of(trials, scene, share):
    """After stage 1, of the twin and of RGBA."""
    textured = trials.trained(scene, share, "rgba")
    return [at(trials.trained(scene, share, "none"), "evaluation", "effective_rank"),
            at(textured, "untextured", "effective_rank"), at(textured, "evaluation", "effective_rank")]

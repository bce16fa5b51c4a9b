#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Tables and figures from the cells that bench/reproduce.py leaves, every number from their JSON.

    bench/report.py                      docs/results.md from docs/lab/trials
    bench/report.py --work WORK          and WORK/results.html: the same tables, with plots and pictures
    bench/report.py --trials DIR --again DIR --results FILE [--html FILE]

Beside the cells may lie frames.json, {"CELL": {"ms": milliseconds a frame, "device": what drew it}}, and the pictures
grazing/ANGLE-TREATMENT.png.
Numbers that others published stand in bench/paper_tables.py. A file that is no cell's report ends the call.
"""
import argparse
import collections
import math
import pathlib
import statistics
import sys

import paper_tables as paper
from report_document import Code, Heading, Items, Table, Text, markdown, page
from report_figures import (byte_figures, grazing_rows, pictures, rank_figures, share_figures, size_figures,
                            small_figures)
from report_trials import (LABELS, METRICS, Broken, Trials, at, begun, couple, gain, mean, number, percent, published,
                           ranks_of, scaled, score, shown, side, signed, small_kind, student, twin, used_metrics)
from reproduce import (COMPARED, DEFAULT_SIZE, KEY_SHARES, KIND_SHARES, KINDS, MERGED, ROOT, SCENES, SEEDS, SHARES, SIZES,
                       SMALL_SHARES, STAGE_1_CHOICES, STAGE_2_CHOICES, TIE, TREATMENTS, TRIALS)

OWN_SCENE = "printshop"  # of this project; the others are known to the field
UNDECIDED = 0.2  # dB; a wider interval around 0 shows no tie
SWAPPED_LABEL = "limit-swap"  # of the cells that nothing is changed in


def head(trials):
    done, every = trials.done, trials.cells
    blocks = [Text("A cell is one training and its evaluation. Stage 1 trains Gaussians without textures; stage 2 "
                   "gives textures to its result. The twin is stage 2 without textures: the same Gaussians, as many "
                   "iterations more. The share is of the Gaussians that stage 1 makes without a limit, and kept by "
                   "`--limit-by swap` where nothing else is said; the default is `merge` (\"Choices\"). Every share has "
                   "as many texels as 4 x 4 at 100 %, as in the paper's Table A.3. Scores are means over held-out "
                   f"views, PSNR on 8-bit values; {metric_names(trials)} where nothing else is said. \"-\": not done."),
              Text(f"{len(done)} of {len(every)} cells are done. One of them again:"),
              Code("bench/reproduce.py run --data DATA --work WORK --trials AGAIN --only lego/001/rgba/1")]
    weights = sorted({(report["evaluation"]["lpips_network"], report["evaluation"]["lpips_range"])
                      for report in done.values() if "lpips" in score(report)})
    if weights:
        blocks.append(Text("LPIPS: " + "; ".join(f"{network}, inputs in {span}" for network, span in weights) + "."))
    else:
        blocks.append(Text("LPIPS is not among the scores: no weights were at hand (`tgeval --lpips`). Of the paper's "
                           "scenes lego is the only one here; none is of DTU or of Mip-NeRF 360."))
    blocks.append(Table(["scene", "data set", "size", "views: train / test", "iterations of stage 1", "of stage 2",
                         "seeds", "cells"], [scene_row(trials, scene) for scene in SCENES]))
    machines = collections.defaultdict(collections.Counter)
    for report in done.values():
        machine = report["machine"]
        machines[f"{machine['processor']}, {machine['cores']} cores ({report['training']['machine']['device']})"][
            report["commit"]] += 1
    blocks.append(Items(f"{machine}: {sum(commits.values())} cells; commits "
                        + ", ".join(f"`{commit}` ({count})" for commit, count in sorted(commits.items()))
                        for machine, commits in sorted(machines.items())))
    return blocks


def scene_row(trials, scene):
    names = [name for name in trials.cells if name.removeprefix("choice/").split("/")[0] == scene]
    done = {name: trials.done[name]["training"] for name in names if name in trials.done}
    data = [training["dataset"] for training in done.values()]
    views = [f"{done[name]['dataset']['train_views']} / {done[name]['dataset']['test_views']}" for name in done
             if not trials.cells[name].choice]

    def iterations(stage):
        counts = {at(training, "stages", stage, "iterations") for training in done.values()} - {0, None}
        return listed(number(count) for count in sorted(counts))

    return [scene, listed(d["name"] for d in data), listed(f"{d['width']} x {d['height']}" for d in data),
            listed(views), iterations("plain"), iterations("textured"),
            listed(sorted(name.split("/")[-1] for name in done)), f"{len(done)} of {len(names)}"]


def listed(texts):
    """Each once."""
    return ", ".join(dict.fromkeys(texts)) or "-"


def metric_names(trials):
    return " / ".join(METRICS[metric][0] for metric in used_metrics(trials))


def anchor(trials):
    plain, textured = trials.get("lego800/paper/none/1"), trials.get("lego800/paper/rgba/1")
    metrics = used_metrics(trials)
    reference = paper.LEGO_800[0][1]

    def row(label, report, part, stage):
        scores = score(report, part)
        return [label, shown(scores, metrics), signed(scores["psnr"] - reference) if scores else "-",
                number(at(report, part, "gaussians")),
                scaled(at(report, "training", "stages", stage, "seconds"), 60, 1),
                scaled(at(report, "training", "machine", "peak_memory_bytes"), 1e9, 2)]

    rows = [row("stage 1", plain, "evaluation", "plain"), row("twin", textured, "untextured", "untextured"),
            row("RGBA 4 x 4", textured, "evaluation", "textured")]
    rows += [[what, number(psnr, 2), signed(psnr - reference), number(count), "", ""]
             for what, psnr, count in paper.LEGO_800]
    yield Text("lego at 800 x 800 from 100,000 random points, `--preset paper`, without a limit. Twin and textures "
               "train in one process, whose peak of memory both rows have.")
    yield Table(["", metric_names(trials), "beside the published [dB]", "Gaussians", "minutes", "peak memory [GB]"],
                rows)
    yield Text("3DGS draws a projected ellipse, widened by 0.3 px^2. 3DGUT and 3DGRT take a Gaussian where its response "
               "along the pixel's ray is largest, and widen nothing, as is done here: of the published figures theirs "
               "are the ones to compare with. 3DGUT densifies as 3DGS does, every 300 iterations instead of 100.")


def shares(trials):
    metrics = used_metrics(trials)
    rows, over_stage_1, over_twin = [], {}, {}
    for scene in trials.scenes:
        for share in trials.shares(scene):
            plain, textured = trials.trained(scene, share, "none"), trials.trained(scene, share, "rgba")
            none, more, rgba = score(plain), twin(textured), score(textured)
            over_stage_1[scene, share], over_twin[scene, share] = gain(rgba, begun(textured) or none), gain(rgba, more)
            mark = other_start(textured, none)
            rows.append([f"{scene} {share} %{older(plain)}", number(at(plain, "evaluation", "gaussians")),
                         pixels_each(plain, "gaussians"), side(textured), pixels_each(textured, "texels"),
                         shown(none, metrics), *(shown(s, metrics) + mark for s in (more, rgba)),
                         *(shown(gains[scene, share], write=signed) for gains in (over_stage_1, over_twin))])
    found = [scene for scene in COMPARED if scene != OWN_SCENE]
    mixed = f" {OLDER}" if any(row[0].endswith(OLDER_MARK) for row in rows) else ""
    yield Text(f"PSNR / SSIM that RGBA gains, means of {', '.join(COMPARED)}; the paper's gains are over stage 1. That is "
               f"the one that a cell began with, which may have been trained again since. {OTHER_START}{mixed}")
    yield Table(["share", "over stage 1", "over the twin", f"over stage 1, {' and '.join(found)} alone",
                 *(f"paper, {name}" for name in paper.SHARES)],
                [[f"{share} %", *(shown(mean([gains[scene, share] for scene in scenes]), write=signed)
                                  for gains, scenes in ((over_stage_1, COMPARED), (over_twin, COMPARED),
                                                        (over_stage_1, found))),
                  *(shown(gain(published(table[share][1]), published(table[share][0])), write=signed)
                    for table in paper.SHARES.values())]
                 for share in SHARES])
    yield Text(f"{OWN_SCENE} was rendered for this project, of printed matter, which textures suit: it carries the means. "
               "Why the others gain more at 1 and 2 % than the paper's scenes is not known; it is not that pictures are "
               "smaller here ([lab/quality.md](lab/quality.md#what-a-limit-needs)).")
    start, more = (gain_deviations(trials, over) for over in ("start", "twin"))
    yield Text(f"RGBA is ahead of stage 1 by more than {TIE} dB in {wins(over_stage_1)} cells, of the twin in "
               f"{wins(over_twin)}. It is behind stage 1 by more than {TIE} dB in {losses(over_stage_1)}; behind the twin "
               f"in {losses(over_twin)}.")
    if start:
        deviations = ", ".join(f"{scene} {start[scene]:.2f} and {more[scene]:.2f}" for scene in start)
        yield Text(f"Over seeds such gains have a standard deviation, pooled over shares, of [dB]: {deviations}. RGBA is "
                   f"ahead of stage 1 by more than two of them in {wins(over_stage_1, start)} cells, of the twin in "
                   f"{wins(over_twin, more)}.")
    yield Table(["", "Gaussians", "pixels a Gaussian", "texels a side", "pixels a texel",
                 "stage 1", "twin", "RGBA", "gain over stage 1",
                 "gain over the twin"], rows)


def default_sizes(trials):
    rows, over_twin = [], {}
    for scene in COMPARED:
        for share in SHARES:
            paper_size, own = trials.trained(scene, share, "rgba"), trials.trained(scene, share, f"rgba{DEFAULT_SIZE}")
            more, rgba = twin(paper_size), score(own)
            over_twin[scene, share] = gain(rgba, more)
            rows.append([f"{scene} {share} %", side(own), pixels_each(own, "texels"), shown(more),
                         shown(score(paper_size)), shown(rgba) + other_start(own, begun(paper_size)),
                         shown(over_twin[scene, share], write=signed)])
    yield Text("Textures as large as the training views have pixels for (`--pixels-per-texel`), which is what tgtrain "
               "makes where nobody names a size; beside the paper's number of texels. PSNR / SSIM. (*): began with "
               f"another stage 1 than the row's other textures, by more than {TIE} dB.")
    yield Text(f"RGBA is ahead of the twin by more than {TIE} dB in {wins(over_twin)} cells, behind it in "
               f"{losses(over_twin)}.")
    yield Table(["", "texels a side", "pixels a texel", "twin", "RGBA, the paper's number", "RGBA, default",
                 "its gain over the twin"], rows)


OTHER_START = f"(*): began with another stage 1 than the row's, by more than {TIE} dB."
OLDER_MARK = " (o)"
OLDER = ("(o): stage 1 is of an older recipe, which removed no wide Gaussians (--wide-sigma) and took the "
         "scene's extent otherwise (--extent-distances).")


def older(report):
    """The mark of a cell whose stage 1 knew no --wide-sigma and no --extent-distances."""
    settings = at(report, "training", "settings")
    return OLDER_MARK if settings and "extent-distances" not in settings else ""


def other_start(report, stage_1):
    """The mark of a cell that began with another stage 1 than this score."""
    scores = [begun(report).get("psnr"), stage_1.get("psnr")]
    return "" if None in scores or abs(scores[0] - scores[1]) <= TIE else " (*)"


def pixels_each(report, of):
    """Training pixels for each of what `of` counts: what there is to learn it from."""
    data = at(report, "training", "dataset")
    if not data:
        return "-"
    each = data["train_views"] * data["width"] * data["height"] / report["training"][of]
    return number(each, 0 if each >= 10 else 1)


def wins(gains, deviations=None):
    """How many of {(scene, share): gain} are above TIE, or two of the scene's deviations where those are given."""
    known = {where: g["psnr"] for where, g in gains.items() if g}
    if deviations is not None:
        known = {where: value for where, value in known.items() if where[0] in deviations}
    ahead = sum(value > (TIE if deviations is None else 2 * deviations[where[0]]) for where, value in known.items())
    return f"{ahead} of {len(known)}"


def losses(gains):
    behind = [f"{scene} {share} % ({signed(g['psnr'])})" for (scene, share), g in gains.items() if g and g["psnr"] < -TIE]
    return ", ".join(behind) or "none"


def gain_deviations(trials, over):
    """By scene: the standard deviation over seeds of what RGBA gains over its start or its twin, pooled over shares."""
    found = {}
    for scene in COMPARED:
        shares = [same_recipe(trials.done.get(f"{scene}/{share:03}/rgba/{seed}") for seed in SEEDS)
                  for share in KEY_SHARES]
        deviation, freedom = pooled([gain(score(cell), twin(cell) if over == "twin" else begun(cell))["psnr"]
                                     for cell in cells if begun(cell)] for cells in shares)
        if freedom:
            found[scene] = deviation
    return found


def same_recipe(reports):
    """Those of the reports that are there, of the newest recipe and share of one count among them."""
    def recipe(report):
        return (older(report) == "", at(report, "training", "settings", "default-gaussians") or 0)

    known = [report for report in reports if report]
    newest = max(map(recipe, known), default=None)
    return [report for report in known if recipe(report) == newest]


def kinds(trials):
    def row(label, texels, none, scores):
        gains = [gain(scores[kind], none).get("psnr") for kind in KINDS]
        whole = gains[-1]
        parts = [None if g is None or whole is None or whole < TIE else 100 * g / whole for g in gains[:-1]]
        return [label, texels, shown(none), *(shown(scores[kind]) for kind in KINDS),
                couple(parts, lambda part: "-" if part is None else f"{part:.0f} %")]

    rows, ahead = [], {"": [], "-paper": []}
    for share in KIND_SHARES:
        for label, texels in (("", "default"), ("-paper", "paper's")):
            for scene in COMPARED:
                scores = {kind: score(trials.trained(scene, share, kind + label)) for kind in KINDS}
                rows.append(row(f"{scene} {share} %", texels, score(trials.trained(scene, share, "none")), scores))
                if scores["alpha"] and scores["rgb"]:
                    ahead[label].append(scores["alpha"]["psnr"] - scores["rgb"]["psnr"] > TIE)
        for name, table in paper.KINDS.items():
            rows.append(row(f"paper, {name} {share} %", "", published(paper.SHARES[name][share][0]),
                            {kind: published(table[share][kind]) for kind in KINDS}))
    counts = [f"{sum(cells)} of {len(cells)}" for cells in ahead.values()]
    yield Text("PSNR / SSIM after stage 2. Default texels are signed; the paper's stay in [0, 1], start where "
               "`--texture-init paper` says, and learn at 0.001. The last column is the part of RGBA's gain over "
               f"stage 1 in dB that alpha or RGB alone reach. Alpha is ahead of RGB by more than {TIE} dB in "
               f"{counts[0]} cells with default texels, in {counts[1]} with the paper's. The paper has it ahead at "
               f"{KIND_SHARES[0]} % by " + " and ".join(
                   f"{table[KIND_SHARES[0]]['alpha'][0] - table[KIND_SHARES[0]]['rgb'][0]:.2f} dB ({name})"
                   for name, table in paper.KINDS.items())
               + (f": over seeds (below) the two are near each other here, too, but for {OWN_SCENE}, whose surfaces are "
                  "printed in colours." if any(ahead.values()) else "."))
    yield Table(["", "texels", "stage 1", *(LABELS[kind] for kind in KINDS), "part: alpha / RGB"], rows)
    yield from alpha_less_rgb(trials)


def alpha_less_rgb(trials):
    share, rows = KIND_SHARES[0], []
    for label, texels in (("", "default"), ("-paper", "paper's")):
        for scene in COMPARED:
            alpha, rgb = whole_seeds([score(trials.trained(scene, share, kind + label, seed)) for seed in SEEDS]
                                     for kind in KINDS[:-1])
            less = [g["psnr"] for g in map(gain, alpha, rgb) if g]
            rows.append([f"{scene} {share} %", texels, str(len(less)), over_seeds(alpha), over_seeds(rgb),
                         *judged([less] if len(less) > 1 else [])])
    yield Text(f"Over seeds at {share} %, PSNR [dB]: alpha and RGB that begin with the same stage 1, mean and standard "
               "deviation; their difference with its 95 % confidence interval (Student's t). A tie is within that or "
               f"within {TIE} dB; \"undecided\": within an interval wider than {UNDECIDED} dB.")
    yield Table(["", "texels", "seeds", "alpha", "RGB", "alpha less RGB", "alpha is"], rows)


def sizes(trials):
    budget = [trials.trained(scene, 1, "rgba") for scene in COMPARED]
    yield Text("RGBA at 1 % of the Gaussians, PSNR / SSIM by texels a side.")
    yield Table(["texels", *COMPARED], [
        ["none, stage 1", *(shown(score(trials.trained(scene, 1, "none"))) for scene in COMPARED)],
        ["none, twin", *(shown(twin(report)) for report in budget)],
        *([f"{size} x {size}", *(shown(score(trials.trained(scene, 1, f"rgba-{size}"))) for scene in COMPARED)]
          for size in SIZES),
        [f"what 1 % leads to: {listed(side(report) for report in budget if report)} a side",
         *(shown(score(report)) for report in budget)],
    ])


def small(trials):
    rows = []
    for scene in COMPARED:
        for share in (*SMALL_SHARES, 100):
            none, rgba, four = (trials.trained(scene, share, kind) for kind in ("none", "rgba", small_kind(share)))
            mark = other_start(rgba, score(none))
            rows.append([f"{scene} {share} %", shown(score(none)), shown(twin(rgba)) + mark,
                         shown(score(four)) + other_start(four, score(none)), shown(score(rgba)) + mark, side(rgba)])
    yield Text("4 x 4 texels a Gaussian at every share, beside as many texels at every share. PSNR / SSIM. "
               f"{OTHER_START}")
    yield Table(["", "stage 1", "twin", "4 x 4", "fixed number of texels", "its texels a side"], rows)


def whole_seeds(columns):
    """The columns at the seeds that all of them have."""
    columns = list(columns)
    rows = [row for row in zip(*columns, strict=True) if all(row)]
    return [[row[k] for row in rows] for k in range(len(columns))]


def over_seeds(scores, write=number):
    values = [s["psnr"] for s in scores if s]
    if len(values) < 2:
        return "-"
    return f"{write(statistics.fmean(values), 2)} +- {statistics.stdev(values):.2f}"


def spread(trials):
    rows = []
    for scene in COMPARED:
        for share in KEY_SHARES:
            pairs = [(trials.trained(scene, share, "none", seed), trials.trained(scene, share, "rgba", seed))
                     for seed in SEEDS]
            alike = same_recipe(rgba for _, rgba in pairs)
            pairs = [(none, rgba if rgba in alike else None) for none, rgba in pairs]
            plain, start, more, rgba = whole_seeds(zip(*((score(first), begun(second) or score(first), twin(second),
                                                         score(second)) for first, second in pairs)))
            gains = [[gain(*both) for both in zip(rgba, worse)] for worse in (start, more)]
            rows.append([f"{scene} {share} %", str(sum(map(bool, gains[0]))), *map(over_seeds, (plain, more, rgba)),
                         *(over_seeds(values, signed) for values in gains)])
    yield Text("PSNR [dB], mean and standard deviation over seeds: of one recipe and one count that shares are of, the "
               "newest.")
    yield Table(["", "seeds", "stage 1", "twin", "RGBA", "gain over stage 1", "gain over the twin"], rows)
    yield from once_more(trials)


def once_more(trials):
    """Cells that were made again, beside what they were."""
    rows, within = [], 0
    for name, now in sorted(trials.again.items()):
        then = trials.done.get(name)
        if not then:
            continue
        found = [measured(trials.cells[name], report) for report in (then, now)]
        deviation, freedom = seed_deviation(trials, name)
        difference, band = found[1] - found[0], 2 * math.sqrt(2) * deviation
        within += abs(difference) <= band
        rows.append([name, *(f"{at(report, 'training', 'machine', 'device').partition(', compute')[0]}, "
                             f"`{report['commit']}`" for report in (then, now)),
                     *(number(value, 2) for value in found), signed(difference, 2), f"{number(band, 2)} ({freedom})"])
    if rows:
        yield Text(f"Cells made again, each from a stage 1 of its own that was trained again, too: {within} of "
                   f"{len(rows)} come within two standard deviations of a difference of two seeds. That deviation is "
                   "pooled over the scene's cells of several seeds, of its tables or of its choices (in brackets how "
                   "many degrees of freedom it has).")
        yield Table(["cell", "made on", "again on", "PSNR", "again", "difference", "two deviations"], rows)


def measured(cell, report):
    """PSNR on the views that such a cell is judged by."""
    if cell.choice:
        return at(report, "training", "stages", "textured" if cell.start else "plain", "test_psnr")
    return score(report)["psnr"]


def seed_deviation(trials, name):
    """The standard deviation between seeds, pooled over the cells of this one's scene and views, and its degrees of
    freedom; 0 and 0 where there is one seed of each."""
    scene = name.split("/")[:2 if trials.cells[name].choice else 1]
    seeds = collections.defaultdict(list)
    for other, report in trials.done.items():
        if other.split("/")[:len(scene)] == scene:
            seeds[other.rpartition("/")[0]].append((trials.cells[other], report))
    alike = [same_recipe(report for _, report in cells) for cells in seeds.values()]
    return pooled([measured(cell, report) for cell, report in cells if report in same]
                  for cells, same in zip(seeds.values(), alike))


def pooled(groups):
    """The standard deviation within groups of numbers, and its degrees of freedom; 0 and 0 where each has one."""
    groups = [group for group in groups if len(group) > 1]
    freedom = sum(len(group) - 1 for group in groups)
    squares = sum((len(group) - 1) * statistics.variance(group) for group in groups)
    return math.sqrt(squares / freedom) if freedom else 0.0, freedom


def efficiency(trials):
    def millions(value):
        return scaled(value, 1e6, 2)

    def megabytes(value):
        return scaled(value, 1e6, 0)

    rows = []
    triples = [(f"{scene} {share} %", trials.trained(scene, share, "none"), trials.trained(scene, share, "rgba"),
                [f"{scene}/{share:03}/{kind}/1" for kind in ("none", "rgba")])
               for scene in SCENES for share in KEY_SHARES if share in trials.shares(scene)]
    names = [f"lego800/paper/{kind}/1" for kind in ("none", "rgba")]
    triples.append(("lego 800", *map(trials.get, names), names))
    for label, plain, textured, names in triples:
        pair = (plain, textured)
        seconds = (at(plain, "training", "stages", "plain", "seconds"),
                   *(at(textured, "training", "stages", stage, "seconds") for stage in ("untextured", "textured")))
        row = [label, number(at(plain, "evaluation", "gaussians")),
               *(couple([at(report, "evaluation", key) for report in pair], millions)
                 for key in ("parameters", "bytes")),
               couple([at(report, "training", "machine", "peak_memory_bytes") for report in pair], megabytes),
               couple(seconds, number),
               " / ".join(dict.fromkeys(device.partition(", compute")[0] for report in pair
                                        if (device := at(report, "training", "machine", "device"))))]
        if trials.frames:
            row.append(couple([at(trials.frames, name, "ms") for name in names], lambda ms: number(ms, 1)))
        rows.append(row)
    table = paper.EFFICIENCY
    row = ["paper, mean of its scenes at 100 %", number(table["gaussians"]), couple(table["parameters"], millions), "",
           couple(table["memory"], megabytes), "", ""]
    if trials.frames:
        row.append(couple(table["frame"], lambda ms: number(ms, 1)))
    devices = sorted({frame["device"] for frame in trials.frames.values()})
    yield Text("Without textures / RGBA; seconds: stage 1 / twin / RGBA. Bytes are of `model.tgz`. Memory is the "
               "training process's own on the host, with the twin's; the paper's is of its GPU. Cells may have run "
               "side by side: seconds are upper bounds."
               + (f" Frames: {'; '.join(devices)}." if devices else ""))
    yield Table(["", "Gaussians", "parameters [M]", "bytes [MB]", "peak memory [MB]", "seconds of training",
                 "trained by", *(["processor ms a frame"] if trials.frames else [])], [*rows, row])


def outside(trials):
    rows = []
    for scene in trials.scenes:
        for share in KEY_SHARES:
            textured = trials.trained(scene, share, "rgba")
            scores = [score(textured), *(score(textured, "outside", treatment) for treatment in TREATMENTS[1:])]
            rows.append([f"{scene} {share} %", *map(shown, scores)])
    yield Text("RGBA trained with the first, drawn with each: the Gaussian's own colour and opacity beyond its texture, "
               "nothing there, or the texels of the border. Test views"
               + ("; the page has pictures at flat angles." if any(grazing_rows(trials)) else "."))
    yield Table(["", *TREATMENTS], rows)


def ranks(trials):
    def row(scene, share):
        found = ranks_of(trials, scene, share)
        return [f"{scene} {share} %", couple([at(rank, "mean") for rank in found], lambda value: number(value, 2)),
                *(couple([at(rank, key) for rank in found], percent) for key in ("needle", "flat", "round"))]

    yield Text("Stage 1 / twin / RGBA: a needle's effective rank is below 1.5, a round one's above 2.5.")
    yield Table(["", "mean", "needles", "flat", "round"],
                [row(scene, share) for scene in trials.scenes for share in KEY_SHARES])


def choices(trials):
    def known(choice, scene, share, *keys):
        """By seed: what lies at these keys of the cells' training."""
        reports = [trials.get(f"choice/{scene}/{share:03}/{choice}/{seed}") for seed in SEEDS]
        return [at(report, "training", *keys) for report in reports]

    def alike(choice, other, scene, share):
        """By seed: whether two cells that are to begin with the same stage 1 did. One that was trained anew since, its
        run having gone, is another on another machine or by another recipe."""
        starts = [trials.cells[f"choice/{scene}/{share:03}/{name}/1"].start for name in (choice, other)]
        scores = [known(name, scene, share, "stages", "plain", "test_psnr") for name in (choice, other)]
        return [starts[0] != starts[1] or None in both or abs(both[0] - both[1]) <= TIE for both in zip(*scores)]

    def otherwise_made(choice, other, group, seeds):
        """The mark of a difference between cells that differ in more than a setting."""
        pairs = [[trials.get(f"choice/{group[0]}/{group[1]:03}/{name}/{seed}") for name in (choice, other)]
                 for seed in seeds]
        if any(older(one) != older(two) for one, two in pairs):
            return " o"
        for mark, keys in ((" d", ("training", "machine", "device")), (" v", ("commit",))):
            if any(at(one, *keys) != at(two, *keys) for one, two in pairs):
                return mark
        return ""

    def table(title, default, others, base_label, first=False):
        """default and the values of others: the choice in the cells' names, and a stage. first: stage 1, which makes
        the Gaussians."""
        groups = [(scene, share) for scene in COMPARED for share in KEY_SHARES
                  if all(f"choice/{scene}/{share:03}/{choice}/1" in trials.cells for choice, _ in others.values())]

        def row(label, choice, stage):
            scores = [known(choice, *group, "stages", stage, "test_psnr") for group in groups]
            base = [known(default[0], *group, "stages", default[1], "test_psnr") for group in groups]
            fair = [[True] * len(SEEDS) if first else alike(choice, default[0], *group) for group in groups]
            pairs = [{seed: a - b for seed, a, b, counts in zip(SEEDS, *three) if None not in (a, b) and counts}
                     for three in zip(scores, base, fair)]
            ratios = [a / b for group in groups for a, b in zip(known(choice, *group, "gaussians"),
                                                                known(default[0], *group, "gaussians"))
                      if None not in (a, b)]
            if label == base_label:
                cells = [number(average(seeds), 2) + how_many(seeds) for seeds in scores]
            else:
                cells = [signed(average(pair.values())) + how_many(pair.values())
                         + otherwise_made(choice, default[0], group, pair) for group, pair in zip(groups, pairs)]
            differences = [list(pair.values()) for pair in pairs if pair]
            return [label, *cells, *(judged(differences) if label != base_label else ["", ""]),
                    *([percent(average(ratios))] if first else [])]

        return Table([title, *(f"{scene} {share} %" for scene, share in groups), "difference", "verdict",
                      *(["Gaussians"] if first else [])],
                     [row(base_label, *default), *(row(label, *other) for label, other in others.items())])

    whole = [(scene, trials.get(f"choice/{scene}/100/none/1")) for scene in COMPARED]
    reached = [f"{number(report['training']['stages']['plain']['test_psnr'], 2)} dB with "
               f"{number(report['training']['gaussians'])} Gaussians ({scene})" for scene, report in whole if report]
    yield Text("Each row changes one setting of the first; PSNR [dB] on every 8th training view, held out; means over "
               f"seeds, in brackets of how many where not of {len(SEEDS)}. A difference is to the first row at the same "
               "scene, share and seed (two that began with different results of the same stage 1 are not compared), so "
               "that the first row and it do not add up to a row's own mean. \"o\": one of some of these pairs is of the "
               "older recipe; \"d\": some are of two devices, and mostly of two versions of the program; \"v\": of two "
               "versions alone. What recipe, device or version changes is in such a difference, and one seed on "
               "two devices is two trainings.")
    yield Text("\"difference\" is the mean over scenes and shares, +- its 95 % confidence interval (Student's t) by "
               "the seeds, where there are any: one spread is assumed for all, so that it is too narrow where a scene "
               f"with one seed varies more than the others. A tie is within that or within {TIE} dB, \"undecided\" "
               f"within an interval wider than {UNDECIDED} dB; \"mixed\": there "
               f"are columns on both sides, by more than {TIE} dB. \"Gaussians\" is beside the first row's count. 100 % "
               "have no limit.")
    twin = "no textures (twin)"
    yield table("after stage 1", ("none", "plain"), {choice: (choice, "plain") for choice in STAGE_1_CHOICES},
                SWAPPED_LABEL, first=True)
    yield table("after stage 2", ("rgba-default", "textured"),
                {twin: ("rgba-default", "untextured"),
                 **{choice: (f"rgba-{choice}", "textured") for choice in STAGE_2_CHOICES if choice != "default"}},
                SWAPPED_LABEL)
    yield table("after stage 2", (f"rgba-{MERGED}", "textured"),
                {twin: (f"rgba-{MERGED}", "untextured"), SWAPPED_LABEL: ("rgba-default", "textured")},
                f"default, {MERGED}")
    if reached:
        yield Text(f"Without a limit stage 1 reaches {', '.join(reached)} on the same views.")


def average(values):
    known = [value for value in values if value is not None]
    return statistics.fmean(known) if known else None


def how_many(values):
    count = sum(value is not None for value in values)
    return "" if count in (0, len(SEEDS)) else f" ({count})"


def judged(groups):
    """The mean of the groups' means with its 95 % confidence interval, and a word for it. A group's spread is by seed;
    all share one."""
    if not groups:
        return ["-", "-"]
    means = [statistics.fmean(group) for group in groups]
    difference, mixed = statistics.fmean(means), ", mixed" if min(means) < -TIE and max(means) > TIE else ""
    deviation, freedom = pooled(groups)
    if not freedom:
        return [signed(difference), "-"]
    error = student(freedom) * deviation * math.sqrt(sum(1 / len(group) for group in groups)) / len(groups)
    if abs(difference) >= max(TIE, error):
        verdict = "better" if difference > 0 else "worse"
    else:
        verdict = "tie" if error <= UNDECIDED else "undecided"
    return [f"{signed(difference)} +- {error:.2f}", verdict + mixed]


def nothing(_):
    return ()


# Title, tables, figures of the page.
SECTIONS = [
    ("Lego as published, beside the paper's own figure", anchor, nothing),
    ("RGBA at every share (Table A.3)", shares, share_figures),
    ("RGBA by default", default_sizes, nothing),
    ("Kinds of textures (Table A.4)", kinds, nothing),
    ("Texture size at 1 % (Figure A.5)", sizes, size_figures),
    ("4 x 4 at every share (Figure A.6)", small, small_figures),
    ("Spread over seeds", spread, nothing),
    ("Size, memory and time (Table A.2)", efficiency, byte_figures),
    ("Beyond +-3 sigma (Figure A.3)", outside, nothing),
    ("Effective ranks (Figure A.2)", ranks, rank_figures),
    ("Choices", choices, nothing),
]


def document(trials):
    blocks = head(trials)
    for title, tables, figures in SECTIONS:
        trials.asked = set()
        content = list(tables(trials))
        asked, done = len(trials.asked), sum(name in trials.done for name in trials.asked)
        if done:
            blocks += [Heading(title), Text(f"{done} of {asked} cells."), *content, *filter(None, figures(trials))]
        else:
            blocks.append(Text(f"{title}: left out, none of its {asked} cells is done."))
    return blocks


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trials", type=pathlib.Path, default=TRIALS, help="folder of the cells")
    parser.add_argument("--results", type=pathlib.Path, default=ROOT / "docs/results.md", help="the Markdown to write")
    parser.add_argument("--work", type=pathlib.Path, help="folder for results.html")
    parser.add_argument("--html", type=pathlib.Path, help="the page to write")
    parser.add_argument("--again", type=pathlib.Path, default=TRIALS.with_name("again"),
                        help="folder of cells that were made again")
    options = parser.parse_args()
    try:
        trials = Trials(options.trials)
        trials.again = Trials(options.again).done
    except Broken as problem:
        sys.exit(str(problem))
    title = "Results: the paper's tables, trained here"
    blocks = document(trials)
    options.results.write_text(markdown(title, blocks))
    target = options.html or options.work and options.work / "results.html"
    if target:
        shown = list(pictures(trials))
        target.write_text(page(title, [*blocks, *([Heading("Pictures"), *shown] if shown else [])]))


if __name__ == "__main__":
    main()

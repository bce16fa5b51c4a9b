# SPDX-License-Identifier: Apache-2.0
"""What only the page of bench/report.py shows: plots and pictures."""
import base64

import svg_plot
from report_document import Figure, plots
from report_trials import LABELS, METRICS, at, number, ranks_of, score, side, small_kind, twin
from reproduce import COMPARED, GRAZING_ANGLES, GRAZING_CELL, KEY_SHARES, KIND_SHARES, KINDS, SCENES, SHARES, SIZES, SMALL_SHARES, TREATMENTS


def share_figures(trials):
    def lines(scene, metric):
        def line(label, style, kind, shares, part="evaluation", **how):
            points = [(share, score(trials.trained(scene, share, kind), part).get(metric)) for share in shares]
            return svg_plot.Line(label, style, points, **how)

        shares = trials.shares(scene)
        return [line("stage 1", "none", "none", shares), line("twin", "twin", "rgba", shares, "untextured"),
                *(line(LABELS[kind], kind, kind, KIND_SHARES, joined=False) for kind in ("alpha", "rgb")
                  if scene in COMPARED),
                line("RGBA", "rgba", "rgba", shares)]

    for metric in ("psnr", "ssim"):
        name = METRICS[metric][0]
        yield plots(f"{name} against the share of the Gaussians",
                    [svg_plot.plot(scene, lines(scene, metric), "share of the Gaussians [%]",
                                   f"{name} [dB]" if metric == "psnr" else name,
                                   x_ticks=trials.shares(scene)) for scene in trials.scenes],
                    lines(COMPARED[0], metric))


def size_figures(trials):
    def lines(scene):
        budget = trials.trained(scene, 1, "rgba")
        curve = [(size, score(trials.trained(scene, 1, f"rgba-{size}")).get("psnr")) for size in SIZES]
        if budget:
            curve.append((float(side(budget)), score(budget)["psnr"]))

        def level(label, style, scores):
            ends = curve[0][0], curve[-1][0]
            return svg_plot.Line(label, style, [(size, scores.get("psnr")) for size in ends], dots=False)

        return [level("stage 1", "none", score(trials.trained(scene, 1, "none"))), level("twin", "twin", twin(budget)),
                svg_plot.Line("RGBA", "rgba", curve)]

    yield plots("PSNR against texels a side, 1 % of the Gaussians",
                [svg_plot.plot(scene, lines(scene), "texels a side", "PSNR [dB]", x_ticks=[*SIZES, 40])
                 for scene in COMPARED], lines(COMPARED[0]))


def small_figures(trials):
    def lines(scene):
        def line(label, style, kind, shares=SHARES, part="evaluation", **how):
            scores = [score(trials.trained(scene, share, kind(share)), part) for share in shares]
            return svg_plot.Line(label, style, [(share, s.get("psnr")) for share, s in zip(shares, scores)], **how)

        return [line("stage 1", "none", lambda _: "none"), line("twin", "twin", lambda _: "rgba", part="untextured"),
                line("RGBA 4 x 4", "rgba", small_kind, (*SMALL_SHARES, 100), dashed=True),
                line("RGBA, fixed number of texels", "rgba", lambda _: "rgba")]

    yield plots("PSNR of 4 x 4 texels against the share of the Gaussians",
                [svg_plot.plot(scene, lines(scene), "share of the Gaussians [%]", "PSNR [dB]", x_ticks=SHARES)
                 for scene in COMPARED], lines(COMPARED[0]))


def byte_figures(trials):
    def lines(scene):
        def line(label, style, cells, part="evaluation", **how):
            reports = [at(trials.trained(scene, *cell), part) for cell in cells]
            points = [(report["bytes"] / 1e6, report["psnr"]) if report else (None, None) for report in reports]
            return svg_plot.Line(label, style, points, **how)

        shares = trials.shares(scene)
        result = [line("stage 1", "none", [(share, "none") for share in shares]),
                  line("twin", "twin", [(share, "rgba") for share in shares], "untextured"),
                  line("RGBA, fixed number of texels", "rgba", [(share, "rgba") for share in shares])]
        if scene in COMPARED:
            result += [line("RGBA 4 x 4", "rgba", [(share, small_kind(share)) for share in (*SMALL_SHARES, 100)],
                            dashed=True),
                       line("1 %, by texels a side", "size", [(1, f"rgba-{size}") for size in SIZES])]
        return result

    yield plots("PSNR against the model's bytes",
                [svg_plot.plot(scene, lines(scene), "model.tgz [MB]", "PSNR [dB]") for scene in trials.scenes],
                lines(COMPARED[0]))


def rank_figures(trials):
    def line(label, style, rank):
        bins = rank["bins"] if rank else []
        return svg_plot.Line(label, style, [(rank["first"] + (i + end) * rank["bin_width"], 100 * count / sum(bins))
                                            for i, count in enumerate(bins) for end in (0, 1)], dots=False)

    def lines(scene, share):
        labels = [("stage 1", "none"), ("twin", "twin"), ("RGBA", "rgba")]
        return [line(*label, rank) for label, rank in zip(labels, ranks_of(trials, scene, share))]

    yield plots("Effective ranks: part of the Gaussians by rank",
                [svg_plot.plot(f"{scene} {share} %", lines(scene, share), "effective rank", "Gaussians [%]",
                               logarithmic=False) for scene in trials.scenes for share in KEY_SHARES],
                lines(COMPARED[0], 1))


def pictures(trials):
    """What only the page shows: photographs, and what was trained, beside one another."""
    for scene in SCENES:
        rows = "".join(picture_row(trials, scene, share) for share in trials.shares(scene))
        if rows:
            yield Figure(f"{scene}: photograph of the first test view, and what is trained, by share",
                         f'<div class="grid">{rows}</div>')
    rows = "".join(grazing_rows(trials))
    if rows:
        yield Figure(f"{GRAZING_CELL} at grazing angles, by what lies beyond +-3 sigma (Figure A.3)",
                     f'<div class="grid">{rows}</div>')


def grazing_rows(trials):
    return [grazing_row(trials.folder / "grazing", angle) for angle in GRAZING_ANGLES]


def grazing_row(folder, angle):
    pictures = [(treatment, folder / f"{angle}-{treatment}.png") for treatment in TREATMENTS]
    if not all(path.exists() for _, path in pictures):
        return ""
    return '<div class="pictures">' + "".join(
        f'<div><img alt="{treatment} at {angle} degrees" src="{embedded(path)}">{treatment}, {angle} degrees</div>'
        for treatment, path in pictures) + "</div>"


def picture_row(trials, scene, share):
    """The left half of a cell's picture is the photograph, the right half what it renders."""
    found = []
    for kind in ("none", *KINDS):
        name = f"{scene}/{share:03}/{kind}/1"
        path = trials.folder / f"{name}.png"
        if name in trials.done and path.exists():
            found.append((kind, trials.done[name], path))
    if not found:
        return ""
    data = found[0][1]["training"]["dataset"]
    names = "".join(f"--{kind}:url({embedded(path)});" for kind, _, path in found)
    width, height = data["width"], data["height"]

    def picture(label, kind, left):
        return (f'<div><i role="img" aria-label="{label}" style="width:clamp(110px,{90 // (len(found) + 1)}vw,'
                f'{width}px);aspect-ratio:{width}/{height};background-image:var(--{kind});'
                f'background-position:{left} 0"></i>{label}</div>')

    parts = [picture(f"at {share} %", found[0][0], "0%")]
    for kind, report, _ in found:
        parts.append(picture(f"{LABELS[kind]} {number(report['evaluation']['psnr'], 2)} dB", kind, "100%"))
    return f'<div class="pictures" style="{names}">{"".join(parts)}</div>'


def embedded(path):
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode()

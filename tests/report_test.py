#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds bench/report.py against cells that are made up here, and docs/results.md against what the report makes of the
tree's own.

    tests/report_test.py
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "bench"))
import reproduce  # its names of cells

RANKS = {"mean": 2.0, "needle": 0.25, "flat": 0.5, "round": 0.25, "first": 1.0, "bin_width": 0.5, "bins": [1, 1, 1, 1]}
PIXEL = bytes.fromhex("89504e470d0a1a0a0000000d4948445200000002000000010802000000")  # a PNG's beginning


def evaluation(psnr, ssim=0.9, texels=0, gaussians=100):
    return {"gaussians": gaussians, "texels": texels, "parameters": 5900000 + 4 * texels, "bytes": 12340000 + texels,
            "psnr": psnr, "ssim": ssim, "effective_rank": RANKS, "interrupted": False}


def cell(name, psnr, twin=None, side=0, gaussians=100):
    """The report of a cell that scores `psnr`, as bench/reproduce.py writes it."""
    stage = {"iterations": 7000, "gaussians": gaussians, "seconds": 300.0, "test_psnr": psnr}
    stages = {"plain": stage}
    if "rgb" in name or "alpha" in name:
        stages = {"plain": {**stage, "iterations": 0, "test_psnr": 20.0}, "textured": stage}
    report = {
        "cell": name, "commit": "abc1234", "machine": {"processor": "Processor", "cores": 2},
        "training": {
            "dataset": {"name": "folder", "train_views": 43, "test_views": 7, "width": 135, "height": 240},
            "gaussians": gaussians, "texels": side * side * gaussians, "interrupted": False, "stages": stages,
            "machine": {"device": "CPU", "seconds": 310.0, "peak_memory_bytes": 512000000},
        },
    }
    if not name.startswith("choice/"):
        report["evaluation"] = evaluation(psnr, texels=side * side * gaussians, gaussians=gaussians)
    if twin is not None:
        report["outside"] = {treatment: {"psnr": psnr - 0.25, "ssim": 0.9} for treatment in ("clip", "edge")}
        stages["untextured"] = {**stage, "seconds": 200.0, "test_psnr": twin}
        report["untextured"] = evaluation(twin, gaussians=gaussians)
    return report


def row(text, section, *labels):
    """The cells of the row that begins with these, under the heading that begins with `section`."""
    part = re.split(r"^## ", text, flags=re.M)
    lines = [line for p in part if p.startswith(section) for line in p.splitlines()]
    for line in lines:
        cells = [c.strip() for c in line.strip("|").split("|")]
        if cells[:len(labels)] == list(labels):
            return cells[len(labels):]
    raise AssertionError(f"no row {labels} in {section}:\n" + "\n".join(lines))


class ReportTest(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        self.trials, self.again = self.path / "trials", self.path / "again"
        self.trials.mkdir()

    def add(self, name, *scores, **how):
        self.write(f"{name}.json", json.dumps(cell(name, *scores, **how)))

    def write(self, name, text):
        path = self.trials / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def run_report(self):
        return subprocess.run([sys.executable, ROOT / "bench/report.py", "--trials", self.trials, "--again", self.again,
                               "--results", self.path / "results.md", "--work", self.path], capture_output=True, text=True)

    def results(self):
        run = self.run_report()
        self.assertEqual(run.returncode, 0, run.stderr)
        return (self.path / "results.md").read_text()

    def page(self):
        return (self.path / "results.html").read_text()

    def test_nothing_done(self):
        text = self.results()
        self.assertRegex(text, r"\n0 of \d+ cells are done")
        self.assertIn("Choices: left out, none of its", text)
        self.assertNotIn("##", text)
        self.assertNotIn("<svg", self.page())

    def test_shares(self):
        for scene, above in (("fox", 1.0), ("lego", 2.0), ("printshop", 3.0)):
            self.add(f"{scene}/001/none/1", 25.0)
            self.add(f"{scene}/001/rgba/1", 25.5 + above, 25.5, side=40)
        text = self.results()
        section = "RGBA at every share"
        self.assertEqual(row(text, section, "fox 1 %"), ["100", "13,932", "40", "8.7", "25.00 / 0.9000",
                                                         "25.50 / 0.9000", "26.50 / 0.9000", "+1.50 / +0.0000",
                                                         "+1.00 / +0.0000"])
        self.assertEqual(row(text, section, "fox 2 %"), ["-"] * 9)
        self.add("fox/001/rgba-default/1", 27.0, side=20)
        text = self.results()
        self.assertEqual(row(text, "RGBA by default", "fox 1 %"), ["20", "35", "25.50 / 0.9000", "26.50 / 0.9000",
                                                                   "27.00 / 0.9000", "+1.50 / +0.0000"])
        self.assertEqual(row(text, "Beyond +-3 sigma", "fox 1 %"), ["26.50 / 0.9000", *["26.25 / 0.9000"] * 2])
        self.assertEqual(row(text, section, "1 %"), ["+2.50 / +0.0000", "+2.00 / +0.0000", "+2.00 / +0.0000",
                                                     "+1.13 / +0.0180", "+1.38 / +0.0773"])
        self.assertEqual(row(text, section, "2 %")[:2], ["-", "-"])
        self.assertIn("6 of 48 cells.", text)
        self.assertEqual(row(text, "Size, memory", "fox 1 %"),
                         ["100", "5.90 / 6.54", "12.34 / 12.50", "512 / 512", "300 / 200 / 300", "CPU"])
        self.assertEqual(row(text, "Effective ranks", "fox 1 %")[1], "25.0 % / 25.0 % / 25.0 %")
        self.assertEqual(row(text, "Texture size", "none, twin"), ["25.50 / 0.9000"] * 3)
        self.assertIn("<title>RGBA: 1, 26.5</title>", self.page())

    def test_gains_are_counted_beside_their_spread_over_seeds_of_one_recipe(self):
        for share, gains in (("001", (1.0, 1.1, 0.9)), ("002", (0.15,)), ("005", (-0.3,))):
            for seed, above in enumerate(gains, 1):
                self.add(f"fox/{share}/none/{seed}", 25.0)
                report = cell(f"fox/{share}/rgba/{seed}", 25.0 + above, 25.0, side=40)
                report["training"]["stages"]["plain"].update(test_psnr=25.0, test_ssim=0.9)
                self.write(f"fox/{share}/rgba/{seed}.json", json.dumps(report))
        text = self.results()
        prose = " ".join(text.split())
        self.assertIn("ahead of stage 1 by more than 0.05 dB in 2 of 3 cells", prose)
        self.assertIn("behind stage 1 by more than 0.05 dB in fox 5 % (-0.30)", prose)
        self.assertIn("[dB]: fox 0.10 and 0.10. RGBA is ahead of stage 1 by more than two of them in 1 of 3 cells", prose)
        self.assertEqual(row(text, "Spread over seeds", "fox 1 %")[0], "3")
        for seed, settings in ((1, {}), (2, {"extent-distances": 2}), (3, {"extent-distances": 2})):
            for kind in ("none", "rgba"):
                path = self.trials / f"fox/001/{kind}/{seed}.json"
                report = json.loads(path.read_text())
                report["training"]["settings"] = {"seed": seed, "default-gaussians": 100, **settings}
                path.write_text(json.dumps(report))
        text = self.results()
        self.assertEqual(row(text, "Spread over seeds", "fox 1 %")[0], "2")
        self.assertEqual(row(text, "RGBA at every share", "fox 1 % (o)")[0], "100")

    def test_gains_are_over_the_stage_1_that_a_cell_began_with(self):
        self.add("fox/001/none/1", 25.0)
        for name, start in (("rgba", 25.5), ("rgba-4", 25.0)):
            report = cell(f"fox/001/{name}/1", 27.0, 26.0, side=40)
            report["training"]["stages"]["plain"].update(test_psnr=start, test_ssim=0.875)
            self.write(f"fox/001/{name}/1.json", json.dumps(report))
        text = self.results()
        self.assertEqual(row(text, "RGBA at every share", "fox 1 %")[-2:], ["+1.50 / +0.0250", "+1.00 / +0.0000"])
        self.assertEqual(row(text, "RGBA at every share", "fox 1 %")[4:7],
                         ["25.00 / 0.9000", "26.00 / 0.9000 (*)", "27.00 / 0.9000 (*)"])
        # The mark is on what began otherwise than the stage 1 in the row, which 4 x 4 did not.
        self.assertEqual(row(text, "4 x 4 at every share", "fox 1 %")[:4],
                         ["25.00 / 0.9000", "26.00 / 0.9000 (*)", "27.00 / 0.9000", "27.00 / 0.9000 (*)"])

    def test_anchor(self):
        self.add("lego800/paper/none/1", 35.68, gaussians=123456)
        text = self.results()
        self.assertEqual(row(text, "Lego as published", "stage 1"), ["35.68 / 0.9000", "-0.10", "123,456", "5.0", "0.51"])
        self.assertEqual(row(text, "Lego as published", "twin")[0], "-")
        self.assertEqual(row(text, "Lego as published", "3DGS, published")[:2], ["35.78", "+0.00"])

    def test_kinds(self):
        self.add("fox/001/none/1", 25.0)
        for kind, psnr in (("alpha", 25.5), ("rgb", 26.5)):
            self.add(f"fox/001/{kind}/1", psnr, side=40)
        self.add("fox/001/rgba/1", 27.0, 25.2, side=40)
        self.add("fox/001/rgba-paper/1", 26.0, side=40)
        text = self.results()
        self.assertEqual(row(text, "Kinds", "fox 1 %", "default")[1:],
                         ["25.50 / 0.9000", "26.50 / 0.9000", "27.00 / 0.9000", "25 % / 75 %"])
        self.assertEqual(row(text, "Kinds", "fox 1 %", "paper's")[1:], ["-", "-", "26.00 / 0.9000", "-"])
        self.assertEqual(row(text, "Kinds", "paper, Blender 1 %", "")[-1], "61 % / 58 %")
        self.assertIn("ahead of RGB by more than 0.05 dB in 0 of 1 cells", text.replace("\n", " "))

    def test_who_is_ahead_by_less_than_a_tie_is_not_counted(self):
        for scene, alpha in (("fox", 25.54), ("lego", 25.56)):
            self.add(f"{scene}/001/alpha/1", alpha, side=40)
            self.add(f"{scene}/001/rgb/1", 25.5, side=40)
        self.assertIn("ahead of RGB by more than 0.05 dB in 1 of 2 cells", self.results().replace("\n", " "))

    def test_seeds(self):
        for seed, above in ((1, 0.9), (2, 1.0), (3, 1.1)):
            self.add(f"fox/020/none/{seed}", 28.0)
            self.add(f"fox/020/rgba/{seed}", 30.0 + above, 30.0, side=9)
        text = self.results()
        self.assertEqual(row(text, "Spread", "fox 20 %"), ["3", "28.00 +- 0.00", "30.00 +- 0.00", "31.00 +- 0.10",
                                                           "+3.00 +- 0.10", "+1.00 +- 0.10"])

    def test_kinds_over_seeds(self):
        for seed, noise in ((1, 0.0), (2, 0.1), (3, 0.2)):
            self.add(f"fox/001/alpha/{seed}", 30.0 + noise, side=40)
            self.add(f"fox/001/rgb/{seed}", 29.0 + 2 * noise, side=40)
            self.add(f"fox/001/rgb-paper/{seed}", 29.0, side=40)
        self.add("lego/001/alpha/1", 30.0, side=40)
        self.add("lego/001/rgb/1", 29.0, side=40)
        text = self.results()
        self.assertEqual(row(text, "Kinds", "fox 1 %", "default", "3"),
                         ["30.10 +- 0.10", "29.20 +- 0.20", "+0.90 +- 0.25", "better"])
        self.assertEqual(row(text, "Kinds", "fox 1 %", "paper's", "0"), ["-", "-", "-", "-"])
        self.assertEqual(row(text, "Kinds", "lego 1 %", "default", "1"), ["-", "-", "-", "-"])

    def test_choices(self):
        better, noisy, missing = list(reproduce.STAGE_1_CHOICES)[:3]
        worse = [choice for choice in reproduce.STAGE_2_CHOICES if choice != "default"][0]
        for seed, noise in ((1, 0.0), (2, 0.02), (3, 0.01)):
            self.add(f"choice/fox/001/none/{seed}", 20.0)
            self.add(f"choice/fox/001/{better}/{seed}", 20.5 + noise, gaussians=90)
            self.add(f"choice/fox/001/{noisy}/{seed}", 20.0 + 10 * noise)
            self.add(f"choice/fox/001/rgba-default/{seed}", 22.0, 21.0)
            self.add(f"choice/fox/001/rgba-{worse}/{seed}", 21.9 + noise)
            self.add(f"choice/fox/001/rgba-{reproduce.MERGED}/{seed}", 22.5, 21.4)
        text = self.results()
        found = row(text, "Choices", better)
        self.assertEqual((found[0], found[1], found[-3:]), ("+0.51", "-", ["+0.51 +- 0.02", "better", "90.0 %"]))
        self.assertEqual(row(text, "Choices", noisy)[-3:], ["+0.10 +- 0.25", "undecided", "100.0 %"])
        self.assertEqual(set(row(text, "Choices", missing)), {"-"})
        found = row(text, "Choices", worse)
        self.assertEqual((found[0], found[1], found[-2:]), ("-0.09", "-", ["-0.09 +- 0.02", "worse"]))
        self.assertEqual(row(text, "Choices", "no textures (twin)")[0], "-1.00")
        merged = text[text.index("| default, limit-merge | 22.50 |"):]
        self.assertEqual([line.split(" | ")[1] for line in merged.splitlines()[1:3]], ["-1.10", "-0.50"])

    def test_choices_that_began_otherwise_are_not_compared(self):
        choice = [choice for choice in reproduce.STAGE_2_CHOICES if choice != "default"][0]
        for seed, start in ((1, 20.0), (2, 20.04), (3, 20.3)):
            for name, psnr, of_stage_1 in (("default", 22.0, 20.0), (choice, 22.5 + seed, start)):
                report = cell(f"choice/fox/001/rgba-{name}/{seed}", psnr)
                report["training"]["stages"]["plain"] = {"test_psnr": of_stage_1}
                self.write(f"{report['cell']}.json", json.dumps(report))
        self.assertEqual(row(self.results(), "Choices", choice)[0], "+2.00 (2)")  # of the first two seeds

    def test_choices_say_of_how_many_seeds_they_are_and_what_else_differs(self):
        ahead, behind, mixed = list(reproduce.STAGE_1_CHOICES)[:3]
        for scene, change in (("fox", 0.5), ("printshop", -0.1)):
            for seed in (1, 2):
                self.add(f"choice/{scene}/001/none/{seed}", 20.0)
                self.add(f"choice/{scene}/001/{mixed}/{seed}", 20.0 + change + seed / 100)
        for name, where in ((ahead, ("training", "machine", "device")), (behind, ("commit",))):
            report = cell(f"choice/fox/001/{name}/1", 20.25)
            place = report
            for key in where[:-1]:
                place = place[key]
            place[where[-1]] = "another"
            self.write(f"choice/fox/001/{name}/1.json", json.dumps(report))
        text = self.results()
        self.assertEqual(row(text, "Choices", "limit-swap")[0], "20.00 (2)")
        self.assertEqual(row(text, "Choices", ahead)[0], "+0.25 (1) d")
        self.assertEqual(row(text, "Choices", behind)[0], "+0.25 (1) v")
        self.assertEqual(row(text, "Choices", mixed)[-2], "better, mixed")

    def test_frames_and_pictures(self):
        self.add("fox/001/none/1", 25.0)
        (self.trials / "fox/001/none/1.png").write_bytes(PIXEL)
        for treatment in reproduce.TREATMENTS:
            self.write(f"grazing/{reproduce.GRAZING_ANGLES[0]}-{treatment}.png", "").write_bytes(PIXEL)
        self.write("frames.json", json.dumps({"fox/001/none/1": {"ms": 12.5, "device": "CPU, 1 threads"}}))
        text = self.results()
        self.assertEqual(row(text, "Size, memory", "fox 1 %")[-1], "12.5 / -")
        self.assertEqual(self.page().count("data:image/png;base64,iVBORw0KGgo"), 4)

    def test_pictures_at_flat_angles_are_spoken_of_where_they_are(self):
        self.add("fox/001/rgba/1", 26.0, 25.5, side=40)
        self.assertNotIn("flat angles", self.results())
        for treatment in reproduce.TREATMENTS:
            self.write(f"grazing/{reproduce.GRAZING_ANGLES[0]}-{treatment}.png", "").write_bytes(PIXEL)
        self.assertIn("flat angles", self.results())

    def test_plots_have_names_and_units_and_gaps_where_cells_are_missing(self):
        for share in (1, 2, 10):
            self.add(f"fox/{share:03}/none/1", 25.0)
        self.results()
        svg = self.page()[self.page().index("<svg class=\"plot\""):]
        self.assertIn('role="img" aria-label="fox: PSNR [dB] over share of the Gaussians [%], of stage 1"', svg)
        self.assertIn(">PSNR [dB]</text>", svg)
        path = re.search('<path class="curve none" d="([^"]*)"', svg)[1]
        self.assertEqual(re.sub("[^ML]", "", path), "MLM")

    def test_page_needs_nothing_else(self):
        self.add("fox/001/rgba/1", 26.0, 25.5, side=40)
        self.results()
        self.assertNotRegex(self.page(), r"https?:|<script|<link|@import|url\((?!data:)")

    def test_same_bytes(self):
        self.add("fox/001/none/1", 25.0)
        first = self.results(), self.page()
        self.assertEqual((self.results(), self.page()), first)
        self.assertNotIn(str(self.path), "".join(first))

    def test_cells_made_again(self):
        self.add("fox/001/none/1", 25.0)
        self.add("fox/001/none/2", 25.1)
        self.add("fox/005/none/1", 26.0)
        self.add("lego/001/none/1", 30.0)  # of another scene, as the choice is of other views
        self.add("lego/001/none/2", 32.0)
        self.add("choice/fox/001/none/1", 24.0)
        self.add("choice/fox/001/none/2", 27.0)
        self.assertNotIn("made again", self.results())
        for name, psnr in (("fox/001/none/1", 25.19), ("fox/005/none/1", 25.7), ("choice/fox/001/none/1", 24.5)):
            path = self.again / f"{name}.json"
            path.parent.mkdir(parents=True)
            path.write_text(json.dumps(cell(name, psnr)))
        text = self.results()
        # 0.1 / sqrt(2) between seeds, and 3 / sqrt(2) between those of choices.
        self.assertEqual(row(text, "Spread", "fox/001/none/1")[2:], ["25.00", "25.19", "+0.19", "0.20 (1)"])
        self.assertEqual(row(text, "Spread", "fox/005/none/1")[2:], ["26.00", "25.70", "-0.30", "0.20 (1)"])
        self.assertEqual(row(text, "Spread", "choice/fox/001/none/1")[2:], ["24.00", "24.50", "+0.50", "6.00 (1)"])
        self.assertIn("2 of 3 come", text)

    def test_broken_cells(self):
        lacking = cell("fox/002/none/1", 25.0)
        del lacking["evaluation"]["ssim"]
        stopped = cell("fox/005/none/1", 25.0)
        stopped["training"]["interrupted"] = True
        broken = {
            "fox/001/none/1.json": ("{", "is no JSON: "),
            "fox/002/none/1.json": (json.dumps(lacking), "evaluation.ssim is null (expected a number)"),
            "fox/005/none/1.json": (json.dumps(stopped), "the run was interrupted"),
            "fox/010/none/1.json": (json.dumps(cell("fox/020/none/1", 25.0)), 'cell is "fox/020/none/1" (expected'),
            "fox/003/none/1.json": (json.dumps(cell("fox/003/none/1", 25.0)), "no cell of bench/reproduce.py"),
            "fox/020/none/1.json": ("[]", "holds no object"),
            "frames.json": ('{"fox/001/none/1": {"ms": "1"}}', "fox/001/none/1 lacks a number ms"),
        }
        paths = {self.write(name, text): what for name, (text, what) in broken.items()}
        run = self.run_report()
        self.assertEqual(run.returncode, 1)
        self.assertNotIn("Traceback", run.stderr)
        self.assertEqual(len(run.stderr.splitlines()), len(broken), run.stderr)
        for path, what in paths.items():
            self.assertIn(f"{path}: {what}", run.stderr)

    def test_the_trees_own(self):
        self.trials, self.again = ROOT / "docs/lab/trials", ROOT / "docs/lab/again"
        self.assertTrue((ROOT / "docs/results.md").read_text() == self.results(), "not what bench/report.py makes now (run it again)")


if __name__ == "__main__":
    unittest.main()

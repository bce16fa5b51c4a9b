#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the report of bench/frontier.py against cells that are made up here, and docs/frontier.md against the tree's
own.

    tests/frontier_test.py
"""
import argparse
import concurrent.futures
import contextlib
import io
import itertools
import json
import math
import pathlib
import subprocess
import sys
import tempfile
import time
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "bench"))
import frontier


MADE = {"commit": "abc1234", "machine": {"processor": "Processor", "cores": 2},
        "training": {"seed": 1, "interrupted": False, "machine": {"device": "CPU", "seconds": 310.0}}}


def add(folder, name, *files, model=40.0, codec=frontier.CODEC):
    """files: (bytes, dB) of the first steps; what the others make is on no hull. SSIM and FLIP go with dB."""
    report = {"cell": name, **MADE,
              "model": {"gaussians": 100, "texels": 0 if "/plain/" in name else 800, "psnr": model, "ssim": model / 100,
                        "flip": 1 - model / 100},
              "files": [{"steps": steps, "bytes": 10**9, "psnr": 1.0, "ssim": 0.01, "flip": 0.99, "gaussians": 100,
                         "texels": 0 if "/plain/" in name else 800} for steps in frontier.STEPS],
              "codec": codec}
    for file, (size, psnr) in zip(report["files"], files):
        file.update(bytes=size, psnr=psnr, ssim=psnr / 100, flip=1 - psnr / 100)
    path = folder / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(report))


def add_command(folder, name, size, psnr, **how):
    scores = {"gaussians": 1000 if "/plain/" in name else 900, "texels": 0, "psnr": psnr, "ssim": 0.9, "flip": 0.05}
    path = folder / f"{name}.json"
    path.parent.mkdir(parents=True, exist_ok=True)
    report = {"cell": name, **MADE, "bytes": size, **scores, "base": {**scores, "psnr": 25.0}, **how}
    path.write_text(json.dumps(report))


class Frontier(unittest.TestCase):
    def run_report(self, folder, page, picture):
        return subprocess.run([sys.executable, ROOT / "bench/frontier.py", "report", "--cells", folder, "--page", page,
                               "--picture", picture], capture_output=True, text=True)

    def report(self, folder):
        with tempfile.TemporaryDirectory() as out:
            page, picture = pathlib.Path(out, "page.md"), pathlib.Path(out, "picture.svg")
            run = self.run_report(folder, page, picture)
            self.assertEqual(run.returncode, 0, run.stderr)
            return page.read_text(), picture.read_text()

    def driver(self, folder, cut=False):
        return frontier.Driver(argparse.Namespace(work=folder / "work", data=folder, bin=folder, device="cpu",
                                                  threads=1, cut=cut, cells=folder / "cells"))

    def test_a_hull_leaves_out_what_others_beat(self):
        chain = frontier.hull([(100, 20.0), (200, 21.0), (250, 20.5), (400, 26.0), (800, 27.0), (110, 19.0)])
        self.assertEqual([point[0] for point in chain], [100, 400, 800])
        self.assertAlmostEqual(frontier.height(chain, 200), 23.0)  # halfway in the logarithm
        self.assertIsNone(frontier.height(chain, 900))
        self.assertIsNone(frontier.height(chain, 99))
        self.assertAlmostEqual(frontier.slope(chain[1], chain[2]), 1 / math.log(2))

    def test_gains_are_between_hulls_at_equal_bytes(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            add(folder, "fox/1700/sh1/plain/1", (10000, 20.0), (40000, 28.0))
            add(folder, "fox/1700/sh1/rgba-8/1", (20000, 25.5), (80000, 30.0))
            page, picture = self.report(folder)
        self.assertIn("2 of ", page)
        self.assertIn("| fox | 20 kB | 1,700 Gaussians, SH 1, rgba 8 | 8.0 | 1 | 25.50 | 24.00 | +1.50 |", page)
        self.assertIn("| fox | 80 kB | 1,700 Gaussians, SH 1, rgba 8 | 8.0 | 2 | 30.00 | - | - |", page)
        # 800 texels bring 10 kB at 20 dB to 20 kB at 25.5 dB, for which plain Gaussians take 25.9 kB.
        self.assertIn("| fox | 1,700 Gaussians, SH 1, rgba 8 | 1 | +5.50 | 12.50 | 19.92 |", page)
        self.assertIn("without textures", picture)
        self.assertNotIn("lego", picture)

    def test_differences_over_the_whole_range_are_means_between_hulls(self):
        # Textures take half the bytes up to 20 dB, and as many as the plain files from 30 dB on; half way in logarithms
        # of bytes lies half way in dB.
        plain = frontier.hull([(100, 10.0), (400, 20.0), (1600, 30.0)])
        textured = frontier.hull([(50, 10.0), (200, 20.0), (1600, 30.0)])
        self.assertAlmostEqual(frontier.rate(plain, textured), math.exp(-0.75 * math.log(2)) - 1)
        # In octaves of bytes: 5 dB ahead from 100 to 200, then down to 10/3 at 400 and to 0 at 1600.
        self.assertAlmostEqual(frontier.mean_gain(plain, textured), (5 + (5 + 10 / 3) / 2 + 10 / 3) / 4)
        for better in (frontier.rate, frontier.mean_gain):
            self.assertAlmostEqual(better(plain, plain), 0)
            self.assertIsNone(better(plain, frontier.hull([(5000, 40.0), (9000, 50.0)])))

    def test_seeds_are_compared_each_with_its_own_plain_hull_where_that_is_whole(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            counts = frontier.COUNTS["fox"]
            for seed, gain in ((1, 1.0), (2, 2.0), (3, 9.0)):
                for place, count in enumerate(counts):
                    if seed == 3 and place == 2:
                        continue  # a gap: this seed does not count
                    add(folder, f"fox/{count}/sh1/plain/{seed}", (20000 * 2 ** place, 20.0 + 2 * place))
                add(folder, f"fox/1700/sh1/rgba-2/{seed}", (40000, 22.0 + gain), (80000, 24.0 + gain))
            few, _ = self.report(folder)
            for seed, count in itertools.product((1, 2), (counts[0], counts[-1])):
                add(folder, f"fox/{count}/sh1/shared4-64/{seed}", (90000, 20.0))  # below the hull
            page, _ = self.report(folder)
        self.assertNotIn("kB | +1.50 +- 6.36 | ", few)  # far from its only count textures are not at their best
        self.assertIn("| fox | cut | 2 | 1, 2 | 40 to 80 kB | +1.50 +- 6.36 | ", page)
        self.assertIn("| fox | cut | 2 | 50 kB | 1, 2 | 3 | 24.14 | 22.64 | +1.50 +- 6.36 |", page)
        self.assertNotIn("| fox | trained for |", page)

    def test_frames_are_compared_at_equal_psnr(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, ms = pathlib.Path(folder), {}
            for name, psnr, time_of in (("3400/sh1/plain", 20.0, 10.0), ("6800/sh1/plain", 24.0, 40.0),
                                        ("3400/sh1/rgba-2", 22.0, 15.0), ("6800/sh1/rgba-2", 25.0, 60.0)):
                add(folder, f"fox/{name}/1", (20000, psnr), model=psnr)
                ms[f"fox/{name}/1"] = {"ms": time_of, "device": "CPU"}
            (folder / "frames.json").write_text(json.dumps(ms))
            page, _ = self.report(folder)
        self.assertIn("| fox | 3,400 Gaussians, SH 1, rgba 2 | 1 | 22.00 | 15.0 | 20.0 | -25 |", page)
        self.assertNotIn("| fox | 6,800 Gaussians, SH 1, rgba 2 | 1 | 25.00", page)  # no plain one comes to that

    def test_what_one_command_makes_is_compared_seed_by_seed(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            add(folder, "fox/1700/sh1/plain/1", (10000, 20.0))
            for arm, seed, size, psnr in (("plain", 1, 24600, 27.0), ("rgba", 1, 24900, 28.0), ("rgba", 3, 25000, 20.0),
                                          ("plain", 2, 25000, 27.5), ("rgba", 2, 25000, 28.1)):
                add_command(folder, f"command/fox/25KB/{arm}/{seed}", size, psnr)
            page, _ = self.report(folder)
        self.assertIn("| fox | 25 kB | 2 | 1,000 | 900 | 27.25 / 0.9000 / 0.0500 | 28.05 / 0.9000 / 0.0500 "
                      "| +0.80 +- 2.54 | 25.00 / 0.9000 / 0.0500 |", page)
        self.assertIn("have 98.4 % of their size", page)

    def test_files_of_different_codecs_are_no_samples_of_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            for seed, codec in ((1, 1), (2, 2)):
                for place, count in enumerate(frontier.COUNTS["fox"]):
                    add(folder, f"fox/{count}/sh1/plain/{seed}", (20000 * 2 ** place, 20.0 + 2 * place), codec=codec)
                for count in frontier.COUNTS["fox"][:3]:
                    files = (40000, 22.0 + seed), (80000, 24.0 + seed)
                    add(folder, f"fox/{count}/sh1/rgba-2/{seed}", *files, codec=codec)
            page, _ = self.report(folder)
        self.assertIn("| fox | cut | 1 | 50 kB | 1 | 3 | 23.64 | 22.64 | +1.00 |", page)
        self.assertIn("| fox | cut | 2 | 50 kB | 2 | 3 | 24.64 | 22.64 | +2.00 |", page)
        self.assertIn("| fox | cut | 1 | 1 | 40 to 80 kB | +1.00 | -29.3 |", page)
        # The mean of half an octave with 3 % fewer bytes of the plain file and 1 % of the other, and of an octave.
        self.assertIn(f"| {50 * (math.sqrt(0.5) * 0.99 / 0.97 - 1 + 0.5 - 1):.1f} +- ", page)

    def test_full_scenes_of_few_textured_counts_are_not_drawn(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, counts = pathlib.Path(folder), frontier.COUNTS["fox-full"]
            add(folder, "fox/1700/sh1/plain/1", (10000, 20.0))
            for place, count in enumerate(counts):
                add(folder, f"fox-full/{count}/sh1/plain/1", (20000 * 2 ** place, 20.0 + 2 * place))
                if place:
                    add(folder, f"fox-full/{count}/sh1/shared4-64/1", (20000 * 2 ** place, 21.0 + 2 * place))
            _, few = self.report(folder)
            add(folder, f"fox-full/{counts[0]}/sh1/shared4-64/1", (20000, 21.0))
            _, enough = self.report(folder)
        self.assertNotIn("fox-full", few)
        self.assertIn("fox-full", enough)

    def test_files_by_one_command_stand_beside_the_hull_of_their_arm(self):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            add(folder, "fox/1700/sh1/plain/1", (10000, 20.0), (40000, 28.0))
            add(folder, "fox/1700/sh1/rgba-8/1", (10000, 21.0), (40000, 29.0))
            add_command(folder, "command/fox/25KB/plain/1", 20000, 25.5)
            add_command(folder, "command/fox/25KB/rgba/1", 20000, 24.75)
            add_command(folder, "command/fox/25KB/rgba/2", 90000, 50.0)  # beyond the hull
            page = self.report(folder)[0].replace("\n", " ")
        self.assertIn("between -0.2 and +1.5 dB beside the first seed's hull", page)
        self.assertIn("(2 of 3 files", page)

    def test_broken_cells_are_named(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, without = pathlib.Path(folder), {"training": None}
            names = [f"fox/{count}/sh1/plain/1" for count in frontier.COUNTS["fox"][:5]]
            for name in names:
                add(folder, name)
            stopped, unscored, uncut, misnamed, cut_off = names

            def change(name, how):
                report = json.loads((folder / f"{name}.json").read_text())
                how(report)
                (folder / f"{name}.json").write_text(json.dumps(report))

            change(stopped, lambda report: report["training"].update(interrupted=True))
            change(unscored, lambda report: report["files"][2].update(psnr=math.nan))
            change(uncut, lambda report: report["files"].pop())
            change(misnamed, lambda report: report.update(cell=stopped))
            (folder / f"{cut_off}.json").write_text('{"cell": ')
            add(folder, "fox/1701/sh1/plain/1")
            add_command(folder, "command/fox/25KB/plain/1", 20000, 25.5, **without)
            add_command(folder, "command/lego-full/250KB/rgba/1", 20000, 25.5, **without)  # is known to have none
            (folder / "frames.json").write_text(json.dumps({stopped: {"ms": 1.0}}))
            run = self.run_report(folder, folder / "page.md", folder / "picture.svg")
            self.assertEqual(run.returncode, 1)
            self.assertNotIn("Traceback", run.stderr)
            expected = {stopped: "the run was interrupted", unscored: "files.psnr is NaN (expected a number)",
                        uncut: "files are not of steps 1, 2, 3, 4, 6, 8", misnamed: f'cell is "{stopped}" (expected',
                        cut_off: "is no JSON: ", "fox/1701/sh1/plain/1": "no cell of bench/frontier.py",
                        "command/fox/25KB/plain/1": "training.machine.device is null (expected a text)",
                        "frames": f"{stopped} lacks a number ms or a text device"}
            for name, what in expected.items():
                self.assertIn(f"{folder / name}.json: {what}", run.stderr)
            self.assertEqual(len(run.stderr.splitlines()), len(expected), run.stderr)

    def test_a_cell_that_was_cut_elsewhere_gets_no_files_of_another_model(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, name = pathlib.Path(folder), "fox/1700/sh1/plain/1"
            add(folder / "cells", name, (10000, 20.0))
            trained_for = []

            def call(_, program, *arguments):
                self.assertNotIn("--run", arguments)
                trained_for.append(arguments[arguments.index("--start-model") + 1].exists())
                arguments[arguments.index("-o") + 1].touch()

            def run(training):
                driver = self.driver(folder)
                driver.call, driver.score = call, lambda *_: {"psnr": 1.0}
                with unittest.mock.patch.multiple(frontier, commit=lambda: "abc1234", training_of=lambda _: training):
                    driver.run(name)

            def state():
                return frontier.state_of(folder / "cells" / name)

            with self.assertRaises(SystemExit):  # without a model
                run(MADE["training"])
            model = folder / "work" / name / "model.tgz"
            model.parent.mkdir(parents=True, exist_ok=True)
            model.touch()
            with self.assertRaises(SystemExit):
                run({**MADE["training"], "seed": 2})
            self.assertEqual((trained_for, state()), ([], "cut only"))
            run(MADE["training"])
            self.assertEqual(trained_for, [True] * len(frontier.TRAINED))
            self.assertEqual(len(json.loads((folder / "cells" / f"{name}.json").read_text())["trained"]),
                             len(frontier.TRAINED))
            self.assertEqual((state(), frontier.state_of(folder / "cells/fox/850")), ("done", "missing"))
            (folder / "cells" / f"{name}.json").write_text("{")
            with self.assertRaises(SystemExit) as told:
                state()
            self.assertIn(f"{name}.json: is no JSON", str(told.exception))

    def test_two_calls_on_one_folder_make_a_cell_once(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, made = pathlib.Path(folder), []

            def cut(name):
                made.append(name)
                time.sleep(0.05)
                return {"cell": name, **MADE}

            drivers = [self.driver(folder, cut=True) for _ in range(2)]
            for driver in drivers:
                driver.cut = cut
            with contextlib.redirect_stderr(io.StringIO()), concurrent.futures.ThreadPoolExecutor(2) as pool:
                for call in [pool.submit(driver.run, "fox/1700/sh1/plain/1") for driver in drivers]:
                    call.result()
        self.assertEqual(made, ["fox/1700/sh1/plain/1"])

    def test_files_of_an_older_codec_are_cut_again_from_the_models_that_are_left(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, cut = pathlib.Path(folder), []
            names = [f"fox/{count}/sh1/plain/1" for count in (850, 1700, 3400)]
            for name in names:
                add(folder / "cells", name, (10000, 20.0))
                path = folder / "cells" / f"{name}.json"
                codec = frontier.CODEC if name == names[2] else frontier.CODEC - 1
                path.write_text(json.dumps({**json.loads(path.read_text()), "training": {"seed": 1}, "codec": codec,
                                            "trained": []}))
                if name != names[1]:
                    (folder / "work" / name).mkdir(parents=True)
                    (folder / "work" / name / "model.tgz").touch()
            driver = self.driver(folder, cut=True)
            driver.files = lambda scene, model, run: cut.append(scene) or [{"steps": 1, "bytes": 9000, "psnr": 20.0}]
            training = {"seed": 1}
            with unittest.mock.patch.multiple(frontier, CELLS=folder / "cells", training_of=lambda _: training):
                for name in names:
                    driver.again(name)
                done = [json.loads((folder / "cells" / f"{name}.json").read_text()) for name in names]
                training["seed"] = 2
                (folder / "work" / names[1]).mkdir(parents=True)
                (folder / "work" / names[1] / "model.tgz").touch()
                with self.assertRaises(SystemExit):  # of a model that is not the cell's
                    driver.again(names[1])
        self.assertEqual(cut, ["fox"])
        self.assertEqual(done[0]["files"][0]["bytes"], 9000)
        self.assertEqual(done[0]["codec"], frontier.CODEC)
        self.assertNotIn("trained", done[0])
        self.assertEqual([report["files"][0]["bytes"] for report in done[1:]], [10000, 10000])

    def test_cells_side_by_side_train_what_they_begin_with_once(self):
        with tempfile.TemporaryDirectory() as folder:
            folder, runs, most, now = pathlib.Path(folder), [], [0], set()
            driver = self.driver(folder)

            def call(_, program, *arguments):
                run = arguments[arguments.index("--run") + 1]
                runs.append(run)
                now.add(run)
                most[0] = max(most[0], len(now))
                time.sleep(0.05)
                run.mkdir(parents=True)
                (run / "model.tgz").touch()
                now.remove(run)

            driver.call = call
            names = [f"{scene}/1700/sh1/{arm}/1" for scene in ("fox", "sample") for arm in ("plain", "rgba-8", "rgba-4")]
            with unittest.mock.patch.object(frontier, "training_of", lambda _: {"interrupted": False}):
                frontier.side_by_side(driver.model, names, 4)
        self.assertEqual(len(runs), 8)
        self.assertEqual(len(set(runs)), 8)
        self.assertGreater(most[0], 1)

    def test_after_a_failure_the_others_run_and_what_it_began_is_not_tried_again(self):
        begun, work = [], tempfile.TemporaryDirectory()
        self.addCleanup(work.cleanup)

        class Driver:
            @frontier.alone
            def run(self, name):
                begun.append(name)
                if name == "start":
                    raise ValueError("no such folder")
                if name != "other":
                    self.run("start")

        for jobs in (1, 3):
            begun.clear()
            Driver.locks = frontier.Locks(pathlib.Path(work.name))
            said = io.StringIO()
            with self.assertRaises(SystemExit) as told, contextlib.redirect_stderr(said):
                frontier.side_by_side(Driver().run, ["a", "b", "start", "other"], jobs)
            self.assertEqual(str(told.exception), "3 of 4 failed: a, b, start")
            self.assertEqual(sorted(said.getvalue().splitlines()),
                             [f"{name}: no such folder" for name in ("a", "b", "start")])
            self.assertEqual(sorted(begun, key=str), sorted(set(begun)))
            self.assertIn("other", begun)

    def test_the_trees_own(self):
        page, picture = self.report(ROOT / "docs/lab/frontier")
        for path, text in ((frontier.PAGE, page), (frontier.PICTURE, picture)):
            self.assertTrue(path.read_text() == text,
                            f"{path}: not what bench/frontier.py report makes now (run it again)")


if __name__ == "__main__":
    unittest.main()

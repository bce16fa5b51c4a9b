#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds what bench/reproduce.py and bench/peers.py keep against full disks, other file systems and calls side by side.

    tests/reproduce_test.py
"""
import argparse
import concurrent.futures
import contextlib
import errno
import io
import json
import os
import pathlib
import sys
import tempfile
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "bench"))
import peers
import reproduce

CELL = "fox/100/none/1"


def full(path, _):
    """Stands in for write_text where the disk has no room left."""
    path.open("w").close()
    raise OSError(errno.ENOSPC, "No space left on device")


class Reproduce(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.trials, self.work = self.folder / "trials", self.folder / "work"
        said = contextlib.redirect_stderr(io.StringIO())
        said.__enter__()
        self.addCleanup(said.__exit__, None, None, None)

    def driver(self):
        return reproduce.Driver(argparse.Namespace(work=self.work, data=self.folder, bin=self.folder, device="cpu",
                                                   trials=self.trials, threads=1, lpips=None, downscale=1,
                                                   iterations=reproduce.LENGTH))

    def model(self, name):
        path = self.work / name / "model.tgz"
        path.parent.mkdir(parents=True)
        path.touch()
        return path

    def test_a_full_disk_leaves_no_run_that_is_done_by_nobody(self):
        driver, done = self.driver(), self.work / CELL / "done"
        driver.call = lambda *_: done.parent.mkdir()
        with unittest.mock.patch.object(reproduce, "commit", lambda: "abc1234"):
            with unittest.mock.patch.object(pathlib.Path, "write_text", full), self.assertRaises(OSError):
                driver.train(CELL)
            self.assertFalse(done.exists())
        done.touch()  # as such a disk left it before
        with self.assertRaises(SystemExit) as told:
            self.driver().run(CELL)
        self.assertIn(f"{done}: empty", str(told.exception))

    def test_a_cell_that_begins_with_a_model_names_no_other_start(self):
        driver, calls = self.driver(), {}

        def call(cell, program, *flags):
            calls[cell.name] = flags
            (self.work / cell.name).mkdir(parents=True)

        driver.call = call
        driver.start = lambda name: self.work / name
        driver.whole = lambda name: 1000
        with unittest.mock.patch.object(reproduce, "commit", lambda: "abc1234"):
            for name in ["lego/100/none/1", "lego/100/rgba/1"]:
                driver.train(name)
        self.assertIn("--start", calls["lego/100/none/1"])
        self.assertNotIn("--start", calls["lego/100/rgba/1"])
        self.assertIn("--start-model", calls["lego/100/rgba/1"])

    def test_frames_of_two_calls_are_kept_with_work_on_another_file_system(self):
        names = [CELL, "lego/100/none/1"]
        for name in names:
            self.model(name)

        def measure(command, **_):
            frame = {"processor_ms": 1.0, "device": "CPU", "width": 1, "height": 1}
            pathlib.Path(command[-1]).write_text(json.dumps(frame))

        def replace(source, target, replaced=os.replace):
            self.assertEqual(pathlib.Path(source).parent, pathlib.Path(target).parent)
            replaced(source, target)

        with unittest.mock.patch.object(reproduce.subprocess, "run", measure), \
                unittest.mock.patch.object(reproduce.os, "replace", replace), \
                concurrent.futures.ThreadPoolExecutor(2) as pool:
            for call in [pool.submit(self.driver().frames, name) for name in names]:
                call.result()
        self.assertEqual(sorted(reproduce.frames_in(self.trials)), names)

    def test_a_lock_is_of_one_thread_of_all_calls_and_may_be_taken_twice(self):
        locks, others, order = reproduce.Locks(self.work), reproduce.Locks(self.work), []

        def other():
            with others[CELL]:
                order.append("the other")

        with concurrent.futures.ThreadPoolExecutor(1) as pool:
            with locks[CELL]:
                with locks[CELL]:
                    call = pool.submit(other)
                with self.assertRaises(concurrent.futures.TimeoutError):
                    call.result(timeout=0.02)
                order.append("first")
            call.result()
        self.assertEqual(order, ["first", "the other"])
        # Who is told to stop waits no longer.
        self.addCleanup(reproduce.STOPPING.clear)
        with concurrent.futures.ThreadPoolExecutor(1) as pool, locks[CELL]:
            call = pool.submit(other)
            reproduce.STOPPING.set()
            self.assertIsInstance(call.exception(timeout=30), KeyboardInterrupt)

    def test_a_full_disk_leaves_the_samples_that_there_were(self):
        file = self.folder / "peers.json"
        arguments = ["peers.py", str(self.folder / "a.ply"), "--ours", "--peer", "nothing=true", "--rounds", "1",
                     "--json", str(file)]
        with unittest.mock.patch.object(sys, "argv", arguments), contextlib.redirect_stdout(io.StringIO()):
            peers.main()
            before = file.read_text()
            with unittest.mock.patch.object(pathlib.Path, "write_text", full), self.assertRaises(OSError):
                peers.main()
        self.assertIn("processor_ms", before)
        self.assertEqual(file.read_text(), before)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the bookkeeping of scripts/fuzz_night.py, and docs/lab/fuzzing.md against what the nights counted.

    tests/fuzzing_test.py
"""
import json
import pathlib
import sys
import tempfile
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import fuzz_night

MOST_BYTES = 2_000_000


class Nights(unittest.TestCase):
    def test_the_page_says_what_the_nights_counted(self):
        record = json.loads(fuzz_night.RECORD.read_text())
        self.assertEqual(fuzz_night.PAGE.read_text(), fuzz_night.page(record))

    def test_executions_of_both_engines_add_up(self):
        entry = {"libfuzzer": {"executions": 3000, "seconds": 2}, "afl": {"executions": 400, "seconds": 2},
                 "edges": [1, 2], "corpus": {"files": 1, "bytes": 10}, "open": 0}
        self.assertIn("| `fuzz_x` | 3,400 | 3,000 | 400 | 1,500 | 1 of 2 | not measured | 1 files, 10 B | 0 |",
                      fuzz_night.table({"x": entry}))

    def test_every_target_has_a_corpus_and_the_sources_that_it_is_for(self):
        targets = {file.stem for file in (ROOT / "fuzz").glob("read_*.cpp")} - {"read_files"}
        self.assertEqual(targets, set(fuzz_night.READERS))
        self.assertEqual(targets, {folder.name for folder in fuzz_night.CORPUS.iterdir()})
        for sources in fuzz_night.READERS.values():
            for source in sources:
                self.assertTrue((ROOT / source).is_file(), source)

    def test_the_corpora_are_small(self):
        sizes = {target: sum(file.stat().st_size for file in (fuzz_night.CORPUS / target).iterdir())
                 for target in fuzz_night.READERS}
        self.assertLess(sum(sizes.values()), MOST_BYTES)
        self.assertLessEqual(max(sizes.values()), fuzz_night.MOST_BYTES)

    def test_a_merge_keeps_the_smallest_files_within_the_bound(self):
        def merged(command, **_):
            if "-merge=1" in command:
                kept, given = pathlib.Path(command[-4]), command[-3:]
                for folder in given:
                    for file in pathlib.Path(folder).iterdir():
                        (kept / file.name).write_bytes(file.read_bytes())
            return unittest.mock.Mock(returncode=0, stderr="")

        with tempfile.TemporaryDirectory() as name:
            root = pathlib.Path(name)
            corpus, working, found = (root / kind / "read_x" for kind in ("corpus", "working", "found"))
            for folder in (corpus, working, found):
                folder.mkdir(parents=True)
            (corpus / "old").write_bytes(b"old")
            (found / "large").write_bytes(bytes(90))
            (found / "small").write_bytes(b"small")
            with unittest.mock.patch.multiple(fuzz_night, run=merged, MOST_BYTES=20, WORKING=root / "working",
                                              CORPUS=root / "corpus", ENGINES={"libfuzzer": root}):
                fuzz_night.merge("read_x", found)
            self.assertEqual({file.read_bytes() for file in corpus.iterdir()}, {b"old", b"small"})
            self.assertEqual({file.stat().st_size for file in working.iterdir()}, {3, 5, 90})


unittest.main()

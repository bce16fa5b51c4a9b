#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds the bookkeeping of scripts/fuzz_night.py, and docs/lab/fuzzing.md against what the nights counted.

    tests/fuzzing_test.py
"""
import json
import pathlib
import re
import sys
import tempfile
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import fuzz_night

MOST_BYTES = 2_000_000
NEW_BYTES = 16 << 10  # a target: of seeds that no night has seen


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

    def test_every_reader_that_a_first_byte_chooses_has_a_seed(self):
        for source in sorted((ROOT / "fuzz").glob("read_*.cpp")):
            text = source.read_text()
            self.assertNotRegex(text, r"data\[0\] *%", f"{source.name}: a new reader would be given others' files")
            chosen = {file.read_bytes()[:1] for file in (fuzz_night.CORPUS / source.stem).glob("*")}
            for number in re.findall(r"case (\d+):", text):
                self.assertIn(bytes([int(number)]), chosen, f"fuzz/corpus/{source.stem} has no file for this reader of "
                              f"{source.name} (expected one of fuzz/make_seeds.py in it)")

    def test_the_corpora_are_small(self):
        sizes = {target: sum(file.stat().st_size for file in (fuzz_night.CORPUS / target).iterdir())
                 for target in fuzz_night.READERS}
        self.assertLess(sum(sizes.values()), MOST_BYTES)
        for target, size in sizes.items():
            self.assertLessEqual(size, fuzz_night.MOST_BYTES + NEW_BYTES,
                                 f"fuzz/corpus/{target} is too large (expected less beyond what a night leaves: "
                                 f"a smaller seed, or scripts/fuzz_night.py --only {target}, which keeps the best)")

    def test_what_reaches_the_most_for_its_bytes_is_kept_within_the_bound(self):
        with tempfile.TemporaryDirectory() as name:
            def file(title, size):
                path = pathlib.Path(name, title)
                path.write_bytes(bytes(size))
                return path

            reached = [(file("large", 90), set(range(50))), (file("good", 30), set(range(40))),
                       (file("other", 10), {98, 99}), (file("known", 1), {98}), (file("too large", 500), {200, 201}),
                       (file("nothing", 1), set())]
            with unittest.mock.patch.object(fuzz_night, "MOST_BYTES", 60):
                chosen = fuzz_night.within_bound(reached)
        self.assertEqual([path.name for path in chosen], ["good", "known", "other"])

    def test_a_corpus_is_replaced_by_files_named_after_their_content(self):
        with tempfile.TemporaryDirectory() as name:
            corpus, found = pathlib.Path(name, "corpus/read_x"), pathlib.Path(name, "found")
            for folder in (corpus, found):
                folder.mkdir(parents=True)
            (corpus / "old").write_bytes(b"old")
            (found / "new").write_bytes(b"new")
            fuzz_night.replace(corpus, [found / "new"])
            self.assertEqual([(path.name, path.read_bytes()) for path in corpus.iterdir()],
                             [("c2a6b03f190dfb2b4aa91f8af8d477a9bc3401dc", b"new")])
            self.assertEqual([path.name for path in corpus.parent.iterdir()], ["read_x"])


unittest.main()

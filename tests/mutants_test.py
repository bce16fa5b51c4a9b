#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds what scripts/mutants.py makes of texts, and docs/lab/mutants.md against the mutants that were judged.

    tests/mutants_test.py
"""
import pathlib
import sys
import tempfile
import unittest
import unittest.mock

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import mutants

SOURCE = "int half(int a) {\n  // a + b\n  TG_ASSERT(a > 0, \"positive\");\n  return a / 2;\n}\n"


class Mutants(unittest.TestCase):
    def test_the_page_says_what_became_of_the_mutants(self):
        records = {room: mutants.load(room) for room in mutants.EVERY_ROOM}
        self.assertEqual(mutants.PAGE.read_text(), mutants.page(records))

    def test_every_survivor_says_why(self):
        for room in mutants.EVERY_ROOM:
            for row in mutants.load(room):
                if row["result"] == "survived":
                    self.assertTrue(row.get("why"), mutants.told(row))

    def test_no_mutant_is_judged_twice(self):
        for room in mutants.EVERY_ROOM:
            names = [(row["source"], row["name"]) for row in mutants.load(room)]
            self.assertEqual(len(names), len(set(names)))

    def test_sources_are_there(self):
        for patterns, _, others in mutants.ROOMS.values():
            for pattern in [*patterns, *(f"tests/{folder}/*_test.cpp" for folder in others)]:
                self.assertTrue(list(ROOT.glob(pattern)), pattern)
        for headers, _ in mutants.HEADER_ROOMS.values():
            for header in headers:
                self.assertTrue((ROOT / header).is_file(), header)

    def test_a_compiler_is_what_is_left_of_a_line(self):
        line = "/usr/bin/ccache /usr/bin/c++ -Dx -O2 -Werror -MD -MT a.o -MF a.o.d -o a.o -c /tree/a.cpp"
        self.assertEqual(mutants.compiler_of(line), ["/usr/bin/c++", "-Dx", "-O2"])

    def test_a_change_is_the_lines_that_differ(self):
        self.assertEqual(mutants.change(SOURCE, SOURCE.replace("/ 2", "/ 1")),
                         (["  return a / 2;"], ["  return a / 1;"]))
        self.assertEqual(mutants.change(SOURCE, SOURCE.replace("  return a / 2;\n", "")), (["  return a / 2;"], []))

    def test_text_and_asserts_are_of_no_interest(self):
        for old, new in (("a + b", "a - b"), ("a > 0", "a >= 0"), ("positive", "negative")):
            self.assertTrue(mutants.is_of_no_interest(SOURCE, SOURCE.replace(old, new)), old)
        self.assertFalse(mutants.is_of_no_interest(SOURCE, SOURCE.replace("/ 2", "* 2")))
        self.assertFalse(mutants.is_of_no_interest(SOURCE, SOURCE.replace("  return a / 2;", "  /*return a / 2;*/")))

    def test_a_line_of_the_record_gives_the_mutant_again(self):
        with tempfile.TemporaryDirectory() as name, unittest.mock.patch.object(mutants, "ROOT", pathlib.Path(name)):
            pathlib.Path(name, "half.cpp").write_text(SOURCE)
            row = {"source": "half.cpp", "line": 4, "old": ["  return a / 2;"], "new": ["  return a / 1;"]}
            self.assertEqual(mutants.text_of(row), SOURCE.replace("/ 2", "/ 1"))
            row["line"] = 3
            with self.assertRaises(SystemExit):
                mutants.text_of(row)

    def test_rooms_are_counted(self):
        rows = [{"result": "killed"}] * 7 + [{"result": "killed", "survived_before": True}] + [{"result": "same"}] + \
               [{"result": "stillborn"}] * 3 + [{"result": "survived", "why": "equivalent: no"}] + \
               [{"result": "survived", "why": "not tested"}]
        self.assertIn("| `x` | 14 | 3 | 1 | 10 | 7, 70.0% | 8, 80.0% | 2 | 1 | 88.9% |", mutants.rooms_table({"x": rows}))

    def test_a_command_that_runs_too_long_ends(self):
        long = (60, 60)
        self.assertTrue(mutants.run(["true"], long)[0])
        self.assertFalse(mutants.run(["false"], long)[0])
        self.assertFalse(mutants.run(["sleep", "60"], (0.2, 60))[0])
        self.assertFalse(mutants.run(["sh", "-c", "while :; do :; done"], (60, 1))[0])


unittest.main()

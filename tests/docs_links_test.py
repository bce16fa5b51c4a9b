#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every relative link and anchor of the documents leads somewhere, every place in docs/ that a source names exists, and
every source that a document names, too.

    tests/docs_links_test.py            prints what leads nowhere; exit code 1 if anything does
"""
import os
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
SOURCES = (".h", ".cpp", ".cu", ".comp", ".vert", ".frag", ".glsl", ".js", ".html", ".py", ".sh", ".cmake", ".txt",
           ".md")
CODE = re.compile(r"^(?:    [^\n]*|```.*?^```)$", re.S | re.M)
LINK = re.compile(r"\]\(([^)\s:#]*)(?:#([\w-]+))?\)")
BREAK = re.compile(r"\s*\n[ \t]*(?:(?://|#)[ \t]*)?")  # of a line, in a comment, too
NAMED = re.compile(r'(?<![\w/])(docs/[\w/-]+\.(?:md|tgz|glb|png))(?:, (?:section )?["*]([^"*]+)["*])?')
SECTION = re.compile(r'\]\(([^)\s:#]+)\), (?:section )?"([^"]+)"')
ROOMS = "bench|cmake|converter|core|fuzz|library|python|render|scripts|shaders|tests|training|viewer"
SOURCE = re.compile(rf"(?<![\w/.-])((?:{ROOMS})/[\w./-]*\b)")
LABEL = r"\d+(?:\.\d+)*[a-g]?"  # of a section or an equation of docs/math.md
LABELS = re.compile(rf"math\.md(?:#[\w-]*)?\)? \(?({LABEL}(?:(?:, | to | and |, \(|\), \(){LABEL})*)")


def headings(path):
    return re.findall(r"^#+ (.*)", CODE.sub("", path.read_text()), flags=re.M)


def anchors(path):  # as GitHub makes them
    return [re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings(path)]


def files():
    for folder, folders, names in os.walk(ROOT):
        folders[:] = [f for f in folders if not f.startswith((".", "build", "node_modules"))]
        yield from (pathlib.Path(folder, name) for name in names if name.endswith(SOURCES))


def broken(path):
    text = path.read_text(errors="replace")
    flat = BREAK.sub(" ", text)
    for name, heading in NAMED.findall(flat):
        if not (ROOT / name).exists() or heading and heading not in headings(ROOT / name):
            yield f"{name} {heading}".strip()
    math = ROOT / "docs/math.md"
    labels = {h.split()[0] for h in headings(math)} | set(re.findall(rf"  \(({LABEL})\)", math.read_text()))
    yield from (f"docs/math.md {n}" for run in LABELS.findall(text) for n in re.findall(LABEL, run) if n not in labels)
    if path.suffix != ".md":
        return
    yield from (name for name in SOURCE.findall(text) if not (ROOT / name).exists())
    for name, heading in SECTION.findall(flat):
        target = path.parent / name
        if target.exists() and heading not in headings(target):
            yield f"{name} {heading}"
    for name, anchor in LINK.findall(CODE.sub("", text)):
        target = (path.parent / name).resolve() if name else path
        if not target.exists() or anchor and anchor not in anchors(target):
            yield f"{name}#{anchor}".strip("#")


lost = [f"{path.relative_to(ROOT)}: {place} leads nowhere" for path in files() for place in broken(path)]
print(*lost, sep="\n", end="\n" if lost else "")
sys.exit(1 if lost else 0)

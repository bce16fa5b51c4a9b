#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds web/src to what pages can embed, and its generated module to its sources.

    tests/web/modules_test.py [SHADERS_JS]       SHADERS_JS: as the build made it (web/shaders.js of a build's folder)

The choices that settings have, the element's attributes and the words of a page's link are those of the types, of
web/README.md and of docs/html.md, and choices have the numbers that the shaders know them by.

cmake/embed_page.cmake puts modules into one script by taking their imports and the word export away: imports are of
names, one statement a module, exports stand before what they export, and no two modules that a page embeds have a name
in common at their top level.
"""
import collections
import pathlib
import re
import sys

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
SOURCE = REPOSITORY / "web/src"
PAGES = [REPOSITORY / "converter/html/page", REPOSITORY / "converter/serve/page"]
ENGINES = {"three.js", "babylon.js", "playcanvas.js"}
IMPORT = re.compile(r"^import \{[^}]*\} from '(\./[a-z_]+\.js)';$", re.M)
wrong = []


def names_of(text):
    names = []
    for line in text.splitlines():
        found = re.match(r"(?:export )?(?:async )?(?:function\*?|class) (\w+)", line)
        if found:
            names.append(found[1])
        found = re.match(r"(?:export )?(?:const|let) (.*)", line)
        if found:
            names += re.findall(r"(?:^|, )(\w+)(?= =|,|;)", re.sub(r"[({\[].*?[)}\]]", "", found[1]))
    return names


def check_forms(file):
    text = file.read_text()
    for number, line in enumerate(text.splitlines(), 1):
        if line.startswith("export") and not re.match(r"export (const|function|class|async function)\b", line):
            wrong.append(f"{file.name}:{number}: {line.strip()} (expected export before const, function or class)")
    left = IMPORT.sub("", text)
    for line in re.findall(r"^import.*", left, re.M):
        wrong.append(f"{file.name}: {line} (expected import {{names}} from './module.js';)")
    for module in IMPORT.findall(text):
        if not (SOURCE / module).is_file():
            wrong.append(f"{file.name}: {module} is not there")
        if module[2:] in ENGINES:
            wrong.append(f"{file.name}: {module} may be imported by pages only")


def check_pages():
    shared = (PAGES[0] / "viewer.html").read_text()
    for folder, name in zip(PAGES, ("page.html", "live.html")):
        embedded = re.findall(r"@([a-z_]+\.js)@", shared + (folder / name).read_text())
        owners = collections.defaultdict(list)
        for module in embedded:
            file = next(f for f in (folder / module, PAGES[0] / module, SOURCE / module) if f.is_file())
            for declared in names_of(file.read_text()):
                owners[declared].append(module)
            for needed in IMPORT.findall(file.read_text()):
                if needed[2:] not in embedded[:embedded.index(module)]:
                    wrong.append(f"{name}: {module} needs {needed[2:]} before it")
        for declared, modules in owners.items():
            if len(modules) > 1:
                wrong.append(f"{name}: {declared} is declared by {' and '.join(modules)}")
        if len(owners) < 50:
            wrong.append(f"{name}: only {len(owners)} names found")


def expect(place, what, found, expected):
    if set(found) != set(expected):
        wrong.append(f"{place}: {what}: {', '.join(sorted(found))} (expected {', '.join(sorted(expected))})")


def within(text, pattern):
    """What stands after the words and a bracket or a =, to a closing one or a ;."""
    found = re.search(pattern + r"[^;]*?[\[{=](.*?)[\]};]", text, re.S)
    return found[1] if found else ""


def check_settings():
    sources = {file.name: file.read_text() for file in [*SOURCE.iterdir(), PAGES[0] / "panel.js"]}
    types, shared = sources["index.d.ts"], (REPOSITORY / "shaders/shared/limits.h").read_text()
    readme, manual = (REPOSITORY / "web/README.md").read_text(), (REPOSITORY / "docs/html.md").read_text()
    named = set()  # settings that choose from names
    for key, table, in re.findall(r"choice\('([a-z-]+)', Object\.keys\((\w+)\)\)", sources["viewer.js"]):
        named.add(key)
        name = next(name for name, text in sources.items() if f"export const {table} = {{" in text)
        choices = dict(re.findall(r"(\w+): (\d+)", within(sources[name], f"export const {table}")))
        union = f"export type {key.capitalize()}"
        expect("index.d.ts", union, re.findall(r"'(\w+)'", within(types, union)), choices)
        attribute = re.search(rf"`{key}`\s+\(([^)]*)\)", readme)
        expect("web/README.md", f"`{key}`", re.findall(r"\w+", attribute[1]) if attribute else [], choices)
        prefix = {"show": "kOutput", "intersection": "kIntersect", "outside": "kOutside"}.get(key)
        for choice, number in choices.items():
            constant = f"{prefix}{choice[0].upper()}{choice[1:]} = {number}u;"
            if prefix and constant not in shared:
                wrong.append(f"{name}: {table}.{choice} is {number} (expected shaders/shared/limits.h with {constant})")
        if f"`{key}`" not in manual and not re.search(rf"[?&]{key}=", manual):
            wrong.append(f"docs/html.md: no {key} (expected it among those of the address)")
    page = re.search(r"for \(const key of \[(.*?)\]\)", sources["panel.js"])
    expect("panel.js", "what a link has", re.findall(r"'([a-z-]+)'", page[1]), named)
    attributes = re.findall(r"'([a-z-]+)'", within(sources["element.js"], "const SETTINGS"))
    members = re.findall(r"^  '?([a-z-]+)'?\?:", re.search(r"interface ViewerSettings \{(.*?)^\}", types, re.S | re.M)[1],
                         re.M)
    expect("index.d.ts", "ViewerSettings", members, {"size", *attributes})
    expect("element.js", "SETTINGS that choose from names", named.intersection(attributes), named)
    own = re.search(r"static settingsOf.*?return \{(.*?)\};", sources["splats.js"], re.S)[1]
    members = re.findall(r"^  (\w+):", re.search(r"interface Settings \{(.*?)^\}", types, re.S | re.M)[1], re.M)
    expect("index.d.ts", "Settings", members, re.findall(r"(?:^|[,{] |\n\s+)(\w+):", own))


for source in sorted(SOURCE.glob("*.js")):
    if source.name not in ENGINES and source.name != "index.js":
        check_forms(source)
check_pages()
check_settings()
if len(sys.argv) > 1 and pathlib.Path(sys.argv[1]).read_bytes() != (SOURCE / "shaders.js").read_bytes():
    wrong.append(f"web/src/shaders.js is not what its sources give (cp {sys.argv[1]} {SOURCE / 'shaders.js'})")
print("\n".join(wrong) or "modules and pages agree")
sys.exit(bool(wrong))

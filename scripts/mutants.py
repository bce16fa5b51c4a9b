#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How many small faults the tests notice: mutants.py ROOM COUNT [--build FOLDER]

Draws mutants of ROOM's sources, as universalmutator (pip) makes them, until docs/lab/mutants/ROOM.jsonl has COUNT that
compile to other code than the source does. Each is compiled by the flags of FOLDER, a tree of this source that is built
with tests (Ninja, GNU ld), and linked before its libraries with the other sources of its folder, each compiled alone:
nothing of that folder's library is linked then, since the linker would refuse two definitions. The room's test program
runs, first the cases of the folder, until one fails. The sources and FOLDER stay as they are.

A line of JSON a mutant: killed (a case fails, or runs ten times as long), survived, same (the compiler makes the same
code of it) or stillborn (it does not compile or link). A later call goes on where this one ended. --again judges those
once more that survived and have no "why" yet, which is written into their lines by hand: a case may have been made for
them. --table writes the tables of docs/lab/mutants.md and ends.

A room of headers has several programs. The mutant lies before the header in the compiler's path; every object of a
program that includes it is compiled anew, and one program after the other is linked with these and runs.

Comments, the text of messages, includes, and asserts, which check us and not what we are given, are not mutated."""
import argparse
import collections
import functools
import json
import os
import pathlib
import random
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
RECORDS, PAGE = ROOT / "docs/lab/mutants", ROOT / "docs/lab/mutants.md"
# Sources, the program whose cases are to notice, and, where the others have nothing to do with them, the folders of
# cases that run beside those of the sources' own folder.
ROOMS = {
    "core": (["core/bundle/blocks.cpp", "core/bundle/camera_file.cpp", "core/bundle/manifest.cpp",
              "core/bundle/ply.cpp", "core/bundle/ply_vertices.cpp", "core/bundle/read_bundle.cpp",
              "core/bundle/splat_rows.cpp", "core/bundle/training_json.cpp", "core/file/file.cpp",
              "core/file/gzip_reader.cpp", "core/file/json.cpp", "core/file/safetensors.cpp", "core/image/exr.cpp",
              "core/image/jpeg.cpp", "core/image/png.cpp", "core/image/webp.cpp"], "core_test", []),
    "step": (["training/step/*.cpp"], "training_test", ["training/run"]),
}
# Headers, and the programs whose cases are to notice. That of the CUDA kernels as C++ comes last: it is the slowest.
HEADER_ROOMS = {
    "shared": (["shaders/shared/record.h", "shaders/shared/sh.h", "shaders/shared/splat.h", "shaders/shared/texture.h"],
               ["reference_test", "cpu_renderer_test", "training_cuda_test"]),
}
EVERY_ROOM = [*ROOMS, *HEADER_ROOMS]
SEED = 1
LEAST_LIMIT_S = 10
MOST_MEMORY, MOST_FILE = 6 << 30, 4 << 30  # a reader without its bounds takes what there is


def mutants_of(source):
    """Every mutant of a source as (name, text)."""
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mutate", ROOT / source, "cpp", "--noCheck", "--mutantDir", folder], check=True, cwd=folder,
                       capture_output=True)
        return sorted((file.name, file.read_text()) for file in pathlib.Path(folder).glob("*.mutant.*"))


def change(source, mutant):
    """The lines that are gone and those that came."""
    old, new = source.splitlines(), mutant.splitlines()
    while old and new and old[0] == new[0]:
        old, new = old[1:], new[1:]
    while old and new and old[-1] == new[-1]:
        old, new = old[:-1], new[:-1]
    return old, new


def is_of_no_interest(source, mutant):
    """Whether nothing but a comment, a message, an include or an assert differs."""
    def bare(line):
        return re.sub(r'"(\\.|[^"\\])*"|//.*', '""', line).strip()

    old, new = ([bare(line) for line in lines] for lines in change(source, mutant))
    return old == new or all(re.match(r"$|#|\"\"$|(TG_ASSERT|static_assert)\(", line) for line in old)


def draw(sources, seed):
    """All mutants of the sources as (source, name, text), in the order of a seed."""
    found = []
    for source in sources:
        text = (ROOT / source).read_text()
        found += [(source, name, mutant) for name, mutant in mutants_of(source) if not is_of_no_interest(text, mutant)]
    random.Random(seed).shuffle(found)
    return found


def run(command, limit):
    """Whether a command succeeds within a limit of the clock and of the processor [s], and how many it took of each;
    what it started ends with it."""
    def limited():
        for what, most in ((resource.RLIMIT_CPU, int(limit[1])), (resource.RLIMIT_AS, MOST_MEMORY),
                           (resource.RLIMIT_FSIZE, MOST_FILE), (resource.RLIMIT_CORE, 0)):
            resource.setrlimit(what, (most, most))

    began, before = time.monotonic(), resource.getrusage(resource.RUSAGE_CHILDREN)
    nothing = subprocess.DEVNULL
    with subprocess.Popen([str(word) for word in command], cwd=ROOT, stdin=nothing, stdout=nothing, stderr=nothing,
                          start_new_session=True, preexec_fn=limited) as child:
        try:
            passed = child.wait(limit[0]) == 0
        except subprocess.TimeoutExpired:
            passed = False
        finally:
            try:
                os.killpg(child.pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return passed, (time.monotonic() - began, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)


def commands_of(folder, program):
    """What compiles the sources of a program, and what links it."""
    listed = subprocess.run(["ninja", "-C", folder, "-t", "commands", program], check=True, text=True,
                            capture_output=True).stdout.splitlines()
    link = next(line for line in reversed(listed) if f" -o bin/{program} " in line)
    return [line for line in listed if " -c " in line], re.sub(r"^: && | && (cd |:$).*", "", link)  # no registering


def compiler_of(command):
    """The words of a line that compiles, without ccache, what becomes an error, and the files."""
    words = [""] + shlex.split(command)
    start = next(i for i, word in enumerate(words) if re.search(r"(\+\+|cc)(-\d+)?$", word))  # after ccache
    return [word for before, word in zip(words[start - 1:], words[start:]) if word not in ("-Werror", "-MD")
            and not {word, before} & {"-MT", "-MF", "-o", "-c"}]


class Build:
    """Compiles, links and tests beside a built tree. `work` is a folder for what it makes."""

    def __init__(self, folder, room, work):
        _, self.program, self.others = ROOMS[room]
        self.folder, self.work = folder, work
        self.commands, self.link = commands_of(folder, self.program)
        self.limits = {}

    def compile(self, source, text):
        """The object of a text in the place of a source, by the command of its folder; None if it is not C++."""
        place = f" {pathlib.Path(source).parent}/CMakeFiles/"
        command = compiler_of(next(line for line in self.commands if place in line and ".o " in line))
        file, out = self.work / pathlib.Path(source).name, self.work / "out.o"
        file.write_text(text)
        done = subprocess.run([*command, "-w", "-c", file, "-o", out], cwd=self.folder, capture_output=True)
        return out.read_bytes() if done.returncode == 0 else None

    @functools.cache
    def beside(self, folder):
        """The objects of a folder's sources, each compiled alone: name to bytes."""
        return {file.name: self.compile(file.relative_to(ROOT), file.read_text())
                for file in (ROOT / folder).glob("*.cpp")}

    def cases(self, folder):
        """What of the program to run first and then, as arguments."""
        def of(folder):
            return [f"[#{file.stem}]" for file in sorted((ROOT / "tests" / folder).glob("*_test.cpp"))]

        rest = [",".join(of(other)) for other in self.others] or ["".join(f"~{case}" for case in of(folder))]
        return [",".join(of(folder)), *rest]

    def test(self, source, changed):
        """What becomes of the cases with this object for a source."""
        folder = pathlib.Path(source).parent
        files = []
        for name, object_ in (self.beside(folder) | {pathlib.Path(source).name: changed}).items():
            files.append(self.work / f"{name}.o")
            files[-1].write_bytes(object_)
        program = self.work / self.program
        link = self.link.replace(f" -o bin/{self.program} ", f" {shlex.join(map(str, files))} -o {program} ")
        if subprocess.run(["bash", "-c", link], cwd=self.folder, capture_output=True).returncode != 0:
            return "stillborn"
        for which in self.cases(folder):
            passed, took = run([program, "-#", "-a", which], self.limits.get((folder, which), (3600, 3600)))
            if not passed:
                return "killed"
            self.limits.setdefault((folder, which), [max(LEAST_LIMIT_S, 10 * seconds) for seconds in took])
        return "survived"

    def judge(self, source, mutant):
        folder, name = pathlib.Path(source).parent, pathlib.Path(source).name
        first = not any(of == folder for of, _ in self.limits)
        if first and self.test(source, self.beside(folder)[name]) != "survived":
            sys.exit(f"{self.program} does not link with the sources of {folder} alone, or fails by itself")
        changed = self.compile(source, mutant)
        if changed is None:
            return "stillborn"
        if changed == self.beside(folder)[name]:
            return "same"
        return self.test(source, changed)


class HeaderBuild:
    """The same for headers."""

    def __init__(self, folder, room, work):
        _, programs = HEADER_ROOMS[room]
        self.folder, self.work, self.before = folder, work, work / "before"
        self.programs = {program: commands_of(folder, program) for program in programs}
        self.limits, self.unchanged = {}, {}
        told = subprocess.run(["ninja", "-C", folder, "-t", "deps"], check=True, text=True, capture_output=True).stdout
        self.includes = {}  # object to what it includes
        for block in told.split("\n\n"):
            head, *rest = block.splitlines() or [""]
            self.includes[head.split(":")[0]] = {line.strip() for line in rest}

    def objects(self, program, header):
        """The lines that compile what of a program includes a header, by object."""
        made = ((re.search(r" -o (\S+\.o) ", line).group(1), line) for line in self.programs[program][0])
        return {name: line for name, line in made if str(ROOT / header) in self.includes.get(name, ())}

    def compile(self, lines, header, text):
        """Objects of a program with a text in the place of a header; None if it is not C++."""
        shutil.rmtree(self.before, ignore_errors=True)
        place = self.before / pathlib.Path(*pathlib.Path(header).parts[1:])  # shaders/ is in the path
        place.parent.mkdir(parents=True)
        place.write_text(text)
        compiled = {}
        for i, (name, line) in enumerate(lines.items()):
            source, out = re.search(r" -c (\S+)", line).group(1), self.work / f"{i}.o"
            compiler, *flags = [word for word in compiler_of(line) if word != source]
            done = subprocess.run([compiler, f"-I{self.before}", *flags, "-w", "-c", source, "-o", out],
                                  cwd=self.folder, capture_output=True)
            if done.returncode != 0:
                return None
            compiled[name] = out
        return compiled

    def passes(self, program, compiled):
        link, more, out = self.programs[program][1], [], self.work / program
        for name, file in compiled.items():
            if f" {name} " in link:
                link = link.replace(f" {name} ", f" {file} ")
            else:
                more.append(file)  # before the library that has it
        link = link.replace(f" -o bin/{program} ", f" {shlex.join(map(str, more))} -o {out} ")
        subprocess.run(["bash", "-c", link], cwd=self.folder, check=True, capture_output=True)
        passed, took = run([out, "-#", "-a"], self.limits.get(program, (3600, 3600)))
        self.limits.setdefault(program, [max(LEAST_LIMIT_S, 10 * seconds) for seconds in took])
        return passed

    def judge(self, header, mutant):
        differs = False
        for program in self.programs:
            lines = self.objects(program, header)
            if (program, header) not in self.unchanged:
                compiled = self.compile(lines, header, (ROOT / header).read_text())
                self.unchanged[program, header] = {name: file.read_bytes() for name, file in compiled.items()}
                if not self.passes(program, compiled):
                    sys.exit(f"{program} fails by itself")
            compiled = self.compile(lines, header, mutant)
            if compiled is None:
                return "stillborn"
            if all(file.read_bytes() == self.unchanged[program, header][name] for name, file in compiled.items()):
                continue
            differs = True
            if not self.passes(program, compiled):
                return "killed"
        return "survived" if differs else "same"


def judged(rows):
    return sum(row["result"] in ("killed", "survived") for row in rows)


def load(room):
    file = RECORDS / f"{room}.jsonl"
    return [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []


def write(path, text):
    fresh = path.with_name(path.name + ".new")
    fresh.write_text(text)
    fresh.rename(path)


def save(room, rows):
    RECORDS.mkdir(exist_ok=True)
    write(RECORDS / f"{room}.jsonl", "".join(json.dumps(row) + "\n" for row in rows))


def shown(lines):
    return " ".join(line.strip() for line in lines) or "nothing"


def told(row):
    """A mutant in a line."""
    return f"{row['result']}: {row['source']}:{row['line']}: {shown(row['old'])} -> {shown(row['new'])}"


def text_of(row):
    """The source with a mutant's lines in it."""
    lines = (ROOT / row["source"]).read_text().splitlines(keepends=True)
    first, end = row["line"] - 1, row["line"] - 1 + len(row["old"])
    if "".join(lines[first:end]).splitlines() != row["old"]:
        sys.exit(f"{row['source']}:{row['line']}: is another line now (expected {row['old']})")
    return "".join(lines[:first] + [line + "\n" for line in row["new"]] + lines[end:])


def find_more(room, count, build):
    patterns = (ROOMS | HEADER_ROOMS)[room][0]
    rows = load(room)
    known = {(row["source"], row["name"]) for row in rows}
    sources = sorted({str(file.relative_to(ROOT)) for pattern in patterns for file in ROOT.glob(pattern)})
    for source, name, mutant in draw(sources, SEED):
        if judged(rows) >= count:
            break
        if (source, name) in known:
            continue
        text = (ROOT / source).read_text()
        old, new = change(text, mutant)
        line = len(os.path.commonprefix([text.splitlines(), mutant.splitlines()])) + 1
        rows.append({"source": source, "name": name, "line": line, "old": old, "new": new})
        rows[-1]["result"] = build.judge(source, text_of(rows[-1]))
        save(room, rows)
        print(told(rows[-1]), flush=True)


def judge_again(room, build):
    rows = load(room)
    for row in rows:
        if row["result"] == "survived" and "why" not in row:
            row["result"] = build.judge(row["source"], text_of(row))
            if row["result"] == "killed":
                row["survived_before"] = True
            save(room, rows)
            print(told(row), flush=True)


def rooms_table(records):
    """What became of the mutants, of a dictionary of rooms to rows."""
    lines = ["| room | drawn | do not compile | same code | judged | killed at first | killed with cases made for "
             "survivors | survive | equivalent | killed of the others |", "|---|---|---|---|---|---|---|---|---|---|"]
    for room, rows in records.items():
        counts, number = collections.Counter(row["result"] for row in rows), judged(rows)
        if number == 0:
            continue
        at_first = counts["killed"] - sum(row.get("survived_before", False) for row in rows)
        equivalent = sum(row.get("why", "").startswith("equivalent") for row in rows)
        lines.append(f"| `{room}` | {len(rows)} | {counts['stillborn']} | {counts['same']} | {number} "
                     f"| {at_first}, {at_first / number:.1%} | {counts['killed']}, {counts['killed'] / number:.1%} "
                     f"| {counts['survived']} | {equivalent} | {counts['killed'] / max(1, number - equivalent):.1%} |")
    return "\n".join(lines) + "\n"


def survivors_table(records):
    """Which mutants survived, and why."""
    def code(lines):
        return "`` " + shown(lines).replace("|", "\\|") + " ``"

    lines = ["| survivor | was | is | why |", "|---|---|---|---|"]
    for rows in records.values():
        lines += [f"| {row['source'].split('/', 1)[1]}:{row['line']} | {code(row['old'])} | {code(row['new'])} "
                  f"| {row.get('why', 'not looked at')} |"
                  for row in sorted(rows, key=lambda row: (row["source"], row["line"])) if row["result"] == "survived"]
    return "\n".join(lines) + "\n"


def page(records):
    """docs/lab/mutants.md with the tables of these records."""
    text = PAGE.read_text()
    for head, made in (("room", rooms_table(records)), ("survivor", survivors_table(records))):
        found = re.search(rf"^\| {head} \| .*\n(\|.*\n)+", text, re.M)
        if not found:
            sys.exit(f"{PAGE}: no table to replace (expected a row \"| {head} | ...\")")
        text = text[:found.start()] + made + text[found.end():]
    return text


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", choices=EVERY_ROOM, nargs="?")
    parser.add_argument("count", type=int, nargs="?", default=100)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build")
    parser.add_argument("--again", action="store_true", help="judge the unexplained survivors once more")
    parser.add_argument("--table", action="store_true", help="write the tables of docs/lab/mutants.md and end")
    options = parser.parse_args()
    if options.table:
        write(PAGE, page({room: load(room) for room in EVERY_ROOM}))
        return
    if not options.room:
        parser.error("expected a room")
    with tempfile.TemporaryDirectory(prefix="tg-mutants-") as work:
        made = Build if options.room in ROOMS else HeaderBuild
        build = made(options.build.resolve(), options.room, pathlib.Path(work))
        judge_again(options.room, build) if options.again else find_more(options.room, options.count, build)


if __name__ == "__main__":
    main()

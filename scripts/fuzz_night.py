#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A night of fuzzing: fuzz_night.py [HOURS] [--only WORD]... [--engine NAME]

Every target runs from its corpus under libFuzzer (build-fuzz, preset fuzz) and AFL++ (build-afl, preset afl), those
with the fewest executions first, for equal shares of HOURS (8). After each share what it found new is merged into
build-fuzz/corpus and, within a bound, into fuzz/corpus; docs/lab/fuzzing.json adds up, and gives docs/lab/fuzzing.md its
table (--table: that alone). An engine that is not built is left out. A night that is cut short loses the share it was in
and nothing else.

Files that fail stand in build-fuzz/findings/TARGET until the target reads them. Where build-cover (preset cover) has
the target, llvm-cov says which lines of its reader the corpus reaches. Exit code 1: something is open."""
import argparse
import hashlib
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
RECORD, PAGE, CORPUS = ROOT / "docs/lab/fuzzing.json", ROOT / "docs/lab/fuzzing.md", ROOT / "fuzz/corpus"
ENGINES = {"libfuzzer": ROOT / "build-fuzz", "afl": ROOT / "build-afl"}
WORKING, FINDINGS, COVER = ROOT / "build-fuzz/corpus", ROOT / "build-fuzz/findings", ROOT / "build-cover"
# What a target is for: its reader's own sources.
READERS = {
    "read_bundle": ["core/bundle/read_bundle.cpp", "core/bundle/manifest.cpp"],
    "read_checkpoint": ["training/run/checkpoint.cpp"],
    "read_dataset": ["training/data/transforms.cpp", "training/data/colmap.cpp", "training/data/lens.cpp"],
    "read_gltf": ["converter/gltf/read_gltf.cpp", "converter/gltf/read_tiles.cpp", "converter/gltf/container.cpp",
                  "converter/gltf/accessor.cpp", "converter/gltf/document.cpp",
                  "converter/gltf/texture_layer.cpp"],
    "read_html": ["converter/html/html.cpp"],
    "read_image": ["core/image/png.cpp", "core/image/jpeg.cpp", "core/image/exr.cpp"],
    "read_lod": ["converter/lod/lod_scene.cpp"],
    "read_photograph": ["training/photos/photograph.cpp"],
    "read_ply": ["core/bundle/ply.cpp", "core/bundle/ply_vertices.cpp", "core/bundle/splat_rows.cpp"],
    "read_safetensors": ["core/file/safetensors.cpp"],
    "read_splats": ["converter/formats/spz.cpp", "converter/formats/read_compressed_ply.cpp",
                    "converter/formats/read_ksplat.cpp", "converter/formats/repair.cpp", "converter/formats/splat.cpp",
                    "converter/sog/read_sog.cpp"],
    "read_viewer_files": ["viewer/view/session.cpp", "viewer/view/camera_path.cpp", "viewer/script/script.cpp"],
}
MOST_BYTES = 160 << 10  # of a target's committed corpus: all twelve stay under 2 MB
LONGEST_INPUT = 16 << 10
LONGEST_RUN_S = 25
LEAST_SHARE_S = 10
# Twice as fast as the defaults where exceptions are common: short stacks of allocations, no frames on the heap (the
# tests of preset asan have both). Files that a target writes are in memory.
ENVIRONMENT = {"ASAN_OPTIONS": "detect_stack_use_after_return=0:malloc_context_size=4",
               "UBSAN_OPTIONS": "print_stacktrace=1"} | ({"TMPDIR": "/dev/shm"} if os.path.isdir("/dev/shm") else {})


def program(engine, target):
    file = ENGINES[engine] / "bin" / f"fuzz_{target}"
    return file if file.exists() else None


def run(command, **environment):
    return subprocess.run([str(word) for word in command], env=os.environ | ENVIRONMENT | environment, cwd=ROOT,
                          capture_output=True, text=True, errors="replace")


def number(pattern, text):
    found = re.findall(pattern, text)
    return int(found[-1]) if found else 0


def files(folder):
    return sorted(file for file in folder.glob("*") if file.is_file())


def libfuzzer(target, seconds, folder):
    """Fuzzes for some seconds; new inputs lie in `folder` then. How many executions."""
    fuzzer = program("libfuzzer", target)
    (FINDINGS / target).mkdir(parents=True, exist_ok=True)
    done = run([fuzzer, f"-max_total_time={seconds}", f"-timeout={LONGEST_RUN_S}", "-rss_limit_mb=2560",
                f"-max_len={LONGEST_INPUT}", "-print_final_stats=1", f"-artifact_prefix={FINDINGS / target}/", folder,
                WORKING / target])
    return number(r"stat::number_of_executed_units: (\d+)", done.stderr)


def afl(target, seconds, folder):
    with tempfile.TemporaryDirectory(prefix="tg-afl-") as out:
        done = run(["afl-fuzz", "-i", WORKING / target, "-o", out, "-V", seconds, "-t", 1000 * LONGEST_RUN_S, "-m", "none",
                    "-g", 1, "-G", LONGEST_INPUT, "--", program("afl", target)], AFL_NO_UI="1", AFL_SKIP_CPUFREQ="1",
                   AFL_NO_AFFINITY="1", AFL_I_DONT_CARE_ABOUT_MISSING_CRASHES="1", AFL_FAST_CAL="1",
                   AFL_NO_STARTUP_CALIBRATION="1", ASAN_OPTIONS="abort_on_error=1:symbolize=0", UBSAN_OPTIONS="")
        found = pathlib.Path(out, "default")
        stats = found / "fuzzer_stats"
        ran = number(r"execs_done +: (\d+)", stats.read_text()) if stats.exists() else 0
        if ran == 0:
            sys.exit(f"afl-fuzz did not run fuzz_{target}:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
        for kind in ("queue", "crashes", "hangs"):
            into = folder if kind == "queue" else FINDINGS / target
            into.mkdir(parents=True, exist_ok=True)
            for file in files(found / kind):
                if file.name != "README.txt":
                    shutil.copyfile(file, into / hashlib.sha1(file.read_bytes()).hexdigest())
        return ran


def replace(folder, chosen):
    """The folder holds these files then and no others, each under the name of its content."""
    with tempfile.TemporaryDirectory(dir=folder.parent) as name:
        fresh = pathlib.Path(name, folder.name)
        fresh.mkdir()
        for file in chosen:
            shutil.copyfile(file, fresh / hashlib.sha1(file.read_bytes()).hexdigest())
        if folder.exists():
            folder.rename(pathlib.Path(name, "older"))
        fresh.rename(folder)


def merge(target, found):
    """Keeps the smallest of what reaches something new: all of it for the next night, in the tree what reaches edges
    and has room."""
    with tempfile.TemporaryDirectory(dir=ENGINES["libfuzzer"]) as name:
        kept = pathlib.Path(name, "kept")
        kept.mkdir()
        done = run([program("libfuzzer", target), "-merge=1", f"-max_len={LONGEST_INPUT}", f"-timeout={LONGEST_RUN_S}",
                    "-rss_limit_mb=2560", f"-artifact_prefix={FINDINGS / target}/", kept, CORPUS / target,
                    WORKING / target, found])
        if done.returncode != 0 or not files(kept):
            sys.exit(f"fuzz_{target} -merge=1 failed:\n{done.stderr[-2000:]}")
        replace(WORKING / target, files(kept))
    replace(CORPUS / target, within_bound(edges_by_file(target)))


def edges_by_file(target):
    """What each input of the working corpus reaches: (file, edges)."""
    with tempfile.TemporaryDirectory(dir=ENGINES["libfuzzer"]) as name:
        kept, control = pathlib.Path(name, "kept"), pathlib.Path(name, "control")
        kept.mkdir()
        run([program("libfuzzer", target), "-set_cover_merge=1", "-use_counters=0", "-use_cmp=0",
             f"-max_len={LONGEST_INPUT}", f"-merge_control_file={control}", kept, WORKING / target])
        # How many files, how many of them are the first folder's, their names, and "FT NUMBER FEATURE..." of each.
        told = control.read_text().splitlines()
        names = told[2:2 + int(told[0])]
        return [(pathlib.Path(names[int(words[1])]), {int(word) for word in words[2:]})
                for words in (line.split() for line in told) if words[:1] == ["FT"]]


def within_bound(reached):
    """Of (file, edges) those files that reach the most for their bytes, as long as there is room."""
    left, chosen, seen, room = sorted(reached, key=lambda entry: entry[0].name), [], set(), MOST_BYTES
    while left:
        file, found = max(left, key=lambda entry: len(entry[1] - seen) / max(1, entry[0].stat().st_size))
        if not found - seen:
            break
        if file.stat().st_size <= room:
            chosen.append(file)
            seen |= found
            room -= file.stat().st_size
        left.remove((file, found))
    return chosen


def still_open(target):
    """Removes the findings that are read now, and counts the others."""
    for file in files(FINDINGS / target):
        if run([program("libfuzzer", target), f"-timeout={LONGEST_RUN_S}", "-rss_limit_mb=2560", file]).returncode == 0:
            file.unlink()
    return len(files(FINDINGS / target))


def edges(target):
    """Of the committed corpus: edges that it reaches, and how many there are in the program."""
    done = run([program("libfuzzer", target), "-runs=0", f"-max_len={LONGEST_INPUT}", CORPUS / target])
    return [number(r"INITED cov: (\d+)", done.stderr), number(r"\((\d+) inline 8-bit counters\)", done.stderr)]


def lines(target):
    """Of the committed corpus: lines of the reader that it reaches, and how many there are; nothing where the program
    is not built."""
    reader = COVER / "bin" / f"fuzz_{target}"
    if not reader.exists():
        return None
    with tempfile.TemporaryDirectory() as name:
        raw, profile = pathlib.Path(name, "raw"), pathlib.Path(name, "profile")
        for command in ([reader, CORPUS / target], ["llvm-profdata-19", "merge", "-o", profile, raw],
                        ["llvm-cov-19", "export", "-summary-only", f"-instr-profile={profile}", reader, *READERS[target]]):
            done = run(command, LLVM_PROFILE_FILE=str(raw))
            if done.returncode != 0:
                sys.exit(f"{command[0]} failed:\n{done.stderr[-2000:]}")
    told = json.loads(done.stdout)["data"][0]["totals"]["lines"]
    return [told["covered"], told["count"]]


def measure(target, entry):
    entry["corpus"] = {"files": len(files(CORPUS / target)), "bytes": sum(f.stat().st_size for f in files(CORPUS / target))}
    entry["edges"] = edges(target)
    reached = lines(target)
    if reached:
        entry["lines"] = reached
    entry["open"] = still_open(target)


def executions(entry):
    return sum(entry.get(engine, {}).get("executions", 0) for engine in ENGINES)


def save(record):
    for path, text in ((RECORD, json.dumps(record, indent=1, sort_keys=True) + "\n"), (PAGE, page(record))):
        fresh = path.with_name(path.name + ".new")
        fresh.write_text(text)
        fresh.rename(path)


def table(record):
    def share(pair):
        return f"{pair[0]:,} of {pair[1]:,}" if pair else "not measured"

    rows = ["| target | executions | libFuzzer | AFL++ | a second of libFuzzer | edges | lines of the reader | corpus | open |",
            "|---|---|---|---|---|---|---|---|---|"]
    for target, entry in sorted(record.items()):
        counts = [entry.get(engine, {"executions": 0, "seconds": 0}) for engine in ENGINES]
        rate = counts[0]["executions"] / counts[0]["seconds"] if counts[0]["seconds"] else 0
        rows.append(f"| `fuzz_{target}` | {executions(entry):,} | {counts[0]['executions']:,} | {counts[1]['executions']:,} "
                    f"| {rate:,.0f} | {share(entry['edges'])} | {share(entry.get('lines'))} | {entry['corpus']['files']:,} "
                    f"files, {entry['corpus']['bytes']:,} B | {entry['open']} |")
    return "\n".join(rows) + "\n"


def page(record):
    """docs/lab/fuzzing.md with the table of this record."""
    text = PAGE.read_text()
    found = re.search(r"^\| target \| executions .*\n(\|.*\n)+", text, re.M)
    if not found:
        sys.exit(f"{PAGE}: no table to replace (expected a row \"| target | executions\")")
    return text[:found.start()] + table(record) + text[found.end():]


def night(options, record):
    targets = [target for target in READERS if program("libfuzzer", target)
               and any(word in target for word in options.only or [""])]
    engines = {"libfuzzer": libfuzzer} | ({"afl": afl} if shutil.which("afl-fuzz") else {})
    shares = [(target, engine) for target in sorted(targets, key=lambda target: executions(record.get(target, {})))
              for engine in engines if program(engine, target) and options.engine in ("", engine)]
    if not shares:
        sys.exit("nothing to run (expected build-fuzz/bin/fuzz_*: cmake --preset fuzz && cmake --build --preset fuzz)")
    seconds = max(LEAST_SHARE_S, int(options.hours * 3600 / len(shares)))
    for target, engine in shares:
        entry = record.setdefault(target, {})
        ran = share(target, engines[engine], seconds)
        counted = entry.setdefault(engine, {"executions": 0, "seconds": 0})
        counted["executions"] += ran
        counted["seconds"] += seconds
        measure(target, entry)
        save(record)
        print(f"fuzz_{target}, {engine}: {ran:,} executions in {seconds} s, {executions(entry):,} in all, {entry['edges'][0]:,} "
              f"edges, {entry['open']} open", flush=True)


def share(target, fuzz, seconds):
    """Fuzzes one target for its share of the night and merges; how many executions."""
    if not files(WORKING / target):
        shutil.copytree(CORPUS / target, WORKING / target, dirs_exist_ok=True)
    with tempfile.TemporaryDirectory(dir=ENGINES["libfuzzer"]) as found:
        ran = fuzz(target, seconds, pathlib.Path(found))
        merge(target, found)
    return ran


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("hours", type=float, nargs="?", default=8.0)
    parser.add_argument("--only", action="append", help="targets whose name holds this")
    parser.add_argument("--engine", default="", choices=["", *ENGINES], help="this one alone")
    parser.add_argument("--merge", action="store_true", help="merge and measure again without fuzzing")
    parser.add_argument("--table", action="store_true", help="write the table of docs/lab/fuzzing.md and end")
    options = parser.parse_args()
    record = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    if options.table:
        save(record)
    elif options.merge:
        for target in record:
            share(target, lambda *_: 0, 0)
            measure(target, record[target])
            save(record)
    else:
        night(options, record)
    sys.exit(1 if any(entry["open"] for entry in record.values()) else 0)


if __name__ == "__main__":
    main()

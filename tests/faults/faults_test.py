#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the programs do when a call fails: faults_test.py INJECTOR BIN [option...]

For each command below and each kind of call, the command runs with its K-th such call failing, for every K or for --most
of them spread over all. It must end by itself with the right code and one line, leave what stood there whole and nothing
beside it, or, where it did without what failed, make what it makes otherwise. Killed before its K-th call that concerns
files, it may leave temporary files (.tg-*), and makes what it makes when it is called again."""
import argparse
import contextlib
import io
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import tarfile
import tempfile

# Exit codes that the failure of a kind may end with (CONTRIBUTING.md).
CODES = {"memory": {5}, "open": {2, 4}, "read": {2, 4}, "write": {4}, "sync": {4}, "rename": {4}, "thread": {5}}
DEVICE_CODES = {"vulkan": {5}, "gl": {5}, "gl-lost": {5}, "egl": {5}}
# What a library makes of it: OpenEXR 3.1.5 calls a file broken when zlib has no memory.
KNOWN = [("memory", 3, "Data decompression (zlib) failed")]
LIMIT_S = 180
OLDER = b"older"


class Scenario:
    """A command in a folder: `inputs` are linked there first, `output` (a file or a folder) is what it makes, with
    `again` behind it where a killed one has been at work. `parts`: the output is files that come one by one. `early`:
    arguments in another's place, by which the output is what a failure may keep half-way."""

    def __init__(self, name, command, output, inputs=(), kinds=(*CODES, "kill"), older=True, window=False, again=(),
                 parts=False, early=None):
        self.name, self.command, self.output, self.again, self.parts = name, command, output, again, parts
        self.inputs, self.kinds, self.older, self.window = inputs, kinds, older, window
        self.early = early or {}


def written_formats(programs):
    """The names that --to of tgconvert takes."""
    said = subprocess.check_output([str(programs / "tgconvert"), "--completion", "bash"], text=True)
    return re.search(r"--to\).*?compgen -W '([^']*)'", said)[1].split()


def writing(kind, model):
    convert = ["tgconvert", "--quiet", "--overwrite", "model.tgz"]
    if kind.endswith(".json"):  # a name of its own, with its parts beside it
        # The folder of files beside lod-meta.json has another number when it is called again: kill_folders().
        kinds = CODES if kind == "lod-meta.json" else (*CODES, "kill")
        return Scenario(f"write {kind}", [*convert, f"out/{kind}"], "out", [model], kinds, older=False, parts=True)
    return Scenario(f"write {kind}", [*convert, f"out.{kind}"], f"out.{kind}", [model])


def scenarios(formats, model, scene, script):
    convert = ["tgconvert", "--quiet", "--overwrite"]
    return [writing(kind, model) for kind in formats] + [
        Scenario("write anew", ["tgconvert", "--quiet", "model.tgz", "out.ply"], "out.ply", [model], older=False,
                 again=["--overwrite"]),
        Scenario("check", ["tgconvert", "check", "model.tgz"], None, [model]),
        Scenario("edit", [*convert, "model.tgz", "out.glb", "--merge-pairs", "10%", "--sh-degree", "1"], "out.glb", [model]),
        Scenario("train", ["tgtrain", "scene", "-o", "out.tgz", "--iterations", "3", "--texture-iterations", "2",
                           "--gaussians", "60", "--texture-size", "2", "--threads", "2", "--device", "cpu", "--quiet",
                           "--overwrite"], "out.tgz", [scene], early={"--texture-iterations": "0"}),
        Scenario("train in a run folder", ["tgtrain", "scene", "--run", "out/run", "-o", "out/m.tgz",
                                           "--iterations", "3", "--texture-iterations", "2", "--gaussians", "60",
                                           "--texture-size", "2", "--threads", "2", "--device", "cpu", "--quiet"],
                 "out", [scene], older=False, again=["--resume"], parts=True),
        Scenario("train on a page", ["tgtrain", "scene", "-o", "out.tgz", "--iterations", "3", "--texture-iterations",
                                     "2", "--gaussians", "60", "--texture-size", "2", "--threads", "2", "--device",
                                     "cpu", "--quiet", "--overwrite", "--serve", "0"], "out.tgz", [scene], ["thread"]),
        Scenario("evaluate", ["tgeval", "model.tgz", "scene", "--json", "out.json", "--device", "cpu", "--threads", "2",
                              "--overwrite"], "out.json", [model, scene]),
        Scenario("render", ["tgview", "model.tgz", "--render", "out.png", "--size", "64x48", "--backend", "cpu"],
                 "out.png", [model], older=False),
        Scenario("record pictures", ["tgview", "model.tgz", "--turntable", "3", "-o", "out/####.png", "--size", "64x48",
                                     "--backend", "cpu"], "out", [model], ["kill"], older=False, parts=True),
        Scenario("render by Vulkan", ["tgview", "model.tgz", "--render", "out.png", "--size", "64x48", "--backend",
                                      "vulkan"], "out.png", [model], ["vulkan"], older=False),
        Scenario("render by OpenGL", ["tgview", "model.tgz", "--render", "out.png", "--size", "64x48", "--backend",
                                      "opengl"], "out.png", [model], ["gl", "gl-lost", "egl"], older=False),
        Scenario("window on Vulkan", ["tgview", "model.tgz", "--script", "script.txt", "--size", "96x64", "--backend",
                                      "vulkan"], None, [model, script], ["vulkan"], window=True),
        Scenario("window on OpenGL", ["tgview", "model.tgz", "--script", "script.txt", "--size", "96x64", "--backend",
                                      "opengl"], None, [model, script], ["gl", "gl-lost", "egl"], window=True),
    ]


def contents(folder, temporary):
    """Everything in a folder, names and bytes, without the seconds that a training took. `temporary`: with files that
    are not at their place yet."""
    found = {}
    for file in sorted(path for path in folder.rglob("*") if path.is_file()):
        if not temporary and file.name.startswith(".tg-"):
            continue
        data = file.read_bytes()
        if file.suffix == ".tgz" and data != OLDER:
            with tarfile.open(fileobj=io.BytesIO(data)) as bundle:
                data = [(entry.name, bundle.extractfile(entry).read()) for entry in bundle
                        if entry.name not in ("training.json", "manifest.json")]
        if file.name == "outputs.json":  # its sums are those of the seconds, too
            data = json.loads(data)["outputs"]
        if file.name not in ("metrics.jsonl", "checkpoint"):
            found[str(file.relative_to(folder))] = data
    return found


def spread(calls, most):
    if calls <= most:
        return range(1, calls + 1)
    return sorted({1 + (calls - 1) * i // max(1, most - 1) for i in range(most)})


class Runner:
    def __init__(self, options, folder, screen):
        self.options, self.folder, self.screen, self.failures, self.runs = options, folder, screen, [], 0

    def run(self, scenario, kind, k, again=False, early=False):
        """The finished process, the folder's files, and what failed or how many calls of the kind there were. `again`:
        where the run before has left off. `early`: with the scenario's other arguments."""
        work = self.folder / "work"
        if not again:
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            for file in scenario.inputs:
                (work / file.name).symlink_to(file)
            if scenario.output and scenario.older:
                (work / scenario.output).write_bytes(OLDER)
        count = self.folder / "count"
        count.unlink(missing_ok=True)
        command = [str(self.options.bin / scenario.command[0]), *scenario.command[1:], *(scenario.again if again else ())]
        if early:
            flags = [None, *command]
            command = [scenario.early.get(flag, argument) for flag, argument in zip(flags, command)]
        environment = os.environ | {"LD_PRELOAD": str(self.options.injector), "TG_FAULT": f"{kind}:{k}:{count}",
                                    "HOME": str(self.folder), "XDG_STATE_HOME": str(self.folder / "state"),
                                    "XDG_CACHE_HOME": str(self.folder / "cache"), "TMPDIR": str(self.folder / "tmp")}
        environment.pop("WAYLAND_DISPLAY", None)
        if self.screen:
            environment["DISPLAY"] = self.screen
        (self.folder / "tmp").mkdir(exist_ok=True)
        try:
            done = subprocess.run(command, cwd=work, env=environment, stdin=subprocess.DEVNULL, capture_output=True,
                                  timeout=LIMIT_S)
        except subprocess.TimeoutExpired:
            done = None
        self.runs += 1
        return done, contents(work, kind != "kill"), count.read_text() if count.exists() else "0"

    def complain(self, scenario, kind, k, what):
        self.failures.append(f"{scenario.name}, {kind} {k} {what}")
        print(self.failures[-1], flush=True)

    def judge(self, scenario, kind, k, done, files, before, wanted):
        if done is None:
            return f"hangs ({LIMIT_S} s)"
        said = done.stderr.decode(errors="replace").strip()
        if done.returncode == 0:
            differing = sorted(name for name in wanted.keys() | files.keys() if wanted.get(name) != files.get(name))
            return f"success, but other bytes: {differing}" if differing else None
        told = said + done.stdout.decode(errors="replace")  # a check tells on standard output what is wrong
        if any((kind, done.returncode) == known[:2] and known[2] in told for known in KNOWN):
            return None
        if kind == "kill":
            return self.judge_killed(scenario, done, files, before, wanted)
        codes = CODES.get(kind) or DEVICE_CODES[kind]
        if done.returncode not in codes:
            return f"exit code {done.returncode} (expected {sorted(codes)}): {said[-300:]}"
        if len(said.splitlines()) != 1:
            return f"{len(said.splitlines())} lines: {said[-600:]}"
        kept = re.search(r"\(the model is kept as (\S+)\)$", said)
        if kept:  # after training: whole, under a name that was free
            model = files.pop(kept[1], None)
            if kept[1] in before or model is None or model not in (*wanted.values(), *self.early_models(scenario, kind)):
                return f"{kept[1]} is no model: {said}"
        if scenario.older:
            differing = sorted(name for name in before.keys() | files.keys() if before.get(name) != files.get(name))
            return f"half-written: {differing}: {said}" if differing and files != wanted else None
        parts = [name for name in files if name not in wanted and name not in before]
        return f"left behind: {parts}" if parts else None

    def early_models(self, scenario, kind):
        """What may be kept where memory runs out."""
        if not scenario.early or kind != "memory":
            return []
        return [self.run(scenario, "memory", 0, early=True)[1][scenario.output]]

    def judge_killed(self, scenario, done, files, before, wanted):
        if done.returncode != -signal.SIGKILL:
            return f"exit code {done.returncode}"
        def is_right(name):
            if scenario.parts and name not in before:  # bundles on the way were read by contents()
                return files.get(name) == wanted.get(name) or name.endswith(".tgz")
            return files.get(name) in (before.get(name), wanted.get(name))
        broken = sorted(name for name in before.keys() | files.keys() if not is_right(name))
        if broken:
            return f"broken: {broken}"
        done, files, _ = self.run(scenario, "kill", 0, again=True)
        if done is None or done.returncode != 0:
            return f"called again: {'hangs' if done is None else done.stderr.decode(errors='replace')}"
        differing = sorted(name for name in wanted.keys() | files.keys() if files.get(name) != wanted.get(name))
        return f"called again, other bytes: {differing}" if differing else None

    def sweep(self, scenario):
        counted = {}  # the injector counts calls of a device one kind at a time
        for kind in scenario.kinds:
            if self.options.kind not in ("", kind):
                continue
            if kind not in counted:
                of = kind if kind in DEVICE_CODES else "all"
                done, wanted, told = self.run(scenario, of, 0)
                if done is None or done.returncode != 0:
                    said = "hangs" if done is None else done.stderr.decode()
                    self.complain(scenario, kind, 0, f"(nothing): fails by itself: {said}")
                    return
                counted |= {kind: told} if of == kind else dict(line.split() for line in told.splitlines())
            calls = int(counted[kind])
            if self.options.counts:
                print(f"{scenario.name}, {kind}: {calls} calls", flush=True)
            before = {name: OLDER if name == scenario.output else data for name, data in wanted.items()
                      if scenario.older and name == scenario.output or any(name.startswith(file.name) for file in scenario.inputs)}
            for k in spread(calls, self.options.most):
                done, files, told = self.run(scenario, kind, k)
                wrong = self.judge(scenario, kind, k, done, files, before, wanted)
                if wrong:
                    self.complain(scenario, kind, k, f"({told}): {wrong}")


    def kill_folders(self, scenario):
        """Killed, lod-meta.json may leave folders that no file names; called again, it names a scene that is there."""
        calls = int(dict(line.split() for line in self.run(scenario, "all", 0)[2].splitlines())["kill"])
        for k in sorted({*spread(calls, self.options.most), *range(1, 8), *range(max(1, calls - 15), calls + 1)}):
            self.run(scenario, "kill", k)
            files = self.run(scenario, "kill", 0, again=True)[1]
            named = json.loads(files["out/lod-meta.json"])["filenames"][0].split("/")[0]
            left = {entry.name for entry in (self.folder / "work/out").iterdir() if not entry.name.startswith(".tg-")}
            strange = {name for name in left if not re.fullmatch(r"lod-meta\.json|[0-9]+|\.new-[0-9]+-[0-9]+", name)}
            if not {"lod-meta.json", named} <= left or strange or len(left) > 3:
                self.complain(scenario, "kill", k, f"and called again leaves {sorted(left)}")


def prepare(options, folder):
    """A model of 30 textured Gaussians, and a data set of four small pictures."""
    def call(*command):
        subprocess.run([str(options.bin / command[0]), *map(str, command[1:])], check=True, stdout=subprocess.DEVNULL)

    scene, model = folder / "scene", folder / "model.tgz"
    call("tgtrain", "make-sample", scene, "--views", 4, "--test-views", 2, "--size", 32)
    call("tgtrain", scene, "-o", model, "--iterations", 5, "--texture-iterations", 5, "--gaussians", 30, "--texture-size",
         3, "--device", "cpu", "--quiet")
    script = folder / "script.txt"
    script.write_text("wait 2\norbit 10 0\nwait 2\nsize 80x60\nwait 2\n")
    return model, scene, script


@contextlib.contextmanager
def display():
    """The name of a display of its own, or nothing where there is no Xvfb."""
    if not shutil.which("Xvfb"):
        yield None
        return
    told, tells = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(tells), "-screen", "0", "320x240x24"], pass_fds=[tells],
                              stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    os.close(tells)
    try:
        yield ":" + os.read(told, 16).decode().strip()
    finally:
        os.close(told)
        server.terminate()
        server.wait()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("injector", type=pathlib.Path)
    parser.add_argument("bin", type=pathlib.Path)
    parser.add_argument("--most", type=int, default=10**9, help="calls of a kind that fail, spread over all")
    parser.add_argument("--only", default="", help="scenarios whose name holds this")
    parser.add_argument("--kind", default="", help="this one alone")
    parser.add_argument("--counts", action="store_true", help="tell how many calls of each kind there are")
    options = parser.parse_args()
    options.injector, options.bin = options.injector.resolve(), options.bin.resolve()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name).resolve()
        with display() as screen:
            runner = Runner(options, folder, screen)
            for scenario in scenarios(written_formats(options.bin), *prepare(options, folder)):
                if options.only not in scenario.name:
                    continue
                if scenario.window and not screen:
                    print(f"{scenario.name}: not run, there is no Xvfb")
                    continue
                runner.sweep(scenario)
                if scenario.name == "write lod-meta.json" and options.kind in ("", "kill"):
                    runner.kill_folders(scenario)
    print(f"{runner.runs} runs, {len(runner.failures)} wrong")
    sys.exit(1 if runner.failures else 0)


main()

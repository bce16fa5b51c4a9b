#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Kills workers of a farm at random moments and compares what they leave with a farm that nobody disturbs.

    bench/farm_kills.py build/bin/tgtrain [--kills 50] [--workers 2] [--jobs 12] [--seed 1]

Prints how long both took and what the kills cost; exit code 1 where a result is missing, changed or other bytes.
"""
import argparse
import json
import pathlib
import random
import signal
import subprocess
import sys
import tempfile
import time


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tgtrain", type=pathlib.Path)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--jobs", type=int, default=12)
    parser.add_argument("--iterations", type=int, default=100)
    parser.add_argument("--longest", type=float, default=1.0, help="between two kills [s]")
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    tgtrain = str(arguments.tgtrain.resolve())
    chance = random.Random(arguments.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        subprocess.run([tgtrain, "make-sample", "scene", "--size", "48", "--views", "8", "--test-views", "2", "--points",
                        "400", "--supersampling", "1", "-q"], cwd=folder, check=True)
        jobs = [{"name": f"job{i}", "dataset": "scene",
                 "flags": ["--iterations", str(arguments.iterations), "--texture-iterations", "50", "--gaussians", "500",
                           "--seed", str(i), "--checkpoint-every", "0"]} for i in range(arguments.jobs)]
        (folder / "jobs.jsonl").write_text("".join(json.dumps(job) + "\n" for job in jobs))

        def work(out):
            return subprocess.Popen([tgtrain, "farm", "jobs.jsonl", "--out", out, "--threads", "1", "--heartbeat", "0.1",
                                     "--stale", "1", "--takeovers", "10000", "-q"], cwd=folder)

        def results(out):
            return {path.parent.name: (path.read_bytes(), path.stat().st_mtime_ns)
                    for path in (folder / out / "results").glob("*/model.tgz")}

        start = time.monotonic()
        for worker in [work("calm") for _ in range(arguments.workers)]:
            worker.wait()
        calm = time.monotonic() - start
        expected = results("calm")

        start = time.monotonic()
        workers = [work("wild") for _ in range(arguments.workers)]
        seen, wrong, kills = {}, [], 0
        while kills < arguments.kills:
            time.sleep(chance.uniform(0.02, arguments.longest))
            victim = chance.randrange(len(workers))
            if workers[victim].poll() is not None:
                break
            workers[victim].send_signal(signal.SIGKILL)
            workers[victim].wait()
            kills += 1
            for job, (model, written) in results("wild").items():
                if seen.setdefault(job, written) != written or model != expected[job][0]:
                    wrong.append(job)
            workers[victim] = work("wild")
        codes = [worker.wait() for worker in workers]
        wild = time.monotonic() - start
        found = results("wild")
        wrong += [job for job in expected if job not in found or found[job][0] != expected[job][0]]
        attempts = sum(1 for _ in (folder / "wild/jobs").glob("*/0*"))
    print(f"{arguments.jobs} jobs, {arguments.workers} workers: {calm:.1f} s undisturbed; {kills} kills, {attempts} "
          f"attempts: {wild:.1f} s; {len(found)} results, {len(set(wrong))} wrong; exit codes {codes}")
    sys.exit(bool(wrong) or any(codes) or kills < arguments.kills)


main()

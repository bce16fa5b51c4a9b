#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""fuzz/make_seeds.py makes files for every target, small ones, of the programs in the folder named."""
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT / "scripts"))
import fuzz_night  # noqa: E402

with tempfile.TemporaryDirectory() as name:
    subprocess.run([sys.executable, ROOT / "fuzz/make_seeds.py", sys.argv[1], name], check=True)
    made = {folder.name: [file.stat().st_size for file in folder.iterdir()] for folder in pathlib.Path(name).iterdir()}
    if set(made) != set(fuzz_night.READERS):
        sys.exit(f"fuzz/make_seeds.py: folders {', '.join(sorted(made))} (expected one a target: "
                 f"{', '.join(sorted(fuzz_night.READERS))})")
    empty = [target for target, sizes in made.items() if not sizes or min(sizes) == 0]
    if empty:
        sys.exit(f"fuzz/make_seeds.py: nothing in it for {', '.join(empty)}")

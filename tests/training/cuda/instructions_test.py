#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Holds what nvcc makes of the CUDA kernels to a table: no kernel, and none of its loops, grows by more than a tenth.

    instructions_test.py TOOLS NVCC TABLE OBJECT... [--write]    TOOLS: folder of cuobjdump and nvdisasm; NVCC: its version

A loop is what lies between a label and a branch back to it; of a kernel the largest one counts that has no other in it.
Loads are the kernel's, by bytes a thread; their number must not grow either. --write makes the table anew. Skips (77)
without the tools, and for another compiler than the table's.
"""
import json
import pathlib
import re
import subprocess
import sys
import tempfile

ARCHITECTURE = "sm_86"
MOST = 1.10
SKIPPED = 77
COUNTED = {"instructions": lambda row: row["instructions"], "instructions in its loop": lambda row: row["loop"],
           "loads": lambda row: sum(row["loads"].values())}
WIDTHS = {"128": 16, "64": 8, "U16": 2, "S16": 2, "U8": 1, "S8": 1}


def disassembled(tools, file):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([tools / "cuobjdump", "-xelf", ARCHITECTURE, pathlib.Path(file).resolve()], cwd=folder, check=True,
                       stdout=subprocess.DEVNULL)
        for cubin in sorted(pathlib.Path(folder).glob("*.cubin")):
            yield subprocess.run([tools / "nvdisasm", "-c", cubin], check=True, capture_output=True, text=True).stdout


def innermost(labels, branches):
    """[(first, last)] of the loops that hold no other one, in numbers of instructions."""
    loops = sorted({(labels[target], at) for at, target in branches if target in labels and labels[target] < at})
    return [a for a in loops if not any(a != b and a[0] <= b[0] and b[1] <= a[1] for b in loops)]


def kernel_of(text):
    """Instructions, registers, loads and the largest innermost loop of one section."""
    labels, branches, instructions = {}, [], []
    for line in text.splitlines():
        label = re.match(r"(\.L_x?_?\w+):", line)
        if label:
            labels[label[1]] = len(instructions)
        found = re.match(r"\s+/\*[0-9a-f]+\*/\s+(?:@!?U?P\w+ )?([A-Z][\w.]*)(.*);", line)
        if not found:
            continue
        if found[1].startswith("BRA"):
            target = re.search(r"`\((\.L\w+)\)", found[2])
            if target:
                branches.append((len(instructions), target[1]))
        instructions.append(found[1])
    # What pads a kernel to its alignment is no work.
    while instructions and instructions[-1] in ("NOP", "BRA"):
        instructions.pop()
    branches = [(at, target) for at, target in branches if at < len(instructions)]
    loops = innermost(labels, branches)
    first, last = max(loops, key=lambda loop: loop[1] - loop[0], default=(0, -1))
    loads = {}
    for name in instructions:
        if re.match(r"LD[GS]?\b", name):
            width = next((WIDTHS[part] for part in name.split(".") if part in WIDTHS), 4)
            key = f"{'shared' if name.startswith('LDS') else 'global'}, {width} bytes"
            loads[key] = loads.get(key, 0) + 1
    registers = re.search(r"SHI_REGISTERS=(\d+)", text)
    return {"instructions": len(instructions), "registers": int(registers[1]) if registers else 0,
            "loop": last - first + 1, "loads": dict(sorted(loads.items()))}


def kernels(tools, files):
    found = {}
    for file in files:
        for text in disassembled(tools, file):
            for section in text.split("\t.section\t.text.")[1:]:
                mangled = section.split(",", 1)[0].strip('"')
                name = subprocess.run(["c++filt", mangled], check=True, capture_output=True, text=True).stdout.strip()
                ours = re.match(r"(?:void )?tg::cuda::(?:\(anonymous namespace\)::)?(.*?)\(", name)
                if ours:
                    found[f"{pathlib.Path(file).name.split('.')[0]}: {ours[1]}"] = kernel_of(section)
    return dict(sorted(found.items()))


def main():
    arguments = [word for word in sys.argv[1:] if word != "--write"]
    tools, compiler, table, files = pathlib.Path(arguments[0]), arguments[1], pathlib.Path(arguments[2]), arguments[3:]
    if not all((tools / name).exists() for name in ("cuobjdump", "nvdisasm")):
        print(f"skipped: no cuobjdump and nvdisasm in {tools} (scripts/install_cuda.sh)")
        return SKIPPED
    if "--write" in sys.argv:
        rows = ",\n".join(f"  {json.dumps(name)}: {json.dumps(row)}" for name, row in kernels(tools, files).items())
        table.write_text(f'{{"nvcc": "{compiler}", "architecture": "{ARCHITECTURE}", "kernels": {{\n{rows}\n}}}}\n')
        return 0
    expected = json.loads(table.read_text())
    if compiler != expected["nvcc"]:
        print(f"skipped: nvcc {compiler}, {table.name} is of {expected['nvcc']}")
        return SKIPPED
    known, found = expected["kernels"], kernels(tools, files)
    wrong = [f"{name}: in {'the table' if name in known else 'the build'} alone" for name in known.keys() ^ found.keys()]
    for name in sorted(known.keys() & found.keys()):
        for what, count in COUNTED.items():
            if count(found[name]) > MOST * count(known[name]):
                wrong.append(f"{name}: {count(found[name])} {what} (expected {count(known[name])}, a tenth more at most)")
    print("\n".join(sorted(wrong)) or f"{len(found)} kernels as {table.name} has them")
    if wrong:
        print("where that is meant: the same command with --write, and the reason in the commit")
    return 1 if wrong else 0


sys.exit(main())

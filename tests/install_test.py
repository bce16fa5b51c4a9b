#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What `cmake --install` copies is all there, starts, and is what desktops accept.

    tests/install_test.py BUILD VERSION PROGRAM...
"""
import os
import pathlib
import platform
import re
import shutil
import subprocess
import sys
import tempfile

build, version, programs = sys.argv[1], sys.argv[2], sys.argv[3:]
failures = []


def check(holds, what):
    if not holds:
        failures.append(what)


def run(*command, **environment):
    return subprocess.run([str(word) for word in command], env=os.environ | environment, stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, timeout=60)


def files_of(program):
    yield f"bin/{program}"
    yield f"share/man/man1/{program}.1"
    yield f"share/bash-completion/completions/{program}"
    yield f"share/zsh/site-functions/_{program}"
    yield f"share/fish/vendor_completions.d/{program}.fish"
    if program == "tgview":
        yield "share/applications/tgview.desktop"
        yield "share/metainfo/org.textured_gaussians.tgview.metainfo.xml"
        yield "share/mime/packages/textured-gaussians.xml"
        yield "share/icons/hicolor/scalable/apps/tgview.svg"
        yield from (f"share/icons/hicolor/{side}x{side}/apps/tgview.png" for side in (48, 128, 256))


def check_component(component, stage, wanted):
    result = run("cmake", "--install", build, "--prefix", "/opt/tg", "--component", component, DESTDIR=stage)
    check(result.returncode == 0, f"cmake --install of {component}: {result.stderr}")
    root = stage / "opt/tg"
    found = {str(file.relative_to(stage)) for file in stage.rglob("*") if file.is_file()}
    for name in sorted(found):
        check(name.startswith("opt/tg/"), f"{component}: installed outside of the prefix: {name}")
    for name in wanted:
        check(f"opt/tg/{name}" in found, f"{component}: {name} is not installed")
    return root, {name.removeprefix("opt/tg/") for name in found}


def check_tools(stage):
    wanted = {name for program in programs for name in files_of(program)}
    root, found = check_component("tools", stage, wanted)
    check(found == wanted, f"tools: installed but not expected: {sorted(found - wanted)}")
    for program in programs:
        shown = run(root / "bin" / program, "--version")
        check(shown.stdout == f"{program} {version}\n", f"{program} --version: {shown.stdout}{shown.stderr}")
        check((root / "share/man/man1" / f"{program}.1").read_text().startswith(".TH "), f"{program}.1 is no manual page")
    metainfo = root / "share/metainfo/org.textured_gaussians.tgview.metainfo.xml"
    if metainfo.exists():
        check(f'<release version="{version}" date="20' in metainfo.read_text(), f"{metainfo.name}: no release {version}")
        if shutil.which("appstreamcli"):
            found = re.search(r"\d+", run("appstreamcli", "--version").stdout)
            # The project has no page of its own on the web, which later versions ask for.
            homeless = ["--override", "url-homepage-missing=info"] if found and int(found[0]) > 0 else []
            result = run("appstreamcli", "validate", "--pedantic", "--no-net", *homeless, metainfo)
            check(result.returncode == 0, f"{metainfo.name}: {result.stdout}")
        else:
            print("no appstreamcli (package appstream): the metainfo is not validated")


def check_without_libraries(program, folder):
    """Files of these names that are no libraries, found first, are as good as none."""
    missing = ("libvulkan.so.1", "libglfw.so.3", "libfontconfig.so.1")
    for name in missing:
        (folder / name).touch()
    listed = run("readelf", "--dynamic", program).stdout
    for name in missing + ("libX11.so.6", "libGL.so.1", "libEGL.so.1"):
        check(name not in listed, f"{program.name} does not start without {name}")
    model = pathlib.Path(__file__).resolve().parent.parent / "docs/sample.tgz"
    picture = folder / "picture.png"
    for backend, code, words in (("cpu", 0, ""), ("vulkan", 5, "Vulkan: no Vulkan driver")):
        result = run(program, model, "--render", picture, "--size", "32x32", "--backend", backend, LD_LIBRARY_PATH=folder)
        check(result.returncode == code and words in result.stderr,
              f"{program.name} --backend {backend} without its loader: {result.returncode}, {result.stderr}")
    check(picture.exists(), f"{program.name} --backend cpu wrote no picture")
    result = run(program, model, LD_LIBRARY_PATH=folder, DISPLAY=":65535")
    check(result.returncode == 5 and "cannot open a window: GLFW gives no reason" in result.stderr,
          f"{program.name} without GLFW: {result.returncode}, {result.stderr}")


def check_links(folder):
    """docs_links_test.py holds these links in the source; what they lead to is installed, too."""
    for page in folder.rglob("*.md"):
        prose = re.sub(r"^(?:    [^\n]*|```.*?^```)$", "", page.read_text(), flags=re.S | re.M)
        for link in re.findall(r"\]\(([^)\s:#]+)[#)]", prose):
            check((page.parent / link).exists(), f"{page.relative_to(folder)} links {link}, which is not installed")


def main():
    with tempfile.TemporaryDirectory() as folder:
        check_tools(pathlib.Path(folder, "tools"))
        documents = "share/doc/textured-gaussians"
        root, found = check_component("doc", pathlib.Path(folder, "doc"),
                                  [f"{documents}/{name}" for name in ("README.md", "LICENSE", "docs/sample.tgz")])
        figures = [name for name in found if "docs/lab/" in name and not name.endswith(".md")]
        check(not figures, f"doc: what pages of the lab are made of is installed: {sorted(figures)[:3]}")
        check_links(root / documents)
        check_component("dev", pathlib.Path(folder, "dev"),
                        ["lib/libtextured_gaussians.a", "lib/cmake/textured_gaussians/textured_gaussians-config.cmake",
                         "lib/pkgconfig/textured_gaussians.pc",
                         "include/textured_gaussians/textured_gaussians.h"])
        if "tgview" in programs and sys.platform == "linux" and platform.machine() in ("x86_64", "aarch64"):
            pathlib.Path(folder, "missing").mkdir()
            check_without_libraries(pathlib.Path(folder, "tools/opt/tg/bin/tgview"), pathlib.Path(folder, "missing"))
    print("\n".join(failures))
    sys.exit(bool(failures))


main()

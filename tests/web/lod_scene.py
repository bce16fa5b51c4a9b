# SPDX-License-Identifier: Apache-2.0
"""A small scene with levels of detail for tests: four leaves, three levels, a chunk each; and a server for it that can
be slow or break chunks off."""
import functools
import http.server
import json
import pathlib
import subprocess
import tarfile
import threading
import time
import zipfile

COUNTS = [None, 1200, 300]  # Gaussians of the levels; None: all
REACH = 100.0


def make(programs, model, folder):
    """Writes lod-meta.json and its chunks into `folder`; returns the path of the finest level as one model (a .tgz)."""
    def run(*arguments):
        subprocess.run([str(programs / "tgconvert"), *map(str, arguments), "--quiet", "--overwrite"], check=True,
                       stdout=subprocess.DEVNULL)
    names = []
    leaves = [{"bound": {"min": [x, y, -REACH], "max": [x + REACH, y + REACH, REACH]}, "lods": {}}
              for x in (-REACH, 0.0) for y in (-REACH, 0.0)]
    for level, count in enumerate(COUNTS):
        whole = folder / f"level_{level}.tgz"
        run(model, whole, *(["--merge-pairs", count] if count else []))
        for index, leaf in enumerate(leaves):
            bound = leaf["bound"]
            part, chunk = folder / "part.sog", f"{level}_{index}"
            # Boxes are closed: nothing lies on both sides of a border that no mean lies on.
            run(whole, part, "--crop-box", ",".join(map(str, bound["min"] + bound["max"])))
            with zipfile.ZipFile(part) as archive:
                archive.extractall(folder / chunk)
            meta = json.loads((folder / chunk / "meta.json").read_text())
            leaf["lods"][str(level)] = {"file": len(names), "offset": 0, "count": meta["count"]}
            names.append(f"{chunk}/meta.json")
    # Boxes around the means, as a writer gives them, if a little wide.
    for leaf in leaves:
        leaf["bound"] = {key: [min(max(v, -2.0), 2.0) for v in corner] for key, corner in leaf["bound"].items()}
    textures = meta["TG_gaussian_splatting_texture"]
    own = {"version": 1, "sh_degree": meta["shN"]["bands"], "texture_mode": textures["mode"],
           "intersection": textures["intersection"], "outside": textures["outside"], "background": [1, 1, 1],
           "cameras": "cameras.json"}
    with tarfile.open(model) as archive:
        (folder / "cameras.json").write_bytes(archive.extractfile("cameras.json").read())
    (folder / "lod-meta.json").write_text(json.dumps({
        "lodLevels": len(COUNTS), "filenames": names, "TG_levels_of_detail": own,
        "tree": {"bound": {"min": [-2.0] * 3, "max": [2.0] * 3}, "children": leaves}}))
    return folder / "level_0.tgz"


class Server:
    """Serves folders by the first part of an address: {"scene": folder}. `asked`: the paths, in order. `slow`: seconds
    before an answer to a path that holds a word; `broken`: words whose paths get half their file, `gone`: none."""

    def __init__(self, folders):
        self.asked, self.slow, self.broken, self.gone = [], {}, [], []
        owner = self

        class Handler(http.server.SimpleHTTPRequestHandler):
            extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".mjs": "text/javascript"}

            def translate_path(self, path):
                first, _, rest = path.split("?")[0].lstrip("/").partition("/")
                return str(pathlib.Path(folders.get(first, "/nowhere")) / rest)

            def do_GET(self):
                path = self.path.split("?")[0]
                owner.asked.append(path)
                for word, seconds in owner.slow.items():
                    if word in path:
                        time.sleep(seconds)
                if any(word in path for word in owner.gone):
                    return self.send_error(503)
                if not any(word in path for word in owner.broken):
                    return super().do_GET()
                data = pathlib.Path(self.translate_path(path)).read_bytes()
                self.send_response(200)
                self.send_header("Content-Length", str(len(data) // 2))
                self.end_headers()
                self.wfile.write(data[:len(data) // 2])

            def log_message(self, *_):
                pass
        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Handler))
        self.server.handle_error = lambda *_: None  # a browser that asks no longer closes the connection
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.address = f"http://127.0.0.1:{self.server.server_port}"

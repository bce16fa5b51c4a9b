#!/usr/bin/env bash
# From nothing to a trained textured model on screen: build, make a small scene, train it, convert it, show it.
# `scripts/demo.sh [FOLDER]`, default demo/.
set -euo pipefail
case "${1:-}" in
  -h | --help) sed -n 's/^# //p' "$0" && exit ;;
  -*) echo "demo.sh: no such option: $1 (expected a folder)" >&2 && exit 1 ;;
esac
out=$(realpath -m "${1:-$(dirname "$0")/../demo}")
cd "$(dirname "$0")/.."

scripts/install_packages.sh build
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DTG_TESTS=OFF -DTG_BENCH=OFF
cmake --build build
bin=build/bin

mkdir -p "$out"
"$bin/tgtrain" make-sample "$out/scene" --overwrite
"$bin/tgtrain" "$out/scene" -o "$out/model.tgz" --overwrite --gaussians 5000 \
  --iterations 1500 --texture-iterations 1500
"$bin/tgconvert" "$out/model.tgz" "$out/model.glb" --overwrite

if [ -n "${DISPLAY:-}${WAYLAND_DISPLAY:-}" ]; then
  exec "$bin/tgview" "$out/model.tgz"
fi
for show in final base texture normal; do
  "$bin/tgview" "$out/model.tgz" --render "$out/$show.png" --show "$show" --size 512x512
done
echo "No display: the pictures are $out/final.png, base.png, texture.png and normal.png; the model is $out/model.tgz," \
     "for the web $out/model.glb. On a machine with a display: build/bin/tgview $out/model.tgz"

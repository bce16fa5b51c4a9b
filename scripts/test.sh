#!/usr/bin/env bash
# Builds everything and passes the tests, on a machine that has nothing but apt: `scripts/test.sh [ctest options]`.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n 's/^# //p' "$0"
  exit
fi
cd "$(dirname "$0")/.."

scripts/install_packages.sh test
werror=OFF
cuda=()
if [ "${CI:-}" = true ]; then
  werror=ON
  # Of the five: the one with the least, and the one whose instructions a test counts.
  cuda=(-DCMAKE_CUDA_ARCHITECTURES="75-real;86-real")
fi
python=/usr/bin/python3  # Debian's, for which the packages are; another may come first on the PATH
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DTG_TESTS=ON -DTG_BENCH=ON -DTG_PYTHON=AUTO \
  -DPython3_EXECUTABLE=$python -DTG_WERROR=$werror "${cuda[@]}"
cmake --build build
scripts/fetch_swiftshader.sh build/swiftshader || true  # without it tests of the second Vulkan driver are skipped
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"
exec ctest --test-dir build --output-on-failure -j "$(nproc)" "$@"

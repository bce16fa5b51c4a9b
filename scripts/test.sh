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
[ "${CI:-}" = true ] && werror=ON
python=/usr/bin/python3  # Debian's, for which the packages are; another may come first on the PATH
cmake -S . -B build -G Ninja -DCMAKE_BUILD_TYPE=Release -DTG_TESTS=ON -DTG_BENCH=ON -DTG_PYTHON=AUTO \
  -DPython3_EXECUTABLE=$python -DTG_WERROR=$werror
cmake --build build
scripts/fetch_swiftshader.sh build/swiftshader || true  # without it tests of the second Vulkan driver are skipped
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"
exec ctest --test-dir build --output-on-failure -j "$(nproc)" "$@"

#!/usr/bin/env bash
# Builds the programs as users run them and packs them: `scripts/packages.sh [FOLDER]`, default packages/. Puts Debian
# packages and a .tar.gz for other Linuxes there (docs/packages.md).
set -euo pipefail
case "${1:-}" in
  -h | --help) sed -n 's/^# //p' "$0" && exit ;;
  -*) echo "packages.sh: no such option: $1 (expected a folder)" >&2 && exit 1 ;;
esac
out="$(realpath -m "${1:-$(dirname "$0")/../packages}")"
cd "$(dirname "$0")/.."

scripts/install_packages.sh package
cmake -S . -B build-packages -G Ninja -DCMAKE_BUILD_TYPE=Release -DTG_TESTS=OFF -DTG_BENCH=OFF -DTG_CUDA=OFF \
  -DCMAKE_EXE_LINKER_FLAGS=-Wl,-z,relro,-z,now
cmake --build build-packages
cpack --config build-packages/CPackConfig.cmake -B "$out"
rm -rf "$out/_CPack_Packages"
# AppStream 1, which later versions of lintian ask, warns of the URL of a page on the web, which the project has not.
flags=(--allow-root --fail-on error,warning)
appstream=appstream-metadata-validation-failed
if lintian-explain-tags $appstream >/dev/null 2>&1; then flags+=(--suppress-tags $appstream); fi
lintian "${flags[@]}" "$out"/*.deb

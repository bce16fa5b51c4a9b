#!/usr/bin/env bash
# The tests that need a browser and other people's viewers: `scripts/test_browsers.sh [ctest options]`. Installs Chromium
# from apt where there is none, node and npm alike, and the packages of tests/web/viewers/package.json into
# build/web_packages. build/ must hold a build with tests. `ctest` alone downloads nothing and skips what is not there.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
cd "$(dirname "$0")/.."

missing=()
command -v "${CHROMIUM:-chromium}" >/dev/null || missing+=(chromium)
command -v node >/dev/null || missing+=(nodejs)
command -v npm >/dev/null || missing+=(npm)
if [ ${#missing[@]} -gt 0 ]; then
  sudo=()
  [ "$(id -u)" -eq 0 ] || sudo=(sudo)
  "${sudo[@]}" apt-get update -qq
  DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi
packages="${TG_WEB_PACKAGES:-$PWD/build/web_packages}"
mkdir -p "$packages"
cp tests/web/viewers/package.json "$packages/"
npm install --prefix "$packages" --no-audit --no-fund --loglevel=error
TG_WEB_PACKAGES="$packages" exec ctest --test-dir build --output-on-failure -R '^web_test' "$@"

#!/usr/bin/env bash
# A second Vulkan driver for the tests, and the validation layer of its time: `fetch_swiftshader.sh FOLDER` unpacks both from
# Debian's chromium-common into FOLDER, where nothing is installed. Exit code 1, with a line, where they cannot be had.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi

folder=${1:?expected a folder}
[ -e "$folder/driver.json" ] && exit 0
command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null || {
  echo "fetch_swiftshader.sh: no apt-get here" >&2
  exit 1
}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
chmod 755 "$work" # apt fetches as a user of its own
(cd "$work" && apt-get download -qq chromium-common) 2>"$work/log" || {
  echo "fetch_swiftshader.sh: $(tail -1 "$work/log")" >&2
  exit 1
}
dpkg-deb -x "$work"/chromium-common_*.deb "$work/package"
mkdir -p "$folder"
folder=$(cd "$folder" && pwd)
cp "$work"/package/usr/lib/chromium/{libvk_swiftshader,libVkLayer_khronos_validation}.so "$folder"
cat >"$folder/layer.json" <<JSON
{"file_format_version": "1.2.0", "layer": {"name": "VK_LAYER_KHRONOS_validation", "type": "GLOBAL",
 "library_path": "$folder/libVkLayer_khronos_validation.so", "api_version": "1.4.0", "implementation_version": "1",
 "description": "Khronos validation",
 "instance_extensions": [{"name": "VK_EXT_debug_utils", "spec_version": "2"},
                         {"name": "VK_EXT_validation_features", "spec_version": "6"}]}}
JSON
# The driver last: it says that all is there.
cat >"$folder/driver.json" <<JSON
{"file_format_version": "1.0.0", "ICD": {"library_path": "$folder/libvk_swiftshader.so", "api_version": "1.3.0"}}
JSON

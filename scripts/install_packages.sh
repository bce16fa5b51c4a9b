#!/usr/bin/env bash
# Installs the Debian / Ubuntu packages that are not there yet: `install_packages.sh [build|package|test|check]`: package
# = build + what packages.sh runs, test = build + what the tests run, among it a CUDA compiler where PyPI can be reached,
# check = test + clang for check.sh.
set -euo pipefail
case "${1:-build}" in
  build | package | test | check) ;;
  -h | --help) sed -n '2,/^[^#]/s/^# //p' "$0" && exit ;;
  *) echo "install_packages.sh: no such set: $1 (expected build, package, test or check)" >&2 && exit 1 ;;
esac

build_packages=(build-essential cmake ninja-build pkg-config ccache
  libglfw3-dev libvulkan-dev mesa-vulkan-drivers libepoxy-dev libegl1 libgl1-mesa-dri libimgui-dev libfontconfig-dev libstb-dev libglm-dev libtinygltf-dev
  nlohmann-json3-dev libopenexr-dev libimath-dev glslang-tools libcli11-dev libhwy-dev libpng-dev libjpeg-dev libwebp-dev
  zlib1g-dev libzstd-dev libarchive-dev libssl-dev libmeshoptimizer-dev libexif-dev libheif-dev libsqlite3-dev
  libcpp-httplib-dev)
package_packages=(patchelf lintian)
# What tgtrain photos starts: cameras of photographs, frames of films.
photo_packages=(colmap ffmpeg)
test_packages=(catch2 librapidcheck-dev appstream desktop-file-utils shared-mime-info libheif-examples vulkan-validationlayers xvfb xauth
  xdotool openbox imagemagick spirv-cross python3 python3-venv
  python3-dev python3-numpy pybind11-dev curl zsh fish mandoc
  libopenmpi-dev openmpi-bin)
check_packages=(clang-19 clang-tidy-19 libclang-rt-19-dev)

packages=("${build_packages[@]}" "${photo_packages[@]}")
[ "${1:-build}" = package ] && packages+=("${package_packages[@]}")
tests=no
if [ "${1:-build}" = test ] || [ "${1:-build}" = check ]; then tests=yes; fi
[ $tests = yes ] && packages+=("${test_packages[@]}")
[ "${1:-build}" = check ] && packages+=("${check_packages[@]}")

if ! command -v apt-get >/dev/null; then
  echo "No apt-get here. These Debian packages, or their equivalents, are needed: ${packages[*]}" >&2
  exit 0
fi
# Since 1.17 libheif reads and writes HEIC by packages of their own, which older releases do not have.
plugins=(libheif-plugin-libde265)
[ $tests = yes ] && plugins+=(libheif-plugin-x265)

add_missing() {
  dpkg-query -W -f='${Status}' "$1" 2>/dev/null | grep -q 'ok installed' || missing+=("$1")
}
add_plugins() {
  for plugin in "${plugins[@]}"; do
    if apt-cache show "$plugin" >/dev/null 2>&1; then add_missing "$plugin"; fi
  done
}
missing=()
for package in "${packages[@]}"; do add_missing "$package"; done
add_plugins
if [ ${#missing[@]} -gt 0 ]; then
  sudo=()
  if [ "$(id -u)" -ne 0 ]; then
    command -v sudo >/dev/null || {
      echo "install_packages.sh: packages are missing and there is no sudo; as root: apt-get install ${missing[*]}" >&2
      exit 1
    }
    sudo=(sudo)
  fi
  echo "Installing by apt, with what they need, which takes minutes: ${missing[*]}"
  "${sudo[@]}" apt-get update -qq
  add_plugins
  DEBIAN_FRONTEND=noninteractive "${sudo[@]}" apt-get install -y -qq --no-install-recommends "${missing[@]}" >/dev/null
fi

if [ $tests = yes ] && ! command -v nvcc >/dev/null; then
  "$(dirname "$0")/install_cuda.sh" ||
    echo "CUDA is not compiled in this build: its compiler could not be installed." >&2
fi

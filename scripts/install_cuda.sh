#!/usr/bin/env bash
# A CUDA compiler and disassembler without a system CUDA: seven wheels from PyPI (110 MB, 277 MB on disk) in the user's
# cache, where cmake/cuda.cmake finds them. `install_cuda.sh [--sanitizer] [--wheels FOLDER]`: --sanitizer: with
# compute-sanitizer, for gpu-bench.sh (14 MB, 39 MB on disk). --wheels: from a folder of downloaded wheels, without a
# network.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi

wheels=(nvidia-cuda-nvcc==13.0.88 nvidia-cuda-crt==13.0.88 nvidia-nvvm==13.0.88 nvidia-cuda-runtime==13.0.96
  nvidia-cuda-cccl==13.0.85 nvidia-cuda-nvdisasm==13.2.51 nvidia-cuda-cuobjdump==13.2.51)
to="${XDG_CACHE_HOME:-$HOME/.cache}/textured_gaussians/cuda-13.0"
from=(--timeout 20 --retries 1)
wanted=(nvcc cuobjdump nvdisasm)
while [ $# -gt 0 ]; do
  case $1 in
    --sanitizer) wheels+=(nvidia-cuda-sanitizer-api==13.0.85) wanted+=(compute-sanitizer) ;;
    --wheels) from=(--no-index --find-links "${2:?--wheels lacks its folder}") && shift ;;
    *) echo "install_cuda.sh: unknown option $1 (expected --sanitizer or --wheels)" >&2 && exit 1 ;;
  esac
  shift
done

there=true
for program in "${wanted[@]}"; do
  [ -x "$to/bin/$program" ] || there=false
done
$there && exit 0
if ! command -v python3 >/dev/null || ! python3 -c 'import ensurepip, venv' 2>/dev/null; then
  echo "install_cuda.sh: no python3 with venv (package python3-venv)" >&2
  exit 1
fi
mkdir -p "$(dirname "$to")"
work=$(mktemp -d "$to.XXXXXX")
trap 'rm -rf "$work"' EXIT
python3 -m venv "$work/venv"
"$work/venv/bin/pip" install --quiet --disable-pip-version-check "${from[@]}" "${wheels[@]}"
root=$(echo "$work"/venv/lib/python3*/site-packages/nvidia/cu13)
# What nvcc and CMake look for and the wheels lack.
ln -sfn lib "$root/lib64"
ln -sfn libcudart.so.13 "$root/lib/libcudart.so"
rm -rf "$to"
mv "$root" "$to"
echo "CUDA compiler: $to/bin/nvcc"

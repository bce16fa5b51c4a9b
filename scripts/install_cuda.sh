#!/usr/bin/env bash
# A CUDA compiler without a system CUDA: five wheels from PyPI (105 MB, 271 MB on disk) in the user's cache, where
# cmake/cuda.cmake finds them. `install_cuda.sh [--wheels FOLDER]`: from a folder of downloaded wheels, without a network.
set -euo pipefail

wheels=(nvidia-cuda-nvcc==13.0.88 nvidia-cuda-crt==13.0.88 nvidia-nvvm==13.0.88 nvidia-cuda-runtime==13.0.96
  nvidia-cuda-cccl==13.0.85)
to="${XDG_CACHE_HOME:-$HOME/.cache}/textured_gaussians/cuda-13.0"
from=(--timeout 20 --retries 1)
[ "${1:-}" = --wheels ] && from=(--no-index --find-links "$2")

[ -x "$to/bin/nvcc" ] && exit 0
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

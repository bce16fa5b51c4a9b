#!/usr/bin/env bash
# The CUDA trainer's tests and times on a machine with an NVIDIA GPU: `gpu-bench.sh [--packages FOLDER]
# [--build FOLDER] [--out FOLDER]`. --packages: Debian packages unpacked with `dpkg -x` (usr/ below it), where the
# machine has no apt; with a cuda-13.0/ in it, as scripts/install_cuda.sh makes it, where it has no nvcc. Builds in
# --build (build-gpu); writes table.md and the logs into --out (gpu-bench). Ends with 5 where no device answers: then
# the table holds the tests alone.
set -euo pipefail
cd "$(dirname "$0")/.."

packages=
build=build-gpu
out=gpu-bench
while [ $# -gt 0 ]; do
  case $1 in
    --packages) packages=$(realpath "$2"); shift 2 ;;
    --build) build=$2; shift 2 ;;
    --out) out=$2; shift 2 ;;
    *) echo "gpu-bench.sh: unknown option $1 (expected --packages, --build or --out FOLDER)" >&2; exit 1 ;;
  esac
done
mkdir -p "$out"

options=(-DCMAKE_BUILD_TYPE=Release -DTG_CUDA=ON -DTG_VIEWER=OFF -DTG_VULKAN=OFF -DTG_BENCH=OFF -DTG_TESTS=ON)
if [ -n "$packages" ]; then
  options+=("-DCMAKE_PREFIX_PATH=$packages/usr")
  export LD_LIBRARY_PATH="$packages/usr/lib/x86_64-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
  export PKG_CONFIG_PATH="$packages/usr/lib/x86_64-linux-gnu/pkgconfig:$packages/usr/share/pkgconfig"
  [ -x "$packages/cuda-13.0/bin/nvcc" ] && options+=("-DCMAKE_CUDA_COMPILER=$packages/cuda-13.0/bin/nvcc")
fi
cmake -S . -B "$build" "${options[@]}" >"$out/configure.log"
cmake --build "$build" -j "$(nproc)" --target tgtrain tgeval training_cuda_test training_gpu_test >"$out/build.log"
bin=$build/bin

table="$out/table.md"
device=$(nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader 2>/dev/null | head -1 || true)
{
  echo "Device: ${device:-none}. $(date -u +%F). $(uname -m), $(nproc) cores."
  echo
  echo "| what | result |"
  echo "|---|---|"
} >"$table"

if "$bin/training_cuda_test" >"$out/test.log" 2>&1; then
  echo "| kernels on the host | $(tail -2 "$out/test.log" | head -1) |" >>"$table"
else
  echo "| kernels on the host | FAILED, see test.log |" >>"$table"
fi

scene="$out/scene"
rm -rf "$scene"
"$bin/tgtrain" make-sample "$scene" --size 800 --views 24 --test-views 2 --points 20000 --supersampling 1
status=0
"$bin/tgtrain" "$scene" -o "$out/probe.tgz" --overwrite --device cuda --iterations 1 --texture-iterations 0 \
  >"$out/probe.log" 2>&1 || status=$?
if [ "$status" -ne 0 ]; then
  echo "| device | $(tail -1 "$out/probe.log") |" >>"$table"
  cat "$table"
  exit "$status"
fi

if "$bin/training_gpu_test" >"$out/gpu_test.log" 2>&1; then
  echo "| the same cases on the device | $(tail -2 "$out/gpu_test.log" | head -1) |" >>"$table"
else
  echo "| the same cases on the device | FAILED, see gpu_test.log |" >>"$table"
fi

# Both devices from one seed; then the tools that look into kernels, where they are installed; then times.
for device_name in cpu cuda; do
  "$bin/tgtrain" "$scene" -o "$out/$device_name.tgz" --overwrite --device $device_name --downscale 4 --gaussians 5000 \
    --densification none --iterations 100 --texture-iterations 100 --json "$out/$device_name.json" \
    >"$out/$device_name.log" 2>&1
  echo "| 100 + 100 iterations, $device_name | $(grep -m1 -i textured "$out/$device_name.log" || true) |" >>"$table"
done
if command -v compute-sanitizer >/dev/null; then
  for tool in memcheck racecheck initcheck; do
    if compute-sanitizer --tool $tool --error-exitcode 9 "$bin/tgtrain" "$scene" -o "$out/probe.tgz" --overwrite \
      --device cuda --downscale 4 --iterations 12 --texture-iterations 6 >"$out/$tool.log" 2>&1; then
      echo "| compute-sanitizer $tool | clean |" >>"$table"
    else
      echo "| compute-sanitizer $tool | FAILED, see $tool.log |" >>"$table"
    fi
  done
else
  echo "| compute-sanitizer | not installed |" >>"$table"
fi
for gaussians in 100000 500000 2000000; do
  for mode in none rgba; do
    name=speed_${gaussians}_$mode
    if "$bin/tgtrain" "$scene" -o "$out/$name.tgz" --overwrite --device cuda --start random --init-count $gaussians \
      --densification none --iterations 500 --texture-iterations 500 --texture-mode $mode --json "$out/$name.json" \
      >"$out/$name.log" 2>&1; then
      echo "| 800 x 800, $gaussians Gaussians, textures $mode | $(tail -3 "$out/$name.log" | tr '\n' ' ') |" >>"$table"
    else
      echo "| 800 x 800, $gaussians Gaussians, textures $mode | $(tail -1 "$out/$name.log") |" >>"$table"
    fi
  done
done
cat "$table"

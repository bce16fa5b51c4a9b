#!/usr/bin/env bash
# The CUDA trainer's tests and times on a machine with an NVIDIA GPU: `gpu-bench.sh [--packages FOLDER] [--build FOLDER]
# [--out FOLDER] [--iterations N] [--only PART] [--sizes LIST]`. --packages: Debian packages unpacked with `dpkg -x`
# (usr/ below it), where the machine has no apt; with a cuda-13.0/ in it, as `scripts/install_cuda.sh --sanitizer` makes
# it, where it has no nvcc or no compute-sanitizer. Builds in --build (build-gpu), for the machine's device alone where
# nvidia-smi names it; writes table.md, kernels.txt and the logs into --out (gpu-bench). --iterations: of each timing
# (200). --only: build, tests, sanitizer or times, where one command may not take as long as all of them; each writes a
# table of its own. --sizes: of the timed pictures ("800x800 1600x1064"). Ends with 5 where no device answers: then the
# table holds the tests on the host alone.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
from=$PWD
cd "$(dirname "$0")/.."
folder() { (cd "$from" && realpath -m "$1"); }  # as the caller names it

packages=
build="build-gpu"
out=gpu-bench
iterations=200
only=
sizes="800x800 1600x1064"
while [ $# -gt 0 ]; do
  if [ $# -lt 2 ]; then
    echo "gpu-bench.sh: $1 lacks its value" >&2
    exit 1
  fi
  case $1 in
    --packages) packages=$(folder "$2") ;;
    --build) build=$(folder "$2") ;;
    --out) out=$(folder "$2") ;;
    --iterations) iterations=$2 ;;
    --only) only=$2 ;;
    --sizes) sizes=$2 ;;
    *)
      echo "gpu-bench.sh: unknown option $1 (expected --packages, --build, --out, --iterations, --only or --sizes)" >&2
      exit 1
      ;;
  esac
  shift 2
done
case $only in
  "" | build | tests | sanitizer | times) ;;
  *) echo "gpu-bench.sh: --only $only (expected build, tests, sanitizer or times)" >&2; exit 1 ;;
esac
part() { [ -z "$only" ] || [ "$only" = "$1" ]; }
mkdir -p "$out"

options=(-DCMAKE_BUILD_TYPE=Release -DTG_CUDA=ON -DTG_VIEWER=OFF -DTG_VULKAN=OFF -DTG_BENCH=ON -DTG_TESTS=ON
  -DTG_ASSERTS=OFF)
if [ -n "$packages" ]; then
  options+=("-DCMAKE_PREFIX_PATH=$packages/usr")
  export LD_LIBRARY_PATH="$packages/usr/lib/x86_64-linux-gnu${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
  export PKG_CONFIG_PATH="$packages/usr/lib/x86_64-linux-gnu/pkgconfig:$packages/usr/share/pkgconfig"
  [ -x "$packages/cuda-13.0/bin/nvcc" ] && options+=("-DCMAKE_CUDA_COMPILER=$packages/cuda-13.0/bin/nvcc")
  PATH=$PATH:$packages/cuda-13.0/bin
fi
architecture=$(nvidia-smi --query-gpu=compute_cap --format=csv,noheader 2>/dev/null | head -1 | tr -d . || true)
case $architecture in
  [0-9]*) options+=("-DCMAKE_CUDA_ARCHITECTURES=$architecture") ;;
esac
if part build; then
  cmake -S . -B "$build" "${options[@]}" 2>&1 | tee "$out/configure.log" | tail -3
  cmake --build "$build" -j "$(nproc)" --target tgtrain tgeval training_cuda_test training_gpu_test train_bench 2>&1 |
    tee "$out/build.log" | tail -15
fi
[ "$only" != build ] || exit 0
bin=$build/bin

table="$out/table.md"
failed=0
row() {
  case "$2" in FAILED*) failed=1 ;; esac
  echo "| $1 | $2 |" >>"$table"
}
# tests NAME PROGRAM LOG: a row with what a Catch2 program says at its end.
tests() {
  if "$2" >"$out/$3" 2>&1; then
    row "$1" "$(grep -E 'All tests passed|skipped' "$out/$3" | tail -1)"
  else
    row "$1" "FAILED, see $3"
  fi
}
device=$(nvidia-smi --query-gpu=name,driver_version,memory.total --format=csv,noheader 2>/dev/null | head -1 || true)
{
  echo "Device: ${device:-none}. $(date -u +%F). $(uname -m), $(nproc) cores."
  echo
  echo "| what | result |"
  echo "|---|---|"
} >"$table"
! part tests || tests "kernels on the host" "$bin/training_cuda_test" test.log

scene="$out/scene"
"$bin/tgtrain" make-sample "$scene" --overwrite --size 800 --views 24 --test-views 2 --points 20000 --supersampling 1
status=0
"$bin/tgtrain" "$scene" -o "$out/probe.tgz" --overwrite --device cuda --iterations 1 --texture-iterations 0 \
  >"$out/probe.log" 2>&1 || status=$?
if [ "$status" -ne 0 ]; then
  row "device" "$(tail -1 "$out/probe.log")"
  cat "$table"
  exit "$status"
fi
if part tests; then
  tests "the same cases on the device" "$bin/training_gpu_test" gpu_test.log

  # Both devices from one seed.
  for name in cpu cuda; do
    if "$bin/tgtrain" "$scene" -o "$out/$name.tgz" --overwrite --device $name --downscale 4 --gaussians 5000 \
      --densification none --iterations 100 --texture-iterations 100 --json "$out/$name.json" \
      >"$out/$name.log" 2>&1; then
      row "100 + 100 iterations, $name" "$(grep -m1 '^textured .* iterations' "$out/$name.log" || true)"
    else
      row "100 + 100 iterations, $name" "FAILED: $(tail -1 "$out/$name.log")"
    fi
  done
fi

# The tools that look into kernels, where they are installed; with densification, so that its kernels run, too.
if ! part sanitizer; then
  :
elif command -v compute-sanitizer >/dev/null; then
  # sanitize NAME TOOL LOG FLAG...: a row with what a tool says of a training.
  sanitize() {
    if timeout 300 compute-sanitizer --tool "$2" --error-exitcode 9 "$bin/tgtrain" "$scene" -o "$out/probe.tgz" \
      --overwrite --device cuda --downscale 8 "${@:4}" >"$out/$3" 2>&1; then
      row "compute-sanitizer $2, $1" clean
    else
      row "compute-sanitizer $2, $1" "FAILED, see $3"
    fi
  }
  for tool in memcheck racecheck initcheck synccheck; do
    sanitize "densification and textures" $tool $tool.log --iterations 24 --densify-from 4 --densify-every 5 \
      --densify-until 20 --texture-iterations 6
    sanitize "shared textures, clipped" $tool ${tool}_shared.log --iterations 4 --texture-iterations 8 \
      --texture-outside clip --texture-dictionary 16
  done
else
  row "compute-sanitizer" "not installed"
fi

# Times: a seeded scene with 60 blended splats a pixel. kernels.txt has the table of each setting's kernels.
if ! part times; then
  cat "$table"
  exit $failed
fi
rate() { sed -nE 's/^([0-9.]+) it\/s over.*/\1/p' "$1"; }
gsplat=
python3 -c 'import gsplat, torch; torch.zeros(1).cuda()' 2>/dev/null && gsplat=yes
: >"$out/kernels.txt"
for size in $sizes; do
  for gaussians in 100000 500000 2000000; do
    setting="$size, $gaussians Gaussians"
    plain="" textured=""
    for textures in none 4x4 "4x4, 64 shared"; do
      log="$out/speed_${size}_${gaussians}_${textures//[, ]/_}.log"
      case $textures in
        none) flags=() ;;
        4x4) flags=(--texels 4 --no-statistics) ;;  # nothing densifies in stage 2
        *) flags=(--texels 4 --dictionary 64 --no-statistics) ;;
      esac
      if "$bin/train_bench" --device cuda --width "${size%x*}" --height "${size#*x}" --gaussians $gaussians \
        --iterations "$iterations" "${flags[@]}" >"$log" 2>&1; then
        speed=$(rate "$log")
        case $textures in
          none) plain=$speed ;;
          4x4) textured=$speed ;;
        esac
        row "$setting, textures $textures" "$speed it/s; $(grep '^device memory' "$log")"
        { echo "== $setting, textures $textures"; cat "$log"; echo; } >>"$out/kernels.txt"
      else
        row "$setting, textures $textures" "$(tail -1 "$log")"
      fi
    done
    if [ -n "$plain" ] && [ -n "$textured" ]; then
      row "$setting, 30k + 30k iterations, stage 2 over stage 1" "$(awk -v a="$plain" -v b="$textured" \
        'BEGIN { printf "%.1f min, %.2f x", (30000 / a + 30000 / b) / 60, a / b }')"
    fi
    if [ -n "$gsplat" ]; then
      log="$out/gsplat_${size}_$gaussians.log"
      if python3 bench/gsplat_bench.py --width "${size%x*}" --height "${size#*x}" --gaussians $gaussians \
        --iterations "$iterations" >"$log" 2>&1; then
        row "$setting, gsplat" "$(rate "$log") it/s$(awk -v a="${plain:-0}" -v b="$(rate "$log")" \
          'BEGIN { if (a > 0 && b > 0) printf "; ours over it %.2f x", a / b }')"
      else
        row "$setting, gsplat" "$(tail -1 "$log")"
      fi
    fi
  done
done
[ -n "$gsplat" ] || row "gsplat" "not importable"
cat "$table"
exit $failed

#!/usr/bin/env bash
# The configurations that look for faults, a line each: `scripts/check.sh [--only NAME]... [--seconds N]`. debug: asserts,
# asan: memory and undefined behaviour, tsan: threads, fuzz: every target for N seconds (60) from fuzz/corpus
# (scripts/fuzz_night.py is for more); tidy runs when it is named.
# Each builds in build-NAME and keeps what it built, its log (check.log) and its fuzz corpus: go on with --only.
# Installs what that needs first: the tests' packages and, but for debug alone, clang 19.
set -uo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
cd "$(dirname "$0")/.."

names=()
seconds=60
while [ $# -gt 0 ]; do
  case "$1 ${2:-}" in
    "--only "debug | "--only "asan | "--only "tsan | "--only "fuzz | "--only "tidy) names+=("$2") ;;
    "--seconds "[1-9]*) seconds=$2 ;;
    *)
      echo "check.sh: $* (expected --only debug, asan, tsan, fuzz or tidy, --seconds N)" >&2
      exit 1
      ;;
  esac
  shift 2
done
case $seconds in
  *[!0-9]*) echo "check.sh: --seconds $seconds (expected an integer from 1 on)" >&2 && exit 1 ;;
esac
[ ${#names[@]} -gt 0 ] || names=(debug asan tsan fuzz)
if [ "${names[*]}" = debug ]; then scripts/install_packages.sh test; else scripts/install_packages.sh check; fi || exit 1
export XDG_RUNTIME_DIR="${XDG_RUNTIME_DIR:-$(mktemp -d)}"

fuzz() {
  local status=0 target name corpus
  for target in build-fuzz/bin/fuzz_*; do
    name=${target##*/fuzz_}
    corpus=build-fuzz/check/$name
    mkdir -p "$corpus"
    "$target" -max_total_time="$seconds" -timeout=25 -rss_limit_mb=2560 -max_len=16384 -artifact_prefix="$corpus-" \
      "$corpus" "fuzz/corpus/$name" || status=1
  done
  return $status
}

check() {
  cmake --preset "$1" && cmake --build --preset "$1" || return
  case $1 in
    tidy) ;;
    fuzz) fuzz ;;
    *) ctest --preset "$1" -j "$(nproc)" ;;
  esac
}

status=0
for name in "${names[@]}"; do
  began=$SECONDS
  log=build-$name/check.log
  mkdir -p "build-$name"
  result=passed
  check "$name" >"$log" 2>&1 || { result="FAILED, see $log" && status=1; }
  tests=$(grep -E '^[0-9]+% tests passed' "$log" | tail -1)
  [ "$name" != fuzz ] || tests="$(ls build-fuzz/bin/fuzz_* 2>/dev/null | wc -l) targets of $seconds s"
  printf '%-5s  %s  %d min %02d s  %s\n' "$name" "$result" $(((SECONDS - began) / 60)) $(((SECONDS - began) % 60)) "$tests"
done
exit $status

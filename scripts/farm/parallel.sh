#!/usr/bin/env bash
# A farm over ssh by GNU parallel: a worker on every machine of a list, all with the same share.
#
#   .../scripts/farm/parallel.sh SHARE/scans/jobs.jsonl SHARE/scans/farm node1 node2 node3
#
# SHARE: where the share is mounted. Paths must mean the same everywhere, and tgtrain must be on the PATH of a shell
# without a terminal.
set -eu
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
if [ $# -lt 3 ]; then
  echo "usage: parallel.sh JOBS.jsonl FOLDER MACHINE..." >&2
  exit 1
fi
jobs=$(realpath "$1") farm=$(realpath "$2")
shift 2
trap 'exit 130' INT  # Ctrl-C is not for parallel alone
tgtrain farm "$jobs" --out "$farm" --prepare
# --nonall: one command a machine; --quote: paths may hold spaces; --tag: lines begin with the machine. A machine that
# is lost is no error while another one is there: the last command says how it went, and does what is left.
parallel --quote --nonall --tag --line-buffer --sshlogin "$(IFS=,; echo "$*")" \
  tgtrain farm "$jobs" --out "$farm" --join || true
exec tgtrain farm "$jobs" --out "$farm" --join

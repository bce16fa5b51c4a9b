#!/usr/bin/env bash
# A farm under MPI, which only starts the workers: they speak by the shared folder, not by messages.
#
#   cd SHARE/scans && .../scripts/farm/mpi.sh jobs.jsonl farm 16 --hostfile hosts --map-by ppr:4:node
#
# 16 workers, four a node, each with THREADS threads (2). What follows the number is for mpirun.
set -eu
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
if [ $# -lt 3 ]; then
  echo "usage: mpi.sh JOBS.jsonl FOLDER WORKERS [ARGUMENTS OF mpirun...]" >&2
  exit 1
fi
jobs=$1 farm=$2 workers=$3
shift 3
trap 'exit 130' INT  # Ctrl-C is not for mpirun alone
tgtrain farm "$jobs" --out "$farm" --prepare
attempts() { find "$farm/jobs" -mindepth 2 -maxdepth 2 -type d | wc -l; }
before=$(attempts)
# --bind-to none: a rank bound to a core would train on that core alone.
# A worker that ends with an error (a full disk, a job given up) must not take the others with it: mpirun would kill
# them all, which loses nothing but time. A machine that is lost does that nevertheless. The last command says how it
# went, and does what is left - but not the whole list, here alone, where no worker was started.
mpirun -np "$workers" --bind-to none "$@" \
  sh -c 'tgtrain farm "$1" --out "$2" --join --threads "$3" || echo "a worker ended with exit code $?" >&2' \
  worker "$jobs" "$farm" "${THREADS:-2}" || {
  code=$?
  echo "mpirun ended with exit code $code" >&2
  if [ "$(attempts)" = "$before" ]; then exit "$code"; fi
}
exec tgtrain farm "$jobs" --out "$farm" --join --threads "${THREADS:-2}"

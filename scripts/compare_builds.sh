#!/usr/bin/env bash
# Whether two builds make the same bytes: `scripts/compare_builds.sh OLD/bin NEW/bin [FOLDER]`. Runs the demo's pipeline on a
# small scale, every output format, edits, every kind of picture on every backend that works here, and the conformance
# files through both; names each file that differs and exits with 1. FOLDER keeps the outputs, default a temporary one.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
old=$(realpath "$1") new=$(realpath "$2")
folder=$(realpath -m "${3:-$(mktemp -d)}")
cd "$(dirname "$0")/.."
python3 scripts/make_conformance.py "$folder/conformance" >/dev/null

names() {  # PROGRAM FLAG: that it takes, of the old build, since both make them
  "$old/$1" --completion bash | sed -n "s/^ *$2) COMPREPLY=(\$(compgen -W '\([^']*\)'.*/\1/p"
}

formats=$(names tgconvert --to) shows=$(names tgview --show)
if [ -z "$formats" ] || [ -z "$shows" ]; then
  echo "compare_builds.sh: $old: completions without formats or outputs (expected those of --to and --show)" >&2
  exit 1
fi

outputs() {  # PROGRAMS: everything into the working folder, by relative names, since some outputs hold the names
  local bin=$1 format backend show
  "$bin/tgtrain" make-sample scene --size 96 --views 24 --test-views 4 --overwrite
  local quick=(--gaussians 1500 --reproducible --quiet --overwrite)
  "$bin/tgtrain" scene -o model.tgz --iterations 250 --texture-iterations 150 --compare-untextured \
    --untextured-output untextured.tgz --json training.json "${quick[@]}"
  "$bin/tgtrain" scene -o mcmc.tgz --iterations 150 --texture-iterations 60 --densification mcmc --filter-3d \
    --texture-mode rgb --texture-sizes footprint --texel-budget 20000 --intersection plane "${quick[@]}"
  "$bin/tgtrain" scene -o paper.tgz --preset paper --iterations 150 --texture-iterations 60 "${quick[@]}"
  "$bin/tgtrain" --print-config > config.ini
  "$bin/tgeval" model.tgz scene --images eval --side-by-side side --effective-rank --json eval.json > eval.txt

  local file
  for format in $formats png; do
    file=model.$format
    case $format in *.json) mkdir -p "${format%.json}" && file=${format%.json}/$format ;; esac  # with parts beside it
    "$bin/tgconvert" model.tgz "$file" --overwrite > "convert_$format.txt"
    [ "$format" = png ] || "$bin/tgconvert" "$file" --info --stats --json null > "info_$format.json"
  done
  "$bin/tgconvert" model.tgz lean.glb --lean --quantize --atlas png16 > lean.txt
  "$bin/tgconvert" model.tgz meshopt.glb --meshopt --quantize --atlas exr > meshopt.txt || true
  "$bin/tgconvert" model.glb back.tgz > back.txt
  "$bin/tgconvert" model.ply model.spz edited.glb --rotate 1,2,3,40 --scale 1.5 --translate 1,0,2 --keep "opacity > 0.1" \
    --sh-degree 1 > edited.txt
  "$bin/tgconvert" model.tgz fewer.glb --decimate 50% --texel-budget 6000 --crop-sphere 0,0,0,3 > fewer.txt
  "$bin/tgconvert" untextured.tgz pairs.ply --merge-pairs 60% > pairs.txt
  "$bin/tgconvert" model.tgz error.ply --texture-error 0.02 > error.txt
  for file in "$folder"/conformance/*.gl*; do
    "$bin/tgconvert" check "$file" --json > "check_$(basename "$file").json" || true
  done

  for backend in cpu vulkan opengl; do
    for show in $shows; do
      "$bin/tgview" model.tgz --render "$backend-$show.exr" --show "$show" --size 128x96 --backend "$backend" \
        > /dev/null 2>&1 || true
    done
  done
  "$bin/tgview" model.tgz --render compare.png --compare untextured.tgz --size 128x96 --backend cpu > compare.txt
  "$bin/tgview" model.tgz --turntable 3 -o turn --size 64x64 --backend cpu > turn.txt 2>&1 || true
  local program
  for program in tgtrain tgeval tgconvert tgview; do "$bin/$program" --help > "help_$program.txt"; done
}

for side in old new; do
  rm -rf "${folder:?}/$side"
  mkdir -p "$folder/$side"
  (cd "$folder/$side" && outputs "${!side}")
done
differ=0
while IFS= read -r file; do
  cmp -s "$folder/old/$file" "$folder/new/$file" || { echo "differs: $file"; differ=1; }
done < <(cd "$folder" && find old new -type f | sed 's|^[^/]*/||' | sort -u)
echo "$(find "$folder/old" -type f | wc -l) files compared in $folder"
exit "$differ"

#!/usr/bin/env bash
# Makes docs/sample.tgz (the trained model that ships) and the README's pictures again, with the programs in build/bin.
set -euo pipefail
if [ "${1:-}" = --help ] || [ "${1:-}" = -h ]; then
  sed -n '2,/^[^#]/s/^# //p' "$0"
  exit
fi
cd "$(dirname "$0")/.."
bin=build/bin
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

"$bin/tgtrain" make-sample "$work/scene"
"$bin/tgtrain" "$work/scene" -o docs/sample.tgz --overwrite --reproducible --gaussians 5000 \
  --iterations 4000 --texture-iterations 4000
mkdir -p docs/images
for show in final base texture normal; do
  "$bin/tgview" docs/sample.tgz --render "docs/images/$show.png" --show "$show" --size 400x400
done
printf 'wait 20\ninspect 700 480\nwait 20\nwindow docs/images/window.png\n' > "$work/script"
xvfb-run -a "$bin/tgview" docs/sample.tgz --size 1280x720 --script "$work/script"

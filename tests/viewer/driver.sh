#!/bin/sh
# Runs tgview ("$@") under a window manager and does to its window, as a hand would, what ./hand.sh says with the
# functions below. The script that tgview runs and the hand wait for each other by files.
set -u
# A window made while the manager is starting waits for it for ever.
openbox --startup "touch $PWD/managed" >/dev/null 2>&1 &
tries=0
until [ -e managed ]; do
  tries=$((tries + 1))
  [ "$tries" -lt 3000 ] || exit 89
  sleep 0.02
done
"$@" &
tgview=$!
trap 'kill $tgview 2>/dev/null' EXIT

# Waits until a file is there.
reached() {
  tries=0
  until [ -e "$1" ]; do
    tries=$((tries + 1))
    kill -0 "$tgview" 2>/dev/null && [ "$tries" -lt 3000 ] || exit 90
    sleep 0.02
  done
}
# Waits until a frame was drawn with what the hand has done; the script says `await-file NAME`, `window NAME.png`.
seen() { touch "$1" && reached "$1.png"; }
# Waits until the window manager has given the window that size, WxH.
sized() {
  tries=0
  until xdotool getwindowgeometry "$window" | grep -q " $1\$"; do
    tries=$((tries + 1))
    [ "$tries" -lt 1200 ] || exit 92
    sleep 0.05
  done
}
# The pointer, in pixels of the window. The question at the end is answered when the event is on its way.
to() { xdotool mousemove --window "$window" "$1" "$2" getmouselocation >/dev/null; }
press() { xdotool mousedown "$1" getmouselocation >/dev/null; }
release() { xdotool mouseup "$1" getmouselocation >/dev/null; }
click() { to "$1" "$2" && press 1 && release 1; }
wheel() { xdotool click "$1" getmouselocation >/dev/null; }
key() { xdotool key "$1" getmouselocation >/dev/null; }

reached ready.png
window=$(xdotool search --onlyvisible --name '^tgview' | head -n 1)
[ -n "$window" ] || exit 91
. ./hand.sh
trap - EXIT
wait "$tgview"

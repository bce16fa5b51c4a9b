#!/bin/sh
# Runs tgview ("$@") under a window manager and does to its window, as a hand would, what ./hand.sh says with the
# functions below. The script that tgview runs and the hand wait for each other by files.
set -u
# A window made while the manager is starting waits for it for ever.
openbox --startup "touch $PWD/managed" >/dev/null 2>&1 &
tries=0
until [ -e managed ]; do
  tries=$((tries + 1))
  [ "$tries" -lt 1500 ] || exit 89
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
    kill -0 "$tgview" 2>/dev/null && [ "$tries" -lt 1500 ] || exit 90
    sleep 0.02
  done
}
# The pointer, in pixels of the window; slowly enough for a frame in between.
to() { xdotool mousemove --window "$window" "$1" "$2" && sleep 0.2; }
press() { xdotool mousedown "$1" && sleep 0.2; }
release() { xdotool mouseup "$1" && sleep 0.2; }
key() { xdotool key "$1" && sleep 0.2; }

reached ready.png
window=$(xdotool search --onlyvisible --name '^tgview' | head -n 1)
[ -n "$window" ] || exit 91
. ./hand.sh
trap - EXIT
wait "$tgview"

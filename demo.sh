#!/bin/bash
# Scans a simulated polymer blend through the daemon and its client, live, then draws the maps and says how far they
# lie from the truth. `./demo.sh --once` ends after one frame; without it the scan goes on until Ctrl-C.
set -euo pipefail
cd "$(dirname "$0")"

once=false
case "$*" in
  '') ;;
  --once) once=true ;;
  *) echo "usage: ./demo.sh [--once]" >&2; exit 2 ;;
esac

.ci/install
cmake --preset release >/dev/null
cmake --build --preset release --target combforce combforced

bin=$PWD/build/release
mkdir -p demo-output
cd demo-output
rm -rf maps maps.png pixels.ndjson

setsid "$bin/combforced" --config ../config/demo.json 2>daemon.log &  # out of reach of the terminal's Ctrl-C
daemon=$!
stop_daemon() {
  trap '' INT TERM HUP
  kill -TERM "$daemon" 2>/dev/null || true
  wait "$daemon" || { echo "the daemon failed:"; cat daemon.log; } >&2
}
trap stop_daemon EXIT
trap 'echo; exit 0' INT TERM HUP

socket=combforce-demo.sock
for _ in $(seq 100); do
  [ ! -S $socket ] || break
  kill -0 "$daemon" 2>/dev/null || exit 1
  sleep 0.1
done
combforce() { "$bin/combforce" "$@" --connect "unix:$socket"; }

echo; echo "The daemon runs (demo-output/daemon.log). Free motion of the cantilever, the reference of every force:"
combforce free --windows 64

frame() {
  combforce watch --frames 1 --start-scan --maps maps --truth ../config/demo.json --output pixels.ndjson
  gnuplot -e "maps='maps'; picture='maps.png'" ../plots/maps.gp
  echo "In demo-output/: maps.png, maps/*.gsf (for Gwyddion), pixels.ndjson (every pixel as it came over the socket)."
}

echo; echo "Scanning 64 x 64 pixels:"
frame
while ! $once; do frame; done

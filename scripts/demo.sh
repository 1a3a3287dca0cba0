#!/usr/bin/env bash
# The main job, end to end: find the loops of a recording, score them, draw them. Ends by naming the report.
# Without DATA=FOLDER the recording is a simulated drive of 1 km through a town, in streets that come again the same way
# and the other way; no scan of it is written to the disk.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${OUT:-out/demo}
recording=${DATA:-}
if [ -z "$recording" ]; then
  mkdir -p "$out"
  recording=$out/town.toml
  printf '[simulation]\nworld = "town"\nsensor = "hdl64e"\nseed = 1\nlength_m = 1000\n' > "$recording"
fi
if [ ! -e "$recording" ]; then
  echo "no recording at $recording: name one, e.g. make demo DATA=kitti/sequences/00" >&2
  exit 1
fi
case $recording in *.toml) reference=$recording ;; esac
for poses in "$recording"/poses.txt "$recording"/poses_subset.txt; do
  if [ -f "$poses" ]; then reference=${reference:-$poses}; fi
done
build/revisit info "$recording"
echo
build/revisit detect "$recording" --out "$out" --overwrite
query=$(awk -F, 'NR > 1 { print $1; exit }' "$out/loops.csv")
if [ -n "$query" ]; then build/revisit describe "$recording" --frame "$query" --out "$out/scan.png"; fi
echo
if [ -n "${reference:-}" ]; then
  build/revisit evaluate "$out" --reference "$reference"
  build/revisit view "$out" --report "$out/view.html"
  echo "In a browser, with both scans of each loop: build/revisit view $out"
else
  echo "No reference poses: nothing to score against. In a browser: build/revisit view $out"
fi

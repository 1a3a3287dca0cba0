#!/usr/bin/env bash
# The main job on real scans: find the loops of a recording, score them, draw them. Ends by naming the report.
# Recording: DATA=FOLDER, by default the small KITTI folder beside the project.
set -euo pipefail
cd "$(dirname "$0")/.."
recording=${DATA:-../shared/data/kitti00_mini}
out=${OUT:-out/demo}
if [ ! -d "$recording" ]; then
  echo "no recording at $recording: name one, e.g. make demo DATA=kitti/sequences/00" >&2
  exit 1
fi
build/revisit info "$recording"
echo
build/revisit detect "$recording" --out "$out" --overwrite
query=$(awk -F, 'NR > 1 { print $1; exit }' "$out/loops.csv")
if [ -n "$query" ]; then
  for scan in "$recording"/velodyne/*"$(printf '%06d' "$query")".bin; do
    if [ -f "$scan" ]; then build/revisit describe "$scan" --out "$out/scan.png"; fi
  done
fi
echo
for reference in "$recording"/poses.txt "$recording"/poses_subset.txt; do
  if [ -f "$reference" ]; then
    build/revisit evaluate "$out" --reference "$reference"
    exit 0
  fi
done
echo "Report: $out/loops.csv (no reference poses: nothing to score against)"

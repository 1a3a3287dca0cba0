#!/usr/bin/env bash
# Table 5 (docs/evaluation.md): scans of another day looked for, one by one, in the map of the first day, at the shipped
# defaults; then scans of places that the map does not hold.
# usage: scripts/waking.sh POSES_FOLDER OUT SEED MAP_SENSOR SCAN_SENSOR DIFFICULTY SEQUENCE ...
# Each SEQUENCE is one of POSES_FOLDER/kitti_SEQUENCE.txt. Of the map, half of the drive is kept; the scans are of all of
# it, and of a town of another seed along another way, which the map does not hold.
set -euo pipefail
cd "$(dirname "$0")/.."
usage="usage: scripts/waking.sh POSES_FOLDER OUT SEED MAP_SENSOR SCAN_SENSOR DIFFICULTY SEQUENCE ..."
poses=$(realpath "${1:?$usage}") out=${2:?$usage} seed=${3:?$usage} map=${4:?$usage} scan=${5:?$usage} difficulty=${6:?$usage}
shift 6
program=${REVISIT:-build/revisit}
mkdir -p "$out"
drive() {  # file, sensor, seed, sequence, further lines
  printf '[simulation]\nsensor = "%s"\nseed = %s\ndifficulty = %s\ntrajectory = "%s"\n%b' "$2" "$3" "$difficulty" \
    "$poses/kitti_$4.txt" "$5" > "$1"
}
for sequence in "$@"; do
  at=$out/$sequence-$map-$scan-$difficulty
  drive "$at-map.toml" "$map" "$seed" "$sequence" 'to_m = 1200\n'
  drive "$at-day1.toml" "$scan" "$seed" "$sequence" 'day = 1\nbeside_m = 0.8\nto_m = 2400\n'
  other=$([ "$sequence" = 08 ] && echo 00 || echo 08)
  drive "$at-elsewhere.toml" "$scan" $((seed + 1000)) "$other" 'day = 1\nto_m = 1200\n'
  [ -e "$at-map/map.revisit" ] || "$program" slam "$at-map.toml" --out "$at-map" --no-map || [ $? = 3 ]  # 3: some scans were not tracked
  for kind in day1 elsewhere; do
    "$program" localise "$at-map" "$at-$kind.toml" --out "$at-$kind" --each
    echo "== $sequence, map $map, scans $scan, difficulty $difficulty, seed $seed: $kind"
    elsewhere=$([ "$kind" = elsewhere ] && echo --elsewhere || true)
    "$program" evaluate "$at-$kind" --reference "$at-$kind.toml" $elsewhere | tee "$at-$kind.txt"
  done
done

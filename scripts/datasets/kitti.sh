#!/usr/bin/env bash
# KITTI odometry, from what was downloaded to the tables of docs/evaluation.md: checks the folder, says what is missing,
# runs every method (`revisit compare --verify`) and SLAM over each sequence, and puts the tables into OUT/tables.txt.
# usage: scripts/datasets/kitti.sh FOLDER OUT [SEQUENCE ...]          (default: 00 02 05 06 07 08, those with revisits)
# FOLDER is the data set's own (its page calls it `dataset`):
#   sequences/NN/velodyne/NNNNNN.bin   data_odometry_velodyne.zip, 80 GB
#   sequences/NN/calib.txt times.txt   data_odometry_calib.zip
#   poses/NN.txt                       data_odometry_poses.zip, 00 to 10
# A sequence takes some minutes to half an hour on two cores. What is there already is not run again. METHODS=a,b: only these.
set -euo pipefail
usage="usage: scripts/datasets/kitti.sh FOLDER OUT [SEQUENCE ...]"
folder=$(realpath "${1:?$usage}")
out=$(realpath -m "${2:?$usage}")
shift 2
revisit=$(realpath -m "${REVISIT:-$(dirname "$0")/../../build/revisit}")
[ $# -gt 0 ] || set -- 00 02 05 06 07 08
declare -A scans=([00]=4541 [01]=1101 [02]=4661 [03]=801 [04]=271 [05]=2761 [06]=1101 [07]=1101 [08]=4071 [09]=1591 [10]=1201)

missing=0
lacks() { echo "missing: $1 (of $2)" >&2; missing=1; }
[ -x "$revisit" ] || lacks "$revisit" "this project: make build"
for sequence in "$@"; do
  if [ -z "${scans[$sequence]:-}" ]; then
    echo "sequence $sequence has no published poses; allowed: 00 to 10" >&2
    exit 2
  fi
  of=$folder/sequences/$sequence
  for file in calib.txt times.txt; do [ -s "$of/$file" ] || lacks "$of/$file" data_odometry_calib.zip; done
  [ -s "$folder/poses/$sequence.txt" ] || lacks "$folder/poses/$sequence.txt" data_odometry_poses.zip
  found=0
  [ ! -d "$of/velodyne" ] || found=$(find -L "$of/velodyne" -name '*.bin' -size +0 | wc -l)
  if [ "$found" = 0 ]; then
    lacks "$of/velodyne/*.bin" data_odometry_velodyne.zip
  elif [ "$found" != "${scans[$sequence]}" ]; then
    echo "note: $of/velodyne holds $found of ${scans[$sequence]} scans: not the figures of the whole sequence" >&2
  fi
done
[ $missing = 0 ] || exit 1

# 3: done, but for some scans (`revisit --help`).
run() { "$@" > /dev/null || [ $? = 3 ]; }
mkdir -p "$out"
for sequence in "$@"; do
  of=$folder/sequences/$sequence poses=$folder/poses/$sequence.txt to=$out/$sequence
  found=$(find -L "$of/velodyne" -name '*.bin' -size +0 | wc -l)
  # Finished, and with as many scans as there are now.
  [ "$(cat "$to/scans.txt" 2> /dev/null)" != "$found" ] || continue
  echo "== $sequence" >&2
  run "$revisit" compare "$of" --poses "$poses" --verify --out "$to" --overwrite \
    ${METHODS:+--methods "$METHODS"}
  run "$revisit" slam "$of" --no-map --out "$to/slam" --overwrite
  "$revisit" evaluate "$to/slam" --reference "$poses" > "$to/slam.txt"
  echo "$found" > "$to/scans.txt"
done
for sequence in "$@"; do
  printf '== %s\n' "$sequence"
  cat "$out/$sequence/comparison.txt" "$out/$sequence/slam.txt"
done > "$out/tables.txt"
cat "$out/tables.txt"

#!/usr/bin/env bash
# Scans that lie far apart in time: `revisit slam` of every K-th scan of simulated drives, with their times, wheels and
# odometry left out (docs/slam.md, "Scans far apart").
# usage: scripts/sparse.sh POSES_FOLDER OUT SEED DIFFICULTY SEQUENCE-SENSOR:K ...
# SEQUENCE is 00 to 10 (POSES_FOLDER holds kitti_NN.txt), building or warehouse; REVISIT another program.
set -euo pipefail
cd "$(dirname "$0")/.."
usage="usage: scripts/sparse.sh POSES_FOLDER OUT SEED DIFFICULTY SEQUENCE-SENSOR:K ..."
poses=$(realpath "${1:?$usage}") out=${2:?$usage} seed=${3:?$usage} difficulty=${4:?$usage}
shift 4
revisit=${REVISIT:-build/revisit}
mkdir -p "$out"
for run in "$@"; do
  drive=${run%%:*} every=${run#*:} sequence=${run%%-*} all=$out/${run%%:*} some=$out/${run%%:*}-$every
  if [ ! -e "$all/times.txt" ]; then
    printf '[simulation]\nsensor = "%s"\nseed = %s\ndifficulty = %s\n' "${drive#*-}" "$seed" "$difficulty" > "$all.toml"
    case $sequence in
      warehouse | building) printf 'world = "%s"\nlength_m = 100\n' "$sequence" >> "$all.toml" ;;
      *) printf 'trajectory = "%s"\n' "$poses/kitti_$sequence.txt" >> "$all.toml" ;;
    esac
    "$revisit" simulate --parameters "$all.toml" --out "$all"
  fi
  rm -rf "$some"
  for kind in velodyne velodyne_times velodyne_rings; do
    [ -d "$all/$kind" ] || continue
    mkdir -p "$some/$kind"
    number=0
    for file in $(ls "$all/$kind" | awk -v k="$every" 'NR % k == 1 || k == 1'); do
      ln "$all/$kind/$file" "$some/$kind/$(printf '%06d.bin' $number)"
      number=$((number + 1))
    done
  done
  for rows in times.txt poses.txt; do awk -v k="$every" 'NR % k == 1 || k == 1' "$all/$rows" > "$some/$rows"; done
  cp "$all/calib.txt" "$some"
  echo "== $drive, every scan of $every, seed $seed, difficulty $difficulty"
  "$revisit" slam "$some" --out "$some/slam" --overwrite || [ $? -eq 3 ]  # 3: some were not tracked
  "$revisit" evaluate "$some/slam" --reference "$some" | tee "$some.txt"
done

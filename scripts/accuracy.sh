#!/usr/bin/env bash
# Tables 1 and 2 (docs/evaluation.md) over simulated towns along recorded trajectories, at the shipped defaults.
# usage: scripts/accuracy.sh POSES_FOLDER OUT [SEED [DIFFICULTY [SEQUENCE-SENSOR ...]]]
# POSES_FOLDER holds kitti_NN.txt; sequences default to 00, 02, 05, 06, 07 and 08 with hdl64e and vlp16, and 200 m of
# warehouse and building with vlp16 and os0-128. Choose nothing on the seeds that figures are reported for.
set -euo pipefail
cd "$(dirname "$0")/.."
usage="usage: scripts/accuracy.sh POSES_FOLDER OUT [SEED [DIFFICULTY [SEQUENCE-SENSOR ...]]]"
poses=$(realpath "${1:?$usage}") out=${2:?$usage} seed=${3:-42} difficulty=${4:-0}
shift $(($# < 4 ? $# : 4))
if [ $# -eq 0 ]; then
  set -- {00,02,05,06,07,08}-{hdl64e,vlp16} warehouse-vlp16 building-{vlp16,os0-128}
fi
mkdir -p "$out"
for run in "$@"; do
  sequence=${run%%-*} sensor=${run#*-} spec=$out/$run.toml
  printf '[simulation]\nsensor = "%s"\nseed = %s\ndifficulty = %s\n' "$sensor" "$seed" "$difficulty" > "$spec"
  case $sequence in
    warehouse | building) printf 'world = "%s"\nlength_m = 200\n' "$sequence" >> "$spec" ;;
    *) printf 'trajectory = "%s"\n' "$poses/kitti_$sequence.txt" >> "$spec" ;;
  esac
  echo "== $run, seed $seed, difficulty $difficulty"
  build/revisit detect "$spec" --out "$out/$run" --overwrite
  build/revisit evaluate "$out/$run" --reference "$spec" | tee "$out/$run.txt"
done

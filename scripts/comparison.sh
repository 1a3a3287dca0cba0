#!/usr/bin/env bash
# All methods side by side over simulated drives (docs/comparison.md), each verified by this program's registration too.
# usage: scripts/comparison.sh POSES_FOLDER OUT [SEED] [DRIVE-SENSOR-DIFFICULTY ...]
# POSES_FOLDER holds kitti_NN.txt. Drives: 00, 02, ... or warehouse, building; 07-hdl64e-1, say. Choose nothing on the
# seeds that figures are reported for. FRAMES=N drives only the first N scans; OPTIONS are those of `revisit compare` instead
# of --verify ("" for retrieval alone, which takes half as long).
set -euo pipefail
program=$(realpath -m "${REVISIT:-$(dirname "$0")/../build/revisit}")
usage="usage: scripts/comparison.sh POSES_FOLDER OUT [SEED] [DRIVE-SENSOR-DIFFICULTY ...]"
poses=$(realpath "${1:?$usage}")
out=${2:?$usage} seed=${3:-42}
shift $(($# < 3 ? $# : 3))
if [ $# -eq 0 ]; then
  set -- {00,02,05,07,08}-hdl64e-{0,1} 08-vlp16-{0,1} warehouse-vlp16-{0,1} building-os0-128-{0,1}
fi
mkdir -p "$out"
for run in "$@"; do
  drive=${run%%-*} difficulty=${run##*-} sensor=${run#*-} spec=$out/$run.toml
  sensor=${sensor%-*}
  printf '[simulation]\nsensor = "%s"\nseed = %s\ndifficulty = %s\n' "$sensor" "$seed" "$difficulty" > "$spec"
  case $drive in
    warehouse) printf 'world = "warehouse"\nlength_m = 150\n' >> "$spec" ;;
    building) printf 'world = "building"\nlength_m = 150\n' >> "$spec" ;;
    *) printf 'trajectory = "%s"\n' "$poses/kitti_$drive.txt" >> "$spec" ;;
  esac
  [ -z "${FRAMES:-}" ] || printf 'frames = %s\n' "$FRAMES" >> "$spec"
  echo "== $run, seed $seed"
  # shellcheck disable=SC2086  # several words
  "$program" compare "$spec" ${OPTIONS---verify} --out "$out/$run" --overwrite > "$out/$run.txt" || [ $? = 3 ]  # but for some scans
  cat "$out/$run.txt"
done

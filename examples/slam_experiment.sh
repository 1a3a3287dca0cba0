#!/usr/bin/env bash
# Trajectories before and after loop closing, with pictures: a robot in a warehouse, out and back in reverse, by its
# wheels alone and by wheels and LiDAR; and cars in towns along recorded trajectories, where these are given.
# usage: examples/slam_experiment.sh OUT [SEED] [POSES_FOLDER [SEQUENCE ...]]
# POSES_FOLDER holds kitti_NN.txt; sequences default to 00 05 07. Writes OUT/table.txt and OUT/*/trajectories.png.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:?usage: examples/slam_experiment.sh OUT [SEED] [POSES_FOLDER [SEQUENCE ...]]}
seed=${2:-42} poses=${3:-}
shift $(($# < 3 ? $# : 3))
[ $# -gt 0 ] || set -- 00 05 07
mkdir -p "$out"
: > "$out/table.txt"

run() {  # NAME TOML [OPTION ...]
  local name=$1 spec=$2
  shift 2
  echo "== $name"
  # 3: done, but with scans skipped or not tracked, which the output names.
  build/revisit slam "$spec" --out "$out/$name" --overwrite "$@" || [ $? -eq 3 ]
  build/revisit evaluate "$out/$name" --reference "$spec" > "$out/$name.txt"
  { echo "$name"; sed -n '/^Table 3/,/^$/p' "$out/$name.txt" | tail -n +2; } >> "$out/table.txt"
}

printf '[simulation]\nworld = "warehouse"\nsensor = "vlp16"\nseed = %s\n' "$seed" > "$out/warehouse.toml"
run warehouse_wheels "$out/warehouse.toml" --odometry wheels
run warehouse "$out/warehouse.toml"
if [ -n "$poses" ]; then
  for sequence in "$@"; do
    printf '[simulation]\nsensor = "hdl64e"\nseed = %s\ntrajectory = "%s"\n' "$seed" \
      "$(realpath "$poses/kitti_$sequence.txt")" > "$out/town_$sequence.toml"
    run "town_$sequence" "$out/town_$sequence.toml"
  done
fi
cat "$out/table.txt"

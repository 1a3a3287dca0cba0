#!/usr/bin/env bash
# What each ingredient of detection brings: tables 1 and 2 (docs/evaluation.md) with one of them removed at a time, over
# the first scans of a simulated town. usage: scripts/ablation.sh POSE_FILE OUT [SEED] [SENSOR] [FRAMES] [DIFFICULTY]
set -euo pipefail
usage="usage: scripts/ablation.sh POSE_FILE OUT [SEED] [SENSOR] [FRAMES] [DIFFICULTY]"
poses=$(realpath "${1:?$usage}") out=$(realpath -m "${2:?$usage}") seed=${3:-42} sensor=${4:-hdl64e}
frames=${5:-1900} difficulty=${6:-0}
cd "$(dirname "$0")/.."
mkdir -p "$out"
drive=$out/drive
if [ ! -d "$drive" ]; then
  build/revisit simulate --out "$drive" --sensor "$sensor" --seed "$seed" --trajectory "$poses" --frames "$frames" \
    --difficulty "$difficulty"
fi
# The same scans without the times of their points: nothing can be undone.
mkdir -p "$out/no_times"
for part in "$drive"/*; do
  [ "$(basename "$part")" = velodyne_times ] || ln -sfn "$part" "$out/no_times/"
done

printf '| removed | R@1 | R@P100 | false loops | recall | median error |\n|---|---|---|---|---|---|\n' |
  tee "$out/table.md"
without() {
  local name=$1 recording=$2 results
  shift 2
  results=$out/${name//[^a-z0-9]/_}
  build/revisit detect "$recording" --out "$results" --overwrite "$@" > "$results.log" 2>&1
  build/revisit evaluate "$results" --reference "$drive" |
    awk -v name="$name" '
      $1 == "all" { r1 = $4; p100 = $7 }
      table2 && NF > 8 { printf "| %s | %s | %s | %s of %s | %s | %s m, %s deg |\n", name, r1, p100, $2, $1, $4, $6, $10; exit }
      $1 == "accepted" { table2 = 1 }' | tee -a "$out/table.md"
}
without "nothing" "$drive"
without "layers of height (one image of 20 x 60)" "$drive" --descriptor.levels 0 --descriptor.sectors 60
without "the ground, from the descriptor" "$drive" --preprocess.remove_ground true
without "intensity in retrieval" "$drive" --retrieval.intensity_weight 0
without "the search from overhead" "$drive" --geometric.overhead_search false
without "a second and third candidate" "$drive" --geometric.candidates 1
without "loop following" "$drive" --geometric.follow false
without "intensity, everywhere" "$drive" --intensity.full_scale 1e9
without "undoing the sweep" "$out/no_times"

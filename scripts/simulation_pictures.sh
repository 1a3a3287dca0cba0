#!/usr/bin/env bash
# The pictures and figures of docs/simulation.md. KITTI=FOLDER names the real recording that the town is compared with.
set -euo pipefail
cd "$(dirname "$0")/.."
kitti=${KITTI:-../shared/data/kitti00_mini}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
describe() {  # NAME WORLD SENSOR FRAME TITLE
  printf '[simulation]\nworld = "%s"\nsensor = "%s"\n' "$2" "$3" > "$work/$1.toml"
  build/revisit describe "$work/$1.toml" --frame "$4" --out "docs/images/simulation_$1.png" --descriptor.max_range_m "$5"
}
describe hdl64e town hdl64e 500 50
describe vlp16 town vlp16 500 50
describe os0-128 town os0-128 500 50
describe mid360 town mid360 500 50
describe rosette town rosette 500 50
describe warehouse warehouse vlp16 400 30
if [ -d "$kitti" ]; then
  poses=$(realpath "$kitti/../poses/kitti_00.txt")
  printf '[simulation]\ntrajectory = "%s"\nmotion_distortion = false\n' "$poses" > "$work/simulated.toml"
  printf '[descriptor]\nrings = 60\nsectors = 20\nlevels = 0\nmax_range_m = 50\n' > "$work/grid.toml"
  build/revisit info "$work/simulated.toml" --beside "$kitti" --parameters "$work/grid.toml" \
    --picture docs/images/simulation_statistics.png
fi

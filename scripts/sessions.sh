#!/usr/bin/env bash
# Table 6 (docs/evaluation.md): ten sessions of four sensors, each of another day, along stretches that overlap by a
# third, some of them driven the other way round; each begins where it likes. They are mapped alone, then merged.
# usage: scripts/sessions.sh POSES_FOLDER OUT SEED DIFFICULTY SEQUENCE LENGTH_M
set -euo pipefail
cd "$(dirname "$0")/.."
usage="usage: scripts/sessions.sh POSES_FOLDER OUT SEED DIFFICULTY SEQUENCE LENGTH_M"
poses=$(realpath "${1:?$usage}") out=${2:?$usage} seed=${3:?$usage} difficulty=${4:?$usage} sequence=${5:?$usage} length=${6:?$usage}
program=${REVISIT:-build/revisit}
mkdir -p "$out"
sensors=(hdl64e vlp16 os0-128 rosette)
maps=()
for session in 0 1 2 3 4 5 6 7 8 9; do
  at=$out/$session from=$((session * length * 2 / 3))
  reverse=$([ $((session % 3)) = 2 ] && echo true || echo false)
  printf '[simulation]\nsensor = "%s"\nseed = %s\ndifficulty = %s\ntrajectory = "%s"\nday = %s\nreverse = %s\nfrom_m = %s\nto_m = %s\n' \
    "${sensors[session % 4]}" "$seed" "$difficulty" "$poses/kitti_$sequence.txt" "$session" "$reverse" "$from" \
    $((from + length)) > "$at.toml"
  [ -e "$at/map.revisit" ] || "$program" slam "$at.toml" --out "$at" --no-map || [ $? = 3 ]  # 3: some scans were not tracked
  maps+=("$at/map.revisit")
done
rm -f "$out/all.revisit"
/usr/bin/time -f '%e s, %M kB' "$program" merge "${maps[@]}" --out "$out/all.revisit"
"$program" evaluate "$out/all.revisit" | tee "$out/all.txt"

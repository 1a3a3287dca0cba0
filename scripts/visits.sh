#!/usr/bin/env bash
# A robot comes back to a building, each time on another day: how the map grows. The table goes to OUT/visits.txt.
# usage: scripts/visits.sh OUT SEED DIFFICULTY VISITS LENGTH_M
set -euo pipefail
cd "$(dirname "$0")/.."
usage="usage: scripts/visits.sh OUT SEED DIFFICULTY VISITS LENGTH_M"
out=${1:?$usage} seed=${2:?$usage} difficulty=${3:?$usage} visits=${4:?$usage} length=${5:?$usage}
program=${REVISIT:-build/revisit}
mkdir -p "$out"
printf '%5s %9s %10s %9s %10s\n' visit MB keyframes places memory_MB > "$out/visits.txt"
for ((visit = 0; visit < visits; ++visit)); do
  at=$out/$visit
  printf '[simulation]\nworld = "building"\nsensor = "vlp16"\nseed = %s\ndifficulty = %s\nlength_m = %s\nday = %s\nreverse = %s\n' \
    "$seed" "$difficulty" "$length" "$visit" "$([ $((visit % 2)) = 1 ] && echo true || echo false)" > "$at.toml"
  into=$([ "$visit" = 0 ] || echo "--into $out/0/map.revisit")
  # shellcheck disable=SC2086  # none or two words
  /usr/bin/time -f %M -o "$at.memory" "$program" slam "$at.toml" --out "$at" $into --no-map > "$at.log" 2>&1 ||
    [ $? = 3 ]  # 3: some scans were not tracked
  python3 - "$visit" "$out/0/map.revisit" "$(tail -n 1 "$at.memory")" << 'PYTHON' | tee -a "$out/visits.txt"
import os, sqlite3, sys
visit, map_file, memory_kB = sys.argv[1:]
count = lambda table: sqlite3.connect(map_file).execute(f"select count(*) from {table}").fetchone()[0]
print(f"{visit:>5} {os.path.getsize(map_file) / 1e6:9.2f} {count('keyframes'):10} {count('descriptors'):9} {int(memory_kB) / 1e3:10.1f}")
PYTHON
done

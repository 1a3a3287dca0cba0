#!/usr/bin/env bash
# Reads broken copies of all recordings and scans in a folder, with sanitizers on: nothing may crash or hang.
# usage: scripts/mutate.sh FOLDER [COPIES]; some 20 copies a second.
set -euo pipefail
cd "$(dirname "$0")/.."
folder=${1:?usage: scripts/mutate.sh FOLDER [COPIES]} copies=${2:-10000}
cmake --preset debug --log-level=NOTICE > /dev/null
cmake --build --preset debug --parallel "$(nproc)" --target mutate_files
exec build/debug/bin/mutate_files "$folder" 1 "$copies"

#!/usr/bin/env bash
# Fuzzes every reader with clang's libFuzzer, under AddressSanitizer and UndefinedBehaviorSanitizer; a table at the end.
# usage: scripts/fuzz.sh [SECONDS [READER...]]: seconds a reader (default 1800), all of them if none is named.
# What breaks a reader is kept in out/fuzz; once mended it belongs into tests/fuzz/found/READER.
set -euo pipefail
cd "$(dirname "$0")/.."
seconds=${1:-1800}
shift || true
scripts/install_packages.sh clang libclang-rt-14-dev
cmake --preset fuzz --log-level=NOTICE > /dev/null
cmake --build --preset fuzz --parallel "$(nproc)" --target fuzz_reader
fuzzer=build/fuzz/bin/fuzz_reader
corpus=build/fuzz/corpus out=out/fuzz
mkdir -p "$out"
python3 scripts/fuzz_seeds.py build/release/revisit "$corpus" "${REVISIT_TEST_DATA:-../shared/data}"
readers=("$@")
[ ${#readers[@]} -gt 0 ] || mapfile -t readers < <(READER=none "$fuzzer" 2>&1 | sed 's/.*: *//' | tr ' ' '\n' | grep .)

one() {
  mkdir -p "$corpus/$1"
  READER=$1 "$fuzzer" -max_total_time="$seconds" -timeout=20 -max_len="$([ "$1" = map ] && echo 5000000 || echo 262144)" -rss_limit_mb=3000 -print_final_stats=1 \
    -artifact_prefix="$out/$1-" "$corpus/$1" > "$out/$1.log" 2>&1 && result=clean || result="BROKEN ($out/$1-*, $out/$1.log)"
  printf '| %s | %s | %s | %s | %s |\n' "$1" "$(sed -n 's/stat::number_of_executed_units: *//p' "$out/$1.log")" \
    "$(grep -o 'cov: [0-9]*' "$out/$1.log" | tail -1 | cut -d' ' -f2)" "$(sed -n 's/stat::peak_rss_mb: *//p' "$out/$1.log")" "$result"
}
export -f one
export fuzzer corpus out seconds
echo "| reader | inputs | branches reached | MB at most | result |"
echo "|---|---|---|---|---|"
printf '%s\n' "${readers[@]}" | xargs -P "${PARALLEL:-$(nproc)}" -I{} bash -c 'one {}'
! grep -L "stat::number_of_executed_units" "$out"/*.log | grep . || exit 1

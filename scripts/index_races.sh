#!/bin/sh
# A place index under ThreadSanitizer, one thread adding and four searching: scripts/index_races.sh [PLACES] [SECONDS]
# A million places take 10 GB and some minutes to add.
set -eu
cd "$(dirname "$0")/.."
cmake --preset tsan > /dev/null
cmake --build --preset tsan --target index_races
rm -f build/tsan/race.*
TSAN_OPTIONS="log_path=$PWD/build/tsan/race exitcode=1" build/tsan/bin/index_races "${1:-1000000}" "${2:-180}"
echo "no data race"

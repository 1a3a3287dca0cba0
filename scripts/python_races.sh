#!/bin/sh
# Four threads of Python at work under ThreadSanitizer: scripts/python_races.sh
# On one core, so that oneTBB, which is not instrumented, starts no threads of its own. 10 min, nearly all of it the build.
set -eu
cd "$(dirname "$0")/.."
cmake --preset tsan > /dev/null
cmake --build --preset tsan --target revisit_python
rm -f build/tsan/race.*
LD_PRELOAD=$(gcc -print-file-name=libtsan.so) OPENBLAS_NUM_THREADS=1 PYTHONPATH=build/tsan/bindings/python \
  TSAN_OPTIONS="suppressions=$PWD/cmake/races.supp log_path=$PWD/build/tsan/race exitcode=1" \
  taskset -c 0 /usr/bin/python3 -m pytest -q -p no:cacheprovider bindings/python/tests/test_doors.py -k threads_work
echo "no data race"

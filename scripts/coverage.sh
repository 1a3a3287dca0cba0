#!/bin/sh
# Which lines of src/ the tests run: out/coverage.txt, a table by file, and the share of all. usage: scripts/coverage.sh
# [REGEX OF TESTS]. Counted with gcov in a build of its own, half an hour on two cores; what starts the program counts, too.
set -eu
cd "$(dirname "$0")/.."
scripts/install_packages.sh gcovr
cmake -S . -B build/coverage -G Ninja --log-level=NOTICE -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS="-O1 --coverage" \
  -DREVISIT_BUILD_BENCHMARKS=OFF -DREVISIT_SHARED=OFF > /dev/null
cmake --build build/coverage
find build/coverage -name '*.gcda' -delete
ctest --test-dir build/coverage --parallel "$(nproc)" ${1:+-R "$1"} --timeout 600 || echo "some tests failed: above" >&2
mkdir -p out
gcovr --root . --object-directory build/coverage --filter 'src/revisit/' --exclude '.*_test\.cpp' --exclude-throw-branches \
  --txt out/coverage.txt
tail -3 out/coverage.txt

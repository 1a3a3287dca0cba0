#!/bin/sh
# Which lines of src/ the tests run, counted with gcov in a build of its own: out/coverage.txt, a table by file, and the
# share of all. usage: scripts/coverage.sh [MODULE ...]
# Of modules, their own tests alone (some minutes); of everything, all tests, those of the program, too.
set -eu
cd "$(dirname "$0")/.."
scripts/install_packages.sh gcovr
cmake -S . -B build/coverage -G Ninja --log-level=NOTICE -DCMAKE_BUILD_TYPE=None -DCMAKE_CXX_FLAGS="-O1 --coverage" \
  -DREVISIT_BUILD_BENCHMARKS=OFF -DREVISIT_SHARED=OFF > /dev/null
# shellcheck disable=SC2046 # a word each
cmake --build build/coverage $(for module; do echo "--target ${module}_test"; done)
find build/coverage -name '*.gcda' -delete
if [ $# -eq 0 ]; then
  ctest --test-dir build/coverage --parallel "$(nproc)" --timeout 600 || echo "some tests failed: see above" >&2
fi
for module; do
  (cd build/coverage && bin/"${module}_test" --gtest_brief=1) || echo "some tests of $module failed: see above" >&2
done
mkdir -p out
filter=$(for module; do printf '%s|' "$module"; done)
gcovr --root . --object-directory build/coverage --filter "src/revisit/(${filter%|})" --exclude '.*_test\.cpp' \
  --gcov-ignore-parse-errors --txt out/coverage.txt
tail -2 out/coverage.txt

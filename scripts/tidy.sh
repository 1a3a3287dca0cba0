#!/usr/bin/env bash
# clang-tidy over the library and the program, as many files at once as the argument says.
set -euo pipefail
cd "$(dirname "$0")/.."
# Compiled once an instruction set through its own include: clang-tidy cannot follow.
git ls-files 'src/*.cpp' 'apps/*.cpp' | grep -v -e '_test\.cpp$' -e 'polar_binning\.cpp$' |
  xargs -P "${1:-1}" -n 4 clang-tidy -p build/release --quiet

#!/usr/bin/env bash
# clang-tidy over the library and the program, as many at once as the argument says. It reads the sources as the debug
# preset compiles them, a module at a time: most of its time goes into the system's headers.
set -euo pipefail
cd "$(dirname "$0")/.."
python3 - <<'END' |
import json
for entry in reversed(json.load(open("build/debug/compile_commands.json"))):  # the program first, which takes longest
    # polar_binning is compiled once an instruction set through its own include, which clang-tidy cannot follow; C is
    # made by other programs (idlc).
    if not any(part in entry["file"] for part in ("_test", "/tests/", "/examples/", "polar_binning.cpp", "_c.c")):
        print(entry["file"])
END
  xargs -P "${1:-1}" -n 1 clang-tidy -p build/debug --quiet

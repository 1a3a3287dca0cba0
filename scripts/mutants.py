#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How many small mistakes the tests of a module find.

usage: scripts/mutants.py [MODULE...] [--each N] [--seed S] [--again OUTPUT]

Puts one mistake after the other into the sources of a module (default: bits, retrieval, verification, pose_graph,
store), builds the module's own tests in a copy of the tree (build/mutants), and runs them. A mistake is found where the
tests fail, hang or do not compile. --each: so many a module, drawn by the seed (default 30; 0: all). Prints a table and
those that nobody found; these are looked at by hand (docs/reliability.md). --again: only those that an earlier output
lists as not found, once there are tests for them.
"""

import argparse
import pathlib
import random
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
WORK = ROOT / "build" / "mutants"
MODULES = ["bits", "retrieval", "verification", "pose_graph", "store"]
# What stands there, and what is put instead.
MISTAKES = [(r" < ", " <= "), (r" <= ", " < "), (r" > ", " >= "), (r" >= ", " > "), (r" == ", " != "), (r" != ", " == "),
            (r" \+ ", " - "), (r" - ", " + "), (r" \* ", " / "), (r" / ", " * "), (r" && ", " || "), (r" \|\| ", " && "),
            (r"\btrue\b", "false"), (r"\bfalse\b", "true"), (r"\bif \(!", "if ("), (r"\bif \((?=[a-z])", "if (!"),
            (r"(?<![\w.])1(?![\w.])", "2"), (r"(?<![\w.])0(?![\w.])", "1"), (r"\+\+", "--"), (r"\bcontinue;", "break;"),
            (r"std::min\b", "std::max"), (r"std::max\b", "std::min"), (r" << ", " >> "), (r" & ", " | ")]


def run(*command, timeout=None):
    try:
        return subprocess.run([str(each) for each in command], capture_output=True, text=True, timeout=timeout).returncode
    except subprocess.TimeoutExpired:
        return -1


def mutants_of(file):
    for number, line in enumerate(file.read_text().splitlines()):
        code = line.split("//")[0]
        if code.lstrip().startswith(("#", "template", "assert", "static_assert", "HWY_")) or '"' in code:
            continue
        for pattern, instead in MISTAKES:
            for found in re.finditer(pattern, code):
                yield number, code[:found.start()] + instead + line[found.end():]


def described(tree, file, number, line):
    """As the list of what was not found names it; lines that moved since are other mistakes."""
    return f"{file.relative_to(tree)}:{number + 1}: {file.read_text().splitlines()[number].strip()}  ->  {line.strip()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("modules", nargs="*", default=MODULES)
    parser.add_argument("--each", type=int, default=30)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--again", type=pathlib.Path)
    given = parser.parse_args()
    tree, build = WORK / "tree", WORK / "build"
    shutil.rmtree(tree, ignore_errors=True)
    for name in subprocess.run(["git", "ls-files", "src", "tests", "cmake", "CMakeLists.txt"], cwd=ROOT, capture_output=True, text=True).stdout.split():
        if (ROOT / name).exists():
            (tree / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, tree / name)  # as new, so that no mistake of the last run stays built
    tests = [f"{module}_test" for module in given.modules]
    if run("cmake", "-S", tree, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Debug",
           "-DCMAKE_CXX_FLAGS_DEBUG=-O1 -D_GLIBCXX_ASSERTIONS",  # they see reads beyond a list, as the sanitizers do
           "-DREVISIT_BUILD_APPS=OFF", "-DREVISIT_BUILD_BINDINGS=OFF", "-DREVISIT_BUILD_BENCHMARKS=OFF",
           "-DREVISIT_BUILD_EXAMPLES=OFF", "-DREVISIT_HARDENING=OFF") or run("cmake", "--build", build, "--target", *tests):
        sys.exit("the tree without mistakes does not build")
    print("| module | mistakes | found | share |\n|---|---|---|---|")
    missed = []
    for module in given.modules:
        if run(build / "bin" / f"{module}_test"):
            sys.exit(f"{module}_test fails without mistakes")
        files = [file for file in sorted((tree / "src/revisit" / module).glob("*.cpp")) if not file.stem.endswith("_test")]
        mutants = [(file, *mutant) for file in files for mutant in mutants_of(file)]
        random.Random(given.seed).shuffle(mutants)
        if given.again:
            mutants = [mutant for mutant in mutants if described(tree, *mutant) in given.again.read_text()]
        else:
            mutants = mutants[:given.each or len(mutants)]
        found = 0
        for i, (file, number, line) in enumerate(mutants):
            right = file.read_text()
            lines = right.splitlines()
            was, lines[number] = described(tree, file, number, line), line
            file.write_text("\n".join(lines) + "\n")
            is_found = run("cmake", "--build", build, "--target", f"{module}_test") != 0 or run(build / "bin" / f"{module}_test", "--gtest_fail_fast", timeout=60) != 0
            file.write_text(right)
            found += is_found
            if not is_found:
                missed.append(was)
                print(f"not found: {missed[-1]}", file=sys.stderr)
            print(f"{module}: {i + 1} of {len(mutants)}, {found} found", file=sys.stderr, flush=True)
        print(f"| {module} | {len(mutants)} | {found} | {found / max(1, len(mutants)):.0%} |", flush=True)
    print("\nNot found:\n" + "\n".join(missed))


if __name__ == "__main__":
    main()

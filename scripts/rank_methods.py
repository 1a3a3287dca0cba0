#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Ranks of methods over several runs, with what chance may have to do with it.

usage: scripts/rank_methods.py [--figure recall_at_1] COMPARED COMPARED ...
Each is a folder that `revisit compare` wrote, of one world or recording each: another seed, another drive. Runs are drawn
anew 10,000 times with replacement (bootstrap): for each method the mean with its 95 % interval, and how often it is first.
One run says nothing about chance: at least three are needed. Figures: those of comparison.csv."""
import argparse
import csv
import pathlib
import random
import sys

DRAWS = 10_000
LESS_IS_BETTER = {"false_loops", "median_translation_m", "median_rotation_deg", "retrieval_ms", "verification_ms",
                  "bytes_a_place"}
NO_RANK = {"revisits", "reverse_revisits", "accepted"}


def read(folder, figure):
    with open(pathlib.Path(folder) / "comparison.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(stream))
    allowed = [name for name in (rows[0] if rows else {}) if name not in NO_RANK | {"method"}]
    if figure not in allowed:
        sys.exit(f"{folder}: no figure {figure}; allowed: {', '.join(allowed)}")
    return {row["method"]: float(row[figure]) if row[figure] else None for row in rows}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--figure", default="recall_at_1")
    parser.add_argument("folders", nargs="+")
    options = parser.parse_args()
    if len(options.folders) < 3:
        parser.error("at least three runs are needed")
    runs = [read(folder, options.figure) for folder in options.folders]
    names = [name for name in runs[0] if all(run.get(name) is not None for run in runs)]
    for name in sorted({name for run in runs for name in run} - set(names)):
        lacking = [folder for folder, run in zip(options.folders, runs) if run.get(name) is None]
        print(f"left out: {name}, without {options.figure} in {', '.join(lacking)}", file=sys.stderr)
    if not names:
        sys.exit(f"no method has {options.figure} in all runs")
    sign = -1 if options.figure in LESS_IS_BETTER else 1
    draw = random.Random(1)
    means = {name: [] for name in names}
    first = dict.fromkeys(names, 0.0)
    for _ in range(DRAWS):
        drawn = draw.choices(runs, k=len(runs))
        now = {name: sum(run[name] for run in drawn) / len(drawn) for name in names}
        best = [name for name in names if sign * now[name] == max(sign * value for value in now.values())]
        for name in names:
            means[name].append(now[name])
        for name in best:
            first[name] += 1 / len(best)
    print(f"{options.figure}, {len(runs)} runs\n{'':>24}   mean   95 % of the means   first")
    for name in sorted(names, key=lambda each: -sign * sum(run[each] for run in runs)):
        low, *_, high = sorted(means[name])[DRAWS // 40:-(DRAWS // 40)]
        print(f"{name:>24}  {sum(run[name] for run in runs) / len(runs):.3f}      {low:.3f} to {high:.3f}   "
              f"{100 * first[name] / DRAWS:4.0f} %")


if __name__ == "__main__":
    main()

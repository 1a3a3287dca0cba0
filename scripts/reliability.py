#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Whether probabilities are right: of the poses that are given .9, nine in ten should be. Needs numpy; a picture, matplotlib.

usage: scripts/reliability.py FOLDER [FOLDER ...] [--picture FILE.png]
Each folder is written by `revisit detect` over a recording with exact poses. Counted is the surest pose of
each query. Prints, for bins of probability, how many are right (0.5 m, 3 degrees), and the expected calibration error:
the mean difference of both."""
import csv
import pathlib
import sys

import numpy as np

from learn_probability import RIGHT_DEG, RIGHT_M, matrix

EDGES = np.array([0.0, 0.05, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.99, 1.0 + 1e-9])


def surest(folder):
    """Probability and rightness of the surest registered pose of each query."""
    poses = [matrix(*row[1:]) for row in np.loadtxt(folder / "poses.tum")]
    best = {}
    with open(folder / "evidence.csv", encoding="ascii") as stream:
        for row in csv.DictReader(stream):
            log_odds = float(row["log_odds"])
            if row["query"] not in best or log_odds > best[row["query"]][0]:
                best[row["query"]] = log_odds, row
    probability, right = [], []
    for log_odds, row in best.values():
        error = np.linalg.inv(np.linalg.inv(poses[int(row["match"])]) @ poses[int(row["query"])]) @ matrix(
            *(float(row[k]) for k in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")))
        angle = np.degrees(np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1)))
        probability.append(1 / (1 + np.exp(-log_odds)))
        right.append(np.linalg.norm(error[:3, 3]) <= RIGHT_M and angle <= RIGHT_DEG)
    return np.array(probability), np.array(right)


def main():
    arguments = sys.argv[1:]
    picture = None
    if "--picture" in arguments:
        at = arguments.index("--picture")
        picture = arguments[at + 1]
        del arguments[at:at + 2]
    if not arguments:
        sys.exit(__doc__)
    p, right = (np.concatenate(each) for each in zip(*(surest(pathlib.Path(a)) for a in arguments)))
    of_bin = np.digitize(p, EDGES) - 1
    error, points = 0.0, []
    print("probability  poses  mean given  share right")
    for b in range(len(EDGES) - 1):
        chosen = of_bin == b
        if not chosen.any():
            continue
        given, found = p[chosen].mean(), right[chosen].mean()
        error += chosen.mean() * abs(given - found)
        points.append((given, found, chosen.sum()))
        print(f"{EDGES[b]:.2f} to {min(EDGES[b + 1], 1.0):.2f} {chosen.sum():6d}  {given:10.3f}  {found:11.3f}")
    print(f"expected calibration error {error:.4f} of {len(p)} poses")
    if picture:
        import matplotlib
        matplotlib.use("Agg")
        from matplotlib import pyplot
        figure, axes = pyplot.subplots(figsize=(4.5, 4.5))
        axes.plot([0, 1], [0, 1], color="0.7")
        given, found, count = zip(*points)
        axes.scatter(given, found, s=[8 * np.log2(2 + c) for c in count])
        for g, f, c in points:
            axes.annotate(str(c), (g, f), textcoords="offset points", xytext=(5, -9), fontsize=8)
        axes.set(xlabel="probability given", ylabel="share right", title="Surest pose of each query")
        figure.tight_layout()
        figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main()

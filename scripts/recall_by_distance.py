#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How many revisits are found, by how far the nearest earlier place is: the other lane, a wide street. Needs numpy.

usage: scripts/recall_by_distance.py RESULTS [RESULTS ...]
Each is a folder written by `revisit detect` over a recording with exact poses. Which places may answer is as in
docs/evaluation.md, at ten scans a second: 300 frames older."""
import csv
import pathlib
import sys

import numpy as np

BORDERS_M = (0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0)
EXCLUDED_FRAMES = 300


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    for kind in ("same direction", "reverse"):
        queries, found = np.zeros(len(BORDERS_M)), np.zeros(len(BORDERS_M))
        for folder in map(pathlib.Path, sys.argv[1:]):
            poses = np.loadtxt(folder / "poses.tum")
            xyz, (qx, qy, qz, qw) = poses[:, 1:4], poses[:, 4:].T
            # The x axis of the LiDAR: where the vehicle heads.
            ahead = np.stack([1 - 2 * (qy**2 + qz**2), 2 * (qx * qy + qz * qw), 2 * (qx * qz - qy * qw)], axis=1)
            with open(folder / "loops.csv", encoding="ascii") as stream:
                loops = {int(row["query"]) for row in csv.DictReader(stream)}
            for query in range(EXCLUDED_FRAMES, len(poses)):
                away = np.linalg.norm(xyz[: query - EXCLUDED_FRAMES + 1] - xyz[query], axis=1)
                nearest = int(away.argmin())
                is_reverse = ahead[query] @ ahead[nearest] < 0.0
                at = int(np.searchsorted(BORDERS_M, away[nearest], side="right")) - 1
                if is_reverse == (kind == "reverse"):
                    queries[at] += 1
                    found[at] += query in loops
        cells = [f"{BORDERS_M[i]:.0f} to {BORDERS_M[i + 1]:.0f} m: {found[i]:.0f} of {queries[i]:.0f}"
                 for i in range(len(BORDERS_M) - 1) if queries[i]]
        print(f"{kind}: " + "; ".join(cells))


if __name__ == "__main__":
    main()

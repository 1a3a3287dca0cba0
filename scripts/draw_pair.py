#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Why was a revisit missed? Two scans of a KITTI folder laid over each other by its poses, from above: what both see, and
what only one of them does. Needs numpy and matplotlib.

usage: scripts/draw_pair.py RECORDING QUERY MATCH PICTURE.png [QUERY MATCH PICTURE.png ...]
RECORDING: with velodyne/, poses.txt and calib.txt, as `revisit simulate --out` writes it. MATCH: auto, the nearest place at
least 300 scans before. Prints the share of each scan's points above ground that have one of the other's within 0.5 m."""
import pathlib
import sys

import matplotlib
import numpy as np

matplotlib.use("Agg")
from matplotlib import pyplot  # noqa: E402

SAME_M, ABOVE_GROUND_M, RANGE_M = 0.5, 0.4, 50.0


def trajectory(folder):
    poses = np.tile(np.eye(4), (len(rows := np.loadtxt(folder / "poses.txt").reshape(-1, 3, 4)), 1, 1))
    poses[:, :3] = rows
    Tr = np.eye(4)
    for line in (folder / "calib.txt").read_text().splitlines():
        if line.startswith("Tr:"):
            Tr[:3] = np.array(line.split()[1:], float).reshape(3, 4)
    return np.linalg.inv(Tr) @ poses @ Tr


def scan(folder, frame):
    """Points above the lowest within 3 m, which is taken for the ground."""
    points = np.fromfile(folder / "velodyne" / f"{frame:06d}.bin", np.float32).reshape(-1, 4)[:, :3].astype(float)
    points = points[np.linalg.norm(points, axis=1) < RANGE_M]
    cells, cell_of = np.unique(np.floor(points[:, :2] / 3.0).astype(int), axis=0, return_inverse=True)
    lowest = np.full(len(cells), np.inf)
    np.minimum.at(lowest, cell_of.ravel(), points[:, 2])
    return points[points[:, 2] > lowest[cell_of.ravel()] + ABOVE_GROUND_M]


def cells_of(points, shift=(0, 0, 0)):
    cell = np.floor(points / SAME_M).astype(np.int64) + shift
    return (cell[:, 0] << 40) + (cell[:, 1] << 20) + cell[:, 2]


def seen_by(points, others):
    """Which points have one of the others in their cell or beside it."""
    taken = np.unique(cells_of(others))
    return np.any([np.isin(cells_of(points, (i, j, k)), taken) for i in (-1, 0, 1) for j in (-1, 0, 1)
                   for k in (-1, 0, 1)], axis=0)


def draw(folder, poses, query, match, picture):
    if match == "auto":
        earlier = poses[:max(query - 300, 1), :3, 3]
        match = int(np.linalg.norm(earlier - poses[query, :3, 3], axis=1).argmin())
    T_query_match = np.linalg.inv(poses[query]) @ poses[int(match)]
    here, there = scan(folder, query), scan(folder, int(match))
    there = there @ T_query_match[:3, :3].T + T_query_match[:3, 3]
    here_seen, there_seen = seen_by(here, there), seen_by(there, here)
    apart_m = np.linalg.norm(T_query_match[:3, 3])
    print(f"{query} and {match}, {apart_m:.2f} m apart: {here_seen.mean():.2f} of the query's points are seen again, "
          f"{there_seen.mean():.2f} of the match's")
    figure, axes = pyplot.subplots(figsize=(8, 8), dpi=100)
    for points, colour, label in ((here[here_seen], "0.6", "both"), (there[~there_seen], "C0", f"only {match}, earlier"),
                                  (here[~here_seen], "C3", f"only {query}, now")):
        axes.plot(points[:, 0], points[:, 1], ".", color=colour, markersize=1.2, label=label)
    axes.plot(0, 0, "k^")
    axes.set(aspect="equal", xlabel="m ahead", ylabel="m to the left", xlim=(-RANGE_M, RANGE_M), ylim=(-RANGE_M, RANGE_M),
             title=f"Scan {query} on {match}, {apart_m:.1f} m apart")
    axes.legend(markerscale=8, loc="upper right")
    figure.tight_layout()
    figure.savefig(picture)
    pyplot.close(figure)


def main():
    folder, *pairs = sys.argv[1:] or [""]
    if not pairs or len(pairs) % 3:
        sys.exit(__doc__)
    poses = trajectory(pathlib.Path(folder))
    for query, match, picture in zip(*[iter(pairs)] * 3):
        draw(pathlib.Path(folder), poses, int(query), match, picture)


main()

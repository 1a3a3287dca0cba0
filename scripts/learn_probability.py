#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Learns the coefficients of src/revisit/verification/loop_probability.cpp. Needs numpy.

usage: scripts/learn_probability.py FOLDER [FOLDER ...]
Each folder is written by `revisit detect --geometric.min_overlap 0.25 --geometric.candidates 5
--geometric.min_inlier_ratio 0 --geometric.min_probability 0 --geometric.follow false --retrieval.exclude_s 20` over a
recording with exact poses. Every recording weighs the same, and in each the right
poses as much as the wrong ones.
Prints the coefficients, then, for each recording, what a model learnt on all the others says about it."""
import csv
import pathlib
import sys

import numpy as np

RIGHT_M, RIGHT_DEG = 0.5, 3.0  # docs/evaluation.md
WRONG_M, WRONG_DEG = 2.0, 10.0  # in between, the place is right and the pose poor: nothing is learnt from it
NAMES = ["inlier_share", "free_space", "intensity", "rmse", "least_fixed", "few", "hidden", "residual"]
REGULARISED = 2e-2


def matrix(x, y, z, qx, qy, qz, qw):
    T = np.eye(4)
    T[:3, :3] = [[1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
                 [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
                 [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)]]
    T[:3, 3] = x, y, z
    return T


def load(folder):
    """Evidence (one row a registered candidate), whether its pose is right, and its query."""
    poses = [matrix(*row[1:]) for row in np.loadtxt(folder / "poses.tum")]
    X, right, queries, in_the_open = [], [], [], []
    with open(folder / "evidence.csv", encoding="ascii") as stream:
        for row in csv.DictReader(stream):
            free, inliers = float(row["free_space_agreement"]), float(row["inlier_ratio"])
            if inliers < 0.2:
                continue  # nobody would take these
            error = np.linalg.inv(np.linalg.inv(poses[int(row["match"])]) @ poses[int(row["query"])]) @ matrix(
                *(float(row[k]) for k in ("tx", "ty", "tz", "qx", "qy", "qz", "qw")))
            angle = np.degrees(np.arccos(np.clip((np.trace(error[:3, :3]) - 1) / 2, -1, 1)))
            distance_m = min(float(row["distance_m"]), 12.0)
            off_m = np.linalg.norm(error[:3, 3])
            is_right = off_m <= RIGHT_M and angle <= RIGHT_DEG
            if not is_right and off_m < WRONG_M and angle < WRONG_DEG:
                continue
            X.append([min(float(row["inlier_share"]) / (1.0 - 0.02 * distance_m), 1.1), -np.log(1.004 - free),
                      np.clip(float(row["intensity_agreement"] or 0.0), -0.2, 1.1),
                      float(row["rmse_m"]) / float(row.get("voxel_m") or 1.0),
                      max(0.0, float(row["least_fixed"]))**0.5,
                      np.log(np.clip(float(row["inliers"]), 10.0, 300.0) / 300.0),
                      float(row["hidden_share"]) - 0.03 * distance_m,
                      max(1.0, float(row["residual_share"]) / (1.0 + 0.03 * distance_m))])
            right.append(is_right)
            queries.append(int(row["query"]))
            in_the_open.append(row["in_the_open"] == "1")
    return np.array(X), np.array(right), np.array(queries), np.array(in_the_open)


def of_world(recording, in_the_open):
    """Pairs in the open, or those in rooms; None where there are too few of them to learn from."""
    chosen = recording[3] == in_the_open
    return tuple(each[chosen] for each in recording) if chosen.sum() > 50 else None


def newton(Z, y, w, penalty):
    """Weighted logistic regression."""
    b = np.zeros(Z.shape[1])
    for _ in range(50):
        p = 1 / (1 + np.exp(-Z @ b))
        H = (Z * (w * p * (1 - p) + 1e-12)[:, None]).T @ Z + penalty
        b -= np.linalg.solve(H, Z.T @ (w * (p - y)) + penalty @ b)
    return b


def learn(recordings, columns):
    """Logistic regression, regularised so that no single measure decides (residuals differ from sensor to sensor), then
    scaled so that its probabilities are right (Platt)."""
    X = np.concatenate([r[0][:, columns] for r in recordings])
    y = np.concatenate([r[1] for r in recordings]).astype(float)
    # A recording without wrong poses gives no weight to them.
    w = np.concatenate([np.where(r[1], 500 / max(30, r[1].sum()), 500 / max(30, (~r[1]).sum())) for r in recordings])
    mean, spread = X.mean(0), X.std(0)
    ones = np.ones((len(X), 1))
    b = newton(np.c_[(X - mean) / spread, ones], y, w, REGULARISED * w.sum() * np.diag([1.0] * len(columns) + [0.0]))
    slopes = b[:-1] / spread
    constant = b[-1] - slopes @ mean
    scale, more = newton(np.c_[X @ slopes + constant, ones], y, w, np.zeros((2, 2)))
    return scale * slopes, scale * constant + more


def main():
    folders = [pathlib.Path(a) for a in sys.argv[1:]]
    if not folders:
        sys.exit(__doc__)
    everything = [load(f) for f in folders]
    for in_the_open in (True, False):
        pairs = [(f.name, of_world(r, in_the_open)) for f, r in zip(folders, everything)]
        names, recordings = zip(*[(name, r) for name, r in pairs if r is not None])
        for intensity in (True, False):
            # In the open, what came and went since the earlier visit hides as much as another place does. In rooms a
            # residual counts as a share of the sensor's own: walls show its noise, trees do not.
            unused = {"hidden", "residual"} if in_the_open else {"rmse"}
            columns = [i for i, name in enumerate(NAMES)
                       if name not in unused and (intensity or name != "intensity")]
            slopes, constant = learn(recordings, columns)
            print("open" if in_the_open else "rooms", "with intensity" if intensity else "without",
                  {NAMES[c]: round(float(s), 3) for c, s in zip(columns, slopes)}, "constant", round(constant, 3))
            for i, (name, (X, right, queries, _)) in enumerate(zip(names, recordings)):
                if len(recordings) == 1:
                    break
                s, c = learn(recordings[:i] + recordings[i + 1:], columns)
                odds, own = X[:, columns] @ s + c, X[:, columns] @ slopes + constant
                best = np.array([max(odds[right & (queries == q)]) for q in set(queries[right])])
                taken = [f"{(best > t).sum()}/{(odds[~right] > t).sum()}" for t in (0.0, 1.0, 3.0, 5.0)]
                print(f"  {name}: {right.sum()} right, {(~right).sum()} wrong; learnt on the others, of {len(best)} "
                      f"queries found / wrong ones taken at log odds 0, 1, 3, 5: {', '.join(taken)}; most of a wrong "
                      f"one {odds[~right].max(initial=-99):.2f}, {own[~right].max(initial=-99):.2f} learnt on all")


if __name__ == "__main__":
    main()

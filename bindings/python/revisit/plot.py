# SPDX-License-Identifier: Apache-2.0
"""Pictures with matplotlib. Each function draws into `ax`, or a new figure, and gives the axes back."""
import numpy as np


def _axes(ax, **arguments):
    import matplotlib.pyplot as plt
    return ax if ax is not None else plt.subplots(**arguments)[1]


def _metres(ax):
    ax.set_aspect("equal")
    ax.set_xlabel("x (m)")
    ax.set_ylabel("y (m)")


def trajectory(poses, loops=(), frames=None, ax=None):
    """A trajectory from above, with loops as lines coloured by probability.

    poses: Trajectory, or N x 4 x 4. loops: of detect() or Slam.loops(); frames: numbers of the poses, without a
    Trajectory.
    """
    ax = _axes(ax)
    frames = getattr(poses, "frames", frames)
    poses = getattr(poses, "poses", poses)
    xy = np.asarray(poses)[:, :2, 3]
    ax.plot(xy[:, 0], xy[:, 1], color="#3b6fb6", linewidth=1.2, label="trajectory", zorder=2)
    loops = list(loops)
    if loops:
        from matplotlib.collections import LineCollection
        row = {int(frame): i for i, frame in enumerate(frames if frames is not None else range(len(xy)))}
        known = [loop for loop in loops if loop.query in row and loop.match in row]
        lines = LineCollection([[xy[row[loop.query]], xy[row[loop.match]]] for loop in known], cmap="viridis",
                               linewidths=1.5, zorder=3)
        lines.set_array(np.array([loop.probability for loop in known]))
        lines.set_clim(0.9, 1.0)
        ax.add_collection(lines)
        ax.figure.colorbar(lines, ax=ax, label="probability of the loop")
    _metres(ax)
    return ax


def scan(points, ax=None, range_m=50.0):
    """A scan from above, coloured by height."""
    ax = _axes(ax)
    points = np.asarray(getattr(points, "points", points))
    near = points[np.linalg.norm(points[:, :2], axis=1) < range_m]
    low, high = np.percentile(near[:, 2], [2, 98]) if len(near) else (0, 1)
    shown = ax.scatter(near[:, 0], near[:, 1], c=near[:, 2], s=0.3, cmap="viridis", vmin=low, vmax=high, linewidths=0)
    ax.figure.colorbar(shown, ax=ax, label="height (m)")
    _metres(ax)
    return ax


def registration(source, target, T_target_source, ax=None, range_m=50.0):
    """Two scans laid on each other at the pose that was found."""
    ax, T_target_source = _axes(ax), np.asarray(T_target_source)
    source = np.asarray(getattr(source, "points", source))[:, :3] @ T_target_source[:3, :3].T + T_target_source[:3, 3]
    for points, colour, name in ((np.asarray(getattr(target, "points", target)), "#999999", "target"),
                                 (source, "#d55e00", "source")):
        near = points[np.linalg.norm(points[:, :2], axis=1) < range_m]
        ax.scatter(near[:, 0], near[:, 1], s=0.3, color=colour, label=name, linewidths=0)
    ax.legend(markerscale=15)
    _metres(ax)
    return ax


def descriptor(of, ax=None):
    """Intensity scan context: rings upwards, sectors to the right; empty cells are white."""
    ax = _axes(ax, figsize=(8, 3))
    values = np.where(of.occupancy.any(axis=0) | (of.intensity > 0), of.intensity / 255.0, np.nan)
    shown = ax.imshow(values, origin="lower", aspect="auto", cmap="viridis", extent=(-180, 180, 0, of.rings), vmin=0,
                      vmax=1)
    ax.set_xlabel("azimuth (degrees)")
    ax.set_ylabel("ring")
    ax.figure.colorbar(shown, ax=ax, label="largest intensity")
    return ax


def map(points, ax=None, most=300_000):
    """A map from above, coloured by height; at most so many of its points."""
    ax, points = _axes(ax), np.asarray(points)
    points = points[:: max(1, len(points) // most)]
    low, high = np.percentile(points[:, 2], [2, 98]) if len(points) else (0, 1)
    order = np.argsort(points[:, 2])
    shown = ax.scatter(points[order, 0], points[order, 1], c=points[order, 2], s=0.2, cmap="viridis", vmin=low,
                       vmax=high, linewidths=0)
    ax.figure.colorbar(shown, ax=ax, label="height (m)")
    _metres(ax)
    return ax


def precision_recall(scores, is_right, revisits, ax=None, label=None):
    """The curve over all thresholds. scores, is_right: of the answers; revisits: how many scans have an answer."""
    ax = _axes(ax)
    order = np.argsort(-np.asarray(scores, dtype=float), kind="stable")
    right = np.cumsum(np.asarray(is_right, dtype=bool)[order])
    ax.plot(right / max(1, revisits), right / np.arange(1, len(order) + 1), label=label)
    ax.set_xlim(0, 1)
    ax.set_ylim(0, 1.02)
    ax.set_xlabel("recall")
    ax.set_ylabel("precision")
    if label:
        ax.legend()
    return ax

# SPDX-License-Identifier: Apache-2.0
"""Methods side by side under one protocol, those of the program and one's own."""
import json
import os
import pathlib

import numpy as np

from . import _core
from ._parameters import Parameters
from ._program import evaluate, run


def compare(recording, out, methods=None, *, own=None, parameters=None):
    """Runs methods over a recording and scores them (docs/evaluation.md): a dict of tables by name.

    recording: what the program takes: a path, or a .toml of a simulation. methods: names of the program's (all; [] for
    none). own: a dict of one's own by name. Each has `describe(scan)`, which gives an array, and `similarity(query,
    places)`, which gives one number a place, larger is surer; `places` are the descriptors of those old enough, stacked.
    Results are left in OUT/NAME, in the form of `revisit detect`.
    """
    recording, out = os.fspath(recording), pathlib.Path(out)
    for name in own or {}:
        if (out / name).exists():
            raise FileExistsError(17, "results are there already", str(out / name))
    tables = {}
    if methods is None or methods:
        chosen = ["--methods", ",".join(methods)] if methods else []
        run("compare", recording, "--out", out, *chosen, *_as_flags(parameters))
        tables["program"] = json.loads((out / "comparison.json").read_text())
    for name, method in (own or {}).items():
        tables[name] = _run_one(recording, out / name, method, parameters or Parameters())
    return tables


def _as_flags(parameters):
    if parameters is None:
        return []
    default = Parameters()
    return [word for info in _core.parameter_infos() if not info.name.startswith("simulation.")
            if parameters._values.get(info.name) != default._values.get(info.name)
            for word in (f"--{info.name}", _text(parameters._values.get(info.name)))]


def _text(value):
    return str(value).lower() if isinstance(value, bool) else str(value)


def _open(recording):
    from . import open_recording
    if not recording.endswith(".toml"):
        return open_recording(recording)
    return _core.simulate(Parameters(file=recording)._values)


def _run_one(path, out, method, parameters):
    recording = _open(path)
    out.mkdir(parents=True)
    exclude_frames = parameters.retrieval.exclude_frames
    exclude_s = parameters.retrieval.exclude_s if recording.has_times else 0.0
    frames, stamps, descriptors, rows = [], [], [], []
    for scan in recording:
        descriptor = np.asarray(method.describe(scan))
        old = [i for i, (frame, stamp) in enumerate(zip(frames, stamps))
               if scan.frame - frame >= exclude_frames and scan.stamp - stamp >= exclude_s - 1e-6]
        if old:
            scores = np.asarray(method.similarity(descriptor, np.stack([descriptors[i] for i in old])), dtype=float)
            best = int(np.argmax(scores))
            rows.append(f"{scan.frame},{frames[old[best]]},{scores[best]:.9g},0,retrieval only: no pose to verify")
        frames.append(scan.frame)
        stamps.append(scan.stamp)
        descriptors.append(descriptor)
    (out / "candidates.csv").write_text("\n".join(["query,match,score,accepted,reason", *rows, ""]))
    (out / "loops.csv").write_text("query,match,score,tx,ty,tz,qx,qy,qz,qw,inlier_ratio,rmse_m\n")
    return evaluate(out, path)

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Every command writes the same bytes for any number of threads, and with any vector instructions.

usage: tests/determinism_test.py PROGRAM
What differs by its nature is left out: times in run.json, tables and reports, and the pages of map.revisit, whose contents are
compared by what is exported from it.
"""

import csv
import hashlib
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

PROGRAM = pathlib.Path(sys.argv[1]).resolve()
LOOPS_SOON = ["--retrieval.exclude_frames", 8, "--retrieval.exclude_s", 0]  # so short a drive has no others
LEFT_OUT = {"run.json", "map.revisit", "all.revisit", "report.html", "comparison.json", "comparison.txt", "comparison.tex"}


def run(folder, *arguments, code=(0, 3)):
    done = subprocess.run([PROGRAM, *map(str, arguments)], cwd=folder, stdin=subprocess.DEVNULL, capture_output=True, text=True)
    if done.returncode not in code:
        raise AssertionError(f"{arguments}: {done.stderr}")
    return done


def drive(folder, day):
    run(folder, "simulate", "--sensor", "vlp16", "--length_m", 20, "--frames", 60, "--day", day, "--out", folder / f"day{day}")


# All commands, one after the other, in one folder.
def work(folder, drives, how):
    day0, day1 = drives / "day0", drives / "day1"
    for arguments in [
        ["simulate", "--sensor", "vlp16", "--length_m", 20, "--frames", 5, "--out", "simulated"],
        ["describe", day0, "--frame", 3, "--out", "description.png"],
        ["convert", day0, "--out", "converted.mcap"],
        ["calibrate", day0, "--out", "calibration.json"],
        ["detect", day0, *LOOPS_SOON, "--out", "detected"],
        ["slam", day0, *LOOPS_SOON, "--out", "map"],
        ["slam", day1, "--out", "map1"],
        ["localise", "map", day1, "--out", "localised"],
        ["merge", "map", "map1", "--out", "all.revisit"],
        *[["export", "all.revisit", "--as", form, "--out", f"as_{form}"] for form in ("ply", "tum", "g2o", "grid", "tiles")],
        ["evaluate", "detected", "--reference", day0 / "poses.txt"],
        ["evaluate", "map", "--reference", day0 / "poses.txt"],
        ["compare", day0, "--methods", "revisit,scan-context", "--out", "compared"],
        ["parameters"],
    ]:
        run(folder, *how, *arguments)


def without_times(text):
    rows = list(csv.reader(text.splitlines()))
    kept = [i for i, name in enumerate(rows[0]) if name != "ms" and not name.endswith("_ms")]
    return [[row[i] for i in kept] for row in rows]


def bytes_of(path):
    return repr(without_times(path.read_text())).encode() if path.suffix == ".csv" else path.read_bytes()


def contents(folder):
    return {str(path.relative_to(folder)): hashlib.sha256(bytes_of(path)).hexdigest()
            for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in LEFT_OUT}


class Determinism(unittest.TestCase):
    maxDiff = None

    @classmethod
    def setUpClass(cls):
        cls.folder = pathlib.Path(tempfile.mkdtemp())
        cls.drives = cls.folder / "drives"
        cls.drives.mkdir()
        for day in (0, 1):
            drive(cls.drives, day)
        cls.reference = cls.made("reference", [])

    @classmethod
    def tearDownClass(cls):
        shutil.rmtree(cls.folder)

    @classmethod
    def made(cls, name, how):
        folder = cls.folder / name
        folder.mkdir()
        work(folder, cls.drives, how)
        made = contents(folder)
        assert len(made) > 40, made.keys()
        shutil.rmtree(folder)
        return made

    def same(self, made, how):
        differing = sorted(name for name in self.reference.keys() | made.keys() if self.reference.get(name) != made.get(name))
        self.assertEqual(differing, [], f"these differ with {how}")

    # Both at once, to save time: where something differs, try one without the other.
    def test_threads_and_instruction_sets(self):
        known = run(self.folder, "--simd", "none", "parameters", code=(2,)).stderr
        names = known.split("processor has")[1].split()
        self.assertIn("SCALAR", names)
        for how in (["--threads", 1, "--simd", "SCALAR"], ["--threads", 8, "--simd", names[0]]):
            with self.subTest(how):
                self.same(self.made("_".join(map(str, how)).replace("-", ""), how), how)

    def test_a_difference_is_seen(self):
        for altered in ({**self.reference, "parameters.txt": "other"}, dict(list(self.reference.items())[1:])):
            with self.assertRaises(AssertionError):
                self.same(altered, [])


if __name__ == "__main__":
    unittest.main(argv=[sys.argv[0], *sys.argv[2:]])

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The scripts of data sets and rankings, on miniatures in the same layout. usage: scripts_test.py REVISIT"""
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import unittest

REVISIT = os.path.abspath(sys.argv.pop(1))
SCRIPTS = pathlib.Path(__file__).resolve().parent.parent / "scripts"


def run(*command):
    return subprocess.run([str(word) for word in command], env={**os.environ, "REVISIT": REVISIT}, timeout=120,
                          capture_output=True, text=True)


class Scripts(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="revisit_scripts_"))

    def tearDown(self):
        shutil.rmtree(self.folder)

    def test_kitti_is_checked_run_and_put_into_tables(self):
        data, out = self.folder / "dataset", self.folder / "out"
        sequence = data / "sequences" / "07"
        made = run(REVISIT, "simulate", "--out", sequence, "--sensor", "vlp16", "--frames", 30)
        self.assertEqual(made.returncode, 0, made.stderr)
        absent = run(SCRIPTS / "datasets" / "kitti.sh", data, out, "07")
        self.assertEqual(absent.returncode, 1, "the poses are not where the data set has them")
        self.assertIn("poses/07.txt (of data_odometry_poses.zip)", absent.stderr)
        (data / "poses").mkdir()
        shutil.move(sequence / "poses.txt", data / "poses" / "07.txt")
        (sequence / "velodyne" / "000007.bin").write_bytes(b"broken")
        done = run(SCRIPTS / "datasets" / "kitti.sh", data, out, "07")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("30 of 1101 scans", done.stderr)
        for word in ("Table 1", "Table 2", "Table 3", "lidar-iris"):
            self.assertIn(word, (out / "tables.txt").read_text())
        self.assertEqual(run(SCRIPTS / "datasets" / "kitti.sh", data, out, "11").returncode, 2)

    def test_methods_are_ranked_over_runs(self):
        folders = []
        for i, (a, b) in enumerate([(0.9, 0.5), (0.8, 0.85), (0.95, 0.4), (0.9, 0.6)]):
            folder = self.folder / str(i)
            folder.mkdir()
            (folder / "comparison.csv").write_text(f"method,recall_at_1,recall,false_loops\na,{a},,3\nb,{b},0.5,1\n")
            folders.append(folder)
        ranked = run(SCRIPTS / "rank_methods.py", *folders)
        self.assertEqual(ranked.returncode, 0, ranked.stderr)
        lines = ranked.stdout.splitlines()
        self.assertEqual(lines[2].split()[:2], ["a", "0.888"])
        self.assertEqual(lines[3].split()[0], "b")
        self.assertGreater(float(lines[2].split()[-2]), 95.0)
        self.assertEqual(run(SCRIPTS / "rank_methods.py", *folders[:2]).returncode, 2)
        less = run(SCRIPTS / "rank_methods.py", "--figure", "false_loops", *folders)
        self.assertEqual(less.stdout.splitlines()[2].split()[0], "b", "fewer are better")
        self.assertIn("left out: a, without recall", run(SCRIPTS / "rank_methods.py", "--figure", "recall", *folders).stderr)
        self.assertIn("allowed:", run(SCRIPTS / "rank_methods.py", "--figure", "x", *folders).stderr)


if __name__ == "__main__":
    unittest.main()

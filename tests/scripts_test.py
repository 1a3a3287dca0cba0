#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The scripts of data sets and rankings, on miniatures in the same layout. usage: scripts_test.py REVISIT"""
import datetime
import importlib.util
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

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

    def test_kitti_on_real_scans(self):
        real = pathlib.Path(os.environ.get("REVISIT_TEST_DATA", SCRIPTS.parent.parent / "shared" / "data")) / "kitti00_mini"
        if not real.exists():
            self.skipTest(f"needs the recordings of {real}")
        data, out = self.folder / "dataset", self.folder / "out"
        sequence = data / "sequences" / "00"
        sequence.mkdir(parents=True)
        (sequence / "velodyne").symlink_to(real / "velodyne")  # as people do, whose scans lie on another disk
        for name in ("calib.txt", "times.txt"):
            shutil.copy(real / name, sequence / name)
        (data / "poses").mkdir()
        shutil.copy(real / "poses_subset.txt", data / "poses" / "00.txt")
        with unittest.mock.patch.dict(os.environ, {"METHODS": "revisit,scan-context"}):
            done = run(SCRIPTS / "datasets" / "kitti.sh", data, out, "00")
        self.assertEqual(done.returncode, 0, done.stderr)
        accepted = (out / "tables.txt").read_text().split("Table 2")[1].splitlines()
        for method in ("revisit", "scan-context"):
            row = next(line for line in accepted if line.split()[:1] == [method]).split()
            self.assertEqual(row[1:4], ["1", "0", "1.000"], "one loop, none false, every revisit")

    def test_each_data_set_is_read_in_its_own_layout(self):
        spec = importlib.util.spec_from_file_location("run", SCRIPTS / "datasets" / "run.py")
        of = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(of)
        made, name = self.folder / "made", "one"
        self.assertEqual(run(REVISIT, "simulate", "--out", made, "--sensor", "vlp16", "--frames", 10).returncode, 0)
        calib = next(line for line in (made / "calib.txt").read_text().splitlines() if line.startswith("Tr:"))
        Tr = of.from_rows([float(word) for word in calib.split()[1:]])
        truth = [of.product(of.product(of.inverse(Tr), of.from_rows(row)), Tr) for row in of.rows(made / "poses.txt")]
        times = [float(line) for line in (made / "times.txt").read_text().split()]
        scans = [path.read_bytes() for path in sorted((made / "velodyne").glob("*.bin"))]
        points = [list(struct.iter_unpack("<4f", scan)) for scan in scans]
        stamps = [1_500_000_000 + time for time in times]

        def write(path, data):
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(data if isinstance(data, bytes) else data.encode())

        def numbers(T):
            return " ".join(f"{T[i][j]:.12g}" for i in range(3) for j in range(4))

        def angles(T):
            return [math.atan2(T[2][1], T[2][2]), math.asin(-T[2][0]), math.atan2(T[1][0], T[0][0])]

        def at(T):
            return [T[i][3] for i in range(3)]

        def kitti360(folder):
            lidar = folder / "data_3d_raw" / name / "velodyne_points"
            for i, scan in enumerate(scans):
                write(lidar / "data" / f"{i:010d}.bin", scan)
            write(lidar / "timestamps.txt", "".join(
                datetime.datetime.fromtimestamp(stamp, datetime.timezone.utc).strftime("%Y-%m-%d %H:%M:%S.%f000\n")
                for stamp in stamps))
            write(folder / "calibration" / "calib_cam_to_velo.txt", numbers(of.inverse(Tr)))
            write(folder / "data_poses" / name / "cam0_to_world.txt", "".join(
                f"{i} {numbers(of.product(T, of.inverse(Tr)))} 0 0 0 1\n" for i, T in enumerate(truth)))

        def mulran(folder):
            T_base_lidar = of.from_angles(1.7042, -0.021, 1.8047, *map(math.radians, (0.0001, 0.0003, 179.6654)))
            for stamp, scan in zip(stamps, scans):
                write(folder / name / "Ouster" / f"{round(stamp * 1e9)}.bin", scan)
            write(folder / name / "global_pose.csv", "".join(
                f"{round(stamp * 1e9)},{numbers(of.product(T, of.inverse(T_base_lidar))).replace(' ', ',')}\n"
                for stamp, T in zip(stamps, truth)))

        def nclt(folder):
            T_body_velo = of.from_angles(0.002, -0.004, -0.957, *map(math.radians, (0.807, 0.166, -90.703)))
            text = ""
            for stamp, scan, T in zip(stamps, points, truth):
                write(folder / name / "velodyne_sync" / f"{round(stamp * 1e6)}.bin", b"".join(
                    struct.pack("<3H2B", *(round((axis + 100) / 0.005) for axis in (x, -y, -z)), 50, 3)
                    for x, y, z, _ in scan if max(abs(x), abs(y), abs(z)) < 99))
                body = of.product(of.product(of.product(of.FLIPPED, T), of.FLIPPED), of.inverse(T_body_velo))
                text += ",".join(f"{word:.12g}" for word in [round(stamp * 1e6), *at(body), *angles(body)]) + "\n"
            write(folder / f"groundtruth_{name}.csv", text)

        def helipr(folder):
            text = ""
            for stamp, scan, T in zip(stamps, points, truth):
                write(folder / name / "LiDAR" / "Ouster" / f"{round(stamp * 1e9)}.bin",
                      b"".join(struct.pack("<4fI3H", *point, 7, 8, 9, 10) for point in scan))
                text += " ".join(f"{word:.12g}" for word in [*at(T), *of.to_quaternion(T)]).join(
                    (f"{round(stamp * 1e9)} ", "\n"))
            write(folder / name / "LiDAR_GT" / "Ouster_gt.txt", text)

        def pcd(scan):
            count = len(scan) // 16
            return (f"VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
                    f"WIDTH {count}\nHEIGHT 1\nPOINTS {count}\nDATA binary\n").encode() + scan

        def newer_college(folder):
            T_base_lidar = of.from_quaternion(-0.084, -0.025, 0.050, 0, 0, 0.924, 0.383)
            text = "#sec,nsec,x,y,z,qx,qy,qz,qw\n"
            for stamp, scan, T in zip(stamps, scans, truth):
                sec, nsec = divmod(round(stamp * 1e9), 10**9)
                write(folder / name / "raw_format" / "ouster_scan" / f"cloud_{sec}_{nsec}.pcd", pcd(scan))
                base = of.product(T, of.inverse(T_base_lidar))
                text += ",".join(f"{word:.12g}" for word in [sec, nsec, *at(base), *of.to_quaternion(base)]) + "\n"
            write(folder / name / "ground_truth" / "registered_poses.csv", text)

        def apollo(folder):
            text = ""
            for i, (stamp, scan, T) in enumerate(zip(stamps, scans, truth), 1):
                write(folder / name / "pcds" / f"{i}.pcd", pcd(scan))
                text += f"{i} {stamp:.6f} " + " ".join(f"{word:.12g}" for word in [*at(T), *of.to_quaternion(T)]) + "\n"
            write(folder / name / "poses" / "gt_poses.txt", text)

        for make in (kitti360, mulran, nclt, helipr, newer_college, apollo):
            with self.subTest(make.__name__):
                data, out = self.folder / make.__name__, self.folder / f"{make.__name__}_out"
                command = (SCRIPTS / "datasets" / "run.py", make.__name__, data, out, name, "--methods",
                           "scan-context-ring-key")
                absent = run(*command)
                self.assertEqual(absent.returncode, 1)
                self.assertIn("missing: ", absent.stderr)
                make(data)
                done = run(*command)
                self.assertEqual(done.returncode, 0, done.stderr)
                for word in ("Table 1", "Table 2", "Table 3", "scan-context-ring-key"):
                    self.assertIn(word, (out / "tables.txt").read_text())
                laid_out = list(of.rows(out / name / "recording" / "reference.tum"))
                self.assertEqual(len(laid_out), len(truth), done.stderr)
                first = of.from_quaternion(*laid_out[0][1:])
                for row, T in zip(laid_out, truth):
                    here = of.product(of.inverse(first), of.from_quaternion(*row[1:]))
                    there = of.product(of.inverse(truth[0]), T)
                    for i in range(3):
                        for j in range(4):
                            self.assertAlmostEqual(here[i][j], there[i][j], delta=2e-3)
                # Poses and scans belong together: the trajectory from the scans alone follows the poses.
                table = (out / "tables.txt").read_text().split("Table 3")[1].splitlines()
                ate_m = next(float(line.split()[-6]) for line in table if " m " in line and "frames" not in line)
                self.assertLess(ate_m, 0.1)

    def test_the_papers_table_stands_beside_ours(self):
        drive = self.folder / "compared" / "05-hdl64e-1"
        (drive / "scan-context").mkdir(parents=True)
        (drive / "scan-context" / "precision_recall.csv").write_text(
            "score,precision,recall\n0.9,1.000000,0.400000\n0.8,1.000000,0.610000\n0.7,0.950000,0.900000\n")
        (drive / "comparison.json").write_text(
            '{"revisit": {"table_2": {"accepted": 9, "precision": 1.0, "recall": 0.995}}, "isc-paper": {"table_2": '
            '{"accepted": 0, "precision": 0.0, "recall": 0.0}}}')
        done = run(SCRIPTS / "paper.py", self.folder / "compared")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("| 05-hdl64e-1 | Scan Context | 100, 90 | scan-context | 61 |", done.stdout)
        self.assertIn("| 05-hdl64e-1 | NBLD | 93, 60 | nbld | - |", done.stdout)
        self.assertIn("| this program | 100, 99.5 |", done.stdout)
        self.assertIn("| no loop, 0 |", done.stdout)
        self.assertIn("holds no folder", run(SCRIPTS / "paper.py", self.folder).stderr)

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

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""KITTI-360, MulRan, NCLT, HeLiPR, Newer College and Apollo-SouthBay, from what was downloaded to the tables of docs/evaluation.md: says
what is missing, lays scans, times and poses of the LiDAR out as `revisit` reads them (scans as links where it can), runs
every method (`revisit compare --verify`) and SLAM, and puts the tables into OUT/tables.txt. KITTI odometry: kitti.sh.

usage: scripts/datasets/run.py DATASET FOLDER OUT SEQUENCE ...     (--methods a,b: only these)

DATASET   what FOLDER holds, as its page lays it out
kitti360  data_3d_raw/SEQUENCE/velodyne_points/{data/*.bin,timestamps.txt}, data_poses/SEQUENCE/cam0_to_world.txt,
          calibration/calib_cam_to_velo.txt             (SEQUENCE: 2013_05_28_drive_0000_sync)
mulran    SEQUENCE/sensor_data/Ouster/*.bin (or SEQUENCE/Ouster), SEQUENCE/global_pose.csv
nclt      velodyne_data/SEQUENCE/velodyne_sync/*.bin (or SEQUENCE/velodyne_sync),
          ground_truth/groundtruth_SEQUENCE.csv (or groundtruth_SEQUENCE.csv)            (SEQUENCE: 2012-01-08)
helipr    SEQUENCE/LiDAR/Ouster/*.bin, SEQUENCE/LiDAR_GT/Ouster_gt.txt
newer_college  SEQUENCE/raw_format/ouster_scan/cloud_SECONDS_NANOSECONDS.pcd (or SEQUENCE/ouster_scan),
          SEQUENCE/ground_truth/registered_poses.csv    (the OS1-64 of 2020; SEQUENCE: 01_short_experiment)
apollo    SEQUENCE/pcds/*.pcd, SEQUENCE/poses/gt_poses.txt (index, time, x y z, qx qy qz qw; taken as the LiDAR's)
A sequence takes some minutes to hours on two cores. What is there already is not run again."""
import argparse
import bisect
import datetime
import math
import os
import pathlib
import subprocess
import sys

REVISIT = os.environ.get("REVISIT", str(pathlib.Path(__file__).resolve().parents[2] / "build" / "revisit"))


class Missing(Exception):
    pass


def need(*paths):
    """The first that is there."""
    for path in paths:
        if path.exists():
            return path
    raise Missing(" or ".join(str(path) for path in paths))


# Poses are 4 x 4, rows of rows.
def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(4)) for j in range(4)] for i in range(4)]


def inverse(a):
    turned = [[a[j][i] for j in range(3)] for i in range(3)]
    return [turned[i] + [-sum(turned[i][k] * a[k][3] for k in range(3))] for i in range(3)] + [[0, 0, 0, 1]]


def from_rows(numbers):
    return [list(numbers[0:4]), list(numbers[4:8]), list(numbers[8:12]), [0, 0, 0, 1]]


def from_angles(x, y, z, roll, pitch, yaw):
    """Rz Ry Rx, radians."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, x],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr, y],
            [-sp, cp * sr, cp * cr, z], [0, 0, 0, 1]]


def from_quaternion(x, y, z, qx, qy, qz, qw):
    n = math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
    qx, qy, qz, qw = qx / n, qy / n, qz / n, qw / n
    return [[1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw), x],
            [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw), y],
            [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy), z], [0, 0, 0, 1]]


def to_quaternion(a):
    """The largest of the four first, so that nothing small is divided by."""
    t = [1 + a[0][0] - a[1][1] - a[2][2], 1 - a[0][0] + a[1][1] - a[2][2], 1 - a[0][0] - a[1][1] + a[2][2],
         1 + a[0][0] + a[1][1] + a[2][2]]
    k = max(range(4), key=lambda i: t[i])
    d = math.sqrt(t[k]) * 2
    off = {(0, 1): a[0][1] + a[1][0], (0, 2): a[0][2] + a[2][0], (1, 2): a[1][2] + a[2][1],
           (0, 3): a[2][1] - a[1][2], (1, 3): a[0][2] - a[2][0], (2, 3): a[1][0] - a[0][1]}
    return [t[k] / d if i == k else off[min(i, k), max(i, k)] / d for i in range(4)]


def between(low, high, share):
    """Straight in position, and by the shorter way in rotation (which is small: linear, then of unit length)."""
    p, q = to_quaternion(low), to_quaternion(high)
    if sum(a * b for a, b in zip(p, q)) < 0:
        q = [-b for b in q]
    mixed = [(1 - share) * a + share * b for a, b in zip(p, q)]
    return from_quaternion(*((1 - share) * low[i][3] + share * high[i][3] for i in range(3)), *mixed)


def at_scans(stamps, poses):
    """Of each scan, where poses reach before and after it within half a second."""
    poses = sorted(poses, key=lambda each: each[0])
    times = [stamp for stamp, _ in poses]
    found = {}
    for stamp in stamps:
        i = bisect.bisect_left(times, stamp)
        if i < len(times) and abs(times[i] - stamp) < 1e-6:
            found[stamp] = poses[i][1]
        elif 0 < i < len(times) and times[i] - times[i - 1] < 0.5:
            found[stamp] = between(poses[i - 1][1], poses[i][1], (stamp - times[i - 1]) / (times[i] - times[i - 1]))
    return found


def rows(path, separator=None):
    with open(path, encoding="utf-8") as stream:
        for number, line in enumerate(stream, 1):
            words = line.replace(",", " ").split() if separator is None else line.split(separator)
            if not words or words[0].startswith("#") or "nan" in line.lower():
                continue
            try:
                yield [float(word) for word in words]
            except ValueError:
                if number > 1:  # else a head line
                    sys.exit(f"{path}, line {number}: not a row of numbers")


def scans_of(folder, ending):
    found = sorted(folder.glob(f"*.{ending}"), key=lambda path: int("".join(filter(str.isdigit, path.stem)) or 0))
    if not found:
        raise Missing(f"{folder}/*.{ending}")
    return found


FLIPPED = [[1, 0, 0, 0], [0, -1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]  # y right, z down to y left, z up


def kitti360(folder, sequence):
    lidar = need(folder / "data_3d_raw" / sequence / "velodyne_points")
    scans = scans_of(need(lidar / "data"), "bin")
    stamps = [datetime.datetime.fromisoformat(line.strip()[:26] + "+00:00").timestamp()
              for line in need(lidar / "timestamps.txt").read_text().splitlines() if line.strip()]
    T_velo_cam = from_rows(next(rows(need(folder / "calibration" / "calib_cam_to_velo.txt"))))
    T_cam_velo = inverse(T_velo_cam)
    poses = [(stamps[int(row[0])], product(from_rows(row[1:13]), T_cam_velo))
             for row in rows(need(folder / "data_poses" / sequence / "cam0_to_world.txt"))]
    return [(stamps[int(scan.stem)], scan) for scan in scans], poses, None


def mulran(folder, sequence):
    base = folder / sequence
    scans = scans_of(need(base / "sensor_data" / "Ouster", base / "Ouster"), "bin")
    T_base_lidar = from_angles(1.7042, -0.021, 1.8047, *(math.radians(a) for a in (0.0001, 0.0003, 179.6654)))
    poses = [(row[0] * 1e-9, product(from_rows(row[1:13]), T_base_lidar))
             for row in rows(need(base / "global_pose.csv"))]
    return [(int(scan.stem) * 1e-9, scan) for scan in scans], poses, None


def nclt(folder, sequence):
    scans = scans_of(need(folder / "velodyne_data" / sequence / "velodyne_sync", folder / sequence / "velodyne_sync"),
                     "bin")
    truth = need(folder / "ground_truth" / f"groundtruth_{sequence}.csv", folder / f"groundtruth_{sequence}.csv")
    T_body_velo = from_angles(0.002, -0.004, -0.957, *(math.radians(a) for a in (0.807, 0.166, -90.703)))
    poses = [(row[0] * 1e-6, product(FLIPPED, product(product(from_angles(*row[1:7]), T_body_velo), FLIPPED)))
             for row in rows(truth)]
    return [(int(scan.stem) * 1e-6, scan) for scan in scans], poses, None


def of_helipr(data):
    """x y z intensity of 26 bytes a point: these four floats, then time, reflectivity, ring, ambient."""
    return b"".join(data[i:i + 16] for i in range(0, len(data) - 25, 26))


def helipr(folder, sequence):
    scans = scans_of(need(folder / sequence / "LiDAR" / "Ouster"), "bin")
    poses = [(row[0] * 1e-9, from_quaternion(*row[1:8]))
             for row in rows(need(folder / sequence / "LiDAR_GT" / "Ouster_gt.txt"))]
    return [(int(scan.stem) * 1e-9, scan) for scan in scans], poses, of_helipr


def newer_college(folder, sequence):
    base = folder / sequence
    scans = scans_of(need(base / "raw_format" / "ouster_scan", base / "ouster_scan"), "pcd")
    # Its poses are those of the base, into which the LiDAR was calibrated: turned by 135 degrees.
    T_base_lidar = from_quaternion(-0.084, -0.025, 0.050, 0, 0, 0.924, 0.383)
    poses = [(row[0] + row[1] * 1e-9, product(from_quaternion(*row[2:9]), T_base_lidar))
             for row in rows(need(base / "ground_truth" / "registered_poses.csv"))]
    stamped = []
    for scan in scans:
        seconds, nanoseconds = scan.stem.split("_")[1:3]
        stamped.append((int(seconds) + int(nanoseconds) * 1e-9, scan))
    return sorted(stamped), poses, None


def apollo(folder, sequence):
    scans = scans_of(need(folder / sequence / "pcds"), "pcd")
    stamps, poses = {}, []
    for row in rows(need(folder / sequence / "poses" / "gt_poses.txt")):
        stamps[int(row[0])] = row[1]
        poses.append((row[1], from_quaternion(*row[2:9])))
    return [(stamps[int(scan.stem)], scan) for scan in scans if int(scan.stem) in stamps], poses, None


def lay_out(scans, poses, convert, out):
    """OUT/scans/NNNNNN.bin, OUT/times.txt, OUT/reference.tum; stamps from the first scan on."""
    (out / "scans").mkdir(parents=True, exist_ok=True)
    first = scans[0][0]
    for i, (_, scan) in enumerate(scans):
        link = out / "scans" / f"{i:06d}{scan.suffix}"
        link.unlink(missing_ok=True)
        if convert:
            link.write_bytes(convert(scan.read_bytes()))
        else:
            link.symlink_to(scan.resolve())
    (out / "times.txt").write_text("".join(f"{stamp - first:.6f}\n" for stamp, _ in scans))
    found = at_scans([stamp for stamp, _ in scans], poses)
    if not found:
        sys.exit(f"{out}: no scan lies between two poses; do their times belong together?")
    origin = [row[3] for row in next(iter(found.values()))]
    with open(out / "reference.tum", "w", encoding="utf-8") as stream:
        for stamp, T in found.items():
            words = [T[i][3] - origin[i] for i in range(3)] + to_quaternion(T)
            stream.write(f"{stamp - first:.6f} " + " ".join(f"{word:.9g}" for word in words) + "\n")
    return len(found)


def run(*command):
    done = subprocess.run([str(word) for word in command], stdout=subprocess.PIPE, text=True)
    if done.returncode not in (0, 3):  # 3: done, but for some scans (`revisit --help`)
        sys.exit(done.returncode)
    return done.stdout


def main():
    datasets = {each.__name__: each for each in (kitti360, mulran, nclt, helipr, newer_college, apollo)}
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", choices=datasets)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("sequence", nargs="+")
    parser.add_argument("--methods")
    options = parser.parse_args()
    laid_out = {}
    try:
        for sequence in options.sequence:
            laid_out[sequence] = datasets[options.dataset](options.folder, sequence)
    except Missing as missing:
        sys.exit(f"missing: {missing}")
    tables = []
    for sequence, (scans, poses, convert) in laid_out.items():
        to = options.out / sequence
        done = to / "tables.txt"
        if not done.exists():
            known = lay_out(scans, poses, convert, to / "recording")
            print(f"== {sequence}: {len(scans)} scans, {known} with a pose", file=sys.stderr)
            recording, reference = to / "recording" / "scans", to / "recording" / "reference.tum"
            chosen = ["--methods", options.methods] if options.methods else []
            text = run(REVISIT, "compare", recording, "--poses", reference, "--verify", "--out", to / "compared",
                       "--overwrite", *chosen)
            run(REVISIT, "slam", recording, "--no-map", "--out", to / "slam", "--overwrite")
            text += run(REVISIT, "evaluate", to / "slam", "--reference", reference)
            done.write_text(f"== {sequence}\n{text}")
        tables.append(done.read_text())
    (options.out / "tables.txt").write_text("\n".join(tables))
    print("\n".join(tables))


if __name__ == "__main__":
    main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Small files of every kind that revisit reads, one folder a reader, for fuzzers to begin with.

usage: scripts/fuzz_seeds.py PROGRAM FOLDER [RECORDINGS]
RECORDINGS: a folder of real recordings, scans and poses; the beginning of each is taken.
"""

import math
import pathlib
import random
import struct
import subprocess
import sys
import tempfile

MOST_BYTES = 48 * 1024
program, out = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2])
recordings = pathlib.Path(sys.argv[3]) if len(sys.argv) > 3 else None
rng = random.Random(1)


def put(reader, name, data):
    folder = out / reader
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(data if isinstance(data, bytes) else data.encode())


def points(count):
    for i in range(count):
        angle = 2 * math.pi * i / count
        yield 10 * math.cos(angle), 10 * math.sin(angle), rng.uniform(-2, 3), rng.uniform(0, 255)


def clouds():
    rows = list(points(40))
    floats = b"".join(struct.pack("<4f", *row) for row in rows)
    text = "\n".join(" ".join(f"{v:.3f}" for v in row) for row in rows) + "\n"
    put("bin", "four", floats)
    put("bin", "five", b"".join(struct.pack("<5f", *row, 3) for row in rows))
    head = "VERSION 0.7\nFIELDS x y z intensity\nSIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\nWIDTH 40\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS 40\nDATA "
    put("pcd", "ascii", head + "ascii\n" + text)
    put("pcd", "binary", (head + "binary\n").encode() + floats)
    ring = head.replace("intensity", "intensity ring time").replace("4 4 4 4", "4 4 4 4 2 4").replace("F F F F", "F F F F U F").replace("1 1 1 1", "1 1 1 1 1 1")
    put("pcd", "ring_time", (ring + "binary\n").encode() + b"".join(struct.pack("<4fHf", *row, i % 16, i * 0.002) for i, row in enumerate(rows)))
    ply = "ply\nformat {} 1.0\nelement vertex 40\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\nend_header\n"
    put("ply", "ascii", ply.format("ascii") + text)
    put("ply", "binary", ply.format("binary_little_endian").encode() + floats)
    put("ply", "big", ply.format("binary_big_endian").encode() + b"".join(struct.pack(">4f", *row) for row in rows))
    put("points", "map", ply.format("binary_little_endian").encode() + floats)
    for scan in range(3):
        yield scan, floats


def messages():
    """sensor_msgs/PointCloud2 as ROS 1 and 2 write it, behind a byte for the reader (tests/fuzz/readers.cpp)."""
    rows = list(points(12))
    data = b"".join(struct.pack("<4f", *row) for row in rows)

    def text(value):
        return struct.pack("<I", len(value)) + value

    fields = b"".join(text(name) + struct.pack("<IBI", 4 * i, 7, 1) for i, name in enumerate([b"x", b"y", b"z", b"intensity"]))
    head = struct.pack("<III", 7, 1, 5) + text(b"lidar")
    ros1 = head + struct.pack("<II", 1, len(rows)) + struct.pack("<I", 4) + fields + struct.pack("<BIII", 0, 16, 16 * len(rows), len(data)) + data + b"\1"
    for first in range(32):
        put("message", f"ros1_{first}", bytes([first]) + ros1)
    put("definition", "cloud", "Header header\nuint32 height\nuint8[] data\nOther[3] others\n" + "=" * 80 + "\nMSG: any/Other\nfloat32[4] x\nstring name\n"
        + "=" * 80 + "\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n")


def packets():
    blocks = b"".join(struct.pack("<HH", 0xEEFF, 300 * i) + struct.pack("<HB", 5000, 40) * 32 for i in range(12))
    for name, product in [("vlp16", 0x22), ("hdl32", 0x21), ("vlp32", 0x28)]:
        packet = blocks + struct.pack("<IBB", 1000, 0x37, product)
        put("packet", name, packet)
        udp = struct.pack(">HHHH", 2368, 2368, 8 + len(packet), 0) + packet
        ip = struct.pack(">BBHHHBBH4s4s", 0x45, 0, 20 + len(udp), 0, 0, 64, 17, 0, bytes([192, 168, 1, 201]), b"\xff" * 4)
        frame = b"\xff" * 12 + b"\x08\x00" + ip + udp
        pcap = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
        put("pcap", name, pcap + b"".join(struct.pack("<IIII", 10, 1300 * i, len(frame), len(frame)) + frame for i in range(4)))


def texts():
    put("kitti_poses", "two", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 1.5 0 1 0 0 0 0 1 0\n")
    put("tum_poses", "two", "# stamp x y z qx qy qz qw\n0.0 0 0 0 0 0 0 1\n0.1 1.5 0 0 0 0 0 1\n")
    put("g2o", "two", "VERTEX_SE3:QUAT 0 0 0 0 0 0 0 1\nVERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\nEDGE_SE3:QUAT 0 1 1 0 0 0 0 0 1 " + " ".join("1" if i in (0, 6, 11, 15, 18, 20) else "0" for i in range(21)) + "\n")
    put("nmea", "gga", "$GPGGA,092750.000,5321.6802,N,00630.3372,W,1,8,1.03,61.7,M,55.2,M,,*76\n$GPRMC,092750.000,A,5321.6802,N,00630.3372,W,0.02,31.66,280511,,,A*43\n")
    put("calib", "kitti", "P0: 1 0 0 0 0 1 0 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n")
    put("calibration", "json", '{"format": "revisit intensity calibration", "version": 1, "distance_knots_m": [1, 10, 40], "distance_gains": [0.5, 1, 2], "ring_gains": [1, 1.1]}')
    put("parameters", "toml", "[descriptor]\nrings = 20\n[retrieval]\nexclude_s = 30.0\n[simulation]\nsensor = \"vlp16\"\n")
    put("candidates", "rows", "query,match,score,accepted,reason\n120,3,1.62,1,\n121,,0,0,no candidate\n")
    put("loops", "rows", "query,match,tx,ty,tz,qx,qy,qz,qw,inlier_ratio,rmse_m,probability,score\n120,3,0.1,0,0,0,0,0,1,0.9,0.03,0.99,1.62\n")
    put("localisation", "rows", "frame,status,session,match,tx,ty,tz,qx,qy,qz,qw,probability\n3,found,0,1,0,0,0,0,0,0,1,0.99\n")
    put("sensor", "ouster", '{"lidar_mode": "512x10", "data_format": {"pixels_per_column": 16, "columns_per_packet": 16, "columns_per_frame": 512, "pixel_shift_by_row": '
        + str([0] * 16) + '}, "beam_altitude_angles": ' + str([15.0 - 2 * i for i in range(16)]) + ', "beam_azimuth_angles": ' + str([1.0] * 16)
        + ', "lidar_origin_to_beam_origin_mm": 15.8, "prod_line": "OS-1-16", "udp_profile_lidar": "LEGACY"}')


def run(*arguments):
    subprocess.run([program, *arguments], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False)


def by_the_program(scans):
    with tempfile.TemporaryDirectory() as name:
        work = pathlib.Path(name)
        velodyne = work / "kitti" / "velodyne"
        velodyne.mkdir(parents=True)
        for i, data in scans:
            (velodyne / f"{i:06}.bin").write_bytes(data)
        (work / "kitti" / "times.txt").write_text("0.0\n0.1\n0.2\n")
        for kind in ("bag", "mcap", "db3"):
            file = work / f"small.{kind}"
            run("convert", work / "kitti", "--out", file)
            if file.is_dir():
                file = next(file.glob("*.db3"))
            if file.exists():
                put(kind, "small", file.read_bytes())
        drive = work / "drive.toml"
        drive.write_text('[simulation]\nsensor = "vlp16"\nlength_m = 20\nframes = 6\n')
        run("slam", drive, "--out", work / "map")
        for reader, file in [("map", "map.revisit"), ("points", "map.ply"), ("las", "map.las"), ("g2o", "graph.g2o"), ("tum_poses", "poses.tum"), ("parameters", "run.json")]:
            path = work / "map" / file
            if path.exists():
                put(reader, "of_slam", path.read_bytes() if reader == "map" else path.read_bytes()[:MOST_BYTES])
        run("describe", work / "kitti", "--out", work / "described")


def real():
    kinds = {".bin": "bin", ".pcd": "pcd", ".ply": "ply", ".bag": "bag", ".mcap": "mcap", ".db3": "db3", ".pcap": "pcap", ".tum": "tum_poses", ".txt": "kitti_poses", ".json": "sensor"}
    for path in sorted(recordings.rglob("*")):
        if path.is_file() and path.suffix in kinds:
            with open(path, "rb") as file:
                put(kinds[path.suffix], f"{path.parent.name}_{path.name}"[:100], file.read(MOST_BYTES))


small = list(clouds())
messages()
packets()
texts()
by_the_program(small)
if recordings and recordings.is_dir():
    real()
print(f"{sum(1 for path in out.rglob('*') if path.is_file())} seeds of {sum(1 for _ in out.iterdir())} readers in {out}")

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Checks who includes whom (docs/architecture.md). Prints each breach and exits with 1 if there is any."""
import pathlib
import re
import sys

CORE_CONFIG = {"core", "config"}
# In the order in which data flows (docs/architecture.md). Nothing is allowed here that is not used: a test checks it.
ALLOWED = {
    "core": set(),
    "bits": set(),
    "config": {"core"},
    "io": {"core"},
    "simulation": CORE_CONFIG | {"io"},
    "preprocess": CORE_CONFIG,
    "descriptors": CORE_CONFIG | {"bits"},
    "retrieval": CORE_CONFIG | {"bits", "descriptors"},
    "vision": {"core", "descriptors"},
    "registration": {"core", "bits"},
    "odometry": CORE_CONFIG | {"preprocess", "registration"},
    "verification": CORE_CONFIG | {"descriptors", "registration"},
    "pose_graph": {"core"},
    "store": CORE_CONFIG | {"preprocess", "descriptors", "registration", "verification", "pose_graph"},
    "mapping": {"core"},
    "localisation": CORE_CONFIG | {"retrieval", "pose_graph", "store"},
    "pipeline": CORE_CONFIG | {"io", "preprocess", "descriptors", "retrieval", "registration", "odometry",
                               "verification", "pose_graph", "store", "mapping", "localisation"},
    "evaluation": {"core"},
}
# One door for each outside library: headers that begin so may stand in these places only.
DOORS = {
    "pcl/": {"src/revisit/io", "benchmarks"},
    "hwy/": {"src/revisit/bits", "src/revisit/descriptors"},
    "xxhash": {"src/revisit/retrieval", "src/revisit/store"},
    "faiss/": {"benchmarks"},
    "nanoflann": {"benchmarks"},
    "ceres/": {"src/revisit/pose_graph"},
    "tsl/": {"src/revisit/odometry"},
    "toml++": {"src/revisit/config"},
    "nlohmann/": {"src/revisit/io", "src/revisit/config", "apps"},
    "opencv2/": {"src/revisit/vision"},
    "embree": {"src/revisit/simulation"},
    "GeographicLib/": {"src/revisit/mapping", "src/revisit/simulation"},
    "sqlite3": {"src/revisit/io", "src/revisit/store"},
    "lz4": {"src/revisit/io"},
    "zstd": {"src/revisit/io"},
    "bzlib": {"src/revisit/io"},
    "zlib": {"src/revisit/io"},
    "pcap": {"src/revisit/io"},
    "cairo": {"apps/cli"},
    "httplib": {"apps/cli"},
    "CLI/": {"apps/cli", "bindings/ros2/dds"},
    "spdlog/": {"apps/cli"},
    "ros/": {"bindings/ros1"},
    "tf2_ros/": {"bindings/ros1", "bindings/ros2/src"},
    "rclcpp": {"bindings/ros2/src"},
    "dds/": {"bindings/ros2/dds"},
    "pybind11/": {"bindings/python"},
}
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')


def breaches_of(path, text):
    """The breaches in one file, given by its path relative to the project."""
    parts = path.parts
    module = parts[2] if parts[:2] == ("src", "revisit") and len(parts) > 3 else None
    is_test = path.stem.endswith("_test") or parts[0] in ("tests", "benchmarks")
    for number, line in enumerate(text.splitlines(), 1):
        match = INCLUDE.match(line)
        if not match:
            continue
        header = match.group(1)
        place = f"{path}:{number}: "
        for prefix, places in DOORS.items() if not is_test else ():
            if header.startswith(prefix) and not any(str(path).startswith(p + "/") for p in places):
                yield f"{place}{header} may be included from {', '.join(sorted(places))} only"
        if module == "bits" and not is_test and header.startswith("Eigen"):
            yield f"{place}bits does without Eigen"
        if not header.startswith("revisit/"):
            continue
        target = header.split("/")[1]
        if parts[:2] == ("bindings", "ros1") or parts[:3] == ("bindings", "ros2", "src"):
            yield f"{place}ROS's messages are C++17: bindings/node stands between them and {header}"
        if "/internal/" in header and module != target and parts[0] != "benchmarks":
            yield f"{place}{header} is internal to {target}"
        # Tests check a module against others; the order of the modules is a rule for the library.
        if module is None or is_test or target == module:
            continue
        if module not in ALLOWED:
            yield f"{place}module {module} is unknown: add it to ALLOWED"
        elif target not in ALLOWED[module]:
            yield f"{place}{module} may not include {target}"


def unused_permissions(files):
    """What ALLOWED permits although no file of the library needs it."""
    used = {module: set() for module in ALLOWED}
    for path, text in files:
        parts = path.parts
        if parts[:2] != ("src", "revisit") or len(parts) < 4 or path.stem.endswith("_test"):
            continue
        for line in text.splitlines():
            match = INCLUDE.match(line)
            if match and match.group(1).startswith("revisit/") and parts[2] in used:
                used[parts[2]].add(match.group(1).split("/")[1])
    for module, allowed in ALLOWED.items():
        for target in sorted(allowed - used[module]):
            yield f"ALLOWED permits {module} to include {target}, which it does not need"


def self_test():
    bad = [("src/revisit/core/a.hpp", "#include <revisit/io/recording.hpp>"),
           ("src/revisit/retrieval/a.cpp", "#include <revisit/pipeline/prepare.hpp>"),
           ("src/revisit/pipeline/a.cpp", "#include <revisit/evaluation/reference.hpp>"),
           ("src/revisit/pipeline/a.cpp", "#include <revisit/io/internal/bytes.hpp>"),
           ("src/revisit/verification/a.cpp", "#include <pcl/features/fpfh.h>"),
           ("bindings/ros1/src/a.cpp", "#include <revisit/pipeline/slam.hpp>"),
           ("bindings/node/a.cpp", "#include <ros/ros.h>"),
           ("apps/cli/a.cpp", '#include "revisit/descriptors/internal/polar_binning.hpp"')]
    good = [("src/revisit/pipeline/a.cpp", "#include <revisit/io/recording.hpp>"),
            ("src/revisit/io/a.cpp", "#include <revisit/io/internal/bytes.hpp>"),
            ("src/revisit/io/a.cpp", "#include <pcl/io/pcd_io.h>")]
    missed = [case for case in bad if not list(breaches_of(pathlib.Path(case[0]), case[1]))]
    wrong = [case for case in good if list(breaches_of(pathlib.Path(case[0]), case[1]))]
    for case in missed:
        print("not noticed:", *case)
    for case in wrong:
        print("wrongly refused:", *case)
    return 1 if missed or wrong else 0


def main():
    if "--self-test" in sys.argv:
        return self_test()
    root = pathlib.Path(__file__).resolve().parent.parent
    found, files = [], []
    for folder in ("src", "apps", "bindings", "examples", "benchmarks", "tests"):
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".hpp", ".cpp", ".h"):
                files.append((path.relative_to(root), path.read_text()))
                found += breaches_of(*files[-1])
    found += unused_permissions(files)
    print("\n".join(found) if found else "layers: no breach")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What the program is made of, with versions, as CycloneDX 1.5.

usage: scripts/sbom.py PROGRAM OUT.json

Listed are the Debian packages of the shared libraries that PROGRAM loads, those whose headers are compiled in
(scripts/packages.txt), and the npm packages inside the page of `revisit view`.
"""

import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEADERS_ONLY = ["libeigen3-dev", "libcli11-dev", "libcpp-httplib-dev", "libtomlplusplus-dev", "nlohmann-json3-dev", "robin-map-dev"]
IN_THE_PAGE = ["three", "3d-tiles-renderer"]


def output(*command):
    return subprocess.run(command, check=False, capture_output=True, text=True).stdout


def loaded_packages(program):
    packages = set()
    for path in re.findall(r"=> (/\S+)", output("ldd", program)):
        real = str(pathlib.Path(path).resolve())
        for candidate in (real, path, real.removeprefix("/usr"), path.removeprefix("/usr")):
            if found := output("dpkg-query", "-S", candidate):
                packages.add(found.split(": ")[0].split(",")[0])
                break
    return packages


def debian(package):
    version, source = output("dpkg-query", "-W", "-f", "${Version} ${source:Package}", package).split()
    name = package.split(":")[0]
    return {"type": "library", "name": name, "version": version, "purl": f"pkg:deb/debian/{name}@{version}", "group": source}


def npm(name):
    locked = json.loads((ROOT / "apps/viewer/package-lock.json").read_text())["packages"][f"node_modules/{name}"]
    return {"type": "library", "name": name, "version": locked["version"], "purl": f"pkg:npm/{name}@{locked['version']}",
            "licenses": [{"license": {"id": locked["license"]}}]}


def main():
    program, out = sys.argv[1], pathlib.Path(sys.argv[2])
    version = output(program, "--version").strip()
    components = [debian(package) for package in sorted(loaded_packages(program) | set(HEADERS_ONLY))]
    components += [npm(name) for name in IN_THE_PAGE]
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps({"bomFormat": "CycloneDX", "specVersion": "1.5", "version": 1,
                               "metadata": {"component": {"type": "application", "name": "revisit", "version": version}},
                               "components": components}, indent=1) + "\n")
    print(f"{out}: {len(components)} components")


main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What README and docs tell people to type: blocks of commands are run, in their order and on small recordings; of all
others the sub-command, its flags, scripts, targets and tests must exist, and so must what links lead to.

usage: docs_test.py REVISIT"""
import functools
import os
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import unittest

REVISIT = os.path.abspath(sys.argv.pop(1))
ROOT = pathlib.Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md")),
         *sorted((ROOT / "bindings").glob("*/README.md"))]
HAS_PAGE = (ROOT / "apps" / "viewer" / "dist" / "viewer.js").exists()  # `make viewer`
SMALL = {"--frames": "24", "--sensor": "vlp16", "--length_m": "150"}


def run(arguments, folder=None):
    return subprocess.run([REVISIT, *map(str, arguments)], cwd=folder, capture_output=True, text=True, timeout=120)


@functools.cache
def help_of(command):
    return run([*command, "--help"]).stdout


def blocks(page):
    """The fenced blocks of a page: lists of lines."""
    return [text.splitlines() for text in re.findall(r"^```\n(.*?)^```", page.read_text(), re.MULTILINE | re.DOTALL)]


def commands_of(page):
    """What may be a command: lines of blocks, indented lines, and what stands in backquotes."""
    text = re.sub(r"\\\n\s*", "", page.read_text())
    found = [line for lines in blocks(page) for line in lines]
    found += re.findall(r"^    (\S.*)$", text, re.MULTILINE) + re.findall(r"`([^`\n]+)`", text)
    return [line.split(" # ")[0].split("; ")[0].strip() for line in found]


def words(line):
    try:
        return shlex.split(line)
    except ValueError:  # a quotation mark in prose
        return line.split()


class Docs(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def simulate(self, *names):
        for name in names:
            done = run(["simulate", "--out", name, *(word for pair in SMALL.items() for word in pair)], self.folder)
            self.assertEqual(done.returncode, 0, done.stderr)

    def run_block(self, page, first, replace):
        """Runs the block whose first line starts so; what a command prints last may be no error."""
        lines = next(lines for lines in blocks(ROOT / page) if lines[0].startswith(first))
        for line in lines:
            line = line.split(" # ")[0]
            for name, value in replace.items():
                line = re.sub(rf"(?<![\w./]){re.escape(name)}(?![\w./])", value, line)
            command = words(line)[1:]
            if command[0] == "view" and ("--report" not in command or not HAS_PAGE):
                continue  # serves until it is stopped
            if command[0] == "simulate":
                command += [word for flag, value in SMALL.items() if flag not in command for word in (flag, value)]
            if "--view" in command:
                command.remove("--view")
            with self.subTest(line):
                done = run(command, self.folder)
                self.assertEqual(done.returncode, 0, f"{page}: {line}\n{done.stdout}{done.stderr}")

    def test_the_commands_of_the_readme(self):
        self.simulate("drive0", "other", "drive.bag")
        self.run_block("README.md", "build/revisit info RECORDING", {
            "RECORDING": "drive0", "OTHER": "other", "SCAN": "drive0/velodyne/000012.bin", "POSES": "drive0/poses.txt",
            "--gps --out map": "--out map3", "map2": "map3",
            "--out drive --sensor": "--out drive_again --sensor"})
        for file in ("results/loops.csv", "results/report.html", "map/map.revisit", "all.revisit", "nav", "phi.json",
                     "compared/comparison.csv", "picture.png", "drive_kitti/velodyne"):
            self.assertTrue((self.folder / file).exists(), file)

    def test_the_commands_about_bags_and_maps(self):
        self.simulate("drive.bag", "monday.bag", "tuesday.bag", "drive0")
        self.run_block("docs/formats.md", "revisit info drive.bag", {"truth.tum": "drive.bag.poses.tum"})
        (self.folder / "maps").mkdir()
        self.assertEqual(run(["slam", "drive.bag", "--out", "maps/robot2"], self.folder).returncode, 0)
        self.run_block("docs/maps.md", "revisit slam monday.bag", {
            "scan.pcd": "drive0/velodyne/000012.bin", "--into maps/site --out tuesday": "--into maps/site --out again"})
        self.run_block("docs/viewer.md", "build/revisit view MAP ", {"RECORDING": "drive.bag", "--out MAP": "--out new",
                                                                    "MAP": "maps/site"})
        self.assertEqual((self.folder / "map.html").exists(), HAS_PAGE)

    def test_the_commands_about_simulation(self):
        poses = "".join(f"1 0 0 {x} 0 1 0 0 0 0 1 0\n" for x in range(200))
        (self.folder / "kitti" / "poses").mkdir(parents=True)
        (self.folder / "kitti" / "poses" / "00.txt").write_text(poses)
        self.run_block("docs/simulation.md", "build/revisit simulate --out drive ", {})

    def test_every_link_leads_somewhere(self):
        def anchors(page):
            heads = re.findall(r"(?m)^#+ (.*)$", page.read_text())
            return {re.sub(r"[^\w\- ]", "", head.lower()).strip().replace(" ", "-") for head in heads}

        checked = 0
        for page in [*PAGES, ROOT / "CHANGELOG.md", ROOT / "SECURITY.md"]:
            for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
                if re.match(r"[a-z]+:", target):
                    continue
                path, _, anchor = target.partition("#")
                to = (page.parent / path) if path else page
                self.assertTrue(to.exists(), f"{page.relative_to(ROOT)}: {target}")
                if anchor:
                    self.assertIn(anchor, anchors(to), f"{page.relative_to(ROOT)}: {target}")
                checked += 1
        self.assertGreater(checked, 100)

    def test_every_flag_script_and_target_exists(self):
        makefile = (ROOT / "Makefile").read_text()
        cmake = "".join(file.read_text() for file in ROOT.glob("**/CMakeLists.txt") if "node_modules" not in str(file)
                        and "build" not in file.relative_to(ROOT).parts)
        tests = cmake + "".join(file.read_text() for file in ROOT.glob("src/**/*_test.cpp")) + "".join(
            file.read_text() for file in ROOT.glob("tests/*.cpp"))
        checked = 0
        for page in PAGES:
            for line in commands_of(page):
                command = words(line)
                if not command:
                    continue
                where, first = f"{page.relative_to(ROOT)}: {line}", command[0]
                if first in ("revisit", "build/revisit", "build/release/revisit") and len(command) > 1:
                    if not re.fullmatch("[a-z]+", command[1]):
                        continue
                    self.assertIn(f"\n  {command[1]} ", help_of(()), where)
                    for flag in (word.split("=")[0] for word in command[2:] if re.match("--[a-z]", word)):
                        self.assertRegex(help_of((command[1],)), rf"(?<![\w-]){re.escape(flag)}(?![\w.-])", where)
                elif re.match(r"(PROJECT/)?scripts/[\w/]+\.(sh|py)$", first):
                    self.assertTrue(os.access(ROOT / first.removeprefix("PROJECT/"), os.X_OK), where)
                elif first == "make" and len(command) > 1:
                    self.assertRegex(makefile, rf"(?m)^{re.escape(command[1])}:", where)
                elif first == "ctest" and "-R" in command:
                    self.assertIn(command[command.index("-R") + 1], tests, where)
                elif first.startswith("build/release/bin/"):
                    self.assertIn(first.rsplit("/", 1)[1], cmake, where)
                else:
                    continue
                checked += 1
        self.assertGreater(checked, 100)


if __name__ == "__main__":
    unittest.main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Lets every write, sync, rename, opening of a file and allocation of the program fail, one after the other.

usage: tests/faults/run_faults.py PROGRAM SHIM [--most N] [--frames N] [--work FOLDER]

PROGRAM: revisit; SHIM: the library of fail_call.cpp. --most: of each kind of call so many, spread evenly (default: every
one). After each the program must have ended by itself, with an error that says what was wrong; what lies on the disk is
as before, or as after a run without faults, or, of detect and slam, the beginning of that: whole rows, a map that opens
and holds what it held. Without memory it may also end at once:
libstdc++ aborts within directory iterators, fontconfig reads null. Prints a table; exit code 1 where something is otherwise.
"""

import argparse
import concurrent.futures
import hashlib
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import tempfile

KINDS = ["write", "full disk", "sync", "rename", "open", "memory"]


def run(program, arguments, environment=None):
    return subprocess.run([program, *map(str, arguments)], env={**os.environ, **(environment or {})},
                          stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, timeout=120,
                          text=True, errors="replace")


class Faults:
    def __init__(self, program, shim, work, frames):
        self.program, self.shim, self.work = program, shim, work
        for day in (0, 1):
            self.must("simulate", "--sensor", "vlp16", "--length_m", 20, "--frames", frames, "--day", day, "--out", work / f"day{day}")
            self.must("slam", work / f"day{day}", "--no-map", "--out", work / f"map{day}")
        map0, map1, drive = work / "map0" / "map.revisit", work / "map1" / "map.revisit", work / "day1"
        self.commands = {
            "detect": ["detect", drive, "--out", "OUT"],
            "slam": ["slam", drive, "--out", "OUT"],
            "slam --into": ["slam", drive, "--no-map", "--into", "MAP", "--out", "OUT"],
            "merge": ["merge", map0, map1, "--out", "OUT/all.revisit"],
            "export": ["export", map0, "--as", "las", "--out", "OUT"],
        }

    def must(self, *arguments):
        done = run(self.program, arguments)
        if done.returncode != 0:
            sys.exit(f"{arguments}: {done.stderr}")

    def attempt(self, command, kind, at, name):
        """Exit code, what was said, the number of calls, and the folder that is left."""
        folder = self.work / "runs" / name
        shutil.rmtree(folder, ignore_errors=True)
        (folder / "out").mkdir(parents=True)
        shutil.copy(self.work / "map0" / "map.revisit", folder / "map.revisit")
        arguments = [str(each).replace("OUT", str(folder / "out")).replace("MAP", str(folder / "map.revisit"))
                     for each in self.commands[command]]
        count = folder.with_suffix(".count")
        environment = {"LD_PRELOAD": str(self.shim), "FAULT_KIND": "write" if kind == "full disk" else kind,
                       "FAULT_AT": str(at), "FAULT_FOLDER": str(folder), "FAULT_COUNT": str(count)}
        if kind == "full disk":
            environment["FAULT_LASTS"] = "1"
        done = run(self.program, arguments, environment)
        calls = int(count.read_text()) if count.exists() else 0
        count.unlink(missing_ok=True)
        return done, calls, folder

    def state(self, folder):
        """What the files hold, without what differs between two runs that go well."""
        files = {}
        for path in sorted(folder.rglob("*")):
            if path.is_file() and path.name != "run.json" and not path.name.endswith((".revisit-wal", ".revisit-shm")):
                files[str(path.relative_to(folder))] = (
                    self.keyframes(path) if path.suffix == ".revisit" else hashlib.sha256(path.read_bytes()).hexdigest())
        return files

    def keyframes(self, map_file):
        done = run(self.program, ["info", "--check", map_file])
        if "holds no key frame yet" in done.stderr:
            return "no key frame"
        if done.returncode != 0:
            return "broken: " + done.stderr.strip()
        return next((line.strip() for line in done.stdout.splitlines() if "key frames" in line), done.stdout[:80])

    def complaint(self, command, kind, done, folder, before, after):
        """What is wrong; empty where nothing is."""
        is_aborted = done.returncode in (-signal.SIGABRT, -signal.SIGSEGV) and kind == "memory"
        if done.returncode < 0 and not is_aborted:
            return f"ended by signal {-done.returncode}: {done.stderr.strip()[-200:]}"
        left = self.state(folder)
        for name, value in left.items():
            if str(value).startswith("broken"):
                return f"{name} is {value}"
        if done.returncode == 3 and "warning" in done.stderr:  # a scan was skipped, and named
            return ""
        if done.returncode in (0, 3):
            differing = [name for name in after if left.get(name) != after[name]]
            return f"success, but these differ: {differing}" if differing else ""
        if not done.stderr.strip():
            return "an error without a message"
        for name, value in left.items():
            if name.endswith(".csv"):
                text = (folder / name).read_bytes()
                if text and not text.endswith(b"\n"):
                    return f"{name} ends within a row"
        if command in ("merge", "export"):
            for name, value in left.items():
                if value not in (before.get(name), after.get(name)) and not name.startswith("out/."):
                    return f"{name} is neither old nor new"
        return ""

    def every(self, command, kind, most):
        done, calls, folder = self.attempt(command, kind, 0, "whole")
        if done.returncode != 0:
            sys.exit(f"{command} without a fault: {done.stderr}")
        after = self.state(folder)
        before = {"map.revisit": self.keyframes(self.work / "map0" / "map.revisit")}
        step = max(1, calls // most) if most else 1
        numbers = list(range(1, calls + 1, step))
        row = {"calls": calls, "tried": len(numbers), "said": 0, "aborted": 0, "went on": 0, "wrong": []}

        def one(at):
            done, _, folder = self.attempt(command, kind, at, f"{command.replace(' ', '')}_{kind.replace(' ', '')}_{at}")
            wrong = self.complaint(command, kind, done, folder, before, after)
            if not wrong:
                shutil.rmtree(folder)
            return at, done, wrong

        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
            for i, (at, done, wrong) in enumerate(pool.map(one, numbers)):
                row["went on" if done.returncode in (0, 3) else "aborted" if done.returncode < 0 else "said"] += 1
                if wrong:
                    row["wrong"].append(f"{command}, {kind} {at}: {wrong}")
                if sys.stderr.isatty():
                    print(f"\r{command}, {kind}: {i + 1} of {len(numbers)}  ", end="", file=sys.stderr)
        return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("shim", type=pathlib.Path)
    parser.add_argument("--most", type=int, default=0)
    parser.add_argument("--frames", type=int, default=30, help="of a drive of 20 m [%(default)s]")
    parser.add_argument("--kinds", nargs="*", default=KINDS)
    parser.add_argument("--commands", nargs="*")
    parser.add_argument("--work", type=pathlib.Path)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        faults = Faults(given.program.resolve(), given.shim.resolve(), (given.work or pathlib.Path(temporary)).resolve(), given.frames)
        print("| command | call | calls | tried | ended with an error | aborted | went on | wrong |\n|---|---|---|---|---|---|---|---|")
        wrong = []
        for command in given.commands or faults.commands:
            for kind in given.kinds:
                row = faults.every(command, kind, given.most)
                wrong += row["wrong"]
                print(f"| {command} | {kind} | {row['calls']} | {row['tried']} | {row['said']} | {row['aborted']} | {row['went on']} | {len(row['wrong'])} |", flush=True)
        for each in wrong:
            print(each)
        print(f"{len(wrong)} wrong")
    sys.exit(1 if wrong else 0)


main()

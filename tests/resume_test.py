#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A slam that is killed (kill -9) at random moments, and resumed each time, writes the same bytes as one that never was.

usage: tests/resume_test.py PROGRAM [--power LIBRARY] [--kills N] [--frames N] [--seed N]
Of each way to run it: as it is, with wheels and GPS, and as a second session of a map. What differs by its nature is left out:
times (run.json), and the pages of map.revisit, whose tables are compared row by row. With the library of faults/lose_power.cpp the
power fails, too, and so it does while `merge` and `export` write: writes that were not synced are lost or not, each by itself. The files
of evidence, which are never synced, may then lack rows.
"""

import argparse
import hashlib
import os
import pathlib
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time

LOOPS_SOON = ["--retrieval.exclude_frames", "8", "--retrieval.exclude_s", "0"]  # so short a drive has no others
TIMES = {"run.json"}
MEMORY_OF_THE_RUN = {"state"}  # which counts scans that were skipped once more


def command(arguments, folder, kill_after_s=None, environment=None):
    """The seconds that it took, or None where it was killed."""
    begin = time.monotonic()
    with open(folder / "log.txt", "a") as log:
        program = subprocess.Popen([PROGRAM, *map(str, arguments)], cwd=folder, stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                   env={**os.environ, **(environment or {})})
        try:
            code = program.wait(kill_after_s)
        except subprocess.TimeoutExpired:
            program.kill()
            program.wait()
            return None
    if code == -signal.SIGKILL:
        return None
    if code not in (0, 3):
        raise SystemExit(f"{arguments}: exit code {code}\n{(folder / 'log.txt').read_text()[-2000:]}")
    return time.monotonic() - begin


def rows_of(map_file):
    with sqlite3.connect(f"file:{map_file}?mode=ro", uri=True) as database:
        tables = [name for name, in database.execute("SELECT name FROM sqlite_master WHERE type='table' ORDER BY name")]
        return {f"{map_file.name}/{table}": hashlib.sha256(repr(database.execute(f"SELECT * FROM {table} ORDER BY 1").fetchall()).encode()).hexdigest()
                for table in tables if table not in MEMORY_OF_THE_RUN}


def contents(folder, map_file):
    files = {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
             for path in sorted(folder.rglob("*")) if path.is_file() and path.name not in TIMES and not path.name.startswith(map_file.name)}
    return files | rows_of(map_file)


def slam(drive, out, before=None):
    """The command, and the map that it makes."""
    arguments = ["slam", drive, *LOOPS_SOON, "--checkpoint-s", "0.02", "--out", out]
    if before is None:
        return arguments, out / "map.revisit"
    out.mkdir()
    shutil.copy(before, out / "home.revisit")
    return [*arguments, "--into", out / "home.revisit"], out / "home.revisit"


def with_options(slam, *options):
    arguments, made = slam
    return [*arguments, *options], made


def progress(name, done, of):
    if sys.stderr.isatty():
        print(f"\r{name}: {done} of {of}", end="", file=sys.stderr)


def compare(name, folder, arguments_of, kills, chance):
    """Kills so often, a few times a run; the moments are spread over all of it."""
    arguments, made = arguments_of(folder / "whole")
    took_s = command(arguments, folder)
    whole = contents(folder / "whole", made)
    assert len(whole) > 15, whole.keys()
    done = runs = 0
    while done < kills:
        out = folder / f"killed{runs}"
        runs += 1
        arguments, made = arguments_of(out)
        resume = []
        for _ in range(4):
            left_s = None if done >= kills else chance.uniform(0.0, 1.1 * took_s)
            if command(arguments + resume, folder, left_s) is not None:
                break
            done += 1
            resume = ["--resume"] if made.exists() else []
        else:
            command(arguments + resume, folder)
        again = contents(out, made)
        differing = sorted(each for each in whole.keys() | again.keys() if whole.get(each) != again.get(each))
        if differing:
            raise SystemExit(f"{name}: these differ after kills: {differing}; see {folder}")
        shutil.rmtree(out)
        progress(name, done, kills)
    shutil.rmtree(folder / "whole")
    print(f"{name}: {done} kills in {runs} runs, the same {len(whole)} files and tables")


def compare_power(name, folder, arguments_of, times, chance, library):
    """The power fails before a random write of each run; the map is whole, and the run goes on from it."""
    arguments, made = arguments_of(folder / "whole")
    environment = {"LD_PRELOAD": str(library), "POWER_FOLDER": str(folder), "POWER_COUNT": str(folder / "count")}
    command(arguments, folder, environment=environment)
    writes = int((folder / "count").read_text())
    whole = contents(folder / "whole", made)
    lost = 0
    for i in range(times):
        out = folder / f"dark{i}"
        arguments, made = arguments_of(out)
        environment |= {"POWER_AT": str(chance.randint(1, writes)), "POWER_SEED": str(i)}
        if command(arguments, folder, environment=environment) is None:
            lost += 1
            command([*arguments, "--resume"], folder)
        again = contents(out, made)
        differing = sorted(each for each in whole.keys() | again.keys() if whole.get(each) != again.get(each) and not each.endswith("evidence.csv"))
        if differing:
            raise SystemExit(f"{name}: these differ after write {environment['POWER_AT']} of {writes}: {differing}; see {folder}")
        shutil.rmtree(out)
        progress(name, i + 1, times)
    shutil.rmtree(folder / "whole")
    same = sum(not each.endswith("evidence.csv") for each in whole)
    print(f"{name}: the power failed {lost} times, before writes of {writes}, the same {same} files and tables")


def compare_power_of_results(name, folder, before, command_of, times, chance, library):
    """The power fails at a random write or new name of a command that writes results: each is the old one or the new one."""
    def results(out):
        return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest() for path in sorted(out.rglob("*"))
                if path.is_file() and not path.name.endswith("evidence.csv")
                and ".part" not in str(path.relative_to(out))}

    def begin(out):
        out.mkdir()
        if before:
            command(before(out), folder)
        return results(out)

    old = begin(folder / "whole")
    environment = {"LD_PRELOAD": str(library), "POWER_FOLDER": str(folder), "POWER_COUNT": str(folder / "count")}
    command(command_of(folder / "whole"), folder, environment=environment)
    writes, new = int((folder / "count").read_text()), results(folder / "whole")
    assert new and new != old
    lost = 0
    for i in range(times):
        out = folder / f"dark{i}"
        begin(out)
        # Around the last ones, files get their names.
        at = writes - i if i < times // 3 and i < writes else chance.randint(1, writes)
        environment |= {"POWER_AT": str(at), "POWER_SEED": str(i)}
        lost += command(command_of(out), folder, environment=environment) is None
        wrong = {file for file, now in results(out).items() if now not in (old.get(file), new.get(file))}
        wrong |= {file for file in old if file in new and file not in results(out)}
        if wrong:
            raise SystemExit(f"{name}: neither old nor new after write {at} of {writes}: {sorted(wrong)}; see {out}")
        if before or results(out) != new:  # a merged map that is there is not written again
            command(command_of(out), folder)
        if results(out) != new:
            raise SystemExit(f"{name}: once more, after write {at} of {writes}, gives something else; see {out}")
        shutil.rmtree(out)
        progress(name, i + 1, times)
    shutil.rmtree(folder / "whole")
    print(f"{name}: the power failed {lost} times, at writes of {writes}, each file the old or the new one")


def main():
    global PROGRAM
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("program", type=pathlib.Path)
    parser.add_argument("--power", type=pathlib.Path, help="the library of faults/lose_power.cpp")
    parser.add_argument("--kills", type=int, default=12, help="of each way to run it [%(default)s]")
    parser.add_argument("--frames", type=int, default=120, help="of a drive of 60 m [%(default)s]")
    parser.add_argument("--seed", type=int, default=None, help="of the moments; without, another one each time")
    options = parser.parse_args()
    PROGRAM = options.program.resolve()
    seed = options.seed if options.seed is not None else random.randrange(10**6)
    print(f"seed {seed}")
    chance = random.Random(seed)
    folder = pathlib.Path(tempfile.mkdtemp())
    days = [folder / f"day{day}.mcap" for day in (0, 1)]
    for day, bag in enumerate(days):
        command(["simulate", "--sensor", "vlp16", "--length_m", 60, "--frames", options.frames, "--day", day, "--gps", "true", "--imu", "true",
                 "--out", bag], folder)
    for name, arguments_of in {
        "LiDAR alone": lambda out: with_options(slam(days[0], out), "--wheels", "none", "--no-imu"),
        "with wheels, IMU and GPS": lambda out: with_options(slam(days[0], out), "--gps"),
        "into a map": lambda out: slam(days[1], out, folder / "first" / "map.revisit"),
    }.items():
        if name == "into a map":
            command(slam(days[0], folder / "first")[0], folder)
        compare(name, folder, arguments_of, options.kills, chance)
        if options.power:
            compare_power(name, folder, arguments_of, options.kills, chance, options.power.resolve())
    if options.power:
        maps = [folder / "first" / "map.revisit", folder / "second" / "map.revisit"]
        command(slam(days[1], folder / "second")[0], folder)

        def export(number, form):
            return lambda out: ["export", maps[number], "--as", form, "--out", out]

        for name, before, command_of in [("merge", None, lambda out: ["merge", *maps, "--out", out / "all.revisit"]),
                                         *((f"export {form}", export(0, form), export(1, form)) for form in ("las", "tiles", "grid", "tum"))]:
            compare_power_of_results(name, folder, before, command_of, options.kills, chance, options.power.resolve())
    shutil.rmtree(folder)


if __name__ == "__main__":
    main()

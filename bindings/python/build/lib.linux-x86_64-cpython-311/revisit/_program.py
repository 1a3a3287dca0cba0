# SPDX-License-Identifier: Apache-2.0
"""The program `revisit`, which comes with the package."""
import json
import os
import pathlib
import subprocess
import sys


def program():
    """Its path: in the package, or what the environment's REVISIT_PROGRAM says."""
    named = os.environ.get("REVISIT_PROGRAM")
    return named or str(pathlib.Path(__file__).parent / "bin" / "revisit")


def run(*arguments, check=True):
    """Runs the program as a shell would: run("detect", "drive.bag", "--out", "results"). Gives a CompletedProcess with
    its output as text; exit code 3 (done, with reservations) is no failure."""
    done = subprocess.run([program(), *map(str, arguments)], capture_output=True, text=True)
    if check and done.returncode not in (0, 3):
        from . import Error
        raise Error(done.stderr.strip() or f"exit code {done.returncode}")
    return done


def evaluate(results, reference=None):
    """Scores a folder of results (detect, slam, localise, compare) as `revisit evaluate` does: a dict of its tables, which it
    also leaves there, with a report and pictures."""
    run("evaluate", results, *(["--reference", reference] if reference is not None else []))
    return json.loads((pathlib.Path(results) / "evaluation.json").read_text())


def main():
    if os.name == "posix":
        os.execv(program(), [program(), *sys.argv[1:]])
    sys.exit(subprocess.call([program(), *sys.argv[1:]]))

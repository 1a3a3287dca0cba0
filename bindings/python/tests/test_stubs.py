# SPDX-License-Identifier: Apache-2.0
"""The stubs say what is there, no more and no less."""
import ast
import inspect
import pathlib
import shutil
import subprocess
import sys

import pytest

import revisit

STUB = pathlib.Path(revisit.__file__).with_suffix(".pyi")
TREE = ast.parse(STUB.read_text())


def members(node):
    functions = {each.name for each in node.body if isinstance(each, ast.FunctionDef)}
    return functions | {each.target.id for each in node.body if isinstance(each, ast.AnnAssign)}


PLOT = STUB.with_name("plot.pyi")


def test_plots_take_what_their_stubs_say():
    import revisit.plot
    stubbed = {node.name: [each.arg for each in node.args.args] for node in ast.parse(PLOT.read_text()).body
               if isinstance(node, ast.FunctionDef)}
    there = {name: list(inspect.signature(each).parameters) for name, each in vars(revisit.plot).items()
             if inspect.isfunction(each) and not name.startswith("_")}
    assert stubbed == there


def test_every_public_name_has_a_stub():
    defined = {node.name for node in TREE.body if isinstance(node, (ast.ClassDef, ast.FunctionDef))} | members(TREE)
    assert set(revisit.__all__) <= defined
    assert {name for name in defined if not name.startswith("_")} <= set(revisit.__all__)


@pytest.mark.parametrize("node", [node for node in TREE.body if isinstance(node, ast.ClassDef) and node.name in revisit.__all__],
                         ids=lambda node: node.name)
def test_classes_have_what_their_stubs_say(node):
    kind = getattr(revisit, node.name)
    inherited = {base.id for base in node.bases if isinstance(base, ast.Name)}
    stubbed = members(node) | ({"to_dict"} if "_Result" in inherited else set())
    public = {name for name in vars(kind) if not name.startswith("_")}
    assert public <= stubbed
    assert {name for name in stubbed if not name.startswith("_")} - public <= {"frames", "stamps", "poses"}


@pytest.mark.parametrize("node", [node for node in TREE.body if isinstance(node, ast.FunctionDef) and node.name in revisit.__all__],
                         ids=lambda node: node.name)
def test_functions_take_what_their_stubs_say(node):
    function = getattr(revisit, node.name)
    if not inspect.isfunction(function):  # compiled
        return
    given = [each.arg for each in node.args.posonlyargs + node.args.args + node.args.kwonlyargs]
    taken = [name for name, each in inspect.signature(function).parameters.items()
             if each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)]
    assert given == taken


def test_mypy_agrees(tmp_path):
    if not shutil.which("mypy"):
        pytest.skip("needs mypy (make python)")
    (tmp_path / "stubs" / "revisit").mkdir(parents=True)
    for stub in (STUB, PLOT):
        shutil.copy(stub, tmp_path / "stubs" / "revisit")
    program = tmp_path / "program.py"
    program.write_text("""import numpy as np
import revisit
import revisit.plot
recording = revisit.open_recording("drive.bag")
detector = revisit.LoopDetector(revisit.Parameters(retrieval={"top_k": 5}), recording=recording)
loops = [d.loop.T_match_query for d in map(detector.process, recording) if d.loop]
detection = detector.process(np.zeros((3, 4)), stamp=1.0)
reveal_type(detection.loop)
revisit.plot.trajectory(np.zeros((5, 4, 4)), detection.loops)
""")
    mypy = subprocess.run([sys.executable, "-m", "mypy", "--strict", "--cache-dir", str(tmp_path / "cache"), str(program)],
                          capture_output=True, text=True, env={"MYPYPATH": str(tmp_path / "stubs"), "PATH": "/usr/bin:/bin"})
    assert mypy.returncode == 0, mypy.stdout + mypy.stderr
    assert "Union[revisit.Loop, None]" in mypy.stdout

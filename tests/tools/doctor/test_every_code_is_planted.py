"""No fault is named that no test has planted: the doctor's codes against what its tests plant."""

import ast
from pathlib import Path

import fwav_companion.tools.doctor
from fwav_companion.tools.doctor.refusals import REFUSALS

DOCTOR = Path(fwav_companion.tools.doctor.__file__).parent
TESTS = [Path(__file__).parent, Path(__file__).parents[2] / "cli"]


def texts(paths):
    """All string constants, without docstrings' words."""
    trees = (ast.parse(path.read_text()) for path in paths)
    constants = (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return {node.value for node in constants if isinstance(node.value, str)}


def named():
    """The first word of every Finding that is made."""
    for path in DOCTOR.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                code = node.args[0]
                if isinstance(code, ast.Constant):
                    yield code.value


def test_every_code_is_planted():
    codes = {*named(), *(reason.value for reason in REFUSALS)}
    planted = texts(path for folder in TESTS for path in folder.glob("test_*.py"))
    assert len(codes) > 50
    assert codes - planted == set()

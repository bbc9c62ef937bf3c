"""Every code that `check` can report is planted by a test."""

import ast
from pathlib import Path

import fwav_companion.tools.doctor
from fwav_companion.tools.doctor.causes import CAUSES
from fwav_companion.tools.doctor.detection_findings import FILTERS
from fwav_companion.tools.reason_table import judged_reasons

DOCTOR = Path(fwav_companion.tools.doctor.__file__).parent
TESTS = [Path(__file__).parent, Path(__file__).parents[2] / "cli"]


def texts(paths):
    """All string constants."""
    trees = (ast.parse(path.read_text()) for path in paths)
    constants = (node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.Constant))
    return {node.value for node in constants if isinstance(node.value, str)}


def named():
    """The code of every Finding that is made with a constant one."""
    for path in DOCTOR.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Finding":
                code = node.args[0]
                if isinstance(code, ast.Constant):
                    yield code.value


def every_code():
    judged = (*judged_reasons("frame"), *judged_reasons("detection"), *FILTERS)
    return {*named(), "above_horizon", *(reason.value for reason in judged)}


def test_every_code_is_planted():
    codes = every_code()
    planted = texts(path for folder in TESTS for path in folder.glob("test_*.py"))
    assert len(codes) > 50
    assert codes - planted == set()


def test_causes_name_codes_that_exist():
    assert {*CAUSES, *(code for effects in CAUSES.values() for code in effects)} <= every_code()


def test_no_finding_is_its_own_cause():
    def below(code, above=()):
        assert code not in above, (*above, code)
        for effect in CAUSES.get(code, ()):
            below(effect, (*above, code))

    for code in CAUSES:
        below(code)

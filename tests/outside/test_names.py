"""Names in files, in the status and in `check`: reasons, states, finding codes."""

from __future__ import annotations

import ast
from enum import StrEnum
from inspect import getfile
from pathlib import Path

from frozen import hold

from fwav_companion.links.base import LinkState
from fwav_companion.mavlink.client.rate_table import RequestState
from fwav_companion.mavlink.client.timesync import NotTaken
from fwav_companion.publishing.landing import Withheld
from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.reason_table import judged_reasons
from fwav_companion.types import ClockStatus, HeightSource, Reason, TrackState

NAMES: dict[str, type[StrEnum]] = {
    "calibration status": CalibrationStatus,
    "clock status": ClockStatus,
    "height source": HeightSource,
    "landing withheld": Withheld,
    "link state": LinkState,
    "rate state": RequestState,
    "reason": Reason,
    "timesync refused": NotTaken,
    "track state": TrackState,
}


def test_reasons_and_states():
    hold("values", {f"{kind}: {value.value}" for kind, names in NAMES.items() for value in names})


def test_the_codes_of_findings():
    """The codes of all findings that the doctor makes; a finding about refusals has the name of its reason."""
    trees = [ast.parse(path.read_text()) for path in Path(getfile(Finding)).parent.rglob("*.py")]
    judged = {reason.value for things in ("frame", "detection") for reason in judged_reasons(things)}
    hold("findings", judged | {code for tree in trees for node in ast.walk(tree) for code in codes_of(node)})


def codes_of(node: ast.AST) -> list[str]:
    """The constant ``code`` of a call of ``Finding``, by position or by name; the value of a ``Reason.NAME``."""
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == Reason.__name__:
        return [Reason[node.attr].value]
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == Finding.__name__):
        return []
    given = [*node.args[:1], *(keyword.value for keyword in node.keywords if keyword.arg == "code")]
    constants = (each for code in given for each in ast.walk(code) if isinstance(each, ast.Constant))
    return [constant.value for constant in constants if isinstance(constant.value, str)]

"""Names in files, in the status and in `check`: reasons, states, finding codes."""

from __future__ import annotations

from enum import StrEnum

from frozen import hold

from fwav_companion.links.base import LinkState
from fwav_companion.mavlink.client.rate_table import RequestState
from fwav_companion.mavlink.client.timesync import NotTaken
from fwav_companion.publishing.landing import Withheld
from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.tools.doctor.finding_table import FINDINGS
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
    """The codes of all findings of the doctor; a finding about refusals has the name of its reason."""
    hold(
        "findings",
        FINDINGS.keys() | {reason.value for things in ("frame", "detection") for reason in judged_reasons(things)},
    )

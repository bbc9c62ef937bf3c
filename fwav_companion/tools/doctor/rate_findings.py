"""The autopilot takes no requests for message rates: what that vehicle cannot do, and where its rates are set."""

from __future__ import annotations

from typing import Final

from fwav_companion.tools.doctor.finding import Finding
from fwav_companion.tools.doctor.finding_table import make_finding
from fwav_companion.types.messages import ATTITUDE_MESSAGES
from fwav_companion.types.situation import AutopilotKind
from fwav_companion.types.status import RunStatus

ATTITUDES_A_SWING: Final = 10.0
"""Attitudes needed a wing beat or swing: the wanted rate is at least ten times its frequency."""
SMALL_FIRMWARES_HZ: Final = 50.0
"""Highest telemetry rate of INAV and Betaflight (TELEMETRY_MAVLINK_MAXRATE in src/main/telemetry/mavlink.c)."""
NOT_TAKEN: Final = frozenset({"unanswered", "unsupported", "denied"})


def takes_no_requests(status: RunStatus) -> bool:
    """Return whether some request for a rate failed, and none was granted.

    A firmware of another kind may still take the group request that follows (INAV), while attitude is asked for.
    """
    rows = status.rates.values()
    granted = any(row.state == "granted" and row.asked_hz is not None for row in rows)
    other = status.autopilot is not None and status.autopilot.kind == AutopilotKind.OTHER.value
    asking = other and any(status.rates[name].state == "asking" for name in ATTITUDE_MESSAGES if name in status.rates)
    return not granted and not asking and any(row.state in NOT_TAKEN for row in rows)


def rates_not_taken(status: RunStatus, source: str, wanted_hz: float) -> Finding:
    """Return the finding. ``source``: the message that attitudes are taken from."""
    hz = status.telemetry.rates_hz.get(source, 0.0)
    return make_finding(
        "rates_not_taken",
        "enough" if hz >= wanted_hz else "slow",
        autopilot_kind(status),
        source=source,
        hz=hz,
        swing_hz=hz / ATTITUDES_A_SWING,
        rate_hz=wanted_hz,
        small_firmware_hz=min(wanted_hz, SMALL_FIRMWARES_HZ),
    )


def autopilot_kind(status: RunStatus) -> str:
    """Return the case of ``rate_setting`` in the table of findings: where the vehicle's attitude rate is set."""
    return "" if status.autopilot is None else status.autopilot.kind

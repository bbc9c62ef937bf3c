"""The autopilot takes no requests for message rates: what that vehicle cannot do, and where its rates are set."""

from __future__ import annotations

from typing import Final

from fwav_companion.tools.doctor.finding import Finding, Level
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
    return Finding(
        "rates_not_taken",
        Level.NOTE if hz >= wanted_hz else Level.WARNING,
        "rates",
        problem=f"the autopilot does not take rate requests: {source} at {hz:.0f} Hz as it comes; enough for a camera "
        f"that swings below {hz / ATTITUDES_A_SWING:.1g} Hz",
        fix=rate_setting(status, wanted_hz),
    )


def rate_setting(status: RunStatus, wanted_hz: float) -> str:
    """Return where the vehicle's attitude rate is set."""
    autopilot = status.autopilot
    kind = AutopilotKind.OTHER.value if autopilot is None else autopilot.kind
    if kind == AutopilotKind.ARDUPILOT.value:
        where = f"set SRn_EXTRA1 (MAVn_EXTRA1 from 4.7) to {wanted_hz:.0f}"
    elif kind == AutopilotKind.PX4.value:
        where = "set MAV_n_MODE to Onboard"
    else:
        hz = min(wanted_hz, SMALL_FIRMWARES_HZ)
        return f"set its telemetry rate to {hz:.0f} Hz (INAV, Betaflight: mavlink_extra1_rate = {hz:.0f})"
    return f"check that what this service sends reaches it (on a wire our TX on its RX); else {where}"

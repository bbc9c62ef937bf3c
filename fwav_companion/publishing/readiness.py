"""The one line that an operator reads when the vehicle is armed: ready, or the one reason why not."""

from __future__ import annotations

from math import isfinite

import msgspec

from fwav_companion.types.messages import Notice, Severity

SLOW = 0.8
"""Below this share of the wanted attitude rate, the flapping may not be caught."""


class Readiness(msgspec.Struct, frozen=True, kw_only=True):
    """What localizing rests on, at this moment. None: not known, or not there."""

    attitude_hz: float | None
    wanted_attitude_hz: float
    clock_sigma_s: float | None
    frames_hz: float | None
    expected_m: float | None
    """One sigma of a target straight below, larger semi-axis, relative to the vehicle."""
    height_m: float | None = None
    """For which that is told."""
    trouble: str = ""
    """Something that the pipeline knows, and that goes before all else."""


def ready_notice(readiness: Readiness) -> Notice:
    """``ready: attitude 98 Hz, clock 0.6 ms, camera 30/s, expect 0.4 m at 10 m (relative to the vehicle)``."""
    reason = _why_not(readiness)
    if reason:
        return Notice(Severity.WARNING, f"not ready: {reason}", to_ground=True)
    parts = [
        f"attitude {readiness.attitude_hz or 0.0:.0f} Hz",
        f"clock {(readiness.clock_sigma_s or 0.0) * 1e3:.1f} ms",
        f"camera {readiness.frames_hz or 0.0:.0f}/s",
    ]
    if readiness.expected_m is not None and readiness.height_m is not None and isfinite(readiness.expected_m):
        parts.append(f"expect {readiness.expected_m:.1f} m at {readiness.height_m:.0f} m (relative to the vehicle)")
    return Notice(Severity.INFO, f"ready: {', '.join(parts)}", to_ground=True)


def _why_not(readiness: Readiness) -> str:
    """The first thing that is wrong, in the order of the data's way; "" if nothing is."""
    if readiness.trouble:
        return readiness.trouble
    if not readiness.attitude_hz:
        return "no attitude from the autopilot"
    if readiness.clock_sigma_s is None or not isfinite(readiness.clock_sigma_s):
        return "the autopilot's clock is not known yet"
    if not readiness.frames_hz:
        return "no pictures from the camera"
    if readiness.attitude_hz < SLOW * readiness.wanted_attitude_hz:
        return f"attitude {readiness.attitude_hz:.0f} Hz, wanted {readiness.wanted_attitude_hz:.0f} Hz"
    return ""

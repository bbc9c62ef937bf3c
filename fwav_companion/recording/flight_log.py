"""What an autopilot's own log tells of a flight, whichever autopilot wrote it. Pure.

What GPS tells of UTC places the whole on Unix time, some tenths of a second late.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import asin, degrees, sqrt
from typing import Final

import msgspec

from fwav_companion.geometry.rotations import Quaternion, conjugate, multiply, normalized
from fwav_companion.geometry.vectors import Vector3

US_PER_S: Final = 1_000_000
LONGEST_PAIR_US: Final = US_PER_S
"""Attitudes, or places, further apart say nothing about what was between them."""
TOLERABLE: Final = 0.1
"""degrees, RMS: the attitude noise that a configuration has by default. More, and the log's rate limits what comes."""


class LoggedAttitude(msgspec.Struct, frozen=True, gc=False):
    """Where the body points."""

    boot_us: int
    ned_from_body: Quaternion
    rates: Vector3 = (0.0, 0.0, 0.0)
    """rad/s, FRD."""


class LoggedPosition(msgspec.Struct, frozen=True, gc=False):
    """Where it is: degrees, metres, m/s."""

    boot_us: int
    lat: float
    lon: float
    alt_amsl_m: float
    height_above_home_m: float
    velocity_ned: Vector3 | None = None
    """None: the log does not tell it, and the places before and after must."""


class LoggedRange(msgspec.Struct, frozen=True, gc=False):
    """A rangefinder's reading."""

    boot_us: int
    distance_m: float
    orientation: int
    """MAV_SENSOR_ORIENTATION; 25 looks down."""


class LoggedGps(msgspec.Struct, frozen=True, gc=False):
    """The receiver: its fix, and UTC where it knows it."""

    boot_us: int
    fix_type: int
    """GPS_FIX_TYPE."""
    unix_us: int | None


class FlightLog(msgspec.Struct, frozen=True, kw_only=True):
    """One autopilot's log, everything in the order of its clock."""

    autopilot: str
    """ardupilot | px4."""
    attitude_source: str
    """The log's name for the messages that the attitudes are from."""
    attitudes: Sequence[LoggedAttitude]
    positions: Sequence[LoggedPosition] = ()
    ranges: Sequence[LoggedRange] = ()
    gps: Sequence[LoggedGps] = ()
    origin: tuple[float, float, float] | None = None
    """Of the estimator: latitude, longitude in degrees, metres AMSL."""

    @property
    def unix_minus_boot_us(self) -> int:
        """By GPS; 0 where it never knew UTC. The greatest difference: a message is logged late, never early.

        Of those near the middle one: a damaged message tells any time.
        """
        differences = sorted(fix.unix_us - fix.boot_us for fix in self.gps if fix.unix_us is not None)
        middle = differences[len(differences) // 2] if differences else 0
        return max((each for each in differences if abs(each - middle) <= US_PER_S), default=0)

    def complaints(self) -> list[str]:
        """What a user should know before believing what comes of this log."""
        told = []
        off_deg = degrees(between_attitudes(self.attitudes))
        if off_deg > TOLERABLE:
            told.append(
                f"{self.attitude_source} comes at {self._rate_hz():.0f} Hz, which is too slow for this motion: halfway "
                f"between two of them the attitude is off by about {off_deg:.1f} deg (RMS). {_FASTER[self.autopilot]}"
            )
        if not self.unix_minus_boot_us:
            told.append("GPS never told UTC: detections must be stamped with time_boot")
        return told

    def _rate_hz(self) -> float:
        if len(self.attitudes) < 2:
            return 0.0
        span_us = self.attitudes[-1].boot_us - self.attitudes[0].boot_us
        return US_PER_S * (len(self.attitudes) - 1) / span_us if span_us else 0.0


_FASTER: Final = {
    "ardupilot": "Next time set LOG_BITMASK bit 0 (ATTITUDE_FAST).",
    "px4": "Next time set SDLOG_PROFILE bit 3 (high rate).",
}


def between_attitudes(attitudes: Sequence[LoggedAttitude]) -> float:
    """How far off a straight line between two attitudes is in its middle, rad, RMS over the log.

    Each attitude is compared with the line between its neighbours; at half that distance a line errs by a quarter.
    """
    squares: list[float] = []
    for (before, here), (_, after) in pairwise(pairwise(attitudes)):
        span_us = after.boot_us - before.boot_us
        if not 0 < span_us <= LONGEST_PAIR_US:
            continue
        share = (here.boot_us - before.boot_us) / span_us
        if 0.25 < share < 0.75:
            squares.append(_angle(_between(before.ned_from_body, after.ned_from_body, share), here.ned_from_body) ** 2)
    return 0.25 * sqrt(sum(squares) / len(squares)) if squares else 0.0


def _between(a: Quaternion, b: Quaternion, share: float) -> Quaternion:
    sign = 1.0 if sum(x * y for x, y in zip(a, b, strict=True)) >= 0.0 else -1.0
    w, x, y, z = ((1.0 - share) * p + share * sign * q for p, q in zip(a, b, strict=True))
    return normalized((w, x, y, z))


def _angle(a: Quaternion, b: Quaternion) -> float:
    _, x, y, z = multiply(conjugate(a), b)
    return 2.0 * asin(min(1.0, sqrt(x * x + y * y + z * z)))

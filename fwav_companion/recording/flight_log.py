"""The content of an autopilot's own log, the same for all autopilots. PURE.

UTC from GPS places the log on Unix time, some tenths of a second late.
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
"""Nothing is interpolated between attitudes, or positions, that are further apart."""
TOLERABLE: Final = 0.1
"""Degrees, RMS: the default attitude noise of a configuration. Above it the log's rate limits the accuracy."""


class LoggedAttitude(msgspec.Struct, frozen=True, gc=False):
    """Attitude of the body."""

    boot_us: int
    ned_from_body: Quaternion
    rates: Vector3 = (0.0, 0.0, 0.0)
    """Body rates, FRD, rad/s."""


class LoggedPosition(msgspec.Struct, frozen=True, gc=False):
    """Position of the vehicle: degrees, metres, m/s."""

    boot_us: int
    lat: float
    lon: float
    alt_amsl_m: float
    height_above_home_m: float
    velocity_ned: Vector3 | None = None
    """None if the log does not have it; it then follows from the positions before and after."""


class LoggedRange(msgspec.Struct, frozen=True, gc=False):
    """Reading of a rangefinder."""

    boot_us: int
    distance_m: float
    orientation: int
    """MAV_SENSOR_ORIENTATION; 25 is downward."""


class LoggedGps(msgspec.Struct, frozen=True, gc=False):
    """State of the GNSS receiver: fix type, and UTC if known."""

    boot_us: int
    fix_type: int
    """GPS_FIX_TYPE."""
    unix_us: int | None


class FlightLog(msgspec.Struct, frozen=True, kw_only=True):
    """Content of one autopilot's log, in order of the autopilot's clock."""

    autopilot: str
    """ardupilot | px4."""
    attitude_source: str
    """The log's name of the messages from which the attitudes are taken."""
    attitudes: Sequence[LoggedAttitude]
    positions: Sequence[LoggedPosition] = ()
    ranges: Sequence[LoggedRange] = ()
    gps: Sequence[LoggedGps] = ()
    origin: tuple[float, float, float] | None = None
    """Origin of the estimator: latitude and longitude in degrees, metres AMSL."""

    @property
    def unix_minus_boot_us(self) -> int:
        """Unix time minus boot time by GPS, microseconds; 0 if GPS never knew UTC.

        The largest difference is taken, since a message is logged late, never early; of those near the median, since a
        damaged message may have any time.
        """
        differences = sorted(fix.unix_us - fix.boot_us for fix in self.gps if fix.unix_us is not None)
        middle = differences[len(differences) // 2] if differences else 0
        return max((each for each in differences if abs(each - middle) <= US_PER_S), default=0)

    def complaints(self) -> list[str]:
        """Warnings to the user about results from this log."""
        warnings = []
        off_deg = degrees(between_attitudes(self.attitudes))
        if off_deg > TOLERABLE:
            warnings.append(
                f"{self.attitude_source} comes at {self._rate_hz():.0f} Hz, which is too slow for this motion: halfway "
                f"between two of them the attitude is off by about {off_deg:.1f} deg (RMS). {_FASTER[self.autopilot]}"
            )
        if not self.unix_minus_boot_us:
            warnings.append("the log has no UTC from GPS: detections must be stamped with time_boot")
        return warnings

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
    """Error of linear interpolation midway between two attitudes, rad, RMS over the log.

    Each attitude is compared with the line between its neighbours; over half that distance the error is a quarter.
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

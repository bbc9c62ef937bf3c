"""The content of an autopilot's own log, the same for all autopilots. PURE.

UTC from GPS gives the log's Unix time, some tenths of a second late.
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
"""Longest interval between two attitudes, or positions, that is interpolated."""
TOLERABLE: Final = 0.1
"""Largest interpolation error without a warning, degrees, RMS: the default attitude noise of a configuration. Above it
the log's rate limits the accuracy."""


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
    """Velocity in NED, m/s; None if the log lacks it: then it is computed from the positions before and after."""


LEAST_UNIX_US: Final = 10**15
"""Least Unix time: 2001-09-09. As a time since boot it would be 31 years."""
LEAST_FIXES, LEAST_MEASURED_US, TOLERABLE_RATE = 10, 5_000_000, 0.01
"""For the rate of a clock from GPS times: their least number, the least time between them, and the departure from 1
that is reported. GPS times are logged up to 0.2 s late. That is at worst 4 % of five seconds, and much less over
many."""


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
    """Name, in the log, of the messages from which the attitudes are taken."""
    attitudes: Sequence[LoggedAttitude]
    positions: Sequence[LoggedPosition] = ()
    ranges: Sequence[LoggedRange] = ()
    gps: Sequence[LoggedGps] = ()
    origin: tuple[float, float, float] | None = None
    """Origin of the estimator: latitude and longitude in degrees, metres AMSL."""
    home: tuple[float, float, float] | None = None
    """First home, where the vehicle took off: latitude and longitude in degrees, metres AMSL."""

    @property
    def knows_utc(self) -> bool:
        """Whether GPS knew UTC, or the log's own clock counts from 1970."""
        first_us = self.attitudes[0].boot_us if self.attitudes else 0
        return first_us > LEAST_UNIX_US or any(fix.unix_us is not None for fix in self.gps)

    @property
    def clock_rate(self) -> float | None:
        """Seconds of the log's clock in a second of GPS; None without GPS times that are far enough apart."""
        known = [(fix.boot_us, fix.unix_us) for fix in self.gps if fix.unix_us is not None]
        if len(known) < LEAST_FIXES:
            return None
        (boot0_us, unix0_us), (boot1_us, unix1_us) = known[len(known) // 10], known[-1 - len(known) // 10]
        passed_us = unix1_us - unix0_us
        return (boot1_us - boot0_us) / passed_us if passed_us >= LEAST_MEASURED_US else None

    @property
    def unix_minus_boot_us(self) -> int:
        """Unix time minus boot time by GPS, microseconds; 0 if GPS never knew UTC.

        The largest difference near the median is used: a message is logged late, never early, and a damaged message may
        have any time.
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
        rate = self.clock_rate
        if rate is not None and abs(rate - 1.0) > TOLERABLE_RATE:
            warnings.append(
                f"its clock runs {rate:.1f} times as fast as GPS: detections on another clock do not fit; "
                "accepted: time_boot"
                if rate > 1.5
                else f"its clock runs {1e2 * abs(rate - 1.0):.1f} % {'fast' if rate > 1.0 else 'slow'} against GPS: "
                "detections on another clock drift away; accepted: time_boot"
            )
        if not self.knows_utc:
            warnings.append("the log has no UTC from GPS: it fits only detections that are stamped with time_boot")
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

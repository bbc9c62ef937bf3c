"""What an autopilot's own log tells of a flight, as the telemetry it would have sent. Pure.

A log has one clock, the autopilot's: host time is boot time here, so the clock between them is exact by construction,
and TIMESYNC exchanges without a round trip say so. Attitudes have no delay of sending: they are logged where they are
made. What GPS tells of UTC places the whole on Unix time, some tenths of a second late.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from heapq import merge
from itertools import pairwise
from math import asin, degrees, sqrt
from typing import Any, Final

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.rotations import Quaternion, conjugate, multiply, normalized
from fwav_companion.geometry.vectors import ZERO3, Vector3, scale

US_PER_S: Final = 1_000_000
EXCHANGE_EVERY_US: Final = 500_000
BEATS_A_HEARTBEAT: Final = 2
"""One a second."""
LONGEST_PAIR_US: Final = US_PER_S
"""Attitudes, or places, further apart say nothing about what was between them."""
TOLERABLE: Final = 0.1
"""degrees, RMS: the attitude noise that a configuration has by default. More, and the log's rate limits what comes."""
AUTOPILOTS: Final = {"ardupilot": 3, "px4": 12}
MAV_TYPE_QUADROTOR: Final = 2
"""The logs do not tell the type in MAVLink's numbers, and of an autopilot's log nothing hangs on it."""


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


Told = tuple[int, str, Mapping[str, Any]]
"""(boot time in microseconds, a message's MAVLink name, its fields)."""


def messages_of(log: FlightLog) -> Iterator[Told]:
    """The autopilot's messages in their order; after each TIMESYNC request of ours, its answer."""
    streams = (
        _beats(log),
        map(_attitude, log.attitudes),
        map(_gps, log.gps),
        map(_position, log.positions, _velocities(log.positions)),
        map(_range, log.ranges),
    )
    return merge(*streams, key=lambda told: told[0])


def _beats(log: FlightLog) -> Iterator[Told]:
    """Where there is anything to be paired: a sample that damage put days away does not fill the days between."""
    times = [each.boot_us for series in (log.attitudes, log.positions) for each in series]
    if not times:
        return
    first_us = min(times)
    if log.origin is not None:
        lat, lon, alt_m = log.origin
        fields = {"latitude": _whole(lat, 1e7), "longitude": _whole(lon, 1e7), "altitude": _whole(alt_m, 1e3)}
        yield first_us, "GPS_GLOBAL_ORIGIN", fields | {"time_usec": first_us}
    for beat in sorted({(at_us - first_us) // EXCHANGE_EVERY_US for at_us in times}):
        at_us = first_us + beat * EXCHANGE_EVERY_US
        if beat % BEATS_A_HEARTBEAT == 0:
            yield at_us, "HEARTBEAT", _HEARTBEAT | {"autopilot": AUTOPILOTS[log.autopilot]}
        yield at_us, "TIMESYNC", {"tc1": 0, "ts1": at_us * 1000}
        yield at_us, "TIMESYNC", {"tc1": max(1, at_us * 1000), "ts1": at_us * 1000}


_HEARTBEAT: Final = {"type": MAV_TYPE_QUADROTOR, "base_mode": 0, "custom_mode": 0, "system_status": 4}


def _attitude(attitude: LoggedAttitude) -> Told:
    w, x, y, z = attitude.ned_from_body
    p, q, r = attitude.rates
    fields = {"time_boot_ms": _ms(attitude.boot_us), "q1": w, "q2": x, "q3": y, "q4": z}
    return attitude.boot_us, "ATTITUDE_QUATERNION", fields | {"rollspeed": p, "pitchspeed": q, "yawspeed": r}


def _velocities(positions: Sequence[LoggedPosition]) -> Iterator[Vector3]:
    """Of each: a velocity that is not known is not zero, which would bend the way between two places."""
    for index, here in enumerate(positions):
        before, after = positions[max(0, index - 1)], positions[min(len(positions) - 1, index + 1)]
        yield here.velocity_ned or _mean_velocity(before, after)


def _mean_velocity(before: LoggedPosition, after: LoggedPosition) -> Vector3:
    span_us = after.boot_us - before.boot_us
    if not 0 < span_us <= LONGEST_PAIR_US:
        return ZERO3
    plane = TangentPlane(Geodetic.from_degrees(before.lat, before.lon, before.alt_amsl_m))
    moved = plane.ned_from_geodetic(Geodetic.from_degrees(after.lat, after.lon, after.alt_amsl_m))
    return scale(moved, US_PER_S / span_us)


def _position(position: LoggedPosition, velocity_ned: Vector3) -> Told:
    north, east, down = (max(-32767, min(32767, _whole(speed, 100.0))) for speed in velocity_ned)
    return (
        position.boot_us,
        "GLOBAL_POSITION_INT",
        {
            "time_boot_ms": _ms(position.boot_us),
            "lat": _whole(position.lat, 1e7),
            "lon": _whole(position.lon, 1e7),
            "alt": _whole(position.alt_amsl_m, 1e3),
            "relative_alt": _whole(position.height_above_home_m, 1e3),
            "vx": north,
            "vy": east,
            "vz": down,
            "hdg": 65535,
        },
    )


def _range(reading: LoggedRange) -> Told:
    fields = {
        "time_boot_ms": _ms(reading.boot_us),
        "min_distance": 0,
        "max_distance": 65535,
        "current_distance": max(0, min(65535, _whole(reading.distance_m, 100.0))),
        "type": 0,
        "id": 0,
        "orientation": reading.orientation,
        "covariance": 255,
    }
    return reading.boot_us, "DISTANCE_SENSOR", fields


def _gps(fix: LoggedGps) -> Told:
    fields = dict.fromkeys(("lat", "lon", "alt"), 0) | dict.fromkeys(("eph", "epv", "vel", "cog"), 65535)
    told = fields | {"time_usec": fix.boot_us, "fix_type": fix.fix_type, "satellites_visible": 255}
    return fix.boot_us, "GPS_RAW_INT", told


def _ms(boot_us: int) -> int:
    return boot_us // 1000 & 0xFFFFFFFF


def _whole(value: float, per_unit: float) -> int:
    """In the message's own unit. What is beyond any of its fields stays so, and is refused when it is encoded."""
    return round(max(-BEYOND, min(BEYOND, value * per_unit)))


BEYOND: Final = 2.0**62

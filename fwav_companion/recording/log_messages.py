"""Converts an autopilot's own log into the telemetry that the autopilot would have sent. PURE.

A log has one clock, the autopilot's. Host time is boot time here, so the clock offset is exact. TIMESYNC exchanges
without a round trip express this. Attitudes have no transmission delay: the autopilot logs them where it computes them.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from heapq import merge
from typing import Any, Final

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import ZERO3, Vector3, scale
from fwav_companion.recording.flight_log import (
    LONGEST_PAIR_US,
    US_PER_S,
    FlightLog,
    LoggedAttitude,
    LoggedGps,
    LoggedPosition,
    LoggedRange,
)

EXCHANGE_EVERY_US: Final = 500_000
FIRST_EXCHANGES: Final = 20
"""Number of clock exchanges, a millisecond apart, before the first sample: so the clock is known from the beginning."""
MS_US: Final = 1000
BEATS_A_HEARTBEAT: Final = 2
"""Beats for each heartbeat: one heartbeat a second."""
AUTOPILOTS: Final = {"ardupilot": 3, "px4": 12}
"""MAV_AUTOPILOT by the log's autopilot."""
MAV_TYPE_QUADROTOR: Final = 2
"""Vehicle type of the heartbeats: the logs do not have the type in MAVLink's numbers, and no result depends on it."""
MAV_MODE_FLAG_SAFETY_ARMED: Final = 128
"""Mode of all heartbeats, armed: a log does not show whether the vehicle is at rest."""
BEYOND: Final = 2.0**62
"""Value beyond the range of every message field."""

TimedMessage = tuple[int, str, Mapping[str, Any]]
"""(boot time in microseconds, MAVLink name of the message, its fields)."""


def messages_of(log: FlightLog) -> Iterator[TimedMessage]:
    """The autopilot's messages in order of time, and TIMESYNC requests of the service, each followed by its answer."""
    streams = (
        _beats(log),
        map(_attitude, log.attitudes),
        map(_gps, log.gps),
        map(_position, log.positions, _velocities(log.positions)),
        map(_range, log.ranges),
    )
    return merge(*streams, key=lambda timed: timed[0])


def _beats(log: FlightLog) -> Iterator[TimedMessage]:
    """Heartbeats and clock exchanges, only around the samples: a damaged sample days away does not fill the days."""
    times = [each.boot_us for series in (log.attitudes, log.positions) for each in series]
    if not times:
        return
    first_us = min(times)
    heartbeat = _HEARTBEAT | {"autopilot": AUTOPILOTS[log.autopilot]}
    yield max(0, first_us - FIRST_EXCHANGES * MS_US), "HEARTBEAT", heartbeat
    for before in range(FIRST_EXCHANGES, 0, -1):
        yield from _exchange(max(0, first_us - before * MS_US))
    if log.origin is not None:
        lat, lon, alt_m = log.origin
        fields = {"latitude": _whole(lat, 1e7), "longitude": _whole(lon, 1e7), "altitude": _whole(alt_m, 1e3)}
        yield first_us, "GPS_GLOBAL_ORIGIN", fields | {"time_usec": first_us}
    if log.home is not None:
        lat, lon, alt_m = log.home
        fields = {"latitude": _whole(lat, 1e7), "longitude": _whole(lon, 1e7), "altitude": _whole(alt_m, 1e3)}
        yield (
            first_us,
            "HOME_POSITION",
            fields
            | dict.fromkeys(("x", "y", "z"), 0.0)
            | {
                "q": (1.0, 0.0, 0.0, 0.0),
                **dict.fromkeys(("approach_x", "approach_y", "approach_z"), 0.0),
                "time_usec": first_us,
            },
        )
    for beat in sorted({(at_us - first_us) // EXCHANGE_EVERY_US for at_us in times}):
        at_us = first_us + beat * EXCHANGE_EVERY_US
        if beat % BEATS_A_HEARTBEAT == 0:
            yield at_us, "HEARTBEAT", heartbeat
        yield from _exchange(at_us)


def _exchange(at_us: int) -> Iterator[TimedMessage]:
    """A TIMESYNC request, and its answer at the same instant: host time is boot time."""
    yield at_us, "TIMESYNC", {"tc1": 0, "ts1": at_us * 1000}
    yield at_us, "TIMESYNC", {"tc1": max(1, at_us * 1000), "ts1": at_us * 1000}


_HEARTBEAT: Final = {
    "type": MAV_TYPE_QUADROTOR,
    "base_mode": MAV_MODE_FLAG_SAFETY_ARMED,
    "custom_mode": 0,
    "system_status": 4,
}


def _attitude(attitude: LoggedAttitude) -> TimedMessage:
    w, x, y, z = attitude.ned_from_body
    p, q, r = attitude.rates
    fields = {"time_boot_ms": _ms(attitude.boot_us), "q1": w, "q2": x, "q3": y, "q4": z}
    return attitude.boot_us, "ATTITUDE_QUATERNION", fields | {"rollspeed": p, "pitchspeed": q, "yawspeed": r}


def _velocities(positions: Sequence[LoggedPosition]) -> Iterator[Vector3]:
    """Velocity at each position. An unknown one is computed, because zero would bend the path between two positions."""
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


def _position(position: LoggedPosition, velocity_ned: Vector3) -> TimedMessage:
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


def _range(reading: LoggedRange) -> TimedMessage:
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


def _gps(fix: LoggedGps) -> TimedMessage:
    fields = dict.fromkeys(("lat", "lon", "alt"), 0) | dict.fromkeys(("eph", "epv", "vel", "cog"), 65535)
    fields |= {"time_usec": fix.boot_us, "fix_type": fix.fix_type, "satellites_visible": 255}
    return fix.boot_us, "GPS_RAW_INT", fields


def _ms(boot_us: int) -> int:
    return boot_us // 1000 & 0xFFFFFFFF


def _whole(value: float, per_unit: float) -> int:
    """The value as an integer in the message's unit. A value beyond every field remains so and fails to encode."""
    return round(max(-BEYOND, min(BEYOND, value * per_unit)))

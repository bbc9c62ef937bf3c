"""Decodes messages to samples, and rejects values that are not finite or not plausible."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, isfinite, pi, radians, sqrt
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic
from fwav_companion.geometry.rotations import Quaternion, normalized, quaternion_from_euler, rotate
from fwav_companion.geometry.stamps import NS_PER_S, BootNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.types import RangeSample

MOST_RATE = 100.0
"""Largest plausible body rate, rad/s. Gyroscopes of autopilots saturate at 35 to 70 rad/s (2000 to 4000 deg/s)."""
MOST_HEIGHT_M = 100_000.0
MOST_SPEED_M_S = 1_000.0
MOST_UNDULATION_M = 120.0
"""Largest plausible undulation, metres: the geoid lies -106 to +85 m from the ellipsoid."""
UTC_FROM_S, UTC_UNTIL_S = 1_577_836_800, 4_102_444_800
"""Range of plausible UTC, Unix seconds, 2020 to 2100: a receiver without time reports 1970 or 1980."""
MOST_UTC_ERROR_NS = NS_PER_S
"""Largest difference between the advances of UTC and of the boot clock from one SYSTEM_TIME to the next: at 1 Hz, a
simulator at half speed differs by half a second."""
FIX_3D = 3
"""GPS_FIX_TYPE_3D_FIX."""


class Implausible(msgspec.Struct, frozen=True):
    """Result of a message without a usable value; telemetry counts such messages by name."""


class Attitude(msgspec.Struct, frozen=True, gc=False):
    """Content of ATTITUDE or ATTITUDE_QUATERNION without the stamp."""

    ned_from_body: Quaternion
    rates: Vector3
    """Body rates as sent, rad/s, FRD."""


class Position(msgspec.Struct, frozen=True, gc=False):
    """Content of GLOBAL_POSITION_INT without the stamp."""

    place: Geodetic | None
    """Place; None for latitude and longitude 0/0, which is sent with heights where there is no global position."""
    height_above_home_m: float
    velocity_ned: Vector3


def attitude_from_euler(fields: Any, pitch_trim: float = 0.0) -> Attitude | Implausible:
    """Attitude of ATTITUDE: Z-Y-X Euler angles. ``pitch_trim``: angle that the autopilot subtracted from the pitch,
    radians.
    """
    roll, pitch, yaw = float(fields.roll), float(fields.pitch), float(fields.yaw)
    rates = _rates(fields)
    if not (isfinite(roll + pitch + yaw) and max(abs(roll), abs(pitch), abs(yaw)) <= 2.0 * pi + 1e-3) or rates is None:
        return Implausible()
    return Attitude(quaternion_from_euler(roll, pitch + pitch_trim, yaw), rates)


def attitude_from_quaternion(fields: Any) -> Attitude | Implausible:
    """Attitude of ATTITUDE_QUATERNION: (w, x, y, z) of the same rotation as ATTITUDE's."""
    q = unit_quaternion((fields.q1, fields.q2, fields.q3, fields.q4))
    rates = _rates(fields)
    return Implausible() if q is None or rates is None else Attitude(q, rates)


def unit_quaternion(sent: Sequence[float]) -> Quaternion | None:
    """A quaternion (w, x, y, z) as sent, normalized; None where it is no rotation."""
    w, x, y, z = map(float, sent)
    if not 0.95 <= sqrt(w * w + x * x + y * y + z * z) <= 1.05:  # NaN compares false
        return None
    return normalized((w, x, y, z))


def _rates(fields: Any) -> Vector3 | None:
    p, q, r = float(fields.rollspeed), float(fields.pitchspeed), float(fields.yawspeed)
    limit = MOST_RATE  # NaN compares false
    return (p, q, r) if -limit <= p <= limit and -limit <= q <= limit and -limit <= r <= limit else None


def position(fields: Any) -> Position | Implausible:
    """Position of GLOBAL_POSITION_INT."""
    height_m = fields.relative_alt * 1e-3
    velocity = (fields.vx * 1e-2, fields.vy * 1e-2, fields.vz * 1e-2)
    if abs(height_m) > MOST_HEIGHT_M or hypot(*velocity) > MOST_SPEED_M_S:
        return Implausible()
    place = geodetic(fields.lat, fields.lon, fields.alt)
    if place is None and (fields.lat or fields.lon):
        return Implausible()
    return Position(place, height_m, velocity)


def local_position(place: Vector3, velocity: Vector3) -> tuple[Vector3, Vector3] | Implausible:
    """Place and velocity in the autopilot's local frame, metres and m/s, as sent."""
    if all(abs(c) <= 10.0 * MOST_HEIGHT_M for c in place) and all(abs(c) <= MOST_SPEED_M_S for c in velocity):
        return place, velocity  # NaN compares false
    return Implausible()


def geodetic(lat_e7: int, lon_e7: int, alt_mm: int) -> Geodetic | None:
    """Place from degE7 and millimetres; None for 0/0 and for coordinates that are not on earth."""
    lat_deg, lon_deg, alt_m = lat_e7 * 1e-7, lon_e7 * 1e-7, alt_mm * 1e-3
    nowhere = (lat_e7 == 0 and lon_e7 == 0) or abs(lat_deg) > 90.0 or abs(lon_deg) > 180.0
    if nowhere or abs(alt_m) > MOST_HEIGHT_M:
        return None
    return Geodetic(radians(lat_deg), radians(lon_deg), alt_m)


def undulation_m(fields: Any) -> float | None:
    """Geoid above ellipsoid from GPS_RAW_INT, alt_ellipsoid - alt, metres. None where alt_ellipsoid is 0, the value of
    an absent extension.
    """
    if fields.fix_type < FIX_3D or fields.alt_ellipsoid == 0:
        return None
    value = (fields.alt_ellipsoid - fields.alt) * 1e-3
    return value if abs(value) <= MOST_UNDULATION_M else None


def unix_ns(fields: Any) -> int | None:
    """UTC of SYSTEM_TIME, nanoseconds; None where the autopilot does not know it."""
    seconds = fields.time_unix_usec // 1_000_000
    return int(fields.time_unix_usec) * 1000 if UTC_FROM_S <= seconds <= UTC_UNTIL_S else None


def utc_agrees(one: tuple[int, BootNs], other: tuple[int, BootNs] | None) -> bool:
    """Whether two samples of (UTC in Unix nanoseconds, boot clock) advanced alike; not without the other one."""
    return other is not None and abs((one[0] - other[0]) - (one[1] - other[1])) <= MOST_UTC_ERROR_NS


def finite_height_m(value: float) -> float | None:
    """A plausible height, metres; None otherwise."""
    return float(value) if abs(value) <= MOST_HEIGHT_M else None


_S = sqrt(0.5)
_BEAMS: dict[int, Vector3] = {
    0: (1.0, 0.0, 0.0),
    1: (_S, _S, 0.0),
    2: (0.0, 1.0, 0.0),
    3: (-_S, _S, 0.0),
    4: (-1.0, 0.0, 0.0),
    5: (-_S, -_S, 0.0),
    6: (0.0, -1.0, 0.0),
    7: (_S, -_S, 0.0),
    24: (0.0, 0.0, -1.0),
    25: (0.0, 0.0, 1.0),
}
"""Beam directions in body FRD by MAV_SENSOR_ORIENTATION: the eight yaws, up (pitch 90) and down (pitch 270)."""
ORIENTATION_CUSTOM = 100
COVARIANCE_UNKNOWN = 255


def range_sample(fields: Any, boot_ns: BootNs) -> RangeSample | Implausible:
    """Range of DISTANCE_SENSOR, if it lies inside the sensor's limits and the beam points at least 45 degrees down."""
    if not fields.min_distance < fields.current_distance < fields.max_distance or fields.signal_quality == 1:
        return Implausible()
    beam = _beam(fields)
    if beam is None or beam[2] < _S - 1e-6:
        return Implausible()
    variance_cm2 = fields.covariance if 0 < fields.covariance < COVARIANCE_UNKNOWN else 0
    return RangeSample(boot_ns, fields.current_distance * 1e-2, beam, sqrt(variance_cm2) * 1e-2)


def _beam(fields: Any) -> Vector3 | None:
    if fields.orientation != ORIENTATION_CUSTOM:
        return _BEAMS.get(fields.orientation)
    q = unit_quaternion(fields.quaternion)
    return None if q is None else rotate(q, (1.0, 0.0, 0.0))

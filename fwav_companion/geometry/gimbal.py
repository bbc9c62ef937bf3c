"""The gimbal's attitude in NED from the quaternion and the flags of GIMBAL_DEVICE_ATTITUDE_STATUS.

The quaternion is levelled to the horizon: its roll and pitch count from the earth, so the vehicle's roll and pitch must
not be applied again. Its yaw counts from north or from the vehicle's heading, by the flags. Source: MAVLink common.xml,
message 285, and the page of the gimbal protocol.
"""

from __future__ import annotations

from enum import IntFlag
from math import cos, isfinite, sin

from fwav_companion.geometry.rotations import Quaternion, multiply, normalized, quaternion_from_matrix
from fwav_companion.geometry.vectors import Matrix3, Vector3, cross, transform


class GimbalFlags(IntFlag):
    """The flags of GIMBAL_DEVICE_FLAGS that define the zero of yaw."""

    YAW_LOCK = 16
    YAW_IN_VEHICLE_FRAME = 32
    YAW_IN_EARTH_FRAME = 64


def ned_from_gimbal(q: Quaternion, flags: int, ned_from_body: Matrix3, delta_yaw: float) -> Quaternion | None:
    """The gimbal's attitude in NED; None where the flags contradict each other or the quaternion is not a rotation.

    ``q``: quaternion as sent, (w, x, y, z). ``ned_from_body``: attitude of the vehicle at that instant, of which only
    the heading is used. ``delta_yaw``: field of the message, yaw of the vehicle frame from north, radians; not finite
    where the gimbal does not know it. It must be ignored where neither frame flag is set.
    """
    if not all(map(isfinite, q)) or not any(q):
        return None
    flags &= GimbalFlags.YAW_LOCK | GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME
    in_vehicle, in_earth = bool(flags & GimbalFlags.YAW_IN_VEHICLE_FRAME), bool(flags & GimbalFlags.YAW_IN_EARTH_FRAME)
    if in_vehicle and in_earth:
        return None
    if in_earth or (not in_vehicle and flags & GimbalFlags.YAW_LOCK):
        return normalized(q)
    if in_vehicle and isfinite(delta_yaw) and delta_yaw != 0.0:  # a sender without the field sends 0
        return normalized(multiply((cos(0.5 * delta_yaw), 0.0, 0.0, sin(0.5 * delta_yaw)), q))
    return normalized(multiply(heading_only(ned_from_body), q))


def counts_from_north(flags: int, delta_yaw: float) -> bool:
    """Whether the message alone defines the gimbal's yaw from north; else the vehicle's heading is needed."""
    if flags & GimbalFlags.YAW_IN_VEHICLE_FRAME:
        return isfinite(delta_yaw) and delta_yaw != 0.0
    return bool(flags & (GimbalFlags.YAW_IN_EARTH_FRAME | GimbalFlags.YAW_LOCK))


def heading_only(ned_from_body: Matrix3) -> Quaternion:
    """The rotation about down by the vehicle's heading: its attitude without roll and pitch."""
    forward_north, forward_east = ned_from_body[0][0], ned_from_body[1][0]
    length = (forward_north**2 + forward_east**2) ** 0.5
    if length < 1e-9:  # the nose points straight up or down: the belly defines the heading
        sign = 1.0 if ned_from_body[2][0] < 0.0 else -1.0
        forward_north, forward_east = sign * ned_from_body[0][2], sign * ned_from_body[1][2]
        length = (forward_north**2 + forward_east**2) ** 0.5
    c, s = forward_north / length, forward_east / length
    return quaternion_from_matrix(((c, -s, 0.0), (s, c, 0.0), (0.0, 0.0, 1.0)))


def heading_rate(ned_from_body: Matrix3, rates: Vector3) -> float:
    """The rate of the vehicle's heading about down, rad/s; ``rates``: angular velocity of the body, body axes."""
    nose = (ned_from_body[0][0], ned_from_body[1][0], ned_from_body[2][0])
    north, east, _ = cross(transform(ned_from_body, rates), nose)
    length2 = nose[0] ** 2 + nose[1] ** 2
    return (nose[0] * east - nose[1] * north) / length2 if length2 > 1e-6 else 0.0

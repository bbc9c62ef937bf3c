"""Reading of a gimbal's quaternion by the flags of its message, and the headings that its yaw may count from.

Source: MAVLink common.xml, message 285, and the page of the gimbal protocol. The quaternion's yaw counts from the
vehicle's heading or from north. Roll and pitch count from the horizon where the gimbal locks them; a gimbal that locks
neither, and some autopilots' servo mounts in spite of their flags, report angles from the body.
"""

from __future__ import annotations

from enum import IntFlag
from math import cos, isfinite, sin

from fwav_companion.geometry.rotations import Quaternion, multiply, normalized, quaternion_from_matrix
from fwav_companion.geometry.vectors import Matrix3, Vector3, cross, transform


class GimbalFlags(IntFlag):
    """The flags of GIMBAL_DEVICE_FLAGS that define the zeros of the angles."""

    ROLL_LOCK = 4
    PITCH_LOCK = 8
    YAW_LOCK = 16
    YAW_IN_VEHICLE_FRAME = 32
    YAW_IN_EARTH_FRAME = 64


FRAMES = GimbalFlags.YAW_IN_VEHICLE_FRAME | GimbalFlags.YAW_IN_EARTH_FRAME
LOCKS = GimbalFlags.ROLL_LOCK | GimbalFlags.PITCH_LOCK


def has_both_frames(flags: int) -> bool:
    """Whether the flags contradict each other: yaw cannot count from the vehicle's heading and from north."""
    return flags & FRAMES == FRAMES


def reported_attitude(q: Quaternion, flags: int, delta_yaw: float) -> tuple[Quaternion, bool] | None:
    """The reported attitude, and whether its yaw counts from north (else from the vehicle's heading).

    None where the flags contradict each other or the quaternion is not a rotation. ``delta_yaw``: field of the message,
    the gimbal's idea of the vehicle's heading, radians. A gimbal may count it from its own power-on direction or
    compass: so it only takes an attitude in the earth's frame back into the vehicle's, where the same error is in both,
    and never turns one in the vehicle's frame.
    """
    if not all(map(isfinite, q)) or not any(q) or has_both_frames(flags):
        return None
    heading = gimbals_heading(flags, delta_yaw)
    if flags & GimbalFlags.YAW_IN_EARTH_FRAME and heading is not None:
        return normalized(multiply((cos(0.5 * heading), 0.0, 0.0, -sin(0.5 * heading)), q)), False
    # Older devices set neither frame: they count from north while they hold the yaw.
    locked_alone = not flags & FRAMES and bool(flags & GimbalFlags.YAW_LOCK)
    return normalized(q), bool(flags & GimbalFlags.YAW_IN_EARTH_FRAME) or locked_alone


def gimbals_heading(flags: int, delta_yaw: float) -> float | None:
    """The gimbal's own idea of the vehicle's heading, radians; None where the message does not contain it.

    An older sender's message ends before the field, which is then read as exactly 0. Without a frame flag it must be
    ignored.
    """
    return delta_yaw if flags & FRAMES and isfinite(delta_yaw) and delta_yaw != 0.0 else None


def is_locked(flags: int) -> bool:
    """Whether the flags say that roll and pitch are held to the horizon, and so count from it."""
    return flags & LOCKS == LOCKS


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

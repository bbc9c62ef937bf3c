"""Gimbal messages to attitudes with the zeros of their angles, or the reason for a refusal. Pure.

GIMBAL_DEVICE_ATTITUDE_STATUS is the gimbal protocol's. MOUNT_ORIENTATION and MOUNT_STATUS are older: roll and pitch
count from the horizon, yaw from the vehicle's heading, or from north where MOUNT_ORIENTATION has yaw_absolute.
MOUNT_STATUS has no stamp; its arrival is used instead.
"""

from __future__ import annotations

from math import hypot, isfinite, radians
from typing import Any, Final

import msgspec

from fwav_companion.geometry.gimbal import GimbalFlags, gimbals_heading, has_both_frames, is_locked, reported_attitude
from fwav_companion.geometry.rotations import Quaternion, quaternion_from_euler
from fwav_companion.types import AutopilotKind, Message, Reason

MESSAGE: Final = "GIMBAL_DEVICE_ATTITUDE_STATUS"
OLDER_MESSAGES: Final = ("MOUNT_ORIENTATION", "MOUNT_STATUS")
GIMBAL_MESSAGES: Final = frozenset({MESSAGE, *OLDER_MESSAGES})
MOST_ANGLE_DEG: Final = 720.0
OLDER_TILT_SIGMA: Final = radians(3.0)
"""One sigma of roll and pitch in the older messages: most senders fill in what they command, not what the camera does,
and a servo or a gimbal under load follows to a few degrees."""


class GimbalAttitude(msgspec.Struct, frozen=True, gc=False, order=True):
    """Content of one attitude message."""

    stamp_ns: int
    """Instant of the attitude on the gimbal's clock: its stamp, less the configured delay."""
    q: Quaternion
    """Attitude as reported."""
    from_north: bool
    """Whether yaw counts from north; else from the vehicle's heading."""
    locked: bool
    """Whether the sender says that roll and pitch count from the horizon."""
    heading: float | None = None
    """The gimbal's own idea of the vehicle's heading, radians; None where it reports none."""
    tilt_sigma: float = 0.0
    """One sigma of a slow error of roll and pitch in addition to the configured one, radians."""


def read_attitude(fields: Any, stamp_ns: int) -> GimbalAttitude | Reason:
    """The attitude in GIMBAL_DEVICE_ATTITUDE_STATUS, or the reason for its refusal."""
    if has_both_frames(fields.flags):
        return Reason.GIMBAL_FLAGS
    q = (float(fields.q[0]), float(fields.q[1]), float(fields.q[2]), float(fields.q[3]))
    delta_yaw = float(fields.delta_yaw)
    reported = reported_attitude(q, fields.flags, delta_yaw) if 0.95 <= hypot(*q) <= 1.05 else None
    if reported is None:
        return Reason.NO_GIMBAL
    attitude, from_north = reported
    heading = gimbals_heading(fields.flags, delta_yaw)
    # An attitude of the earth's frame counts from the horizon, also where it was taken back into the vehicle's.
    locked = from_north or is_locked(fields.flags) or bool(fields.flags & GimbalFlags.YAW_IN_EARTH_FRAME)
    return GimbalAttitude(stamp_ns, attitude, from_north, locked, heading)


def read_older_attitude(message: Message, stamp_ns: int, kind: AutopilotKind) -> GimbalAttitude | Reason:
    """The attitude in MOUNT_ORIENTATION or MOUNT_STATUS, or the reason for its refusal.

    PX4's MOUNT_ORIENTATION is its output's setpoint after the vehicle's attitude was subtracted, not where the camera
    looks (gimbal/output.cpp).
    """
    fields = message.fields
    if message.name == "MOUNT_STATUS":  # hundredths of a degree
        angles = (fields.pointing_b / 100.0, fields.pointing_a / 100.0, fields.pointing_c / 100.0)
        from_north = False
    elif kind is AutopilotKind.PX4:
        return Reason.GIMBAL_SETPOINT
    else:
        absolute = float(getattr(fields, "yaw_absolute", 0.0))
        from_north = isfinite(absolute) and absolute != 0.0  # a sender without the field sends 0
        angles = (float(fields.roll), float(fields.pitch), absolute if from_north else float(fields.yaw))
    if not all(isfinite(angle) and abs(angle) <= MOST_ANGLE_DEG for angle in angles):
        return Reason.NO_GIMBAL
    q = quaternion_from_euler(*map(radians, angles))
    return GimbalAttitude(stamp_ns, q, from_north, locked=True, tilt_sigma=OLDER_TILT_SIGMA)

"""ODOMETRY (MAVLink 331) as the autopilot's local position, where LOCAL_POSITION_NED does not come.

Used is the estimate of the autopilot's own filter in LOCAL_NED, whose axes are those of its attitude: PX4 sends it with
velocities in LOCAL_NED, before 1.13 in BODY_FRD (src/modules/mavlink/streams/ODOMETRY.hpp). In LOCAL_FRD it passes an
external system's pose on, whose yaw has a zero of its own and for which the filter's flags do not vouch: refused.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Any

import msgspec

from fwav_companion.geometry.rotations import rotate
from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.telemetry.clock.boot_time import nearest_instant
from fwav_companion.telemetry.clock.clock import Clock
from fwav_companion.telemetry.decoding import Implausible, local_position, unit_quaternion
from fwav_companion.telemetry.world import LOCAL_FRESH_NS
from fwav_companion.types import Unpaired

LOCAL_NED, BODY_FRD, LOCAL_FRD = 1, 12, 20
"""MAV_FRAME."""
OWN_ESTIMATORS = frozenset({0, 8})
"""MAV_ESTIMATOR_TYPE: unknown, as older autopilots leave it, and the autopilot's own filter."""
FAILED = -1
"""Quality of an odometry that failed; 0: unknown, 1 to 100: percent."""
LATEST_NS = NS_PER_S
"""Largest distance of a stamp from its arrival: links delay by hundreds of milliseconds; UTC lies anywhere."""


class OdometryRefusal(StrEnum):
    """Why an ODOMETRY is not used; the name under which it is counted."""

    OTHER_YAW = "ODOMETRY (LOCAL_FRD)"
    OTHER_FRAME = "ODOMETRY (frame)"
    EXTERNAL = "ODOMETRY (estimator_type)"
    FAILED = "ODOMETRY (quality)"
    OTHER_CLOCK = "ODOMETRY (time_usec)"
    IMPLAUSIBLE = "ODOMETRY"


class OdometryPosition(msgspec.Struct, frozen=True, gc=False):
    """The autopilot's local position by an ODOMETRY."""

    boot_ns: BootNs
    place: Vector3
    """Place in the autopilot's local frame, NED, metres."""
    velocity_ned: Vector3
    is_reset: bool
    """Whether the filter was reset since the last ODOMETRY."""


class OdometryReader:
    """Reads ODOMETRY where it is needed, and compares its reset counters."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._local_ned_ns: HostNs | None = None
        """Arrival of the newest LOCAL_POSITION_NED."""
        self._reset_counter: int | None = None

    def on_local_position(self, now: HostNs) -> None:
        """Take the arrival of a LOCAL_POSITION_NED, which is preferred."""
        self._local_ned_ns = now

    def read(self, fields: Any, now: HostNs) -> OdometryPosition | OdometryRefusal | None:
        """The position of an ODOMETRY that arrived now; None where LOCAL_POSITION_NED comes, and while the clock
        is not known.
        """
        if self._local_ned_ns is not None and now - self._local_ned_ns <= LOCAL_FRESH_NS:
            return None
        refusal = _refusal(fields)
        if refusal is not None:
            return refusal
        arrival_ns = self._clock.boot_from_host(now)
        if isinstance(arrival_ns, Unpaired):
            return None
        boot_ns = BootNs(nearest_instant(int(fields.time_usec) * 1000, arrival_ns))
        if abs(boot_ns - arrival_ns) > LATEST_NS:
            return OdometryRefusal.OTHER_CLOCK
        velocity = (float(fields.vx), float(fields.vy), float(fields.vz))
        if fields.child_frame_id == BODY_FRD:
            ned_from_body = unit_quaternion(fields.q)
            if ned_from_body is None:
                return OdometryRefusal.IMPLAUSIBLE
            velocity = rotate(ned_from_body, velocity)
        moving = local_position((fields.x, fields.y, fields.z), velocity)
        if isinstance(moving, Implausible):
            return OdometryRefusal.IMPLAUSIBLE
        before, self._reset_counter = self._reset_counter, fields.reset_counter
        return OdometryPosition(boot_ns, *moving, is_reset=before is not None and before != fields.reset_counter)


def _refusal(fields: Any) -> OdometryRefusal | None:
    """Why this estimate is not the autopilot's local position; None where it is."""
    if fields.frame_id == LOCAL_FRD:
        return OdometryRefusal.OTHER_YAW
    if fields.frame_id != LOCAL_NED or fields.child_frame_id not in (LOCAL_NED, BODY_FRD):
        return OdometryRefusal.OTHER_FRAME
    if fields.estimator_type not in OWN_ESTIMATORS:
        return OdometryRefusal.EXTERNAL
    return OdometryRefusal.FAILED if fields.quality == FAILED else None

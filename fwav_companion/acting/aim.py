"""The target to act on, predicted to an instant. Pure."""

from __future__ import annotations

from math import asin, atan2, cos, pi
from typing import Final

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.geometry.vectors import Vector3, add, norm, scale, subtract
from fwav_companion.types.situation import Situation
from fwav_companion.types.telemetry import GimbalAt, VehicleState
from fwav_companion.types.tracks import Track

MOST_AHEAD_NS: Final = 2 * NS_PER_S
"""Longest prediction of a target by its velocity: beyond it nothing was seen or looked for, and the place is held."""


class Angles(msgspec.Struct, frozen=True):
    """Where something looks: pitch from the horizon, up positive, and yaw, radians."""

    pitch: float
    yaw: float


def wrapped(angle: float) -> float:
    """The angle in [-pi, pi)."""
    return (angle + pi) % (2.0 * pi) - pi


def angle_between(one: Angles, other: Angles) -> float:
    """The larger difference of pitch and of yaw as it moves the axis, radians: straight down yaw moves nothing."""
    return max(abs(one.pitch - other.pitch), abs(wrapped(one.yaw - other.yaw)) * cos(one.pitch))


def target_ned(track: Track, at: HostNs) -> Vector3:
    """Position of the target at an instant, local NED, metres."""
    return moved(track.position_ned, track.velocity_ned, _ahead_s(track, at))


def from_vehicle_ned(track: Track, state: VehicleState, state_ns: HostNs, at: HostNs) -> Vector3 | None:
    """The target minus the vehicle at an instant, NED, metres; None without a position of the vehicle."""
    if state.position_ned is None:
        return None
    vehicle = moved(state.position_ned, state.velocity_ned, (at - state_ns) * 1e-9)
    return subtract(seen_target_ned(track, at), vehicle)


def seen_target_ned(track: Track, at: HostNs) -> Vector3:
    """Position of the target at an instant in the frame of the vehicle's own reports, NED, metres."""
    return moved(track.apparent_ned, track.velocity_ned, _ahead_s(track, at))


def _ahead_s(track: Track, at: HostNs) -> float:
    return min(at - track.host_ns, MOST_AHEAD_NS) * 1e-9


def direction(ned: Vector3) -> Angles:
    """Pitch and yaw from north of a direction."""
    return Angles(asin(max(-1.0, min(1.0, -ned[2] / max(norm(ned), 1e-9)))), atan2(ned[1], ned[0]))


def heading(state: VehicleState) -> float:
    """The vehicle's heading, radians."""
    ned_from_body = matrix_from_quaternion(state.ned_from_body)
    return atan2(ned_from_body[1][0], ned_from_body[0][0])


def measured_look(situation: Situation) -> Angles | None:
    """Where the gimbal looks by its own report, yaw from the vehicle's heading; None while it is not known."""
    state = situation.recent_vehicle
    if state is None or not isinstance(state.gimbal, GimbalAt):
        return None
    axis = matrix_from_quaternion(state.gimbal.ned_from_gimbal)
    looks = direction((axis[0][0], axis[1][0], axis[2][0]))
    return Angles(looks.pitch, wrapped(looks.yaw - heading(state)))


def moved(place: Vector3, velocity: Vector3 | None, seconds: float) -> Vector3:
    """The place after some seconds at this velocity; None: it stands."""
    return place if velocity is None else add(place, scale(velocity, seconds))

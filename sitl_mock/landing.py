"""Consumers of LANDING_TARGET: old ArduPilot, new ArduPilot, PX4. Each accepts a message or names the reason for
refusal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import cos, isfinite, sin, tan
from typing import Any

from sitl_mock.earth import LocalProjection, World
from sitl_mock.flight import State
from sitl_mock.rotation import Matrix, Vector, apply, norm, plus

LOCAL_NED, BODY_FRD, LOCAL_FRD = 1, 12, 20


@dataclass(frozen=True)
class Situation:
    """True situation of the vehicle when a message arrives."""

    lagged: State
    """State PLND_LAG earlier: ArduPilot pairs a measurement with it."""
    now: State
    height_m: float
    """Height above the ground, by the rangefinder and the tilt, metres."""
    projection: LocalProjection
    world: World


@dataclass(frozen=True)
class Landing:
    """Result of one message: a target position in the world's NED, or the reason for refusal."""

    reason: str
    """Reason for refusal; empty: accepted."""
    position: Vector | None = None


Consumer = Callable[[dict[str, Any], Situation], Landing]


def ardupilot_old(fields: dict[str, Any], situation: Situation) -> Landing:
    """ArduPilot before 4.7: the frame is evaluated only where position_valid is set."""
    if fields["position_valid"] == 1 and fields["frame"] != BODY_FRD:
        return Landing("frame_not_supported")
    return _ardupilot(fields, situation, _from_body)


def ardupilot_new(fields: dict[str, Any], situation: Situation) -> Landing:
    """ArduPilot from 4.7: the frame is checked first, for angles too; LOCAL_FRD has the yaw's sign wrong."""
    if fields["frame"] not in (BODY_FRD, LOCAL_FRD):
        return Landing("frame_not_supported")
    rotate = _from_body if fields["frame"] == BODY_FRD else _yawed_backwards
    return _ardupilot(fields, situation, rotate)


def px4(fields: dict[str, Any], situation: Situation) -> Landing:
    """PX4: LOCAL_NED from its local origin; angles are read as tangents, at the attitude of the arrival."""
    if fields["position_valid"]:
        local = (fields["x"], fields["y"], fields["z"])
        if fields["frame"] != LOCAL_NED:
            return Landing("frame_not_local_ned")
        if not _finite(*local):
            return Landing("not_finite")
        return Landing("", situation.world.ned(situation.projection.place(local)))
    angles = (fields["angle_x"], fields["angle_y"])
    if not _finite(*angles):
        return Landing("not_finite")
    ray = apply(situation.now.ned_from_body, (-angles[1], angles[0], 1.0))
    return _along(ray, 0.0, situation.now, situation)


CONSUMERS: dict[str, Consumer] = {"ardupilot_old": ardupilot_old, "ardupilot_new": ardupilot_new, "px4": px4}


def _ardupilot(fields: dict[str, Any], situation: Situation, rotate: Callable[[State, Vector], Vector]) -> Landing:
    state, distance = situation.lagged, fields["distance"]
    if not isfinite(distance):
        return Landing("not_finite")
    if fields["position_valid"] == 1:
        vector = (fields["x"], fields["y"], fields["z"])
        if not _finite(*vector):
            return Landing("not_finite")
        if distance <= 0.0:
            return Landing("distance_not_positive")
        # ArduPilot divides by the distance and multiplies by it again: a distance that differs from the norm does harm
        # elsewhere, not here.
        return Landing("", plus(state.position, rotate(state, vector)))
    angles = (fields["angle_x"], fields["angle_y"])
    if not _finite(*angles):
        return Landing("not_finite")
    ray = rotate(state, (-tan(angles[1]), tan(angles[0]), 1.0))
    return _along(ray, distance, state, situation)


def _along(ray: Vector, distance: float, state: State, situation: Situation) -> Landing:
    """End of a line of sight: at the reported distance, or on the ground by the rangefinder's height."""
    length = norm(ray)
    unit = (ray[0] / length, ray[1] / length, ray[2] / length)
    if unit[2] <= 1e-3:
        return Landing("line_of_sight_not_downward")
    if distance <= 0.0:
        distance = situation.height_m / unit[2]
    return Landing("", plus(state.position, (unit[0] * distance, unit[1] * distance, unit[2] * distance)))


def _from_body(state: State, vector: Vector) -> Vector:
    return apply(state.ned_from_body, vector)


def _yawed_backwards(state: State, vector: Vector) -> Vector:
    """Vector in NED from LOCAL_FRD as ArduPilot released it: turned by -yaw in place of +yaw."""
    yaw = -state.euler[2]
    turned: Matrix = ((cos(yaw), -sin(yaw), 0.0), (sin(yaw), cos(yaw), 0.0), (0.0, 0.0, 1.0))
    return apply(turned, vector)


def _finite(*values: float) -> bool:
    return all(isfinite(value) for value in values)

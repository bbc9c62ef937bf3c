"""Who consumes LANDING_TARGET, and how: old ArduPilot, new ArduPilot, PX4. Each accepts or says why not."""

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
    """The vehicle when a message arrives, as it truly is."""

    lagged: State
    """PLND_LAG ago: what ArduPilot pairs a measurement with."""
    now: State
    height_m: float
    """Above the ground, by the rangefinder and the tilt."""
    projection: LocalProjection
    world: World


@dataclass(frozen=True)
class Landing:
    """What a consumer made of one message: a target in the world's NED, or why there is none."""

    reason: str
    """Empty: accepted."""
    position: Vector | None = None


Consumer = Callable[[dict[str, Any], Situation], Landing]


def ardupilot_old(fields: dict[str, Any], situation: Situation) -> Landing:
    """ArduPilot before 4.7: the frame counts only where the position is valid."""
    if fields["position_valid"] == 1 and fields["frame"] != BODY_FRD:
        return Landing("frame_not_supported")
    return _ardupilot(fields, situation, _from_body)


def ardupilot_new(fields: dict[str, Any], situation: Situation) -> Landing:
    """ArduPilot from 4.7: the frame is looked at first, for angles too; LOCAL_FRD has the yaw's sign wrong."""
    if fields["frame"] not in (BODY_FRD, LOCAL_FRD):
        return Landing("frame_not_supported")
    rotate = _from_body if fields["frame"] == BODY_FRD else _yawed_backwards
    return _ardupilot(fields, situation, rotate)


def px4(fields: dict[str, Any], situation: Situation) -> Landing:
    """PX4: LOCAL_NED from its local origin; angles are taken as tangents, at the attitude of the arrival."""
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
        # It divides by the distance and multiplies by it again: a distance that is not the norm hurts elsewhere.
        return Landing("", plus(state.position, rotate(state, vector)))
    angles = (fields["angle_x"], fields["angle_y"])
    if not _finite(*angles):
        return Landing("not_finite")
    ray = rotate(state, (-tan(angles[1]), tan(angles[0]), 1.0))
    return _along(ray, distance, state, situation)


def _along(ray: Vector, distance: float, state: State, situation: Situation) -> Landing:
    """A line of sight, ended by a told distance or by the height of the rangefinder."""
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
    """LOCAL_FRD as it shipped: turned by -yaw where +yaw was meant."""
    yaw = -state.euler[2]
    turned: Matrix = ((cos(yaw), -sin(yaw), 0.0), (sin(yaw), cos(yaw), 0.0), (0.0, 0.0, 1.0))
    return apply(turned, vector)


def _finite(*values: float) -> bool:
    return all(isfinite(value) for value in values)

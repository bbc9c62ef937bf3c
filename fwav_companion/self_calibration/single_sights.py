"""Single sights of what stands, and how well they meet in one place under any mount of the camera."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot, inf, sqrt
from statistics import median

import msgspec

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.geometry.vectors import ZERO3, Matrix3, Vector3, add, subtract, transform
from fwav_companion.self_calibration.delayed_poses import VehiclePose
from fwav_companion.types import GroundFix

LEAST_DOWN = 0.05
"""Of a unit ray: 3 degrees below the horizon; what is shallower meets the ground anywhere."""


class SingleSight(msgspec.Struct, frozen=True, gc=False):
    """What a single fix saw, without the mount."""

    host_ns: HostNs
    delay_s: float
    """That the next were taken at."""
    label: str
    ray: Vector3
    """Unit, in the camera."""
    body_from_camera: Matrix3
    """As configured; of a camera on a gimbal, in its axes, and so is the next."""
    ned_from_body: Matrix3
    camera_ned: Vector3
    drop_m: float
    """From the camera down to the target's ground."""


class CommonPoint(msgspec.Struct, frozen=True, gc=False):
    """Where sights meet under a mount, and how well."""

    body_from_camera: Matrix3
    """The mount; one that mirrors, too."""
    spread: float
    """Median angle between a sight and the place, rad; infinite where half of them miss the ground."""
    north: float = 0.0
    east: float = 0.0


def sight_of(fix: GroundFix, stood: VehiclePose) -> SingleSight:
    """What is kept of a fix; ``stood``: how the vehicle stood at its capture."""
    sighting = fix.sighting
    nominal = sighting.state
    moved = subtract(stood.position_ned, nominal.position_ned) if nominal.position_ned is not None else ZERO3
    return SingleSight(
        sighting.frame_host_ns,
        stood.delay_s,
        sighting.detection.label,
        sighting.ray.direction,
        sighting.body_from_camera,
        matrix_from_quaternion(stood.ned_from_body),
        add(sighting.camera_ned, moved),
        fix.position_ned[2] - sighting.camera_ned[2] - moved[2],
    )


def meeting(sights: Sequence[SingleSight], body_from_camera: Matrix3) -> CommonPoint:
    """Of sights under this mount. In angles: seen from afar, or steeply, all places lie close."""
    directions = _directions(sights, body_from_camera)
    points = [
        (s.camera_ned[0] + n * s.drop_m / d, s.camera_ned[1] + e * s.drop_m / d)
        for s, (n, e, d) in zip(sights, directions, strict=True)
        if d > LEAST_DOWN
    ]
    if 2 * len(points) < len(sights):
        return CommonPoint(body_from_camera, inf)
    north, east = median([n for n, _ in points]), median([e for _, e in points])
    return CommonPoint(body_from_camera, _apart(sights, directions, north, east), north, east)


def missed(sights: Sequence[SingleSight], there: CommonPoint) -> float:
    """Median angle between other sights, under the same mount, and where those before met, rad."""
    return _apart(sights, _directions(sights, there.body_from_camera), there.north, there.east)


def misplaced_m(sights: Sequence[SingleSight], there: CommonPoint) -> float:
    """How far from where they meet the sights lie as configured, median, metres."""
    return median(
        [
            hypot(s.camera_ned[0] + n * s.drop_m / d - there.north, s.camera_ned[1] + e * s.drop_m / d - there.east)
            for s in sights
            for n, e, d in _directions([s], s.body_from_camera)
            if d > LEAST_DOWN
        ]
        or [0.0]
    )


def _directions(sights: Sequence[SingleSight], body_from_camera: Matrix3) -> list[Vector3]:
    return [transform(s.ned_from_body, transform(body_from_camera, s.ray)) for s in sights]


def _apart(sights: Sequence[SingleSight], directions: Sequence[Vector3], north: float, east: float) -> float:
    apart = []
    for s, (n, e, d) in zip(sights, directions, strict=True):
        to_n, to_e = north - s.camera_ned[0], east - s.camera_ned[1]
        near = 1.0 / sqrt(to_n * to_n + to_e * to_e + s.drop_m * s.drop_m)
        apart.append((n - near * to_n) ** 2 + (e - near * to_e) ** 2 + (d - near * s.drop_m) ** 2)
    return sqrt(median(apart))

"""Fixes with the rotations taken out that landmarks have shown: exact where a linear correction is not.

At 60 degrees off the nadir a rotation of 1.5 degrees moves a fix from 12 m by 1.3 m, and a linear correction leaves
6 cm of it, the same in every fix.
"""

from __future__ import annotations

from math import hypot

from fwav_companion.geometry.rotations import exp, matrix_from_quaternion, rotate
from fwav_companion.geometry.vectors import Vector3, add, scale, transform
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import Bias, GroundFix

LEAST_DESCENT = 0.05
"""Down component of a turned ray, below which the fix is left as it is: 3 degrees below the horizon."""


def rotation_error(model: SharedErrors, fix: GroundFix, mean: Array) -> Vector3:
    """The rotation vector of the ray's error by the estimated biases, NED, radians."""
    sighting = fix.sighting
    late_s = model.value(mean, Bias.TIME_OFFSET) + sighting.row_fraction * model.value(mean, Bias.READOUT)
    p, q, r = sighting.state.carrier_rates
    in_body = (
        model.value(mean, Bias.ROLL) - model.value(mean, Bias.MOUNT_X) + late_s * p,
        model.value(mean, Bias.PITCH) - model.value(mean, Bias.MOUNT_Y) + late_s * q,
        late_s * r - model.value(mean, Bias.MOUNT_Z),
    )
    ned = transform(matrix_from_quaternion(sighting.state.ned_from_carrier), in_body)
    return add(ned, (0.0, 0.0, model.value(mean, Bias.HEADING)))


def turned_point(fix: GroundFix, turn_ned: Vector3, height_m: float) -> tuple[float, float]:
    """Where the ray, turned, meets the level ``height_m`` below the camera: north and east, metres."""
    sighting = fix.sighting
    direction = transform(sighting.ned_from_camera, sighting.ray.direction)
    turned = rotate(exp(turn_ned), direction) if hypot(*turn_ned) > 0.0 else direction
    if turned[2] < LEAST_DESCENT:
        turned = direction
    north, east, _ = scale(turned, height_m / turned[2])
    return sighting.camera_ned[0] + north, sighting.camera_ned[1] + east

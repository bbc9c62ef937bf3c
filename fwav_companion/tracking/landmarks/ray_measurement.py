"""A sight as a measurement of the direction to a point, linear in the shared errors and in the point.

An error that turns the ray changes the direction alike at every distance. An error of the camera's place changes it by
the part of the error across the ray, over the distance. On the ground both effects grow with the height and the tilt of
the single sight, which hold the noise of the telemetry. Over an orbit with 0.3 m of height noise, the product of that
noise with the noise of the same sight drew the estimated height by 1.1 m at a claimed accuracy of 0.1 m.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.geometry.rotations import exp, matrix_from_quaternion
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, norm, scale, subtract, transform
from fwav_companion.self_calibration.arrays import Array, skew
from fwav_companion.tracking.filters.consider_biases import SENSITIVITY_STEP_S
from fwav_companion.tracking.landmarks.delayed_sighting import DelayedSighting
from fwav_companion.tracking.landmarks.joint_place import Correction
from fwav_companion.tracking.landmarks.state_vector import SharedErrors
from fwav_companion.types import GroundFix, Sighting

SMOOTHING_S = 3.0
"""Time constant of the camera's smoothed path, seconds. Between 3 and 30 s, targets near a landmark are equally
accurate; at 0.3 s, a height noise of 0.3 m leaves 0.17 m in the sensitivities."""
START_S = 0.3
"""Weight of the first position in the path, seconds."""
STALE_S = 1.5
"""Interval of frames beyond which the path begins again, seconds: such frames are few, and share no noise."""
FARTHEST_M = 5.0
"""Distance from the smoothed path beyond which the reported position has jumped, metres."""
SENSITIVITY_SHARE = 0.03
"""Relative error of the sensitivities, one sigma: the smoothed path is 0.1 to 0.3 m off at 12 m. Median errors of a
target 5 m from one landmark after 45 s, over 16 orbits, eights and hovers: 0.111, 0.093 and 0.207 m with 0.01, at mean
normalised squares of 2.7, 2.1 and 2.5 (2 if consistent); 0.116, 0.090 and 0.178 m with 0.035, at 2.6, 1.9 and 2.0.
By rates, without the pose at the estimated delay, 0.07 was needed: 0.121, 0.110 and 0.207 m at 2.5, 2.1 and 2.0."""
LEAST_DISTANCE_M = 0.3
"""Least distance at which sensitivities are taken, metres."""


class CameraPath(msgspec.Struct, frozen=True, gc=False):
    """Smoothed path of the camera: predicted by reported velocities, corrected by reported positions."""

    camera_ned: Vector3
    """Smoothed camera position in NED after the frames so far, metres."""
    shift: Vector3
    """Predicted minus reported camera position, NED, metres. The predicted one is free of this frame's noise."""
    at_ns: HostNs
    age_s: float = 0.0

    def after(self, sighting: Sighting) -> CameraPath:
        """The path at a later frame."""
        since_s, reported = s_from_ns(sighting.frame_host_ns - self.at_ns), sighting.camera_ned
        if since_s > STALE_S or sighting.state.velocity_ned is None:
            return first_path(sighting)
        predicted = add(self.camera_ned, scale(sighting.state.velocity_ned, since_s))
        shift, age_s = subtract(predicted, reported), self.age_s + since_s
        if norm(shift) > FARTHEST_M:
            return first_path(sighting)
        share = min(1.0, since_s / min(SMOOTHING_S, age_s + START_S))
        return CameraPath(subtract(predicted, scale(shift, share)), shift, sighting.frame_host_ns, age_s)


def first_path(sighting: Sighting) -> CameraPath:
    """The path that begins at the position of this sighting."""
    return CameraPath(sighting.camera_ned, ZERO3, sighting.frame_host_ns)


class RayMeasurement(msgspec.Struct, frozen=True):
    """A sight as a measurement of a direction, linearized at an estimate."""

    innovation: Array
    """(2) measured minus expected direction, across the ray."""
    rows: Array
    """(2, size) d(direction)/d(shared errors)."""
    by_point: Array
    """(2, 3) d(direction)/d(point), 1/m."""
    noise: Array
    """(2, 2)"""

    def correction(self, rows: Array, mean: Array) -> Correction:
        """The linear measurement of the states ``mean``. ``rows``: its sensitivities to these states."""
        return Correction(self.innovation + rows @ mean, rows, self.noise)


def ray_measurement(
    model: SharedErrors,
    fix: GroundFix,
    mean: Array,
    *,
    pose: DelayedSighting,
    point: Vector3,
    too_high_m: float,
    shift: Vector3,
    since_s: float,
) -> RayMeasurement:
    """The direction of a sight against the direction to ``point``, by the mean of the shared errors.

    ``pose``: the sight with its pose. ``too_high_m``: reported minus true height of the camera above the point.
    ``shift``: from the reported position to the position at which the sensitivities are taken. ``since_s``: time since
    the last sight of the same landmark or target.
    """
    sighting = pose.sighting
    ray = np.array(transform(sighting.ned_from_camera, sighting.ray.direction))
    turn = model.rotation(sighting, mean, pose.late_s)
    off_n, off_e, off_d = model.displacement(sighting, mean, pose.late_s)
    offset = subtract(point, sighting.camera_ned)
    to_point = (offset[0] + off_n, offset[1] + off_e, offset[2] + off_d - too_high_m)
    turned = np.array(matrix_from_quaternion(exp(turn)))
    expected = turned @ to_point / max(norm(to_point), LEAST_DISTANCE_M)
    smooth = turned @ subtract(to_point, shift)
    distance_m = max(float(np.linalg.norm(smooth)), LEAST_DISTANCE_M)
    across = _across(ray)
    by_point = across @ (np.eye(3) - np.outer(smooth, smooth) / distance_m**2) @ turned / distance_m
    rows = model.direction_rows(sighting, -across @ skew(smooth / distance_m), by_point)
    noise = _noise(model, fix, across, since_s) + _bend(model, rows, since_s)
    return RayMeasurement(across @ (ray - expected), rows, by_point, noise)


def _noise(model: SharedErrors, fix: GroundFix, across: Array, since_s: float) -> Array:
    """The covariance of a fix on the ground as that of its direction, where the fix itself is: neither favours far
    sights.
    """
    to_fix = np.array(subtract(fix.position_ned, fix.sighting.camera_ned))
    distance_m = max(float(np.linalg.norm(to_fix)), LEAST_DISTANCE_M)
    by_fix = across[:, :2] / distance_m
    noise = np.array(model.errors.decorrelated(fix, since_s).noise)[:2, :2]
    return np.asarray(by_fix @ noise @ by_fix.T)


def _bend(model: SharedErrors, rows: Array, since_s: float) -> Array:
    """The covariance by the error of the sensitivities."""
    bent = rows[:, model.bent]
    share2 = SENSITIVITY_SHARE**2 * max(1.0, SENSITIVITY_STEP_S / since_s)
    return np.asarray(share2 * (bent * model.bent_variances) @ bent.T)


def _across(ray: Array) -> Array:
    """(2, 3) two unit vectors across a unit ray."""
    first = np.cross(ray, (0.0, 0.0, 1.0) if abs(ray[2]) < 0.9 else (1.0, 0.0, 0.0))
    first /= np.linalg.norm(first)
    return np.stack((first, np.cross(ray, first)))

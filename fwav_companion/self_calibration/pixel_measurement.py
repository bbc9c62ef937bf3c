"""Measurement model: predicts the two pixels of a sighting from its target and from the shared parameters.

The prediction is exact geometry. The residual is in pixels through the lens's own derivatives, and every row is
d(predicted pixel)/d(parameter). Rays instead of ground points keep the noise at its origin: a pixel of a shallow ray is
as accurate as any other, only its point on the ground is not.

Leading axes are hypotheses, then the N measurements of one batch. No entry depends on the others.
"""

from __future__ import annotations

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import (
    EYE,
    Array,
    Mask,
    cross,
    dot,
    rotation,
    skew,
    times,
    turned,
    turned_back,
)
from fwav_companion.self_calibration.calibration_report import SharedParameter
from fwav_companion.self_calibration.delayed_poses import DelayedPoses
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.position_path import TELEMETRY_STEP_S
from fwav_companion.types import ErrorPriors

SHARED_COUNT = len(SharedParameter)
ROW_COUNT = SHARED_COUNT + 2
DELAY, _, _, _, HEADING, HEIGHT, READOUT, POSITION_DELAY = map(int, [*SharedParameter][:8])
NORTH, EAST = SHARED_COUNT, SHARED_COUNT + 1
"""Columns of a row for the apparent place: they hold for the target and for the vehicle's position error alike."""
LEVER = slice(int(SharedParameter.LEVER_X), int(SharedParameter.LEVER_Z) + 1)
MOUNT = slice(int(SharedParameter.MOUNT_X), int(SharedParameter.MOUNT_Z) + 1)
NOISY = [DELAY, 1, 2, 3, HEIGHT, NORTH, EAST]
"""Columns that also propagate measurement noise: time, attitude about three axes, height, position."""
LEAST_COSINE = 0.01
"""Least cosine between a ray and its prediction: 89.4 degrees. Rows grow with the square of its inverse. Nearer to a
right angle they exceed the pixel's own noise by more than a double resolves."""
LEAST_DOWN = 0.02
"""Least down component of a unit ray that meets the ground: 1.1 degrees below the horizon."""


class CameraPose(msgspec.Struct, frozen=True):
    """Poses of the camera at each measurement (..., N), for given values of the shared parameters."""

    poses: DelayedPoses
    """Poses of the vehicle."""
    mounted: Array
    """(..., 1, 3, 3), correction of the mount."""
    ned_from_mounted: Array
    """(..., N, 3, 3), attitude of the mounted camera, by the true heading."""
    camera: Array
    """(..., N, 3), camera position: reported north and east, and height above the target's ground, m."""
    velocity_ned: Array
    """(..., N, 3), velocity of the camera, which swings about the vehicle's reference point, m/s."""

    def ground_points(self, ray: Array) -> tuple[Array, Mask]:
        """(..., N, 2) north and east where rays of the mounted camera meet the ground, and whether they do."""
        direction = turned(self.ned_from_mounted, ray)
        down = direction[..., 2] > LEAST_DOWN
        reach = self.camera[..., 2] / np.where(down, direction[..., 2], 1.0)
        return self.camera[..., :2] + reach[..., None] * direction[..., :2], down


def camera_pose(batch: MeasurementBatch, shared: Array) -> CameraPose:
    """The camera poses for values (..., 11) of the shared parameters, as if the reported position were right."""
    value = shared[..., None, :]
    poses = batch.poses.at(value[..., DELAY] - value[..., READOUT] * batch.row_fraction)
    turns = np.zeros((*shared.shape[:-1], 2, 3))
    turns[..., 0, :], turns[..., 1, 2] = shared[..., MOUNT], -shared[..., HEADING]
    rotations = rotation(turns)
    mounted, turned_heading = rotations[..., :1, :, :], rotations[..., 1:, :, :]
    lever = batch.lever - value[..., LEVER]
    place = poses.position_ned + poses.velocity_ned * value[..., POSITION_DELAY, None]
    place += turned(poses.ned_from_body, lever)
    place[..., 2] = batch.drop_m + batch.camera_down - place[..., 2] - value[..., HEIGHT]
    return CameraPose(
        poses=poses,
        mounted=mounted,
        ned_from_mounted=times(times(turned_heading, poses.ned_from_body), mounted),
        camera=place,
        velocity_ned=poses.velocity_ned + turned(poses.ned_from_body, cross(poses.rates, lever)),
    )


class PredictedPixels(msgspec.Struct, frozen=True):
    """Pixel residuals, measured minus predicted, and the rows of their predictions."""

    residual: Array
    """(..., N, 2), px; zero where invalid, and so are the rows."""
    rows: Array
    """(..., N, 2, 13): by each shared parameter, then by north and east of the apparent place."""
    valid: Mask
    """(..., N): the target lies within 89.4 degrees of the ray."""


class PixelInnovations(msgspec.Struct, frozen=True):
    """Innovations of one batch under each hypothesis (B) of a joint estimate with n states."""

    difference: Array
    """(B, 2N), measured minus predicted, px; u and v alternate, as in every axis of 2N."""
    crossed: Array
    """(B, 2N, n): H P, with the rows H and the covariance P of the state."""
    cov: Array
    """(B, 2N, 2N): S, covariance of the innovations, px^2."""
    common: Array
    """(B, N, 2, 7), square roots of the noise covariance that the measurements of one frame have in common, px."""
    nis: Array
    """(B, N), normalised innovation squared of each measurement alone; inf where the measurement is impossible."""
    determinant: Array
    """(B, N), determinant of S of each measurement alone, px^4."""
    displaced: float
    """Largest angle by which the mean predicts a measurement better than the linearization point does, rad."""
    valid: Mask
    """(B, N), whether the measurement is possible."""


def predict(batch: MeasurementBatch, targets: Array, shared: Array) -> PredictedPixels:
    """The predicted pixels of apparent places (..., N, 2), linearized about shared parameters (..., 11).

    In the frame of the mounted camera, with M its attitude, x the target from the camera and d the measured ray:
    residual = -dual . x / (d . x), and d(pixel) = (dual - residual' d) . dx / (d . x).
    """
    pose = camera_pose(batch, shared)
    there = np.zeros((*targets.shape[:-1], 4, 3))
    there[..., 0, :2], there[..., 0, 2] = targets - pose.camera[..., :2], pose.camera[..., 2]
    there[..., 1, :], there[..., 2, :] = pose.velocity_ned, pose.poses.velocity_ned
    there[..., 3, 0], there[..., 3, 1] = -there[..., 0, 1], there[..., 0, 0]  # turned by a right angle about down
    seen_of = times(there, pose.ned_from_mounted)
    offset, inverse, valid = _offsets(batch, seen_of[..., 0, :])
    by_seen = (batch.dual - offset[..., None] * batch.ray[..., None, :]) * inverse[..., None]
    rows = times(by_seen, _columns(batch, shared, pose, seen_of))
    return PredictedPixels(-offset, rows, valid)


def _offsets(batch: MeasurementBatch, seen: Array) -> tuple[Array, Array, Mask]:
    """Predicted minus measured pixels (..., N, 2) of targets at ``seen`` (..., N, 3) in camera axes, the inverse of
    their depth (..., N, 1), and whether they lie within 89.4 degrees of the ray.
    """
    depth = dot(seen, batch.ray)
    valid = depth > LEAST_COSINE * np.sqrt(dot(seen, seen))
    inverse = (valid / np.where(valid, depth, 1.0))[..., None]
    return turned(batch.dual, seen) * inverse, inverse, valid


def distances(batch: MeasurementBatch, places: Array, shared: Array) -> Array:
    """(T, N) pixels between measurements and the predictions of apparent places (T, 2) by shared parameters (11)."""
    pose = camera_pose(batch, shared)
    there = np.empty((len(places), len(batch.tracks), 3))
    there[..., :2], there[..., 2] = places[:, None] - pose.camera[:, :2], pose.camera[:, 2]
    offset, _, valid = _offsets(batch, turned_back(pose.ned_from_mounted, there))
    return np.where(valid, np.hypot(offset[..., 0], offset[..., 1]), np.inf)


def _columns(batch: MeasurementBatch, shared: Array, pose: CameraPose, seen_of: Array) -> Array:
    """(..., N, 3, 13) derivative of the target's position in camera axes by each parameter, then by north and east.

    ``seen_of`` (..., N, 4, 3), camera axes: the target, both velocities, and the target turned by a right angle.
    """
    axes, crossed = pose.ned_from_mounted, skew(seen_of[..., 0, :])
    columns = np.empty((*seen_of.shape[:-2], 3, ROW_COUNT))
    columns[..., DELAY] = turned_back(crossed, turned_back(pose.mounted, pose.poses.rates)) + seen_of[..., 1, :]
    # A step of the rotation vector is not quite a rotation: this holds to first order in the correction itself.
    columns[..., MOUNT] = times(crossed, EYE - 0.5 * skew(shared[..., None, MOUNT]))
    columns[..., HEADING] = seen_of[..., 3, :]
    columns[..., HEIGHT] = -axes[..., 2, :]
    columns[..., READOUT] = -batch.row_fraction[:, None] * columns[..., DELAY]
    columns[..., POSITION_DELAY] = -seen_of[..., 2, :]
    columns[..., LEVER] = times(axes.swapaxes(-1, -2), pose.poses.ned_from_body)
    columns[..., NORTH:] = axes[..., :2, :].swapaxes(-1, -2)
    return columns


def common_noise(batch: MeasurementBatch, rows: Array, priors: ErrorPriors) -> Array:
    """(..., N, 2, 7) square roots of the noise covariance that the measurements of one frame have in common, px.

    The whole noise covariance is common @ common' plus pixel_sigma^2 on the diagonal.
    """
    since_s = batch.since_s
    least_s = np.maximum(np.where(since_s > 0.0, since_s, np.inf), 1e-3)
    repeated, attitudes = _repeated(TELEMETRY_STEP_S, least_s), _repeated(batch.attitude_spacing_s, least_s)
    variances = np.empty((len(batch.tracks), 1, len(NOISY)))
    variances[:, 0, 0] = batch.time_noise_s**2
    variances[:, 0, 1:4] = (priors.attitude_noise**2 * attitudes + batch.attitude_sigma**2)[:, None]
    variances[:, 0, 4] = priors.height_noise_m**2 * repeated
    variances[:, 0, 5:] = (priors.position_noise_m**2 * repeated)[:, None]
    return np.asarray(rows[..., NOISY] * np.sqrt(variances))


def _repeated(step_s: float | Array, since_s: Array) -> Array:
    """Number of measurements that share one sample of telemetry, which comes every ``step_s``."""
    return np.maximum(1.0, step_s / since_s)

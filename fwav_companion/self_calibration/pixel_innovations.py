"""The innovations of a batch: measured pixels minus the pixels that the joint estimate predicts."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.joint_filter import JointFilter
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.pixel_measurement import (
    SHARED_COUNT,
    PixelInnovations,
    PredictedPixels,
    common_noise,
    predict,
)

LEAST_DETERMINANT = 1e-300
"""Substitute for a determinant that rounding left not positive, px^4."""


def innovations(joint: JointFilter, batch: MeasurementBatch) -> PixelInnovations:
    """The innovations of a batch about the estimate's linearization point; all its targets are in the estimate."""
    point, index = joint.linearization_point, [joint.tracks.index(track) for track in batch.tracks]
    places = point[:, SHARED_COUNT:].reshape(len(point), -1, 2)
    seen = predict(batch, places[:, index], point[:, :SHARED_COUNT])
    rows = state_rows(joint, seen, index)
    difference = seen.residual - (rows @ _off_point(joint)[:, :, None]).reshape(seen.residual.shape)
    crossed = rows @ joint.cov
    common = common_noise(batch, seen.rows, joint.priors)
    cov = crossed @ rows.swapaxes(1, 2) + _full_noise(batch, common)
    nis, determinant, valid = _alone(difference, cov, seen.valid)
    gained = np.abs(seen.residual) - np.abs(difference)
    return PixelInnovations(
        difference=difference.reshape(len(point), -1),
        crossed=crossed,
        cov=cov,
        common=common,
        nis=nis,
        determinant=determinant,
        displaced=float((gained / np.sqrt((batch.dual**2).sum(-1))).max()),
        valid=valid,
    )


def state_rows(joint: JointFilter, seen: PredictedPixels, index: Sequence[int]) -> Array:
    """(B, 2N, n): H, sensitivities to the state. ``index``: the target of each measurement.

    An apparent place moves with its target and with the vehicle's position error alike.
    """
    hypotheses, count = seen.valid.shape
    rows = np.zeros((hypotheses, count, 2, joint.mean.shape[1]))
    rows[..., :SHARED_COUNT] = seen.rows[..., :SHARED_COUNT]
    rows[..., joint.moving] = seen.rows[..., SHARED_COUNT:] @ joint.position.by_state
    by_target = rows[..., joint.first :].reshape(hypotheses, count, 2, -1, 2)
    by_target[:, np.arange(count), :, index] = seen.rows[..., SHARED_COUNT:].swapaxes(0, 1)
    return rows.reshape(hypotheses, 2 * count, -1)


def _off_point(joint: JointFilter) -> Array:
    """(B, n) the mean minus the linearization point, in which the vehicle's position error is 0."""
    off = joint.mean.copy()
    off[:, :SHARED_COUNT] -= joint.linearization_point[:, :SHARED_COUNT]
    off[:, joint.first :] -= joint.linearization_point[:, SHARED_COUNT:]
    return off


def _full_noise(batch: MeasurementBatch, common: Array) -> Array:
    """(B, 2N, 2N) covariance of the measurement noise: that of telemetry is common to the measurements of one frame."""
    flat = common.reshape(len(common), -1, common.shape[-1])
    frame = np.repeat(batch.frame, 2)
    noise = np.asarray((flat @ flat.swapaxes(1, 2)) * (frame[:, None] == frame))
    noise.reshape(len(noise), -1)[:, :: len(frame) + 1] += batch.pixel_sigma.ravel() ** 2  # on the diagonal
    return noise


def _alone(difference: Array, cov: Array, valid: Mask) -> tuple[Array, Array, Mask]:
    """NIS and determinant (B, N) of each measurement alone, and whether the measurement is possible."""
    alone = cov.diagonal(axis1=1, axis2=2)
    both = cov.diagonal(1, axis1=1, axis2=2)[:, ::2]
    nis, determinant = two_by_two(difference, alone[:, ::2], both, alone[:, 1::2])
    valid = valid & (determinant > 0.0)
    return np.where(valid, nis, np.inf), determinant, valid


def two_by_two(difference: Array, uu: Array, uv: Array, vv: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distance, inf where the covariance is not positive, and determinant of the covariance."""
    determinant = uu * vv - uv * uv
    du, dv = difference[..., 0], difference[..., 1]
    nis = (vv * du * du - 2.0 * uv * du * dv + uu * dv * dv) / np.maximum(determinant, LEAST_DETERMINANT)
    return np.where(determinant > 0.0, nis, np.inf), determinant

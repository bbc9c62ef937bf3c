"""The joint estimate of the shared parameters and of every target: an extended Kalman filter on pixels.

Two precautions against spurious information. Every row is taken at a fixed linearization point (first-estimates
Jacobians: Huang, Mourikis & Roumeliotis 2008), which moves only when a pass over the kept measurements is repeated: a
point that follows the noise would make directions look observable that are not. And the vehicle's position error is
considered, never estimated (Schmidt 1966): its rows of the gain are zero, its covariances are kept.

Arrays have a leading axis of hypotheses: the delay search runs many at once, all other uses have one. A measurement
update takes all measurements of a frame at once; with P the covariance, H the rows and R the noise::

    S = H @ P @ H.T + R;  K = P @ H.T @ inv(S), zero in considered rows

Immutable: an update returns a new estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import exp

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.calibration_report import PriorInflation, SharedParameter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, MeasurementBatch, pixel_noise, predict
from fwav_companion.types import Bias, ErrorPriors

GATE = 16.0
"""Squared Mahalanobis distance of two pixels: a true one lies beyond once in 3000 times."""
DIFFUSE_M = 100.0
"""One sigma of a new target before its first measurement: hardly any information, and no loss by rounding."""
CONSIDERED = slice(SharedParameter.NORTH, SharedParameter.EAST + 1)


class PixelInnovations(msgspec.Struct, frozen=True):
    """Innovations of one batch under each hypothesis (B)."""

    difference: Array
    """(B, 2N), measured minus predicted, px; u and v alternate, and so below."""
    rows: Array
    """(B, 2N, n)."""
    crossed: Array
    """(B, 2N, n): H P."""
    cov: Array
    """(B, 2N, 2N): S, px^2."""
    noise: Array
    """(B, N, 2, 2): R, px^2."""
    nis: Array
    """(B, N), of each measurement alone; inf where it is impossible."""
    log_det: Array
    """(B, N), of S of each measurement alone."""
    score_variance: Array
    """(B, N), variance of the log-likelihood by which the measurement may prefer another instant of the same motion:
    the attitudes reported for that are as noisy, but not by the same errors."""
    valid: Mask
    """(B, N)."""


class JointFilter(msgspec.Struct, frozen=True):
    """Mean and covariance of (shared parameters, north and east of each target), about a linearization point."""

    priors: ErrorPriors
    mean: Array
    """(B, n)."""
    cov: Array
    """(B, n, n), symmetric."""
    linearization_point: Array
    """(B, n)."""
    tracks: tuple[int, ...]
    """The tracks of the targets, in order."""
    host_ns: int

    def place_of(self, track: int) -> int | None:
        """Index of the target's north; None where it is not in the estimate."""
        return SHARED_COUNT + 2 * self.tracks.index(track) if track in self.tracks else None

    @property
    def targets(self) -> dict[int, Array]:
        """(B, 2) north and east of each target, by track."""
        return {track: self.mean[:, (i := SHARED_COUNT + 2 * k) : i + 2] for k, track in enumerate(self.tracks)}

    def take(self, hypotheses: Sequence[int]) -> JointFilter:
        """Some of the hypotheses."""
        i = list(hypotheses)
        return msgspec.structs.replace(
            self, mean=self.mean[i], cov=self.cov[i], linearization_point=self.linearization_point[i]
        )

    def predict(self, host_ns: int) -> JointFilter:
        """The estimate at another instant: the vehicle's position error has wandered."""
        sigmas = np.array(self.priors.bias_sigmas[Bias.POSITION_NORTH : Bias.POSITION_EAST + 1])
        if host_ns <= self.host_ns or not sigmas.any() or not self.priors.position_bias_time_s > 0.0:
            return self
        kept = exp(-(host_ns - self.host_ns) * 1e-9 / self.priors.position_bias_time_s)
        cov = self.cov.copy()
        cov[:, CONSIDERED] *= kept
        cov[:, :, CONSIDERED] *= kept
        for i, sigma in zip((SharedParameter.NORTH, SharedParameter.EAST), sigmas, strict=True):
            cov[:, i, i] += (1.0 - kept * kept) * sigma**2
        return msgspec.structs.replace(self, cov=cov, host_ns=host_ns)

    def innovations(self, batch: MeasurementBatch) -> PixelInnovations:
        """The innovations of measurements, all of targets in the estimate."""
        places = np.array([SHARED_COUNT + 2 * self.tracks.index(track) for track in batch.tracks])
        point, size = self.linearization_point, self.mean.shape[1]
        targets = point[:, places[:, None] + np.arange(2)]
        seen = predict(batch, targets, point[:, :SHARED_COUNT])
        hypotheses, count = seen.valid.shape
        rows = np.zeros((hypotheses, count, 2, size))
        rows[..., :SHARED_COUNT] = seen.rows[..., :SHARED_COUNT]
        each = np.arange(count)
        rows[:, each, :, places] = np.moveaxis(seen.rows[..., SHARED_COUNT], 1, 0)
        rows[:, each, :, places + 1] = np.moveaxis(seen.rows[..., SHARED_COUNT + 1], 1, 0)
        flat = rows.reshape(hypotheses, 2 * count, size)
        off = (self.mean - point)[:, :, None]
        difference = seen.residual.reshape(hypotheses, -1) - (flat @ off)[..., 0]
        crossed = flat @ self.cov
        noise, common = pixel_noise(batch, seen.rows, self.priors)
        cov = crossed @ flat.swapaxes(1, 2) + _full_noise(batch, common)
        nis, log_det, valid = _alone(difference, cov, seen.valid)
        variances = np.stack((noise[..., 0, 0], noise[..., 1, 1]), -1)
        score_variance = 2.0 - ((batch.pixel_sigma**2 / variances) ** 2).sum(-1)
        return PixelInnovations(
            difference=difference,
            rows=flat,
            crossed=crossed,
            cov=cov,
            noise=noise,
            nis=nis,
            log_det=log_det,
            score_variance=score_variance,
            valid=valid,
        )

    def update(self, seen: PixelInnovations, used: Mask) -> tuple[JointFilter, Array]:
        """The estimate after the ``used`` (B, N) of the measurements, and their log-likelihood (B) up to a constant."""
        each = np.repeat(used, 2, axis=1)
        weight = each.astype(float)
        cov = seen.cov * weight[:, :, None] * weight[:, None, :]
        diagonal = np.arange(cov.shape[1])
        cov[:, diagonal, diagonal] += 1.0 - weight
        root = np.linalg.cholesky(cov)
        right = np.concatenate((seen.crossed, seen.difference[:, :, None]), -1) * weight[:, :, None]
        whitened = np.linalg.solve(root, right)
        gain, innovation = whitened[..., :-1], whitened[..., -1]
        mean = self.mean + (gain.swapaxes(1, 2) @ innovation[..., None])[..., 0]
        mean[:, CONSIDERED] = self.mean[:, CONSIDERED]
        cov = self.cov - gain.swapaxes(1, 2) @ gain
        cov = 0.5 * (cov + cov.swapaxes(1, 2))
        cov[:, CONSIDERED, CONSIDERED] = self.cov[:, CONSIDERED, CONSIDERED]
        score = -0.5 * (innovation**2).sum(-1) - np.log(root[:, diagonal, diagonal]).sum(-1)
        return msgspec.structs.replace(self, mean=mean, cov=cov), score

    def with_target(self, track: int, point: Array) -> JointFilter:
        """The estimate with a target that is not yet measured, linearized at ``point`` (B, 2)."""
        size = self.mean.shape[1]
        cov = np.zeros((len(self.mean), size + 2, size + 2))
        cov[:, :size, :size] = self.cov
        cov[:, size, size] = cov[:, size + 1, size + 1] = DIFFUSE_M**2
        return msgspec.structs.replace(
            self,
            mean=np.concatenate((self.mean, point), -1),
            cov=cov,
            linearization_point=np.concatenate((self.linearization_point, point), -1),
            tracks=(*self.tracks, track),
        )

    def without(self, track: int) -> JointFilter:
        """The estimate without this target."""
        place = self.place_of(track)
        if place is None:
            return self
        kept = np.delete(np.arange(self.mean.shape[1]), (place, place + 1))
        return msgspec.structs.replace(
            self,
            mean=self.mean[:, kept],
            cov=self.cov[:, kept[:, None], kept],
            linearization_point=self.linearization_point[:, kept],
            tracks=tuple(each for each in self.tracks if each != track),
        )

    def inflated(self, inflation: PriorInflation) -> JointFilter:
        """The estimate as it would be with the wider prior.

        The information of the configured prior is subtracted (Sherman & Morrison); the considered position stays.
        """
        i = inflation.parameter
        less = inflation.sigma**-2 - inflation.wider_sigma**-2
        column = self.cov[:, i]
        factor = (less / (1.0 - less * column[:, i]))[:, None]
        mean = self.mean + column * (factor * (self.mean[:, i, None] - inflation.mean))
        cov = self.cov + factor[:, :, None] * column[:, :, None] * column[:, None, :]
        mean[:, CONSIDERED] = self.mean[:, CONSIDERED]
        cov[:, CONSIDERED, CONSIDERED] = self.cov[:, CONSIDERED, CONSIDERED]
        return msgspec.structs.replace(self, mean=mean, cov=cov)

    def gates(self, batch: MeasurementBatch) -> tuple[Array, Array]:
        """(T, N) NIS and log of det(S) / det(R) of each measurement for each target, linearized at the mean."""
        mean, cov, shared = self.mean[0], self.cov[0], slice(0, SHARED_COUNT)
        targets = mean[SHARED_COUNT:].reshape(-1, 1, 2)
        seen = predict(batch, np.broadcast_to(targets, (len(self.tracks), len(batch.tracks), 2)), mean[None, shared])
        places = SHARED_COUNT + 2 * np.arange(len(self.tracks))[:, None] + np.arange(2)
        index = np.concatenate((np.broadcast_to(np.arange(SHARED_COUNT), (len(places), SHARED_COUNT)), places), 1)
        blocks = cov[index[:, :, None], index[:, None, :]]
        noise, _ = pixel_noise(batch, seen.rows, self.priors)
        crossed = np.einsum("tnai,tij->tnaj", seen.rows, blocks)
        spread = noise + np.einsum("tnaj,tnbj->tnab", crossed, seen.rows)
        nis, log_det = _two_by_two(seen.residual, spread)
        possible = seen.valid & np.isfinite(log_det)
        return np.where(possible, nis, np.inf), log_det - _two_by_two(seen.residual, noise)[1]


def _full_noise(batch: MeasurementBatch, common: Array) -> Array:
    """(B, 2N, 2N) covariance of the fresh errors: those of telemetry are common to the measurements of one frame."""
    flat = common.reshape(len(common), -1, common.shape[-1])
    frame = np.repeat(batch.frame, 2)
    noise = np.where(frame[:, None] == frame, flat @ flat.swapaxes(1, 2), 0.0)
    each = np.arange(len(frame))
    noise[:, each, each] += batch.pixel_sigma.ravel() ** 2
    return noise


def _alone(difference: Array, cov: Array, valid: Mask) -> tuple[Array, Array, Mask]:
    """NIS and log determinant (B, N) of each measurement alone, and whether it is one."""
    each = 2 * np.arange(valid.shape[1])
    blocks = cov[:, each[:, None, None] + np.arange(2)[:, None], each[:, None, None] + np.arange(2)]
    nis, log_det = _two_by_two(difference.reshape(*valid.shape, 2), blocks)
    valid = valid & np.isfinite(log_det)
    return np.where(valid, nis, np.inf), log_det, valid


def _two_by_two(difference: Array, cov: Array) -> tuple[Array, Array]:
    """Squared Mahalanobis distance, and log determinant of the covariance; -inf where that is not positive."""
    uu, uv, vv = cov[..., 0, 0], cov[..., 0, 1], cov[..., 1, 1]
    determinant = uu * vv - uv * uv
    positive = determinant > 0.0
    safe = np.where(positive, determinant, 1.0)
    du, dv = difference[..., 0], difference[..., 1]
    nis = (vv * du * du - 2.0 * uv * du * dv + uu * dv * dv) / safe
    return nis, np.where(positive, np.log(safe), -np.inf)


def joint_filter(priors: ErrorPriors, sigmas: Array, means: Array, point: Array) -> JointFilter:
    """The estimate before any target: means and points (B, 13), and one sigma (13) of each shared parameter."""
    cov = np.broadcast_to(np.diag(sigmas**2), (len(means), SHARED_COUNT, SHARED_COUNT))
    return JointFilter(priors, means, cov, point, (), 0)

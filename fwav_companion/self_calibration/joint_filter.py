"""The joint estimate of the shared parameters and of every target: an extended Kalman filter on pixels.

The state is (shared parameters, error of the vehicle's position, north and east of each target). A fix sees a target
at its *apparent place*, the target plus the present error of the vehicle's position.

Rows are evaluated at a linearization point that stays (first-estimates Jacobians: Huang, Mourikis & Roumeliotis 2008):
a point that follows the noise would make unobservable directions look observable. In the point, the places of several
targets move alike with the vehicle's position error (``displaced``). The whole point moves to the estimate if that has
moved in view by more than the linearization tolerates, as on a descent: 0.2 m are 0.8 degrees from 15 m, 11 from 1 m.

Arrays have a leading axis of hypotheses: the delay search runs many at once, a served pass one for each kind of wander.
A measurement update takes all measurements of a frame at once; with P the covariance, H the rows and R the noise::

    S = H @ P @ H.T + R;  K = P @ H.T @ inv(S)

Immutable: an update returns a new estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import inf

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.calibration_report import PriorInflation
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.pixel_measurement import DELAY, HEIGHT, SHARED_COUNT, PixelInnovations
from fwav_companion.self_calibration.position_error import SMOOTH, PositionError, position_error
from fwav_companion.types import ErrorPriors

GATE = 16.0
"""Gate on the NIS of two pixels: a true measurement exceeds it once in 3000 times."""
DIFFUSE_M = 100.0
"""One sigma of a new target before its first measurement, metres: hardly any information, and no loss by rounding."""
ENOUGH_TARGETS = 3
"""Number of targets whose mutual distances show the height."""
MOST_DISPLACED = 0.02
"""Largest angle, rad, by which the mean may predict better than the linearization point before the point moves to the
mean: its square is 0.02 degrees, a tenth of a pixel's noise."""


class JointFilter(msgspec.Struct, frozen=True, dict=True):
    """Mean and covariance of the state, about a linearization point."""

    priors: ErrorPriors
    position: PositionError
    mean: Array
    """(B, n), mean of the state."""
    cov: Array
    """(B, n, n), covariance of the state, symmetric."""
    linearization_point: Array
    """(B, 11 + 2T), shared parameters and apparent places."""
    tracks: tuple[int, ...]
    """The tracks of the targets, in the order of the state."""
    host_ns: int
    shows_height: bool = False
    """Whether the vehicle's path is long enough to show the height."""

    @property
    def first(self) -> int:
        """Index of the north of the first target in the state."""
        return SHARED_COUNT + self.position.count

    def place_of(self, track: int) -> int | None:
        """Index of the target's north in the state; None if the target is not in the estimate."""
        return self.first + 2 * self.tracks.index(track) if track in self.tracks else None

    @property
    def considers_height(self) -> bool:
        """Whether the height is considered, not estimated (Schmidt 1966): its rows of the gain are zero.

        The error of a wandering position is in the rows of the height and in the residuals, and a filter takes that
        for information: on circles of 3 m at 14 m the height diverged by 4 m, and the mount with it. Distances between
        three targets show the height without the position.
        """
        return self.position.count > 0 and not (self.shows_height and len(self.tracks) >= ENOUGH_TARGETS)

    @property
    def moving(self) -> slice:
        """Indices of the vehicle's position error in the state."""
        return slice(SHARED_COUNT, self.first)

    @property
    def position_error(self) -> Array:
        """(B, 2), the present error of the vehicle's position."""
        return np.asarray(self.mean[:, self.moving] @ self.position.by_state.T)

    @cached_property
    def apparent(self) -> Array:
        """(B, 2T), apparent places."""
        places = self.mean[:, self.first :].reshape(len(self.mean), -1, 2) + self.position_error[:, None]
        return np.asarray(places.reshape(len(self.mean), -1))

    @property
    def targets(self) -> dict[int, Array]:
        """(B, 2) apparent place of each target, by track."""
        apparent = self.apparent
        return {track: apparent[:, 2 * k : 2 * k + 2] for k, track in enumerate(self.tracks)}

    def separation2(self, one: int, other: int) -> float:
        """Squared Mahalanobis distance of two targets, 2 degrees of freedom, under the first hypothesis.

        Errors that both share cancel. Infinite if one of the targets is not in the estimate.
        """
        a, b = self.place_of(one), self.place_of(other)
        if a is None or b is None:
            return inf
        first, second, cov = slice(a, a + 2), slice(b, b + 2), self.cov[0]
        apart = self.mean[0, first] - self.mean[0, second]
        relative = cov[first, first] + cov[second, second] - cov[first, second] - cov[second, first]
        return float(apart @ np.linalg.solve(relative, apart))

    def take(self, hypotheses: Sequence[int]) -> JointFilter:
        """The estimate under some of the hypotheses."""
        i = list(hypotheses)
        return msgspec.structs.replace(
            self,
            position=self.position.take(i),
            mean=self.mean[i],
            cov=self.cov[i],
            linearization_point=self.linearization_point[i],
        )

    def predict(self, host_ns: int) -> JointFilter:
        """The estimate at a later instant: the vehicle's position error has wandered."""
        if host_ns <= self.host_ns or not self.position.count:
            return self
        if not self.host_ns:
            return msgspec.structs.replace(self, host_ns=host_ns)
        step, prior = self.position.transition((host_ns - self.host_ns) * 1e-9), self.position.prior
        mean, cov, moving = self.mean.copy(), self.cov.copy(), self.moving
        mean[:, moving] = (step @ mean[:, moving, None])[..., 0]
        cov[:, moving, moving] -= prior  # the difference from the stationary covariance decays
        cov[:, moving] = step @ cov[:, moving]
        cov[:, :, moving] = cov[:, :, moving] @ step.swapaxes(1, 2)
        cov[:, moving, moving] += prior
        return msgspec.structs.replace(self, mean=mean, cov=cov, host_ns=host_ns)

    def displaced(self) -> JointFilter:
        """The estimate with all places of the linearization point shifted alike, to the mean of the apparent places.

        The vehicle's position error moves all targets, and their distances stay. If the point of each target followed
        its own estimate, the points would turn, and the filter would take that for information on the heading: on
        circles over three targets its sigma was 0.86 degrees, that of least squares about the truth 1.23. A single
        target has no distances.
        """
        if not self.position.count or len(self.tracks) < 2:
            return self
        point = self.linearization_point.copy()
        off = (self.apparent - point[:, SHARED_COUNT:]).reshape(len(point), -1, 2)
        point[:, SHARED_COUNT:] += np.tile(off.mean(1), (1, off.shape[1]))
        return msgspec.structs.replace(self, linearization_point=point)

    def relinearized(self, batch: MeasurementBatch) -> JointFilter:
        """The estimate linearized at its present mean; the delay stays if the vehicle turns far within its change.

        At the beginning of a pass the mean of the delay is still the prior, perhaps half a wing beat from the delay
        that was found, and poses extrapolated to the prior fit no measurement.
        """
        point = np.concatenate((self.mean[:, :SHARED_COUNT], self.apparent), 1)
        before = self.linearization_point[:, DELAY]
        turn = np.abs(point[:, DELAY] - before) * np.sqrt((batch.poses.rates**2).sum(-1).max())
        point[:, DELAY] = np.where(turn > MOST_DISPLACED, before, point[:, DELAY])
        return msgspec.structs.replace(self, linearization_point=point)

    def update(self, seen: PixelInnovations, used: Mask) -> tuple[JointFilter, Array, Array]:
        """The estimate after an update with the ``used`` (B, N) measurements, their log-likelihood (B) up to a
        constant, and their innovations whitened by S (B, 2N), 0 where unused.
        """
        cov, right = seen.cov, np.concatenate((seen.crossed, seen.difference[:, :, None]), -1)
        diagonal = np.arange(cov.shape[1])
        if not used.all():
            weight = np.repeat(used, 2, axis=1).astype(float)
            cov, right = cov * weight[:, :, None] * weight[:, None, :], right * weight[:, :, None]
            cov[:, diagonal, diagonal] += 1.0 - weight
        root = np.linalg.cholesky(cov)
        whitened = np.linalg.solve(root, right)
        gain, innovation = whitened[..., :-1], whitened[..., -1]
        mean = self.mean + (gain.swapaxes(1, 2) @ innovation[..., None])[..., 0]
        cov = self.cov - gain.swapaxes(1, 2) @ gain
        cov = 0.5 * (cov + cov.swapaxes(1, 2))
        if self.considers_height:
            mean[:, HEIGHT], cov[:, HEIGHT, HEIGHT] = self.mean[:, HEIGHT], self.cov[:, HEIGHT, HEIGHT]
        score = -0.5 * (innovation**2).sum(-1) - np.log(root[:, diagonal, diagonal]).sum(-1)
        return msgspec.structs.replace(self, mean=mean, cov=cov), score, innovation

    def with_target(self, track: int, point: Array) -> JointFilter:
        """The estimate with a target that is not yet measured, linearized at ``point`` (B, 2), its apparent place."""
        size = self.mean.shape[1]
        cov = np.zeros((len(self.mean), size + 2, size + 2))
        cov[:, :size, :size] = self.cov
        cov[:, size, size] = cov[:, size + 1, size + 1] = DIFFUSE_M**2
        return msgspec.structs.replace(
            self,
            mean=np.concatenate((self.mean, point - self.position_error), -1),
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
        own = place - self.position.count
        return msgspec.structs.replace(
            self,
            mean=self.mean[:, kept],
            cov=self.cov[:, kept[:, None], kept],
            linearization_point=np.delete(self.linearization_point, (own, own + 1), 1),
            tracks=tuple(each for each in self.tracks if each != track),
        )

    def inflated(self, inflation: PriorInflation) -> JointFilter:
        """The estimate as it would be with the wider prior.

        The information of the configured prior is subtracted (Sherman & Morrison).
        """
        i = inflation.parameter
        less = inflation.sigma**-2 - inflation.wider_sigma**-2
        column = self.cov[:, i]
        factor = (less / (1.0 - less * column[:, i]))[:, None]
        mean = self.mean + column * (factor * (self.mean[:, i, None] - inflation.mean))
        cov = self.cov + factor[:, :, None] * column[:, :, None] * column[:, None, :]
        return msgspec.structs.replace(self, mean=mean, cov=cov)

    @cached_property
    def apparent_cov(self) -> Array:
        """(11 + 2T, 11 + 2T) covariance of the shared parameters and of the apparent places."""
        by = np.delete(np.eye(self.mean.shape[1]), self.moving, 0)
        by[SHARED_COUNT:, self.moving] = np.tile(self.position.by_state, (len(self.tracks), 1))
        return np.asarray(by @ self.cov[0] @ by.T)


def joint_filter(
    priors: ErrorPriors, sigmas: Array, means: Array, point: Array, hypotheses: tuple[int, ...] | None = None
) -> JointFilter:
    """The estimate before any target: means and points (B, 11), and one sigma (11) of each shared parameter.

    ``hypotheses``: kind of wander of the vehicle's position under each; None: smooth under all.
    """
    position = position_error(priors, hypotheses or (SMOOTH,) * len(means))
    mean = np.concatenate((means, np.zeros((len(means), position.count))), 1)
    cov = np.zeros((*mean.shape, mean.shape[1]))
    cov[:, :SHARED_COUNT, :SHARED_COUNT] = np.diag(sigmas**2)
    cov[:, SHARED_COUNT:, SHARED_COUNT:] = position.prior
    return JointFilter(priors, position, mean, cov, point, (), 0)

"""The filter of a standing target in plain numpy: the readable specification of the scalar one, and a reference for
speed.

Sensitivities are those of the fixes; the linearization point has tests of its own.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
from scipy.special import expit
from scipy.stats import multivariate_normal

from fwav_companion.tracking.filters.consider_biases import (
    FIRST_SENSITIVITY_S,
    SENSITIVITY_SHARE,
    SENSITIVITY_STEP_S,
)
from fwav_companion.tracking.filters.linearization import SENSITIVE
from fwav_companion.types import Bias, ErrorPriors, GroundFix

Array = NDArray[np.float64]
Sample = tuple[Array, Array, Array]
TELEMETRY_STEP_S = 0.1
MOST_TURN_COSINE = 0.7
STEP_S = 1.0
PRIOR_SCORE = 0.5
MOST_NIS = 20.0


class FixArrays:
    """A fix as arrays, made beforehand."""

    def __init__(self, fix: GroundFix, priors: ErrorPriors) -> None:
        sigmas = np.array(priors.bias_sigmas)
        sigmas[[Bias.POSITION_NORTH, Bias.POSITION_EAST]] = 0.0  # these are a state
        self.at_ns = fix.sighting.frame_host_ns
        self.camera = np.array(fix.sighting.camera_ned)[:2]
        self.position = np.array(fix.position_ned)[:2]
        self.noise = np.array(fix.noise_cov)[:2, :2]
        jacobian = np.array(fix.bias_jacobian).T[:2]
        self.by_height = jacobian[:, Bias.HEIGHT]
        self.shared = jacobian * sigmas


class PlainFilter:
    """The apparent place at every fix; place, position errors and their rates once a second."""

    def __init__(self, first: FixArrays, priors: ErrorPriors) -> None:
        self.priors, self.first_ns, self.at_ns, self.placed_ns = priors, first.at_ns, first.at_ns, first.at_ns
        self.sigma, self.rates = priors.sigma(Bias.POSITION_NORTH), 2.0 / np.array(priors.position_times_s)
        self.each = self.sigma**2 / len(self.rates)
        self.score, self.means, self.is_apart = PRIOR_SCORE, list[tuple[float, Sample]](), False
        count = first.shared.shape[1]
        self.smooth, self.quick = (np.zeros(count), np.eye(count)), (np.zeros(count), np.eye(count))
        self.apparent, self.shared = first.position, first.shared
        self.noise = first.noise + self._sensitivity_noise(first.shared, FIRST_SENSITIVITY_S)
        self._begin_place()

    @property
    def cov(self) -> Array:
        """Covariance of the place."""
        return self.cov_all[0, 0] * np.eye(2) + self.shared_all[0] @ self.shared_all[0].T

    def step(self, fix: FixArrays) -> None:
        since_s = (fix.at_ns - self.at_ns) * 1e-9
        self.at_ns = fix.at_ns
        self.noise = self.noise + self._moved(since_s) * np.eye(2)
        own = self._turned(fix, self._repeated(fix, since_s))
        sample = (fix.position, own + self._sensitivity_noise(fix.shared, since_s), fix.shared)
        self.apparent, self.noise, self.shared = _updated((self.apparent, self.noise, self.shared), sample)
        placed_s = (fix.at_ns - self.placed_ns) * 1e-9
        if (fix.at_ns - self.first_ns) * 1e-9 < STEP_S:
            self._begin_place()
            return
        self.is_apart = True
        self.second.append((fix.position, own, fix.shared))
        self.fresh = sample if self.fresh is None else _updated(self.fresh, sample)
        if placed_s >= STEP_S:
            self._judge(placed_s, _mean(self.second))
            self._place(placed_s, *self.fresh)
            self.fresh, self.second = None, []

    def _moved(self, since_s: float) -> float:
        quick = float(2.0 * self.each * np.sum(1.0 - np.exp(-0.5 * self.rates * since_s)))
        turn = self.rates * since_s
        moved = 2.0 * self.each * np.sum(1.0 - (1.0 + turn) * np.exp(-turn))
        walked = np.sqrt(np.mean(self.rates**2)) * self.sigma * np.sqrt(np.trace(self.noise) / 2.0) * since_s
        share = expit(self.score) if self.is_apart else 0.0
        return float(share * max(moved, walked) + (1.0 - share) * quick)

    def _begin_place(self) -> None:
        """States: place, then error and rate of each process: rows of ``mean_all``, matrices of ``shared_all``."""
        self.placed_ns, self.fresh, self.second = self.at_ns, None, list[Sample]()
        steady, count = self._steady(), 1 + 2 * len(self.rates)
        self.mean_all = np.vstack([self.apparent, np.zeros((count - 1, 2))])
        self.shared_all = np.stack([self.shared, *[0.0 * self.shared] * (count - 1)])
        self.cov_all = block_diag(self.sigma**2 + np.trace(self.noise) / 2.0, steady)
        self.cov_all[0, 1::2] = self.cov_all[1::2, 0] = -self.each

    def _steady(self) -> Array:
        return self.each * np.diag([variance for w in self.rates for variance in (1.0, w * w)])

    def _place(self, since_s: float, position: Array, noise: Array, shared: Array) -> None:
        """error'' = -w^2 error - 2 w error' by the matrix exponential, and a Kalman update by place + errors."""
        self.placed_ns, steady = self.at_ns, self._steady()
        process = block_diag(*(expm(since_s * np.array([[0.0, 1.0], [-w * w, -2.0 * w]])) for w in self.rates))
        move, more = block_diag(1.0, process), block_diag(0.0, steady - process @ steady @ process.T)
        self.mean_all, self.cov_all = move @ self.mean_all, move @ self.cov_all @ move.T + more
        self.shared_all = np.einsum("ij,jkl->ikl", move, self.shared_all)
        seen = np.array([1.0, *[1.0, 0.0] * len(self.rates)])
        total = noise + shared @ shared.T
        gain = self.cov_all @ seen / (seen @ self.cov_all @ seen + np.trace(total) / 2.0)
        self.cov_all = self.cov_all - np.outer(gain, seen @ self.cov_all)
        self.mean_all = self.mean_all + np.outer(gain, position - seen @ self.mean_all)
        off = shared - np.einsum("i,ijk->jk", seen, self.shared_all)
        self.shared_all = self.shared_all + gain[:, None, None] * off

    def _judge(self, since_s: float, mean: Sample) -> None:
        """Log-likelihood ratio of a smooth error over a first-order one, by second differences of means of a second.

        Each hypothesis has its own estimate of the biases.
        """
        self.means = [*self.means[-2:], (since_s, mean)] if since_s <= 3.0 else [(since_s, mean)]
        if len(self.means) < 3:
            return
        (_, oldest), (last_s, middle), (_, newest) = self.means
        r = since_s / last_s
        off, shared = (newest[k] - (1.0 + r) * middle[k] + r * oldest[k] for k in (0, 2))
        noise = newest[1] + (1.0 + r) ** 2 * middle[1] + r**2 * oldest[1] + 0.1**2 * shared @ shared.T
        quick = self.each * self.rates.sum() * 0.5 * (since_s + r * r * last_s)
        smooth = 4.0 * self.each * (self.rates**3).sum() * since_s**3
        by_smooth, for_smooth, _ = _taught(self.smooth, off, shared, noise + smooth * np.eye(2), since_s)
        by_quick, for_quick, nis = _taught(self.quick, off, shared, noise + quick * np.eye(2), since_s)
        if nis > MOST_NIS:
            return
        self.smooth, self.quick = by_smooth, by_quick
        self.score = float(np.clip(self.score + 0.5 * (for_smooth - for_quick), -10.0, 10.0))

    def _sensitivity_noise(self, shared: Array, since_s: float) -> Array:
        sensitive = shared[:, list(SENSITIVE)]
        return SENSITIVITY_SHARE**2 * max(1.0, SENSITIVITY_STEP_S / since_s) * sensitive @ sensitive.T

    def _repeated(self, fix: FixArrays, since_s: float) -> Array:
        if since_s >= TELEMETRY_STEP_S:
            return fix.noise
        repeated = TELEMETRY_STEP_S / since_s - 1.0
        height = self.priors.height_noise_m**2 * np.outer(fix.by_height, fix.by_height)
        return fix.noise + repeated * (height + self.priors.position_noise_m**2 * np.eye(2))

    def _turned(self, fix: FixArrays, noise: Array) -> Array:
        of_fix, of_target = fix.position - fix.camera, self.apparent - fix.camera
        both = sqrt((of_fix @ of_fix) * (of_target @ of_target))
        cosine = of_fix @ of_target / both
        if cosine <= MOST_TURN_COSINE:
            return noise
        sine = (of_fix[0] * of_target[1] - of_fix[1] * of_target[0]) / both
        turn = np.array([[cosine, -sine], [sine, cosine]])
        return turn @ noise @ turn.T


def _updated(before: Sample, sample: Sample) -> Sample:
    """Place, noise and shared errors after one more fix, by the gain of least total covariance."""
    (place, noise, shared), (fix_place, fix_noise, fix_shared) = before, sample
    d = fix_shared - shared
    gain = (noise - shared @ d.T) @ np.linalg.inv(noise + fix_noise + d @ d.T)
    rest = np.eye(2) - gain
    return (
        place + gain @ (fix_place - place),
        rest @ noise @ rest.T + gain @ fix_noise @ gain.T,
        shared + gain @ d,
    )


def _mean(samples: list[Sample]) -> Sample:
    """Mean of fixes, each weighed by the inverse trace of its noise."""
    weights = np.array([1.0 / np.trace(noise) for _, noise, _ in samples])
    weights /= weights.sum()
    place, shared = (sum(w * sample[k] for w, sample in zip(weights, samples, strict=True)) for k in (0, 2))
    return np.asarray(place), np.einsum("i,ijk->jk", weights**2, [noise for _, noise, _ in samples]), np.asarray(shared)


def _taught(
    biases: tuple[Array, Array], off: Array, rows: Array, noise: Array, since_s: float
) -> tuple[tuple[Array, Array], float, float]:
    """Mean and covariance of the biases after an interval and a second difference, its log-likelihood, its square."""
    kept = np.exp(-since_s / 100.0)
    mean, cov = kept * biases[0], kept**2 * biases[1] + (1.0 - kept**2) * np.eye(len(biases[0]))
    total = noise + rows @ cov @ rows.T
    likelihood = multivariate_normal.logpdf(off, mean=rows @ mean, cov=total)
    gain = cov @ rows.T @ np.linalg.inv(total)
    nis = (off - rows @ mean) @ np.linalg.solve(total, off - rows @ mean)
    return (mean + gain @ (off - rows @ mean), cov - gain @ rows @ cov), float(likelihood), float(nis)

"""The filter of a standing target in plain numpy: the readable specification of the scalar one, and a reference for
speed.

Sensitivities are those of the fixes; the linearization point has tests of its own.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm
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
SMOOTH_MARGIN = -0.5


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
        self.score, self.means, self.is_apart = 0.0, list[tuple[float, Sample]](), False
        self.apparent, self.shared = first.position, first.shared
        self.noise = first.noise + self._sensitivity_noise(first, FIRST_SENSITIVITY_S)
        self._begin_place()

    @property
    def cov(self) -> Array:
        """Covariance of the place."""
        return self.cov_all[0, 0] * np.eye(2) + self.shared_all[0] @ self.shared_all[0].T

    def step(self, fix: FixArrays) -> None:
        since_s = (fix.at_ns - self.at_ns) * 1e-9
        self.at_ns = fix.at_ns
        self.noise = self.noise + self._moved(since_s) * np.eye(2)
        noise = self._turned(fix, self._repeated(fix, since_s)) + self._sensitivity_noise(fix, since_s)
        sample = (fix.position, noise, fix.shared)
        self.apparent, self.noise, self.shared = _updated((self.apparent, self.noise, self.shared), sample)
        placed_s = (fix.at_ns - self.placed_ns) * 1e-9
        if (fix.at_ns - self.first_ns) * 1e-9 < STEP_S:
            self._begin_place()
            return
        self.is_apart = True
        self.fresh = sample if self.fresh is None else _updated(self.fresh, sample)
        if placed_s >= STEP_S:
            self._place(placed_s, *self.fresh)
            self.fresh = None

    def _moved(self, since_s: float) -> float:
        if not self.is_apart or self.score < SMOOTH_MARGIN:
            return float(2.0 * self.each * np.sum(1.0 - np.exp(-0.5 * self.rates * since_s)))
        turn = self.rates * since_s
        moved = 2.0 * self.each * np.sum(1.0 - (1.0 + turn) * np.exp(-turn))
        walked = np.sqrt(np.mean(self.rates**2)) * self.sigma * np.sqrt(np.trace(self.noise) / 2.0) * since_s
        return float(max(moved, walked))

    def _begin_place(self) -> None:
        """States: place, then error and rate of each process: rows of ``mean_all``, matrices of ``shared_all``."""
        self.placed_ns, self.fresh = self.at_ns, None
        steady, count = self._steady(), 1 + 2 * len(self.rates)
        self.mean_all = np.vstack([self.apparent, np.zeros((count - 1, 2))])
        self.shared_all = np.stack([self.shared, *[0.0 * self.shared] * (count - 1)])
        self.cov_all = block_diag(self.sigma**2 + np.trace(self.noise) / 2.0, steady)
        self.cov_all[0, 1::2] = self.cov_all[1::2, 0] = -self.each

    def _steady(self) -> Array:
        return self.each * np.diag([variance for w in self.rates for variance in (1.0, w * w)])

    def _place(self, since_s: float, position: Array, noise: Array, shared: Array) -> None:
        """error'' = -w^2 error - 2 w error' by the matrix exponential, and a Kalman update by place + errors."""
        self._judge(since_s, (position, noise, shared))
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
        """Log-likelihood ratio of a smooth error over a first-order one, by second differences of means of a second."""
        self.means = [*self.means[-2:], (since_s, mean)] if since_s <= 3.0 else [(since_s, mean)]
        if len(self.means) < 3:
            return
        (_, oldest), (last_s, middle), (_, newest) = self.means
        r = since_s / last_s
        off, shared = (newest[k] - (1.0 + r) * middle[k] + r * oldest[k] for k in (0, 2))
        noise = newest[1] + (1.0 + r) ** 2 * middle[1] + r**2 * oldest[1] + shared @ shared.T
        quick = self.each * self.rates.sum() * 0.5 * (since_s + r * r * last_s)
        smooth = 4.0 * self.each * (self.rates**3).sum() * since_s**3
        ratio = multivariate_normal.logpdf(off, cov=noise + smooth * np.eye(2))
        ratio -= multivariate_normal.logpdf(off, cov=noise + quick * np.eye(2))
        self.score = float(np.clip(self.score + 0.5 * ratio, -10.0, 10.0))

    def _sensitivity_noise(self, fix: FixArrays, since_s: float) -> Array:
        sensitive = fix.shared[:, list(SENSITIVE)]
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

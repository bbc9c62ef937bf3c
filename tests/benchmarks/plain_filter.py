"""The filter of a standing target in plain numpy: the readable specification of the scalar one, and a reference for
speed.

Sensitivities are those of the fixes; the linearization point has tests of its own.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm

from fwav_companion.tracking.filters.consider_biases import (
    FIRST_SENSITIVITY_S,
    SENSITIVE,
    SENSITIVITY_SHARE,
    SENSITIVITY_STEP_S,
)
from fwav_companion.types import Bias, ErrorPriors, GroundFix

Array = NDArray[np.float64]
TELEMETRY_STEP_S = 0.1
MOST_TURN_COSINE = 0.7
STEP_S = 1.0


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
    """The apparent place at every fix; place, position error and its rate once a second."""

    def __init__(self, first: FixArrays, priors: ErrorPriors) -> None:
        self.priors, self.first_ns, self.at_ns, self.placed_ns = priors, first.at_ns, first.at_ns, first.at_ns
        self.sigma, self.rate = priors.sigma(Bias.POSITION_NORTH), 2.0 / priors.position_bias_time_s
        self.apparent, self.shared = first.position, first.shared
        self.noise = first.noise + self._sensitivity_noise(first, FIRST_SENSITIVITY_S)
        self._begin_place()

    @property
    def cov(self) -> Array:
        """Covariance of the place."""
        return self.cov3[0, 0] * np.eye(2) + self.shared3[0] @ self.shared3[0].T

    def step(self, fix: FixArrays) -> None:
        since_s = (fix.at_ns - self.at_ns) * 1e-9
        self.at_ns = fix.at_ns
        self.noise = self.noise + self._moved(since_s) * np.eye(2)
        noise = self._turned(fix, self._repeated(fix, since_s)) + self._sensitivity_noise(fix, since_s)
        d = fix.shared - self.shared
        gain = (self.noise - self.shared @ d.T) @ np.linalg.inv(self.noise + noise + d @ d.T)
        rest = np.eye(2) - gain
        self.apparent = self.apparent + gain @ (fix.position - self.apparent)
        self.noise = rest @ self.noise @ rest.T + gain @ noise @ gain.T
        self.shared = self.shared + gain @ d
        placed_s = (fix.at_ns - self.placed_ns) * 1e-9
        if (fix.at_ns - self.first_ns) * 1e-9 < STEP_S:
            self._begin_place()
        elif placed_s >= STEP_S:
            self._place(placed_s)

    def _moved(self, since_s: float) -> float:
        turn = self.rate * since_s
        moved = 2.0 * self.sigma**2 * (1.0 - (1.0 + turn) * np.exp(-turn))
        walked = self.rate * self.sigma * np.sqrt(np.trace(self.noise) / 2.0) * since_s
        return float(max(moved, walked))

    def _begin_place(self) -> None:
        """States: place, error, rate. ``mean3`` has a row, ``shared3`` a matrix for each."""
        self.placed_ns = self.at_ns
        self.mean3 = np.vstack([self.apparent, np.zeros((2, 2))])
        self.shared3 = np.stack([self.shared, 0.0 * self.shared, 0.0 * self.shared])
        s2 = self.sigma**2
        self.cov3 = np.array([[s2, -s2, 0.0], [-s2, s2, 0.0], [0.0, 0.0, s2 * self.rate**2]])
        self.cov3[0, 0] += np.trace(self.noise) / 2.0

    def _place(self, since_s: float) -> None:
        """error'' = -w^2 error - 2 w error' by the matrix exponential, and a Kalman update by place + error."""
        self.placed_ns = self.at_ns
        w = self.rate
        process = expm(since_s * np.array([[0.0, 1.0], [-w * w, -2.0 * w]]))
        steady = self.sigma**2 * np.diag([1.0, w * w])
        move, more = block_diag(1.0, process), block_diag(0.0, steady - process @ steady @ process.T)
        self.mean3, self.cov3 = move @ self.mean3, move @ self.cov3 @ move.T + more
        self.shared3 = np.einsum("ij,jkl->ikl", move, self.shared3)
        seen = np.array([1.0, 1.0, 0.0])
        total = self.noise + self.shared @ self.shared.T
        gain = self.cov3 @ seen / (seen @ self.cov3 @ seen + np.trace(total) / 2.0)
        self.cov3 = self.cov3 - np.outer(gain, seen @ self.cov3)
        self.mean3 = self.mean3 + np.outer(gain, self.apparent - self.mean3[0] - self.mean3[1])
        self.shared3 = self.shared3 + gain[:, None, None] * (self.shared - self.shared3[0] - self.shared3[1])

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

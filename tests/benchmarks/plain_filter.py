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
PLACE, APPARENT = [2, 3], [0, 1]
H = np.eye(2, 6)


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
    """States: apparent place, place, rate of the position error; north and east each."""

    def __init__(self, first: FixArrays, priors: ErrorPriors) -> None:
        self.priors, self.at_ns = priors, first.at_ns
        self.sigma, self.rate = priors.sigma(Bias.POSITION_NORTH), 2.0 / priors.position_bias_time_s
        noise = first.noise + self._sensitivity_noise(first, FIRST_SENSITIVITY_S)
        self.mean = np.concatenate([first.position, first.position, [0.0, 0.0]])
        both = np.kron(np.ones((2, 2)), noise)
        self.noise = block_diag(both, (self.rate * self.sigma) ** 2 * np.eye(2))
        self.noise[2:4, 2:4] += self.sigma**2 * np.eye(2)
        self.shared = np.vstack([first.shared, first.shared, 0.0 * first.shared])

    def cov(self, pair: list[int]) -> Array:
        return (self.noise + self.shared @ self.shared.T)[np.ix_(pair, pair)]

    def step(self, fix: FixArrays) -> None:
        since_s = (fix.at_ns - self.at_ns) * 1e-9
        self.at_ns = fix.at_ns
        self._wander(since_s)
        noise = self._turned(fix, self._repeated(fix, since_s)) + self._sensitivity_noise(fix, since_s)
        d = fix.shared - H @ self.shared
        innovation = H @ self.noise @ H.T + noise + d @ d.T
        gain = (self.noise @ H.T - self.shared @ d.T) @ np.linalg.inv(innovation)
        rest = np.eye(6) - gain @ H
        self.mean = self.mean + gain @ (fix.position - self.mean[:2])
        self.noise = rest @ self.noise @ rest.T + gain @ noise @ gain.T
        self.shared = self.shared + gain @ d

    def _wander(self, since_s: float) -> None:
        """The process by the matrix exponential: apparent = place + error, error'' = -w^2 error - 2 w error'."""
        w = self.rate
        process = expm(since_s * np.array([[0.0, 1.0], [-w * w, -2.0 * w]]))
        steady = self.sigma**2 * np.diag([1.0, w * w])
        added = steady - process @ steady @ process.T
        states = np.zeros((3, 3))
        states[0] = [process[0, 0], 1.0 - process[0, 0], process[0, 1]]
        states[1, 1] = 1.0
        states[2] = [process[1, 0], -process[1, 0], process[1, 1]]
        move, more = np.kron(states, np.eye(2)), np.zeros((3, 3))
        more[np.ix_([0, 2], [0, 2])] = added
        self.mean, self.shared = move @ self.mean, move @ self.shared
        self.noise = move @ self.noise @ move.T + np.kron(more, np.eye(2))

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
        of_fix, of_target = fix.position - fix.camera, self.mean[:2] - fix.camera
        both = sqrt((of_fix @ of_fix) * (of_target @ of_target))
        cosine = of_fix @ of_target / both
        if cosine <= MOST_TURN_COSINE:
            return noise
        sine = (of_fix[0] * of_target[1] - of_fix[1] * of_target[0]) / both
        turn = np.array([[cosine, -sine], [sine, cosine]])
        return turn @ noise @ turn.T

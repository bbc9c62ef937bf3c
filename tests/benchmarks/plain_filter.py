"""The state of a static target as a plain implementation with filterpy and numpy: the reference for speed. Frozen.

filterpy has no consider filter, so its :class:`KalmanFilter` holds position and noise, and the shared biases are
separate arrays: the same estimate as ours by plain matrices. It is tuned neither for speed nor against it. Do not
change it: ratios are comparable over time only while this stays the same.
"""

from __future__ import annotations

from math import exp, sqrt

import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from fwav_companion.types import Bias, ErrorPriors, GroundFix

Array = NDArray[np.float64]
WANDERING = [Bias.POSITION_NORTH, Bias.POSITION_EAST]
TELEMETRY_STEP_S = 0.1
MOST_TURN_COSINE = 0.7
DOWN_FLOOR = np.diag([0.0, 0.0, 0.02**2])


class FixArrays:
    """A fix as arrays, made beforehand."""

    def __init__(self, fix: GroundFix, priors: ErrorPriors) -> None:
        self.at_ns = fix.sighting.frame_host_ns
        self.camera = np.array(fix.sighting.camera_ned)[:2]
        self.position = np.array(fix.position_ned)
        self.noise = np.array(fix.noise_cov) + DOWN_FLOOR
        jacobian = np.array(fix.bias_jacobian).T
        self.by_height = jacobian[:, Bias.HEIGHT]
        self.shared = jacobian * np.array(priors.bias_sigmas)


class PlainFilter:
    """Position and noise in filterpy's filter; in addition cov(error, biases) and the earlier values of the wandering
    biases.
    """

    def __init__(self, first: FixArrays, priors: ErrorPriors) -> None:
        self.priors = priors
        self.kalman = KalmanFilter(dim_x=3, dim_z=3)
        self.kalman.H, self.kalman.Q = np.eye(3), np.zeros((3, 3))
        self.kalman.x, self.kalman.P = first.position, first.noise
        self.shared = first.shared.copy()
        self.forgotten = np.zeros((3, 3))
        self.at_ns = first.at_ns

    @property
    def cov(self) -> Array:
        return self.kalman.P + self.shared @ self.shared.T + self.forgotten

    def step(self, fix: FixArrays) -> None:
        since_s = (fix.at_ns - self.at_ns) * 1e-9
        self.at_ns = fix.at_ns
        self._wander(exp(-since_s / self.priors.position_bias_time_s))
        self.kalman.predict()
        self.kalman.update(fix.position, R=self._turned(fix, self._noise(fix, since_s)))
        gain = self.kalman.K
        rest = np.eye(3) - gain
        self.shared += gain @ (fix.shared - self.shared)
        self.forgotten = rest @ self.forgotten @ rest.T

    def _wander(self, kept: float) -> None:
        wandering = self.shared[:, WANDERING]
        self.forgotten += (1.0 - kept * kept) * wandering @ wandering.T
        self.shared[:, WANDERING] *= kept

    def _noise(self, fix: FixArrays, since_s: float) -> Array:
        if since_s >= TELEMETRY_STEP_S:
            return fix.noise
        repeated = TELEMETRY_STEP_S / since_s - 1.0
        height = self.priors.height_noise_m**2 * np.outer(fix.by_height, fix.by_height)
        return fix.noise + repeated * (height + self.priors.position_noise_m**2 * np.diag([1.0, 1.0, 0.0]))

    def _turned(self, fix: FixArrays, noise: Array) -> Array:
        of_fix, of_target = fix.position[:2] - fix.camera, self.kalman.x[:2] - fix.camera
        both = sqrt((of_fix @ of_fix) * (of_target @ of_target))
        cosine = of_fix @ of_target / both
        if cosine <= MOST_TURN_COSINE:
            return noise
        sine = (of_fix[0] * of_target[1] - of_fix[1] * of_target[0]) / both
        turn = np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
        return turn @ noise @ turn.T

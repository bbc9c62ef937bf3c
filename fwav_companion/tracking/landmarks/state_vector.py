"""The errors that all targets share, in the order in which landmarks estimate them.

======================  ==============================================================================================
biases                  every bias but the vehicle's position, in units of its prior
altitude                the vehicle's altitude above sea level against the landmarks', metres
wander                  the vehicle's position: error and rate of each process, north, then east; metres and m/s
survey                  north, east and height of each landmark, metres
======================  ==============================================================================================

The height above home is barometric and good to decimetres; altitudes above sea level are the receiver's, and worse than
its place by 1.5 to 2 times. A target on the home surface depends on the first alone, a landmark on both.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt

import numpy as np

from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.filters.consider_biases import ConsiderBiases, Measurement
from fwav_companion.tracking.filters.position_wander import PositionWander, position_wander
from fwav_companion.types import Bias, ErrorPriors, GroundFix, Landmark

ALTITUDE_SHARE = 2.0
"""One sigma of the receiver's altitude over that of its place: 1.5 to 2."""

TURNING = (
    Bias.ROLL, Bias.PITCH, Bias.HEADING, Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z, Bias.TIME_OFFSET, Bias.READOUT,
)  # fmt: skip
"""Biases that turn the ray."""
CONSIDERED = (
    Bias.TIME_OFFSET, Bias.READOUT, Bias.TERRAIN, Bias.POSITION_DELAY, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z,
)  # fmt: skip
"""Biases that landmarks do not move. A flight shows little of them, in small differences of sensitivities; those have
the noise of the telemetry, and so has each fix: 30 sights/s over half a minute of an orbit without any delay of its
positions showed one of -45 to -95 ms where 25 ms were claimed."""


class SharedErrors:
    """Layout, priors and dynamics of the shared errors. Immutable."""

    def __init__(self, priors: ErrorPriors, landmarks: Sequence[Landmark]) -> None:
        self.errors = ConsiderBiases(priors, wandering=False)
        self.landmarks = tuple(landmarks)
        north, east = priors.sigma(Bias.POSITION_NORTH), priors.sigma(Bias.POSITION_EAST)
        self.position_sigma_m = sqrt(0.5 * (north * north + east * east))
        """One sigma of the position where the receiver has no word of its own, metres an axis."""
        self._times_s = priors.position_times_s
        self._unit = (north, east)
        processes = len(self._times_s)
        self.biases = slice(0, self.errors.count)
        self.altitude = self.errors.count
        self.wander = slice(self.altitude + 1, self.altitude + 1 + 4 * processes)
        self._axis = 2 * processes
        self.size = self.wander.stop + 3 * len(self.landmarks)
        self._scaled = {
            bias: (index, priors.sigma(bias)) for bias in Bias if (index := self.errors.index_of(bias)) is not None
        }
        self.estimated = np.ones(self.size)
        """(size) 0 for what is considered and not estimated, else 1."""
        self.estimated[[self._scaled[bias][0] for bias in CONSIDERED if bias in self._scaled]] = 0.0
        self._turns = [self._scaled[bias][0] for bias in TURNING if bias in self._scaled]
        self.height = self.errors.index_of(Bias.HEIGHT)
        """Index of the height's bias; None where it has no prior."""
        self.height_sigma_m = priors.sigma(Bias.HEIGHT)

    def survey(self, landmark: int) -> slice:
        """The states of one landmark."""
        first = self.wander.stop + 3 * landmark
        return slice(first, first + 3)

    def prior(self, sigma_m: float) -> Array:
        """The covariance before any sight, by a receiver of this accuracy."""
        variances = np.ones(self.size)
        variances[self.altitude] = (ALTITUDE_SHARE * sigma_m) ** 2
        variances[self.wander] = self.stationary(sigma_m)
        for i, landmark in enumerate(self.landmarks):
            variances[self.survey(i)] = landmark.sigma_m**2
        return np.diag(variances)

    def stationary(self, sigma_m: float) -> Array:
        """The variances of the wander's states that it has in the long run."""
        wander = self._process(sigma_m)
        each = wander.variance_each
        return np.array([variance for rate in wander.rates for variance in (each, each * rate * rate)] * 2)

    def transition(self, from_ns: HostNs, to_ns: HostNs) -> Array:
        """The transition of the wander's states: critically damped second-order processes."""
        t = s_from_ns(to_ns - from_ns)
        step = np.zeros((self.wander.stop - self.wander.start,) * 2)
        for i, rate in enumerate(self._process(self.position_sigma_m).rates * 2):
            decay = np.exp(-rate * t)
            block = ((1.0 + rate * t, t), (-rate * rate * t, 1.0 - rate * t))
            step[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = decay * np.array(block)
        return step

    def rows(self, measurement: Measurement, fix: GroundFix) -> Array:
        """(2, size) d(north, east)/d(shared errors) of a fix."""
        rows = np.zeros((2, self.size))
        rows[0, self.biases], rows[1, self.biases] = measurement.shared[:2]
        if self.position_sigma_m > 0.0:
            first, axis = self.wander.start, self._axis
            for k, bias in enumerate((Bias.POSITION_NORTH, Bias.POSITION_EAST)):
                column = np.array(fix.bias_jacobian[bias][:2]) * self._unscaled(fix)
                rows[:, first + k * axis : first + (k + 1) * axis : 2] = column[:, None]
        return rows

    def with_heading(self, rows: Array, toward: tuple[float, float]) -> None:
        """Set the sensitivity to the heading to that of a target in this place from the camera, metres."""
        scaled = self._scaled.get(Bias.HEADING)
        if scaled is not None:
            rows[:, scaled[0]] = (-toward[1] * scaled[1], toward[0] * scaled[1])

    def value(self, mean: Array, bias: Bias) -> float:
        """The mean of one bias, in its unit."""
        scaled = self._scaled.get(bias)
        return 0.0 if scaled is None else float(mean[scaled[0]]) * scaled[1]

    def turning(self, rows: Array, mean: Array) -> Array:
        """(2) what the estimated rotations do to a fix, to first order."""
        return np.asarray(rows[:, self._turns] @ mean[self._turns])

    def sigma_at(self, fix: GroundFix) -> float:
        """One sigma of the position at a fix by the receiver's own word, else the configured one."""
        by_receiver = fix.sighting.state.position_bias_m
        return self.position_sigma_m if by_receiver is None or self.position_sigma_m == 0.0 else by_receiver

    def _unscaled(self, fix: GroundFix) -> float:
        """The factor to the columns of the position: those of a fix are per sigma of the receiver's word."""
        by_receiver = fix.sighting.state.position_bias_m
        return self._unit[0] / by_receiver if by_receiver else 1.0

    def _process(self, sigma_m: float) -> PositionWander:
        return position_wander(sigma_m, self._times_s)

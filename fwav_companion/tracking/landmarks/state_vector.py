"""The errors that all targets share, in the order in which landmarks estimate them.

======================  ==============================================================================================
biases                  every bias but the vehicle's position, in units of its prior
altitude                the vehicle's altitude above sea level against the landmarks', metres
wander                  the vehicle's position: error and rate of each process, north, then east; metres and m/s
survey                  north, east and height of each landmark, metres
======================  ==============================================================================================

The height above home is barometric and accurate to decimetres. Altitudes above sea level are the receiver's, with 1.5
to 2 times the error of its horizontal position. A target on the home surface depends on the height above home alone, a
landmark on both.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fwav_companion.geometry.rotations import matrix_from_quaternion
from fwav_companion.geometry.stamps import HostNs, s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, scale, transform
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.tracking.filters.consider_biases import Measurement
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.position_wander import process_step
from fwav_companion.types import Bias, ErrorPriors, GroundFix, Landmark, Sighting

ALTITUDE_SHARE = 2.0
"""Ratio of one sigma of the receiver's altitude to one sigma of its horizontal position: 1.5 to 2."""

TIMED = (Bias.TIME_OFFSET, Bias.READOUT)
LEVERS = (Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z)
CONSIDERED = (Bias.TERRAIN, Bias.LEVER_X, Bias.LEVER_Y, Bias.LEVER_Z)
"""Biases that are considered and not estimated: their effects are small, and those of others look alike. With them
estimated, the best possible accuracy of a target near a landmark is the same to 0.003 m."""


class SharedErrors:
    """Layout, priors and dynamics of the shared errors. Immutable."""

    def __init__(self, priors: ErrorPriors, landmarks: Sequence[Landmark]) -> None:
        self.own = StaticKalman(priors)
        """The filter of a target alone."""
        self.errors = self.own.model.errors
        self.landmarks = tuple(landmarks)
        self.attitude_noise = priors.attitude_noise
        """Attitude noise about each axis, one sigma, independent in each attitude, radians."""
        self._wander = self.own.model.wander
        self.position_sigma_m = self._wander.sigma_m
        """One sigma of the vehicle's position where the receiver reports no accuracy, metres an axis."""
        self._unit_m = priors.sigma(Bias.POSITION_NORTH)
        processes = len(self._wander.rates)
        self.biases = slice(0, self.errors.count)
        self.altitude = self.errors.count
        self.wander = slice(self.altitude + 1, self.altitude + 1 + 4 * processes)
        self._axis = 2 * processes
        self.size = self.wander.stop + 3 * len(self.landmarks)
        self._scaled = {
            bias: (index, priors.sigma(bias)) for bias in Bias if (index := self.errors.index_of(bias)) is not None
        }
        self.estimated = np.ones(self.size)
        """(size) 1 for each estimated state, 0 for each considered state."""
        self.estimated[[self._scaled[bias][0] for bias in CONSIDERED if bias in self._scaled]] = 0.0
        straight = {self._scaled[bias][0] for bias in TIMED if bias in self._scaled}
        self.bent = [i for i in range(self.errors.count) if i not in straight] + [self.altitude]
        """Indices of the states whose sensitivities are uncertain."""
        self.bent_variances = np.array([1.0] * (len(self.bent) - 1) + [(ALTITUDE_SHARE * self.position_sigma_m) ** 2])
        """Prior variances of these states."""

    def survey(self, landmark: int) -> slice:
        """Slice of the survey states of one landmark."""
        first = self.wander.stop + 3 * landmark
        return slice(first, first + 3)

    def prior(self, sigma_m: float) -> Array:
        """The covariance before any sight, with a receiver of this accuracy."""
        variances = np.ones(self.size)
        variances[self.altitude] = (ALTITUDE_SHARE * sigma_m) ** 2
        variances[self.wander] = self.stationary(sigma_m)
        for i, landmark in enumerate(self.landmarks):
            variances[self.survey(i)] = landmark.sigma_m**2
        return np.diag(variances)

    def stationary(self, sigma_m: float) -> Array:
        """Stationary variances of the wander's states, with a receiver of this accuracy."""
        variances = np.array(self._wander.prior_variances * 2)
        return variances * (sigma_m / self.position_sigma_m) ** 2 if self.position_sigma_m else variances

    def transition(self, from_ns: HostNs, to_ns: HostNs) -> Array:
        """The transition of the wander's states: critically damped second-order processes."""
        t = s_from_ns(to_ns - from_ns)
        step = np.zeros((self.wander.stop - self.wander.start,) * 2)
        for i, rate in enumerate(self._wander.rates * 2):
            ee, er, re, rr = process_step(rate, t)
            step[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = ((ee, er), (re, rr))
        return step

    def rows(self, measurement: Measurement, fix: GroundFix) -> Array:
        """(2, size) d(north, east)/d(shared errors) of a fix."""
        rows = np.zeros((2, self.size))
        rows[0, self.biases], rows[1, self.biases] = measurement.shared[:2]
        if self.errors.curved is not None:  # second order of the delay, which is estimated here
            rows[:, self.errors.curved] = 0.0
        if self.position_sigma_m > 0.0:
            for k, bias in enumerate((Bias.POSITION_NORTH, Bias.POSITION_EAST)):
                column = np.array(fix.bias_jacobian[bias][:2]) * self._unscaled(fix)
                rows[:, self._wander_of(k)] = column[:, None]
        return rows

    def value(self, mean: Array, bias: Bias) -> float:
        """The mean of one bias, in its unit."""
        scaled = self._scaled.get(bias)
        return 0.0 if scaled is None else float(mean[scaled[0]]) * scaled[1]

    def rotation(self, sighting: Sighting, mean: Array, taken_s: float) -> Vector3:
        """Rotation vector of a ray's error, NED, radians. ``taken_s``: delay that the pose already has, seconds."""
        late_s, (p, q, r) = self.late_s(sighting, mean) - taken_s, sighting.state.carrier_rates
        in_body = (
            self.value(mean, Bias.ROLL) - self.value(mean, Bias.MOUNT_X) + late_s * p,
            self.value(mean, Bias.PITCH) - self.value(mean, Bias.MOUNT_Y) + late_s * q,
            late_s * r - self.value(mean, Bias.MOUNT_Z),
        )
        ned = transform(matrix_from_quaternion(sighting.state.ned_from_carrier), in_body)
        return add(ned, (0.0, 0.0, self.value(mean, Bias.HEADING)))

    def displacement(self, sighting: Sighting, mean: Array, taken_s: float) -> Vector3:
        """Reported minus true position of the camera above home, NED, metres; ``taken_s`` as in :meth:`rotation`."""
        late_s = self.late_s(sighting, mean) - taken_s - self.value(mean, Bias.POSITION_DELAY)
        lever = tuple(self.value(mean, bias) for bias in LEVERS)
        by_lever = transform(matrix_from_quaternion(sighting.state.ned_from_body), (lever[0], lever[1], lever[2]))
        by_time = scale(sighting.state.velocity_ned or ZERO3, late_s)
        north, east = (float(mean[self._wander_of(axis)].sum()) for axis in (0, 1))
        return add(add(by_lever, by_time), (north, east, -self.value(mean, Bias.HEIGHT)))

    def direction_rows(self, sighting: Sighting, by_turn: Array, by_point: Array) -> Array:
        """(2, size) d(direction of a point above home)/d(shared errors).

        ``by_turn``, ``by_point``: (2, 3) derivatives of the direction by a turn and by the point.
        """
        rows = np.zeros((2, self.size))
        state = sighting.state
        body = by_turn @ np.array(matrix_from_quaternion(state.ned_from_carrier))
        lever = by_point @ np.array(matrix_from_quaternion(state.ned_from_body))
        by_delay = by_point @ np.array(state.velocity_ned or ZERO3)
        by_time = body @ np.array(state.carrier_rates) + by_delay
        columns = {
            Bias.ROLL: body[:, 0], Bias.PITCH: body[:, 1], Bias.HEADING: by_turn[:, 2],
            Bias.MOUNT_X: -body[:, 0], Bias.MOUNT_Y: -body[:, 1], Bias.MOUNT_Z: -body[:, 2],
            Bias.TIME_OFFSET: by_time, Bias.READOUT: sighting.row_fraction * by_time,
            Bias.HEIGHT: -by_point[:, 2], Bias.POSITION_DELAY: -by_delay,
            **{bias: lever[:, k] for k, bias in enumerate(LEVERS)},
        }  # fmt: skip
        for bias, (index, sigma) in self._scaled.items():
            if bias in columns:
                rows[:, index] = columns[bias] * sigma
        if self.position_sigma_m > 0.0:
            for axis in (0, 1):
                rows[:, self._wander_of(axis)] = by_point[:, axis, None]
        return rows

    def with_level(self, rows: Array, fix: GroundFix, by_point: Array) -> None:
        """Set the sensitivities of a target's direction to the level of its ground and to its own height."""
        depths = {Bias.TERRAIN: float(any(fix.bias_jacobian[Bias.TERRAIN])),
                  Bias.TARGET_HEIGHT: fix.sighting.anchor_sigma_m}  # fmt: skip
        for bias, depth in depths.items():
            if bias in self._scaled:
                index, sigma = self._scaled[bias]
                rows[:, index] = by_point[:, 2] * depth * sigma

    def late_s(self, sighting: Sighting, mean: Array) -> float:
        """The estimated delay of a sighting's stamp, seconds."""
        return self.value(mean, Bias.TIME_OFFSET) + sighting.row_fraction * self.value(mean, Bias.READOUT)

    def _wander_of(self, axis: int) -> slice:
        """Slice of the states of the position's errors along one axis."""
        first = self.wander.start + axis * self._axis
        return slice(first, first + self._axis, 2)

    def _unscaled(self, fix: GroundFix) -> float:
        """Factor to the position columns of a fix, which are per sigma of the accuracy that the receiver reports."""
        by_receiver = fix.sighting.state.position_bias_m
        return self._unit_m / by_receiver if by_receiver else 1.0

"""The vehicle's path by its reported positions, smoothed with its reported velocities."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import TypeAlias

import msgspec
import numpy as np

from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.types import ErrorPriors, VehicleState

TELEMETRY_STEP_S = 0.1
"""Height and position arrive at 10 Hz and are interpolated: frames that come faster share their noise, and that of the
attitudes where those come no faster."""
VELOCITY_DENSITY = 0.05**2 * TELEMETRY_STEP_S
"""Density of what reported velocities leave open, m^2/s: 0.1 m/s, fresh in every report."""
JUMP_SIGMAS, JUMP_LEAST_M = 6.0, 0.05
LONGEST_S = 2.0
"""A step of the position, and an interval, after which smoothing begins again."""

SmoothedReport: TypeAlias = tuple[tuple[float, float], tuple[float, float]]
"""Noise of one reported position, north and east, metres, and the variance of what is left of it, m^2."""


class PositionPath(msgspec.Struct, frozen=True):
    """The newest point of the path, by a Kalman filter of each axis with the velocity as its input. Immutable."""

    at_s: float = 0.0
    position: Array = np.full(3, np.nan)
    """NaN before the first."""
    velocity: Array = np.zeros(3)
    variance: Array = np.zeros(3)
    begun: int = 0
    """Number of times that the path began again."""

    def report(self, vehicle: VehicleState, priors: ErrorPriors) -> SmoothedReport | None:
        """The noise of a later report, and the variance that is left of it; None without a path that leads to it."""
        at_s = s_from_ns(vehicle.boot_ns)
        if vehicle.position_ned is None or vehicle.velocity_ned is None:
            return None
        if np.isnan(self.position[0]) or not 0.0 < at_s - self.at_s < LONGEST_S:
            return None
        position = np.array(vehicle.position_ned)
        after = self.after(at_s, position, np.array(vehicle.velocity_ned), priors)
        (north, east, _), (var_n, var_e, _) = (position - after.position).tolist(), after.variance.tolist()
        return (north, east), (var_n, var_e)

    def after(self, at_s: float, position: Array, velocity: Array, priors: ErrorPriors) -> PositionPath:
        """The path with one more report."""
        noise = np.array((priors.position_noise_m, priors.position_noise_m, priors.height_noise_m)) ** 2
        seconds = at_s - self.at_s
        if np.isnan(self.position[0]) or not 0.0 < seconds < LONGEST_S:
            return PositionPath(at_s, position, velocity, noise, self.begun + 1)
        predicted, variance = self._predicted(at_s, velocity)
        gain = variance / (variance + noise * max(1.0, TELEMETRY_STEP_S / seconds))
        off = position - predicted
        if (np.abs(off) > JUMP_SIGMAS * np.sqrt(variance + noise + JUMP_LEAST_M**2)).any():
            return PositionPath(at_s, position, velocity, noise, self.begun + 1)
        return PositionPath(at_s, predicted + gain * off, velocity, (1.0 - gain) * variance, self.begun)

    def _predicted(self, at_s: float, velocity: Array) -> tuple[Array, Array]:
        """Position and variance at a later instant with this velocity."""
        seconds = at_s - self.at_s
        variance = self.variance + VELOCITY_DENSITY * seconds + chord_error_m(self.velocity, velocity, seconds) ** 2
        return self.position + 0.5 * (self.velocity + velocity) * seconds, variance

    def shift_by(self, later: PositionPath, shift: Array) -> Array:
        """Change of the position by the later one of the path, which changes by ``shift``; 0 on another path."""
        if later.begun != self.begun or later.at_s <= self.at_s:
            return np.zeros(3)
        predicted, variance = self._predicted(later.at_s, later.velocity)
        return np.asarray(self.variance / variance * (later.position + shift - predicted))


def chord_error_m(before: Array, after: Array, seconds: float) -> float:
    """Distance between the end of a path with the mean of two velocities and that of an arc between them, metres.

    Over an arc with the angle 2 a and the speed v, the chord is v t sin(a) / a, and the mean velocity makes
    v t cos(a) of it. A target that leaves the view on a tight circle is seen again after a third of a turn: the
    smoothed path was 0.6 m off there, and followed the reported positions only within seconds.
    """
    squares = float(before @ before), float(after @ after)
    both = float(before @ after)
    half = 0.5 * atan2(sqrt(max(0.0, squares[0] * squares[1] - both * both)), both)
    speed = sqrt(0.5 * sum(squares))
    return speed * seconds * (sin(half) / half - cos(half)) if half > 0.0 else 0.0

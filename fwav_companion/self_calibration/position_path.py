"""The vehicle's path by its reported positions, smoothed with its reported velocities."""

from __future__ import annotations

from math import atan2, cos, sin, sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import s_from_ns
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, dot, scale, subtract
from fwav_companion.types import ErrorPriors, VehicleState

TELEMETRY_STEP_S = 0.1
"""Interval of height and position, s: they arrive at 10 Hz ([rates] position) and are interpolated. Frames that come
faster share their noise, and also the noise of the attitudes where those come no faster than the frames."""
VELOCITY_DENSITY = 0.05**2 * TELEMETRY_STEP_S
"""Process noise of the position due to errors of reported velocities, m^2/s: 0.05 m/s, fresh in every report."""
JUMP_SIGMAS, JUMP_LEAST_M = 6.0, 0.05
"""Step of the position from which smoothing starts again, in sigmas, and a part of that sigma, m."""
LAG_SHARE = 0.125
"""Share of a new innovation of the height in their running mean: about the last eight, 0.8 s."""
LAG_SIGMAS = 3.5
"""Running mean from which the vertical velocity is wrong: by the noise of innovations alone once in 200 s."""
LONGEST_S = 2.0
"""Interval of two reports from which smoothing starts again, s."""

SmoothedReport: TypeAlias = tuple[Vector3, Vector3]
"""Estimated noise of one reported position, NED, metres, and the variance of that estimate on each axis, m^2."""


class PositionPath(msgspec.Struct, frozen=True, gc=False):
    """Newest point of the path, from a Kalman filter of each axis with the reported velocity as input. Immutable."""

    at_s: float = 0.0
    position: Vector3 = ZERO3
    velocity: Vector3 = ZERO3
    variance: Vector3 = ZERO3
    begun: int = 0
    """Number of starts of the path; 0 before the first report."""
    lag_m: float = 0.0
    """Running mean of the innovations of the height (fading-memory mean, Bar-Shalom, Li & Kirubarajan 2001, ch. 11)."""
    opened_m2: float = 0.0
    """Variance that was added to the predicted height because of that mean, m^2."""

    def report(self, vehicle: VehicleState, priors: ErrorPriors) -> SmoothedReport | None:
        """The estimated noise of a later report, and its variance; None if the path does not lead to that report."""
        at_s, position = s_from_ns(vehicle.boot_ns), vehicle.position_ned
        if position is None or vehicle.velocity_ned is None or not self._leads_to(at_s):
            return None
        after = self.after(at_s, position, vehicle.velocity_ned, priors)
        return subtract(position, after.position), after.variance

    def after(self, at_s: float, position: Vector3, velocity: Vector3, priors: ErrorPriors) -> PositionPath:
        """The path with one more report.

        Where the innovations of the height lean one way, the vertical velocity is wrong, as that of a heaving wing: the
        height is then opened by as much as it lags.
        """
        level, down = priors.position_noise_m**2, priors.height_noise_m**2
        noise = (level, level, down)
        begun = PositionPath(at_s, position, velocity, noise, self.begun + 1)
        if not self._leads_to(at_s):
            return begun
        predicted, variance = self._predicted(at_s, velocity)
        off, repeated = subtract(position, predicted), max(1.0, TELEMETRY_STEP_S / (at_s - self.at_s))
        for o, v, n in zip(off, variance, noise, strict=True):
            if abs(o) > JUMP_SIGMAS * sqrt(v + n + JUMP_LEAST_M**2):
                return begun
        lag_m, opened_m2 = self._lag(off[2], variance[2] + down)
        variance = add(variance, (0.0, 0.0, opened_m2))
        x, y, z = (v / (v + n * repeated) for v, n in zip(variance, noise, strict=True))
        position = add(predicted, (x * off[0], y * off[1], z * off[2]))
        left = ((1.0 - x) * variance[0], (1.0 - y) * variance[1], (1.0 - z) * variance[2])
        return PositionPath(at_s, position, velocity, left, self.begun, lag_m, opened_m2)

    def _lag(self, off_m: float, variance: float) -> tuple[float, float]:
        """``lag_m`` and ``opened_m2`` after an innovation of the height with this variance."""
        lag_m = self.lag_m + LAG_SHARE * (off_m - self.lag_m)
        if lag_m * lag_m <= LAG_SIGMAS**2 * LAG_SHARE / (2.0 - LAG_SHARE) * variance:
            return lag_m, 0.0
        return 0.0, lag_m * lag_m

    def _leads_to(self, at_s: float) -> bool:
        return self.begun > 0 and 0.0 < at_s - self.at_s < LONGEST_S

    def _predicted(self, at_s: float, velocity: Vector3) -> tuple[Vector3, Vector3]:
        """Predicted position and variance at a later instant with this velocity."""
        seconds = at_s - self.at_s
        more = VELOCITY_DENSITY * seconds + chord_error_m(self.velocity, velocity, seconds) ** 2
        moved = scale(add(self.velocity, velocity), 0.5 * seconds)
        return add(self.position, moved), add(self.variance, (more, more, more))

    def shift_by(self, later: PositionPath, shift: Vector3) -> Vector3:
        """Correction of this point by the ``later`` one, which is corrected by ``shift``; 0 if on another path."""
        if later.begun != self.begun or later.at_s <= self.at_s:
            return ZERO3
        predicted, variance = self._predicted(later.at_s, later.velocity)
        x, y, z = subtract(add(later.position, shift), predicted)
        (own_x, own_y, own_z), (of_x, of_y, of_z) = self.variance, add(variance, (0.0, 0.0, later.opened_m2))
        return (own_x / of_x * x, own_y / of_y * y, own_z / of_z * z)


def chord_error_m(before: Vector3, after: Vector3, seconds: float) -> float:
    """Error of a prediction with the mean of two velocities if the vehicle flies an arc between them, metres.

    Over an arc with the angle 2 a and the speed v, the chord is v t sin(a) / a, but the mean velocity gives
    v t cos(a). A target that leaves the view on a tight circle is seen again after a third of a turn: the smoothed path
    was 0.6 m off there, and took seconds to follow the reported positions.
    """
    squares, both = (dot(before, before), dot(after, after)), dot(before, after)
    half = 0.5 * atan2(sqrt(max(0.0, squares[0] * squares[1] - both * both)), both)
    speed = sqrt(0.5 * sum(squares))
    return speed * seconds * (sin(half) / half - cos(half)) if half > 0.0 else 0.0

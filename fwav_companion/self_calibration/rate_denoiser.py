"""Angular rates of the vehicle without the noise of the attitudes from which they are computed.

Rates are slopes of the attitude over time, and noise adds slopes of its own. In the rows of the camera's delay such a
slope looks like a motion that shows the delay: on a body that hardly turns, the delay would be found from noise alone,
with a small sigma. So rates are split. Between two distant instants noise adds nearly no slope: slow turning is known.
Faster turning is known as far as it exceeds the noise: errors in a regressor are corrected by its reliability, the
share of its mean square that is not noise (errors in variables: Fuller 1987). One such share of all rates together is
not enough: mount and position explain a slow turn nearly as well as a delay does, so little of the turn shows the
delay, while all of the noise remains.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.rotations import difference
from fwav_companion.geometry.vectors import ZERO3, Vector3, scale, subtract
from fwav_companion.self_calibration.arrays import Array
from fwav_companion.self_calibration.delayed_poses import DelayedPoses
from fwav_companion.types import GimbalAt, VehicleState

SPAN_S = 0.3
"""Interval of the slow rates, s: noise of 0.1 deg makes a slope of 0.5 deg/s over it, but 8 deg/s between neighbours
at 50 Hz. A vehicle banks into its turns as slowly, and three beats of 10 Hz cancel."""
SLOPE_NOISE = 1.6
"""One sigma of the slope of a curve through attitudes with independent noise, in units of that noise over their
spacing: sqrt(2) for a chord, 1.2 to 1.6 within a cubic through four, 1.1 sqrt(2) on the mean for a cubic with given
slopes."""
MEMORY = 50
"""Time constant of the fading sums, in samples: five seconds, several beats of a slow wing."""
BEGUN = 3
"""Number of samples of pure noise that the sums contain before the first sample."""


def slow_rates(before: VehicleState, after: VehicleState) -> Vector3:
    """Mean angular velocity of the camera's carrier between two states SPAN_S apart, in the carrier's axes, rad/s."""
    return scale(difference(after.ned_from_carrier, before.ned_from_carrier), 1.0 / SPAN_S)


class RateDenoiser(msgspec.Struct, frozen=True, gc=False):
    """Fading sums of squared fast rates and of their noise, over samples. Immutable."""

    reported2: Vector3 = ZERO3
    """Sum of squares of the fast rates as reported, about the axes of the carrier, (rad/s)^2."""
    noise2: float = 0.0
    """Sum of squares expected from noise alone, about each axis, (rad/s)^2."""

    def with_state(self, state: VehicleState, slow: Vector3, attitude_noise: float) -> RateDenoiser:
        """The sums after one more sample; ``attitude_noise``: one sigma about an axis, rad, fresh in every attitude.

        A gimbal's rates come from its own attitudes, whose interval is not known: they leave the sums unchanged.
        """
        if isinstance(state.gimbal, GimbalAt) or not state.spacing_s > 0.0:
            return self
        noise2 = (SLOPE_NOISE * attitude_noise / state.spacing_s) ** 2
        x, y, z = subtract(state.carrier_rates, slow)
        if self.reported2 == ZERO3:
            before, (a, b, c) = BEGUN * noise2, (BEGUN * noise2,) * 3
        else:
            kept = 1.0 - 1.0 / MEMORY
            before, (a, b, c) = kept * self.noise2, (kept * s for s in self.reported2)
        return RateDenoiser((a + x * x, b + y * y, c + z * z), before + noise2)

    @property
    def shares(self) -> Vector3:
        """Share of each fast rate's mean square that is not noise; 1 where the noise is not known."""
        x, y, z = (max(0.0, 1.0 - self.noise2 / square) if square > 0.0 else 1.0 for square in self.reported2)
        return (x, y, z)


def denoised(poses: DelayedPoses, by: Array) -> DelayedPoses:
    """The poses (N, D) with rates expected from the reported ones; ``by`` (N, 2, 3): slow rates, and shares."""
    slow, shares = by[:, None, 0], by[:, None, 1]
    rates = slow + shares * (poses.rates - slow)
    return msgspec.structs.replace(poses, rates=rates, acceleration=shares * poses.acceleration)

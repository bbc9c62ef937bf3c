"""How the vehicle really moves, beside the noise of the attitudes and places that its rates are taken from.

Rates are slopes of the attitude's course, and noise makes slopes of its own. In the rows of the camera's delay such a
slope looks like a motion that shows the delay: a body that hardly turns would find it by noise alone, and be sure of
it. So rates are told apart. Between two instants far apart noise makes next to no slope: what turns slowly is known.
What turns faster than that is known as far as it exceeds the noise: errors in a regressor are undone by its
reliability, the share of its mean square that is no noise. Of all rates together that share would not do: mount and
place explain a slow turn nearly as well as a delay does, so what shows the delay is little, and the noise is all there.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.rotations import difference
from fwav_companion.geometry.vectors import ZERO3, Vector3, add, scale, subtract
from fwav_companion.self_calibration.delayed_poses import DelayedPoses, VehiclePose
from fwav_companion.types import GimbalAt, VehicleState

SPAN_S = 0.3
"""Between the two instants: noise of 0.1 deg makes a slope of 0.5 deg/s of it, where neighbours at 50 Hz make 8. A
vehicle banks into its turns as slowly, and three beats of 10 Hz cancel. Places with 0.1 m of noise, ten a second, make
slopes of 0.5 m/s of it, and 1.4 between neighbours."""
SLOPE_NOISE = 1.6
"""One sigma of a slope of a course through attitudes with fresh noise, in units of that noise over their spacing:
sqrt(2) for a chord, 1.2 to 1.6 within a cubic through four, 1.1 sqrt(2) on the mean for one with slopes given."""
MEMORY = 100
"""Frames: several beats of a slow wing."""
BEGUN = 3
"""Frames of nothing but noise that are counted before the first."""


class SmoothedMotion(msgspec.Struct, frozen=True, gc=False):
    """The mean motion over SPAN_S."""

    rates: Vector3 = ZERO3
    """Of what carries the camera, rad/s, its own axes."""
    velocity_ned: Vector3 | None = None
    """m/s; None where it is not told."""


def slow_between(before: VehicleState, after: VehicleState) -> SmoothedMotion:
    """The mean motion between two states that are SPAN_S apart."""
    rates = scale(difference(after.ned_from_carrier, before.ned_from_carrier), 1.0 / SPAN_S)
    if before.position_ned is None or after.position_ned is None:
        return SmoothedMotion(rates)
    return SmoothedMotion(rates, scale(subtract(after.position_ned, before.position_ned), 1.0 / SPAN_S))


class RateDenoiser(msgspec.Struct, frozen=True, gc=False):
    """Fading sums over frames. Immutable."""

    told2: Vector3 = ZERO3
    """Squared rates, beyond the slow ones, about the axes of what carries the camera."""
    noise2: float = 0.0
    """What noise alone would have made of each."""

    def with_state(self, state: VehicleState, slow: SmoothedMotion, attitude_noise: float) -> RateDenoiser:
        """With one more frame; ``attitude_noise``: one sigma about an axis, rad, fresh in every attitude.

        A gimbal's rates are of its own attitudes, whose spacing is not told: nothing is said of their noise.
        """
        if isinstance(state.gimbal, GimbalAt) or not state.spacing_s > 0.0:
            return self
        noise2 = (SLOPE_NOISE * attitude_noise / state.spacing_s) ** 2
        x, y, z = subtract(state.carrier_rates, slow.rates)
        if self.told2 == ZERO3:
            before, (a, b, c) = BEGUN * noise2, (BEGUN * noise2,) * 3
        else:
            kept = 1.0 - 1.0 / MEMORY
            before, (a, b, c) = kept * self.noise2, (kept * s for s in self.told2)
        return RateDenoiser((a + x * x, b + y * y, c + z * z), before + noise2)

    @property
    def shares(self) -> Vector3:
        """Of each fast rate, what is no noise; 1 where nothing is known of noise."""
        x, y, z = (max(0.0, 1.0 - self.noise2 / told2) if told2 > 0.0 else 1.0 for told2 in self.told2)
        return (x, y, z)

    def freed_of_noise(self, course: DelayedPoses, slow: SmoothedMotion) -> DelayedPoses:
        """The course with the motion to be expected, given what is told."""
        return DelayedPoses(tuple(self._expected(moment, slow) for moment in course.moments))

    def _expected(self, moment: VehiclePose, slow: SmoothedMotion) -> VehiclePose:
        (x, y, z), (a, b, c), (p, q, r) = subtract(moment.rates, slow.rates), self.shares, moment.acceleration
        return msgspec.structs.replace(
            moment,
            rates=add(slow.rates, (a * x, b * y, c * z)),
            acceleration=(a * p, b * q, c * r),
            velocity_ned=slow.velocity_ned or moment.velocity_ned,
        )

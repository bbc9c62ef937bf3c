"""How much the body really turns, beside the noise of the attitudes that its rates are taken from.

Rates are slopes of the attitude's course, and noise makes slopes of its own. In the rows of the camera's delay such a
slope looks like a motion that shows the delay: a body that hardly turns would find it by noise alone, and be sure of
it. Errors in a regressor are undone by its reliability: the share of its mean square that is no noise.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.nouns import GimbalAt, VehicleState

SLOPE_NOISE = 1.6
"""One sigma of a slope of a course through attitudes with fresh noise, in units of that noise over their spacing:
sqrt(2) for a chord, 1.2 to 1.6 within a cubic through four, 1.1 sqrt(2) on the mean for one with slopes given."""
MEMORY = 100
"""Frames: several beats of a slow wing."""
BEGUN = 3
"""Frames of nothing but noise that are counted before the first."""


class Turning(msgspec.Struct, frozen=True, gc=False):
    """Fading sums over frames. Immutable."""

    told2: Vector3 = ZERO3
    """Squared rates about the axes of what carries the camera."""
    noise2: float = 0.0
    """What noise alone would have made of each."""

    def with_state(self, state: VehicleState, attitude_noise: float) -> Turning:
        """With one more frame; ``attitude_noise``: one sigma about an axis, rad, fresh in every attitude.

        A gimbal's rates are of its own attitudes, whose spacing is not told: nothing is said of their noise.
        """
        if isinstance(state.gimbal, GimbalAt) or not state.spacing_s > 0.0:
            return self
        noise2 = (SLOPE_NOISE * attitude_noise / state.spacing_s) ** 2
        x, y, z = state.carrier_rates
        if self.told2 == ZERO3:
            before, (a, b, c) = BEGUN * noise2, (BEGUN * noise2,) * 3
        else:
            kept = 1.0 - 1.0 / MEMORY
            before, (a, b, c) = kept * self.noise2, (kept * s for s in self.told2)
        return Turning((a + x * x, b + y * y, c + z * z), before + noise2)

    @property
    def shares(self) -> Vector3:
        """Of each rate, what is no noise; 1 where nothing is known of noise."""
        x, y, z = (max(0.0, 1.0 - self.noise2 / told2) if told2 > 0.0 else 1.0 for told2 in self.told2)
        return (x, y, z)

"""How far the filter of a moving target is behind one that goes another way by now.

A filter that believes in a steady course follows a walker who turns about by metres too late, and loses him. Fixes then
lie off on one side, one like the next, where noise throws them to all sides, and a time offset forth and back with
every beat: their running mean tells.
"""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.small_matrices import Symmetric2
from fwav_companion.geometry.vectors import Matrix3

SHARE = 0.15
"""Of a new fix in the running mean: at 30 frames/s it looks back 0.2 s, a beat of 5 Hz."""
MEAN_VARIANCE = SHARE / (2.0 - SHARE)
"""Of the running mean, over that of a single fix."""
TURNED = 20.0
"""Squared Mahalanobis distance of the running mean (2 degrees of freedom): noise alone exceeds it once in 20 000."""


class ManeuverLag(msgspec.Struct, frozen=True, gc=False):
    """Running mean of how far fixes lay from where the target was believed, horizontal. Immutable."""

    north_m: float = 0.0
    east_m: float = 0.0
    back_s: float = 0.0
    """How far the mean looks back: a running mean of the ages of what is in it."""

    def with_fix(self, north_m: float, east_m: float, since_s: float) -> ManeuverLag:
        """With one more fix, which lay so far off and came so long after the one before."""
        return ManeuverLag(
            self.north_m + SHARE * (north_m - self.north_m),
            self.east_m + SHARE * (east_m - self.east_m),
            (1.0 - SHARE) * (self.back_s + since_s),
        )

    def is_turn(self, expected: Symmetric2) -> bool:
        """Whether this is more than ``expected``, the covariance of a single fix's distance, can bring about."""
        n, e, (nn, ne, ee) = self.north_m, self.east_m, expected
        return ee * n * n - 2.0 * ne * n * e + nn * e * e > TURNED * MEAN_VARIANCE * (nn * ee - ne * ne)

    @property
    def position_cov(self) -> Matrix3:
        """Of the position of a target that went another way for as long: this one deviation, m^2."""
        n, e = self.north_m, self.east_m
        return ((n * n, n * e, 0.0), (n * e, e * e, 0.0), (0.0, 0.0, 0.0))

"""Scatter of the fixes of one target beyond their noise (innovation-based adaptive noise, Mehra 1970)."""

from __future__ import annotations

import msgspec

SCATTER_SHARE = 0.02
"""Forgetting factor: time constant of 50 fixes (8 wing beats of 5 Hz at 30 frames/s)."""
FIXES_TO_LEARN = 20
"""Three beats of 5 Hz at 30 frames/s: the effect of a time offset on this target has shown by then."""
MOST_SCATTER = 4.0
"""Largest variance, in those of one sigma of the time offset: two sigma."""
LEAST_DOUBT = 0.1
"""Share of the prior that is always kept: a glide does not show the next beat."""


class AdaptiveNoise(msgspec.Struct, frozen=True, gc=False):
    """Variance of fixes about the estimate beyond their noise, as a constant time offset makes it on a flapping wing.

    The offset displaces single fixes much farther than their mean, and not in proportion to the present rate. So the
    variance that its prior allows counts for a new target only, and the observed one for an old target.
    """

    variance: float = 0.0
    """Observed variance of each axis, m^2, limited by ``allowed``: clutter must not widen a gate that lets more in."""
    allowed: float = 0.0
    """Variance of each axis by the prior of the time offset, running mean over the fixes, m^2."""
    count: int = 1
    """Number of fixes."""

    def with_fix(self, distance2: float, expected2: float, thrown2: float) -> AdaptiveNoise:
        """The noise after one more fix. Squares of both axes together, m^2: distance from the estimate, its expectation
        by noise alone, and displacement by one sigma of the time offset.
        """
        share = max(SCATTER_SHARE, 1.0 / (self.count + 1))
        allowed = self.allowed + share * (0.5 * thrown2 - self.allowed)
        variance = self.variance + share * (0.5 * (distance2 - expected2) - self.variance)
        return AdaptiveNoise(min(max(0.0, variance), MOST_SCATTER * allowed), allowed, self.count + 1)

    @property
    def doubt(self) -> float:
        """Share of the time offset's prior that still counts."""
        return max(LEAST_DOUBT, 1.0 - self.count / FIXES_TO_LEARN)

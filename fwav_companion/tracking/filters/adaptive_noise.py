"""Scatter of the fixes of one target beyond their noise (innovation-based adaptive noise, Mehra 1970)."""

from __future__ import annotations

import msgspec

SCATTER_SHARE = 0.02
"""Forgetting factor: time constant of 50 fixes (8 wing beats of 5 Hz at 30 frames/s)."""
FIXES_TO_LEARN = 20
"""Number of fixes that show the effect of a time offset on a target: three wing beats of 5 Hz at 30 frames/s."""
MOST_SCATTER = 4.0
"""Limit of the observed variance, as a multiple of the variance by one sigma of the time offset: two sigma."""
LEAST_DOUBT = 0.1
"""Smallest share of the time offset's prior that is kept: a glide does not show the next wing beat."""


class AdaptiveNoise(msgspec.Struct, frozen=True, gc=False):
    """Observed variance of the fixes of one target about its estimate, in excess of their noise.

    A constant time offset causes it on a flapping wing: the offset displaces single fixes much farther than their mean,
    and not in proportion to the present rate. So a new target uses the variance that the prior of the offset allows,
    and an old target the observed variance.
    """

    variance: float = 0.0
    """Observed variance of each axis, m^2. ``allowed`` limits it: clutter must not widen a gate that lets in more."""
    allowed: float = 0.0
    """Variance of each axis due to the prior of the time offset, running mean over the fixes, m^2."""
    count: int = 1
    """Number of fixes."""

    def with_fix(self, distance2: float, expected2: float, thrown2: float) -> AdaptiveNoise:
        """The adaptive noise after one more fix. All squares are sums of both axes, m^2.

        ``distance2``: squared distance of the fix from the estimate; ``expected2``: its expectation by noise alone;
        ``thrown2``: squared displacement by one sigma of the time offset.
        """
        share = max(SCATTER_SHARE, 1.0 / (self.count + 1))
        allowed = self.allowed + share * (0.5 * thrown2 - self.allowed)
        variance = self.variance + share * (0.5 * (distance2 - expected2) - self.variance)
        return AdaptiveNoise(min(max(0.0, variance), MOST_SCATTER * allowed), allowed, self.count + 1)

    @property
    def doubt(self) -> float:
        """Share of the time offset's prior variance that a gate still includes."""
        return max(LEAST_DOUBT, 1.0 - self.count / FIXES_TO_LEARN)

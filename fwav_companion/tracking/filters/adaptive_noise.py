"""How far the fixes of one target lie from where it is thought to be, beyond their noise."""

from __future__ import annotations

import msgspec

SCATTER_SHARE = 0.02
"""Of a new fix in what was seen: fifty fixes, eight beats of 5 Hz at 30 frames/s."""
FIXES_TO_LEARN = 20
"""Three beats of 5 Hz at 30 frames/s: by then what a time offset does to this target was seen."""
MOST_SCATTER = 4.0
"""Times what one sigma of the time offset makes: two sigma."""
LEAST_DOUBT = 0.1
"""A glide does not show what the next beat will."""


class AdaptiveNoise(msgspec.Struct, frozen=True, gc=False):
    """How far fixes lie from the estimate beyond their noise: what a standing time offset does on a flapping wing.

    It throws single fixes much farther than their mean, and not in proportion to the rate of the moment; so what its
    prior allows is believed of a new target only, and of an old one what was seen.
    """

    variance: float = 0.0
    """Seen, an axis, m^2; at most what is allowed: clutter must not widen a gate that lets in more clutter."""
    allowed: float = 0.0
    """By the prior of the time offset, an axis, as a running mean over the fixes, m^2."""
    count: int = 1
    """Fixes blended."""

    def with_fix(self, distance2: float, expected2: float, thrown2: float) -> AdaptiveNoise:
        """With one more fix, so far from the estimate, where noise alone made so much, and one sigma of the time
        offset throws it so far: squares of two axes, m^2.
        """
        share = max(SCATTER_SHARE, 1.0 / (self.count + 1))
        allowed = self.allowed + share * (0.5 * thrown2 - self.allowed)
        variance = self.variance + share * (0.5 * (distance2 - expected2) - self.variance)
        return AdaptiveNoise(min(max(0.0, variance), MOST_SCATTER * allowed), allowed, self.count + 1)

    @property
    def doubt(self) -> float:
        """The share of what the time offset's prior allows that is still to be reckoned with."""
        return max(LEAST_DOUBT, 1.0 - self.count / FIXES_TO_LEARN)

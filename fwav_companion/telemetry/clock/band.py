"""The widest band between the bounds of the exchanges: offset and rate by maximum likelihood. Seconds.

Each exchange bounds the offset on both sides, because no delay is shorter than the least one. Where delays are a least
delay, common to both directions, and an exponential tail, the log-likelihood of a line is n / tail times the width of
the band about it that no bound enters. So the best line is the middle of the widest band. Single fast requests and
single fast answers decide it, even where no exchange was fast both ways: of 64 exchanges with tails of 10 ms the error
is 0.1 ms, that of a fit weighted by round trips 0.7 ms.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fwav_companion.geometry.hull import lower_hull
from fwav_companion.telemetry.clock.agreement import Exchange

MEDIAN_OF_TWO = 1.678
"""Median of the sum of two exponential delays of mean 1; exchanges that are late now and then do not move it."""
LEAST_TAIL_S = 2e-5
"""Least mean of a tail, s: microseconds are not resolved by the stamps."""
RESOLUTION_S = 5e-6
"""One sigma of what stamps do not resolve, s."""
LEAST_STEP = 1e-7
"""First step of the search for a fall of the likelihood."""
HALVINGS = 6
"""Bisections of its place: to 2 %."""
NEAREST = 8
"""Bounds that show how dense they lie at the edges of the band."""
FREE = 0.75
"""Share of them that says something: two or three define the band."""
SHAPE = 0.5
STEPS = 24
"""Bisections of the skew: of 4e-3 a few ten-billionths are left, of 1.4 1e-7."""


class Band(NamedTuple):
    """The widest band of some exchanges."""

    t: float
    """Instant of the newest exchange."""
    offset: float
    """Middle at that instant."""
    skew: float
    width: float
    """Least delays of both directions together, by this line; negative where the bounds cross."""
    apart: float
    """Mean distance of neighbouring bounds at one edge."""
    tail: float
    """Mean of a delay's tail."""
    var_offset: float
    cov_offset_skew: float
    var_skew: float

    def predicted(self, t: float) -> float:
        """Offset of the middle at an instant."""
        return self.offset + self.skew * (t - self.t)

    def entered_by(self, exchange: Exchange) -> float:
        """Distance by which a bound of an exchange lies inside the band; negative outside."""
        turn = 0.5 * self.skew * exchange.trip  # each bound holds at its own instant
        level = abs(exchange.offset - self.predicted(exchange.t))
        return 0.5 * self.width + turn + level - 0.5 * exchange.trip - exchange.beside


class Envelopes:
    """The bounds of some exchanges, and the likelihood of lines between them under N(``skew``, ``sigma``^2)."""

    def __init__(self, exchanges: Sequence[Exchange], skew: float, sigma: float) -> None:
        self._end, self._number = exchanges[-1].t, len(exchanges)
        end = self._end
        # A bound holds at its own instant: that from above when the answer came, that from below when the request left.
        self._above = sorted([(e.t + 0.5 * e.trip - end, e.offset + 0.5 * e.trip + e.beside) for e in exchanges])
        self._below = sorted([(e.t - 0.5 * e.trip - end, 0.5 * e.trip + e.beside - e.offset) for e in exchanges])
        """Bounds from below, mirrored."""
        self._upper, self._lower = lower_hull(self._above), lower_hull(self._below)
        trips = sorted([e.trip for e in exchanges])
        self._tail = max(LEAST_TAIL_S, (trips[self._number // 2] - trips[0]) / MEDIAN_OF_TWO)
        self._skew, self._information = skew, 0.5 / (sigma * sigma)

    def opening(self, near: float, reach: float) -> tuple[float, float]:
        """Width of the likeliest band with a skew within ``reach`` of ``near``, and distance of bounds at its edge."""
        skew = self._likeliest(near, reach)
        low, high = self._free(skew)
        return high - low, self._spacing(skew, low, high)

    def widest(self, near: float, reach: float) -> Band:
        """The band of the likeliest line whose skew is within ``reach`` of ``near``.

        Its covariance follows from the fall of the likelihood. What counts is how dense the bounds lie at the edges,
        whatever the tails are like further out: the middle errs by half the difference of the two nearest ones.
        """
        skew = self._likeliest(near, reach)
        low, high = self._free(skew)
        apart = self._spacing(skew, low, high)
        below, above = (self._falls_by_one(skew, sign, apart) for sign in (-1.0, 1.0))
        var_skew = SHAPE * (below * below + above * above)
        lower, higher = (0.5 * sum(self._free(skew + step)) for step in (-below, above))
        turn = (higher - lower) / (below + above)
        fixed = 0.5 * apart * apart + RESOLUTION_S**2 + min(0.0, high - low) ** 2
        return Band(
            t=self._end,
            offset=0.5 * (low + high),
            skew=skew,
            width=high - low,
            apart=apart,
            tail=self._tail,
            var_offset=fixed + turn * turn * var_skew,
            cov_offset_skew=turn * var_skew,
            var_skew=var_skew,
        )

    def _spacing(self, skew: float, low: float, high: float) -> float:
        """Mean distance of neighbouring bounds at one edge of the band, by the nearest ones of both edges."""
        away = [y - skew * t - high for t, y in self._above]
        away += [y + skew * t + low for t, y in self._below]
        nearest = min(NEAREST, self._number)
        return max(LEAST_TAIL_S / self._number, 2.0 * sorted(away)[nearest] / (FREE * nearest))

    def _free(self, skew: float) -> tuple[float, float]:
        """The lowest and the highest offset that no bound contradicts at this skew."""
        return -min([y + skew * t for t, y in self._lower]), min([y - skew * t for t, y in self._upper])

    def _likeliest(self, near: float, reach: float) -> float:
        """Skew of the largest likelihood, which is concave, by bisection."""
        low, high = near - reach, near + reach
        for _ in range(STEPS):
            skew = 0.5 * (low + high)
            _, below = min([(y + skew * t, t) for t, y in self._lower])
            _, above = min([(y - skew * t, t) for t, y in self._upper])
            if self._number * (below - above) > 2.0 * self._tail * self._information * (skew - self._skew):
                low = skew
            else:
                high = skew
        return 0.5 * (low + high)

    def _falls_by_one(self, skew: float, sign: float, apart: float) -> float:
        """Distance from the likeliest skew at which the log-likelihood, with bounds ``apart``, is lower by one."""

        def likelihood(at: float) -> float:
            low, high = self._free(at)
            return (high - low) / apart - self._information * (at - self._skew) ** 2

        level, near, far = likelihood(skew) - 1.0, 0.0, LEAST_STEP
        while likelihood(skew + sign * far) > level:
            near, far = far, 2.0 * far
        for _ in range(HALVINGS):
            middle = 0.5 * (near + far)
            if likelihood(skew + sign * middle) > level:
                near = middle
            else:
                far = middle
        return far

"""The widest band between the envelopes of the exchanges: offset and rate by maximum likelihood. Seconds.

Each exchange bounds the offset on both sides, because no delay is shorter than the least one. Where delays are a least
delay, common to both directions, and an exponential tail, the log-likelihood of a line is n / tail times the width of
the band about it that no bound enters. So the best line is the middle of the widest band. Single fast requests and
single fast answers decide it, even where no exchange was fast both ways: of 64 exchanges with tails of 10 ms the error
is 0.1 ms, that of a fit weighted by round trips 0.7 ms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

from fwav_companion.geometry.hull import lower_hull
from fwav_companion.telemetry.clock.exchange_fit import Exchange

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
SHAPE = 0.5
LIGHTER_TAILS = 1.3
"""Factor on the variance for tails that are lighter than exponential: behind normal delays 0.7 of the error would be
claimed, behind exponential ones 1.05."""
STEPS = 26
"""Golden sections of the skew: of 4e-3 a few millionths are left, 1e-8."""
GOLDEN = 0.6180339887498949


class Band(NamedTuple):
    """The widest band of some exchanges."""

    offset: float
    """Middle at the newest exchange."""
    skew: float
    width: float
    """Least delays of both directions together, by this line; negative where the bounds cross."""
    tail: float
    """Mean of a delay's tail."""
    number: int
    """Number of the exchanges."""

    def worse_by(self, width: float) -> float:
        """Log-likelihood by which these exchanges prefer a band of that width; negative where this one is wider."""
        return self.number * (width - self.width) / self.tail

    def is_entered_by(self, exchange: Exchange, dt: float) -> bool:
        """Whether a bound of an exchange, ``dt`` seconds after the newest one, lies inside the band."""
        room = 0.5 * exchange.trip + exchange.beside
        level = exchange.offset - self.offset - self.skew * dt
        turn = 0.5 * self.skew * exchange.trip  # each bound holds at its own instant
        return min(room + level, room - level) - turn < 0.5 * self.width


class Envelopes:
    """The bounds of some exchanges, and the likelihood of lines between them under N(``skew``, ``sigma``^2)."""

    def __init__(self, exchanges: Sequence[Exchange], skew: float, sigma: float) -> None:
        end, self._number = exchanges[-1].t, len(exchanges)
        # A bound holds at its own instant: that from above when the answer came, that from below when the request left.
        self._above = sorted((e.t + 0.5 * e.trip - end, e.offset + 0.5 * e.trip + e.beside) for e in exchanges)
        self._below = sorted((e.t - 0.5 * e.trip - end, 0.5 * e.trip + e.beside - e.offset) for e in exchanges)
        """Bounds from below, mirrored."""
        self._upper, self._lower = lower_hull(self._above), lower_hull(self._below)
        trips = sorted([e.trip for e in exchanges])
        self._tail = max(LEAST_TAIL_S, (trips[self._number // 2] - trips[0]) / MEDIAN_OF_TWO)
        self._skew, self._information = skew, 0.5 / (sigma * sigma)

    def widest(self, near: float, reach: float) -> Band:
        """The band of the likeliest line whose skew is within ``reach`` of ``near``."""
        skew = _maximum(self._likelihood, near - reach, near + reach)
        low, high = self._free(skew)
        return Band(0.5 * (low + high), skew, high - low, self._tail, self._number)

    def covariance(self, band: Band) -> tuple[float, float, float]:
        """Covariance of offset and skew of the widest band (00, 01, 11), by the fall of the likelihood beside it.

        What counts is how dense the bounds lie at the band's edges, whatever the tails are like further out: the middle
        errs by half the difference of the two nearest ones.
        """
        apart = self._spacing(band)
        below, above = (self._falls_by_one(band.skew, sign, apart) for sign in (-1.0, 1.0))
        var_skew = SHAPE * (below * below + above * above)
        low, high = (0.5 * sum(self._free(band.skew + step)) for step in (-below, above))
        turn = (high - low) / (below + above)
        fixed = LIGHTER_TAILS * 0.5 * apart * apart + RESOLUTION_S**2
        var_skew *= LIGHTER_TAILS
        return fixed + turn * turn * var_skew, turn * var_skew, var_skew

    def _spacing(self, band: Band) -> float:
        """Mean distance of neighbouring bounds at one edge of the band, by the nearest ones of both edges."""
        low, high = band.offset - 0.5 * band.width, band.offset + 0.5 * band.width
        away = [y - band.skew * t - high for t, y in self._above]
        away += [y + band.skew * t + low for t, y in self._below]
        nearest = min(NEAREST, self._number // 2)
        return max(LEAST_TAIL_S / self._number, 2.0 * sorted(away)[nearest] / nearest)

    def _free(self, skew: float) -> tuple[float, float]:
        """The lowest and the highest offset that no bound contradicts at this skew."""
        return -min([y + skew * t for t, y in self._lower]), min([y - skew * t for t, y in self._upper])

    def _likelihood(self, skew: float) -> float:
        low, high = self._free(skew)
        return self._number * (high - low) / self._tail - self._information * (skew - self._skew) ** 2

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


def widest_band(exchanges: Sequence[Exchange], skew: float, sigma: float, near: float, reach: float) -> Band:
    """The band of the likeliest line under the prior N(``skew``, ``sigma``^2), skew within ``reach`` of ``near``."""
    return Envelopes(exchanges, skew, sigma).widest(near, reach)


def _maximum(of: Callable[[float], float], low: float, high: float) -> float:
    """Place of the maximum of a concave function by golden sections."""
    left, right = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
    at_left, at_right = of(left), of(right)
    for _ in range(STEPS):
        if at_left < at_right:
            low, left, at_left = left, right, at_right
            right = low + GOLDEN * (high - low)
            at_right = of(right)
        else:
            high, right, at_right = right, left, at_left
            left = high - GOLDEN * (high - low)
            at_left = of(left)
    return 0.5 * (low + high)

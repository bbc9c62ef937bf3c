"""Clock estimate between two envelopes: an answer is stamped after its request left and before the answer arrived.

Assume that each delay is a least delay plus an exponential tail, the same both ways. Then the likelihood of a line of
offsets depends only on the room that it leaves to both envelopes: it is ``exp(2 n room / tail)`` in the least delay
``room``. The mean of this likelihood is several times nearer to the truth than any weighted fit of the exchanges,
because it uses only the few fastest messages of each direction (convex hull: Zhang, Liu & Xia 2002). Where delays have
another distribution it is overconfident. Therefore :mod:`exchanges` compares the likelihoods of both descriptions.
"""

from __future__ import annotations

from bisect import bisect
from collections.abc import Callable, Sequence
from itertools import pairwise
from math import exp, inf, log

import msgspec

LEAST_TAIL_S = 2e-6
"""Least tail of the delays, s: clocks are read in whole microseconds."""
SLOPES = 41
REACH = 12.0
"""Fall of the log-likelihood from its maximum up to which slopes are tried: by a factor exp(-12)."""
TO_THE_TOP, DOWN = 20, 12
"""Numbers of halvings of the two searches: from 1200 ppm to a thousandth of a ppm, and to a thousandth of the way."""

Point = tuple[float, float]


class EnvelopeFit(msgspec.Struct, frozen=True):
    """A line of offsets, seconds, and its skew, s/s, at time 0, with their covariance."""

    level: float
    skew: float
    var_level: float
    cov_level_skew: float
    var_skew: float
    room_s: float
    """Room between the envelopes, twice the least delay; negative: no line fits, so the skew was not constant."""
    log_likelihood: float
    """Log likelihood of the offsets, given the round trips."""


def lower_hull(points: Sequence[Point]) -> list[Point]:
    """Lower convex hull of points in order of time."""
    hull: list[Point] = []
    for t, y in points:
        while len(hull) > 1:
            (ta, ya), (tb, yb) = hull[-2], hull[-1]
            if (yb - ya) * (t - ta) < (y - ya) * (tb - ta):
                break
            hull.pop()
        hull.append((t, y))
    return hull


class Hull:
    """Lower hull of points in order of time, for the lines of a given slope that touch it from below."""

    __slots__ = ("_points", "_slopes")

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = lower_hull(points)
        self._slopes = [(yb - ya) / (tb - ta) if tb > ta else inf for (ta, ya), (tb, yb) in pairwise(self._points)]

    def lowest(self, slope: float) -> float:
        """Height at time 0 of the highest line of this slope below all points."""
        t, y = self._points[bisect(self._slopes, slope)]
        return y - slope * t

    def touched_at(self, slope: float) -> float:
        """Time at which the highest line of this slope below all points touches them."""
        return self._points[bisect(self._slopes, slope)][0]


def fit_between(
    times: Sequence[float], offsets: Sequence[float], trips: Sequence[float], most_skew: float
) -> EnvelopeFit:
    """Fit to offsets (middle of each exchange) at times, from their round trips; seconds, in any order of time."""
    entries = sorted(zip(times, offsets, trips, strict=True))
    above = Hull([(t, y + 0.5 * r) for t, y, r in entries])
    below = Hull([(t, 0.5 * r - y) for t, y, r in entries])
    n = len(entries)

    def gap(skew: float) -> float:
        """Room between ceiling and floor at time 0 for lines of this skew."""
        return above.lowest(skew) + below.lowest(-skew)

    def widens(skew: float) -> bool:
        return below.touched_at(-skew) > above.touched_at(skew)

    best = _highest(widens, -most_skew, most_skew)
    widest = gap(best)
    tail = max(LEAST_TAIL_S, 0.5 * (sum(trips) / n - widest))
    low, high = (_falls_to(gap, best, end, widest - REACH * tail / n) for end in (-most_skew, most_skew))
    level, skew, var_level, cov, var_skew = _moments(above, below, low, high, n=n, tail=tail, widest=widest)
    return EnvelopeFit(
        level=level,
        skew=skew,
        var_level=max(0.0, var_level) + 0.5 * (tail / n) ** 2,
        cov_level_skew=cov,
        var_skew=max(0.0, var_skew) + 1e-16,
        room_s=widest,
        log_likelihood=-sum(log(max(r - widest, LEAST_TAIL_S)) for r in trips),
    )


def _moments(
    above: Hull, below: Hull, low: float, high: float, *, n: int, tail: float, widest: float
) -> tuple[float, float, float, float, float]:
    """Means of level and skew over the slopes from low to high, weighted by likelihood, and their covariance (00, 01,
    11). The likelihood is that of ``n`` exchanges with this tail, relative to the line with the widest room.
    """
    weight = m_level = m_skew = s_ll = s_ls = s_ss = 0.0
    for k in range(SLOPES):
        skew = low + (high - low) * k / (SLOPES - 1)
        ceiling, floor = above.lowest(skew), -below.lowest(-skew)
        w = exp(n * (ceiling - floor - widest) / tail)
        level = 0.5 * (ceiling + floor)
        weight += w
        m_level += w * level
        m_skew += w * skew
        s_ll += w * level * level
        s_ls += w * level * skew
        s_ss += w * skew * skew
    m_level, m_skew = m_level / weight, m_skew / weight
    return (
        m_level,
        m_skew,
        s_ll / weight - m_level * m_level,
        s_ls / weight - m_level * m_skew,
        s_ss / weight - m_skew * m_skew,
    )


def _highest(rises: Callable[[float], bool], low: float, high: float) -> float:
    """Maximum of a concave function given whether it rises, by bisection."""
    for _ in range(TO_THE_TOP):
        middle = 0.5 * (low + high)
        if rises(middle):
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _falls_to(concave: Callable[[float], float], top: float, end: float, value: float) -> float:
    """Argument at which a concave function falls to ``value`` between ``top`` and ``end``, by bisection, or ``end``."""
    if concave(end) >= value:
        return end
    for _ in range(DOWN):
        middle = 0.5 * (top + end)
        if concave(middle) >= value:
            top = middle
        else:
            end = middle
    return end

"""Which exchanges agree with one another, and the robust line through them. Seconds from a common reference.

An exchange that waited errs by up to half of its excess round trip, so that both the test of agreement and the weights
depend on this excess (Mills, NTP).
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import sqrt
from typing import TypeAlias

import msgspec

AGREEMENT_S = 2e-3
"""Tolerance of an exchange with the least round trip, s: the main loop of a copter takes 2.5 ms."""
FLOOR_S = 0.3e-3
"""Least one sigma of one exchange, s."""
JITTER = 1.2
"""One sigma in medians of absolute residuals, of exchanges faster than the median; 1.48 for a normal distribution."""
EXCHANGES_FOR_JITTER = 8
UNIFORM = 12.0
"""Squared excess of the round trip in variances: the error is uniform within half of the excess either way, which is
exact where each delay is a least delay plus an exponential tail."""
TAIL = 3.0
"""Mean excess of the fastest round trip, in mean excesses over the number of exchanges: 1 where one delay is
exponential, more where both vary."""
HUBER = 1.5
"""Residual in sigmas from which the weight falls (Huber 1964)."""
PASSES = 4
LEAST_APART_S = 0.05
"""Least time between two exchanges that define a rate."""

Line: TypeAlias = tuple[float, float, float, float, float, float]
"""Offset at the newest exchange (s), skew, their covariance (00, 01, 11), and one sigma of the jitter (s)."""


class Exchange(msgspec.Struct, frozen=True, gc=False):
    """One TIMESYNC exchange, seconds from a common reference."""

    t: float
    """Middle between sending and receiving."""
    offset: float
    """host_from_autopilot at that instant."""
    trip: float
    """Round trip."""
    beside: float = 0.0
    """Time of the relayed bytes that travelled with the request: reception may be dated back by them."""


def tolerance(exchange: Exchange, least_trip: float) -> float:
    """Largest plausible error of an exchange, without the part that all exchanges share, seconds."""
    return AGREEMENT_S + 0.5 * (exchange.trip - least_trip) + exchange.beside


def least_possible_trip(exchanges: Sequence[Exchange]) -> float:
    """Estimate of the least possible round trip, seconds: the least of n long-tailed ones lies by about TAIL / n of
    their mean excess above it.
    """
    trips = [entry.trip for entry in exchanges]
    least = min(trips)
    return max(0.0, least - TAIL / len(trips) * (sum(trips) / len(trips) - least))


def variance(exchange: Exchange, least_trip: float, floor2: float) -> float:
    """Variance of the offset of an exchange, s^2; ``floor2``: that of the fastest ones."""
    return floor2 + (exchange.trip - least_trip) ** 2 / UNIFORM + exchange.beside**2


def in_agreement(exchanges: Sequence[Exchange], skew: float = 0.0) -> list[Exchange]:
    """Largest set of exchanges with a common offset at this skew: the intersection algorithm of Marzullo (1984).

    Of sets of equal size the one that contains later exchanges is returned.
    """
    least = min([entry.trip for entry in exchanges])
    intervals = []
    for entry in exchanges:
        level, room = entry.offset - skew * entry.t, tolerance(entry, least)
        intervals.append((level - room, level + room))
    best: list[Exchange] = []
    for low, _ in intervals:
        # An interval of the largest set starts where all of that set overlap.
        chosen = [entry for entry, (a, b) in zip(exchanges, intervals, strict=True) if a <= low <= b]
        if len(chosen) > len(best) or (len(chosen) == len(best) and chosen[-1].t > best[-1].t):
            best = chosen
    return best


def in_line(exchanges: Sequence[Exchange], fastest: float, slowest: float) -> list[Exchange]:
    """Largest set of exchanges on one line, of any skew between ``fastest`` and ``slowest``."""
    best: list[Exchange] = []
    for i, first in enumerate(exchanges):
        for last in exchanges[i + 1 :]:
            if last.t - first.t < LEAST_APART_S:
                continue
            skew = (last.offset - first.offset) / (last.t - first.t)
            if fastest <= skew <= slowest:
                chosen = in_agreement(exchanges, skew)
                if len(chosen) >= len(best):
                    best = chosen
    return best


def fit_line(exchanges: Sequence[Exchange], rate_sigma: float, skew: float, last: Line | None) -> Line:
    """Weighted line with Huber weights, under a prior N(``skew``, ``rate_sigma``^2) on the skew.

    ``last``: line through all but the newest exchange, which shows the jitter of the faster half.
    """
    end = exchanges[-1]
    least = least_possible_trip(exchanges)
    ts = [entry.t - end.t for entry in exchanges]
    ys = [entry.offset - end.offset - skew * t for entry, t in zip(exchanges, ts, strict=True)]
    jitter = 0.0 if last is None else _jitter(exchanges, last)
    floor2 = FLOOR_S**2 + jitter**2
    variances = [variance(entry, least, floor2) for entry in exchanges]
    weights = [1.0 / v for v in variances]
    prior = 1.0 / rate_sigma**2
    level = slope = chi2 = 0.0
    c00 = c01 = c11 = 0.0
    for _ in range(PASSES):
        s0 = s1 = b0 = b1 = 0.0
        s2 = prior
        for t, y, w in zip(ts, ys, weights, strict=True):
            wt = w * t
            s0 += w
            s1 += wt
            s2 += wt * t
            b0 += w * y
            b1 += wt * y
        determinant = s0 * s2 - s1 * s1
        level, slope = (s2 * b0 - s1 * b1) / determinant, (s0 * b1 - s1 * b0) / determinant
        c00, c01, c11 = s2 / determinant, -s1 / determinant, s0 / determinant
        chi2, weights = 0.0, []
        for t, y, v in zip(ts, ys, variances, strict=True):
            u2 = (y - level - slope * t) ** 2 / v
            h = 1.0 if u2 <= HUBER * HUBER else HUBER / sqrt(u2)
            chi2 += h * u2
            weights.append(h / v)
        if max(weights) == min(weights):
            break
    scale = max(1.0, chi2 / max(1, len(ts) - 2))
    return end.offset + level, skew + slope, c00 * scale, c01 * scale, c11 * scale, jitter


def _jitter(exchanges: Sequence[Exchange], line: Line) -> float:
    """One sigma of the scatter of the faster half that their round trips do not explain, s; 0 with few exchanges."""
    if len(exchanges) < EXCHANGES_FOR_JITTER:
        return 0.0
    end = exchanges[-2].t
    middle = sorted([entry.trip for entry in exchanges])[len(exchanges) // 2]
    faster = [entry for entry in exchanges if entry.trip <= middle]
    residuals = [entry.offset - line[0] - line[1] * (entry.t - end) for entry in faster]
    # Differences of neighbours, because a rate that the line does not have yet is no jitter (von Neumann).
    steps = sorted([abs(later - earlier) for earlier, later in pairwise(residuals)])
    scatter = JITTER * steps[len(steps) // 2] / sqrt(2.0)
    least = min([entry.trip for entry in faster])
    explained = sum([(entry.trip - least) ** 2 for entry in faster]) / (UNIFORM * len(faster))
    return sqrt(max(0.0, scatter**2 - explained))

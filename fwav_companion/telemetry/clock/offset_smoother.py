"""Prediction and smoothing of a clock's offset. The offset integrates its rate plus a random walk; the rate is another.

Each exchange has one knot; the smoother is that of Rauch, Tung and Striebel (1965).
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from typing import TypeAlias

import msgspec

RATE_WANDER = 2e-3
"""One sigma of the rate's change in a second: a simulator under a varying load."""
MOST_SMOOTHED = 40
"""Most exchanges after an instant that smooth it: four seconds at ten a second, longer than any frame waits."""

OffsetState: TypeAlias = tuple[float, float, float, float, float]
"""Offset, seconds; its slope, s/s; their covariance: p00, p01, p11."""


class Knot(msgspec.Struct, gc=False):
    """Posterior of the filter after one exchange; times and offsets are seconds from the follower's reference."""

    t: float
    trip_s: float
    level: float
    slope: float
    p00: float
    p01: float
    p11: float
    walk: float
    """Variance of the offset's walk and of a slip since the previous knot, s^2."""
    slipped_s: float
    """Sum of all slips until this knot, seconds."""


def predicted(knot: Knot, t: float, walk: float) -> OffsetState:
    """The state at a later time; ``walk``: variance of the offset's walk until then."""
    dt = t - knot.t
    wander = RATE_WANDER**2 * dt
    return (
        knot.level + knot.slope * dt,
        knot.slope,
        knot.p00 + dt * (2.0 * knot.p01 + dt * knot.p11) + walk + wander * dt * dt / 3.0,
        knot.p01 + dt * knot.p11 + wander * dt / 2.0,
        knot.p11 + wander,
    )


def smoothed(knots: Sequence[Knot], t: float, intensity: float) -> tuple[float, float, float]:
    """(offset, slope, variance of the offset) at any time. ``intensity``: of the walk beyond the knots, s^2/s."""
    index = bisect_right(knots, t, key=lambda knot: knot.t)
    if index == len(knots):
        level, slope, p00, _, _ = predicted(knots[-1], t, intensity * (t - knots[-1].t))
        return level, slope, p00
    if index == 0:  # before the first stored knot: along the first slope
        level, slope, p00, _, p11 = _smoothed_knot(knots, 0)
        dt = t - knots[0].t
        return level + slope * dt, slope, p00 + p11 * dt * dt + intensity * abs(dt)
    before, after = knots[index - 1], knots[index]
    share = (t - before.t) / (after.t - before.t)
    level, slope, p00, p01, p11 = predicted(before, t, after.walk * share)
    here = Knot(t=t, trip_s=0.0, level=level, slope=slope, p00=p00, p01=p01, p11=p11, walk=0.0, slipped_s=0.0)
    level, slope, p00, _, _ = _back(here, after.t, after.walk * (1.0 - share), _smoothed_knot(knots, index))
    return level, slope, p00


def _smoothed_knot(knots: Sequence[Knot], index: int) -> OffsetState:
    last = min(len(knots) - 1, index + MOST_SMOOTHED)
    end = knots[last]
    state = (end.level, end.slope, end.p00, end.p01, end.p11)
    for k in range(last - 1, index - 1, -1):
        state = _back(knots[k], knots[k + 1].t, knots[k + 1].walk, state)
    return state


def _back(knot: Knot, t: float, walk: float, later: OffsetState) -> OffsetState:
    """One backward step: the state at ``knot`` given the smoothed state at the later time ``t``."""
    dt = t - knot.t
    level, slope, q00, q01, q11 = predicted(knot, t, walk)
    determinant = max(q00 * q11 - q01 * q01, 1e-40)
    c00, c01 = knot.p00 + dt * knot.p01, knot.p01  # P F'
    c10, c11 = knot.p01 + dt * knot.p11, knot.p11
    g00, g01 = (c00 * q11 - c01 * q01) / determinant, (c01 * q00 - c00 * q01) / determinant
    g10, g11 = (c10 * q11 - c11 * q01) / determinant, (c11 * q00 - c10 * q01) / determinant
    d0, d1 = later[0] - level, later[1] - slope
    e00, e01, e11 = later[2] - q00, later[3] - q01, later[4] - q11
    return (
        knot.level + g00 * d0 + g01 * d1,
        knot.slope + g10 * d0 + g11 * d1,
        knot.p00 + g00 * (g00 * e00 + 2.0 * g01 * e01) + g01 * g01 * e11,
        knot.p01 + g00 * (g10 * e00 + g11 * e01) + g01 * (g10 * e01 + g11 * e11),
        knot.p11 + g10 * (g10 * e00 + 2.0 * g11 * e01) + g11 * g11 * e11,
    )

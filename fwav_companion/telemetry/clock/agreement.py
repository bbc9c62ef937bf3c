"""Which exchanges agree with one another. Seconds from a common reference.

An exchange that waited errs by up to half of its excess round trip, so that the test of agreement depends on this
excess (Mills, NTP).
"""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

AGREEMENT_S = 2e-3
"""Tolerance of an exchange with the least round trip, s: the main loop of a copter takes 2.5 ms."""
LEAST_APART_S = 0.05
"""Least time between two exchanges that define a rate."""


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


def in_agreement(exchanges: Sequence[Exchange], skew: float = 0.0) -> list[Exchange]:
    """Largest set of exchanges with a common offset at this skew: the intersection algorithm of Marzullo (1984).

    Of sets of equal size the one that contains later exchanges is returned.
    """
    least = min([entry.trip for entry in exchanges])
    intervals = []
    for entry in exchanges:
        level = entry.offset - skew * entry.t
        room = AGREEMENT_S + 0.5 * (entry.trip - least) + entry.beside
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

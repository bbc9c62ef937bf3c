"""Pairs of tracks and fixes that the exact gate may accept: a coarse gate for several tracks.

An innovation n along an axis passes the exact gate only if ``n^2 <= gate * (a + b + |r - s|^2)``, with the variances a
and b of track and fix and their sensitivities r and s to shared errors. Fixes are grouped into strips by north and
sorted by east in each strip. With the reference sensitivities c of a strip, ``|r - s| <= |r - c| + |s - c|``, where the
second length is the same for all tracks. A track is compared only with the fixes of a strip between two bounds of east.
No pair that the exact gate accepts is left out.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from math import ceil, dist, sqrt
from typing import TypeAlias, cast

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.filters.base import TargetState
from fwav_companion.tracking.filters.standing import StandingTargetState
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateShare

FEW_PAIRS = 12
"""Number of pairs up to which the exact gate alone is as fast."""
ABREAST = 12
"""Number of fixes up to which one strip is fastest; the number of strips grows with the square root of their number."""
SLACK = 1.0 + 1e-9
"""Factor on the coarse gate that covers the rounding errors of both gates."""

GatedFix: TypeAlias = tuple[int, GroundFix, float]
"""Index of a fix, the fix, and the largest NIS at which a track may take it."""
Member: TypeAlias = tuple[float, float, float, float, float, float, int]
"""A fix in its strip: north and east, metres; own variances of both, m^2; distances of its north and east sensitivities
from the strip's reference, metres; fix index."""


class GateStrip(msgspec.Struct, frozen=True, gc=False):
    """Fixes of similar north, sorted by east."""

    members: tuple[Member, ...]
    easts: tuple[float, ...]
    reference: GateShare
    """Gate share of one of the fixes, as the reference of sensitivities."""
    gate: float
    """Widest gate of a member, times SLACK."""
    norths: tuple[float, float]
    """Least and largest north, metres."""
    bounds: tuple[float, float, float, float]
    """Largest own variances, m^2, and largest distances of sensitivities, metres, of a member, each north and east."""

    def in_reach(self, position_ned: Vector3, own: GateShare) -> list[int]:
        """Indices of the fixes that a target's gate may accept."""
        (north, east, _), gate, (nn, ee, off_n, off_e) = position_ned, self.gate, self.bounds
        to_n, own_nn, own_ee = dist(own.north, self.reference.north), own.nn, own.ee
        reach = sqrt(gate * (own_nn + nn + (to_n + off_n) ** 2))
        if not self.norths[0] - reach <= north <= self.norths[1] + reach:
            return []
        to_e = dist(own.east, self.reference.east)
        reach = sqrt(gate * (own_ee + ee + (to_e + off_e) ** 2))
        first, last = bisect_left(self.easts, east - reach), bisect_right(self.easts, east + reach)
        near = []
        for fix_n, fix_e, fix_nn, fix_ee, fix_off_n, fix_off_e, j in self.members[first:last]:
            n, e, off_n, off_e = fix_n - north, fix_e - east, to_n + fix_off_n, to_e + fix_off_e
            if n * n <= gate * (own_nn + fix_nn + off_n * off_n) and e * e <= gate * (own_ee + fix_ee + off_e * off_e):
                near.append(j)
        return near


def possible_pairs(targets: Sequence[tuple[int, TargetState]], fixes: Sequence[GatedFix]) -> dict[int, list[int]]:
    """Map of track index to fix indices, in order. It contains every pair that the exact gate accepts."""
    if len(targets) * len(fixes) <= FEW_PAIRS or not all(isinstance(each, StandingTargetState) for _, each in targets):
        every = [j for j, *_ in fixes]
        return {i: every for i, _ in targets}
    standing = cast("StandingTargetState", targets[0][1])
    strips, possible = _strips(fixes, standing.gate_share_of), {}
    for i, target in cast("Sequence[tuple[int, StandingTargetState]]", targets):
        place, own = target.apparent_ned, target.gate_share
        near: list[int] = []
        for strip in strips:
            near += strip.in_reach(place, own)
        if near:
            possible[i] = sorted(near)
    return possible


def _strips(fixes: Sequence[GatedFix], share_of: Callable[[GroundFix], GateShare]) -> list[GateStrip]:
    by_north = sorted(fixes, key=lambda each: each[1].position_ned[0])
    length = ceil(len(fixes) / ceil(sqrt(len(fixes) / ABREAST)))
    return [_strip(by_north[k : k + length], share_of) for k in range(0, len(fixes), length)]


def _strip(fixes: Sequence[GatedFix], share_of: Callable[[GroundFix], GateShare]) -> GateStrip:
    reference = share_of(fixes[len(fixes) // 2][1])
    members: list[Member] = []
    for j, fix, _ in sorted(fixes, key=lambda each: each[1].position_ned[1]):
        share, (north, east, _) = share_of(fix), fix.position_ned
        off_n, off_e = dist(share.north, reference.north), dist(share.east, reference.east)
        members.append((north, east, share.nn, share.ee, off_n, off_e, j))
    norths, easts, nn, ee, off_north, off_east, _ = zip(*members, strict=True)
    return GateStrip(
        tuple(members),
        easts,
        reference,
        SLACK * max([gate for _, _, gate in fixes]),
        (min(norths), max(norths)),
        (max(nn), max(ee), max(off_north), max(off_east)),
    )

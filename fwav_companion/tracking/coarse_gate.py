"""Pairs of tracks and fixes that the exact gate may accept: a coarse gate for several tracks.

An innovation n along an axis passes the exact gate only if ``n^2 <= gate * (a + b + |r - s|^2)``, with the variances a
and b of track and fix and their sensitivities r and s to shared errors. Fixes are gathered in cells of neighbours with
similar sensitivities: with the reference row c of a cell, ``|r - s| <= |r - c| + |s - c|``, where the second length is
that of the fix for all tracks. Whole cells are left out first, then fixes. No pair that the exact gate accepts is left
out.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import ceil, dist, sqrt
from typing import TypeAlias, cast

import msgspec

from fwav_companion.geometry.vectors import Vector3
from fwav_companion.tracking.filters.base import CoarselyGated, TargetState
from fwav_companion.types import GroundFix
from fwav_companion.types.tracks import GateShare

FEW_PAIRS = 12
"""Pairs up to which the exact gate alone is as fast."""
CELL = 12
"""Fixes in a cell."""
SLACK = 1.0 + 1e-9
"""Factor for the rounding of both gates."""

GatedFix: TypeAlias = tuple[int, GroundFix, float]
"""Index of a fix, the fix, and the largest NIS at which a track may take it."""
SharedFix: TypeAlias = tuple[GroundFix, GateShare, float, int]
"""A fix, its share in the gate, that NIS, and its index."""
Member: TypeAlias = tuple[float, float, float, float, float, float, int]
"""A fix in its cell: north and east, metres; own variances along them, m^2; distances of its sensitivities along them
to the cell's, metres; index."""


class GateCell(msgspec.Struct, frozen=True, gc=False):
    """Neighbouring fixes."""

    members: tuple[Member, ...]
    reference: GateShare
    """Share of one of them."""
    gate: float
    """Widest gate of a member, times SLACK."""
    corner: tuple[float, float]
    """Least north and east, metres."""
    opposite: tuple[float, float]
    """Largest north and east, metres."""
    bounds: tuple[float, float, float, float]
    """Largest own variances and distances of sensitivities of a member, each north and east."""


def possible_pairs(targets: Sequence[tuple[int, TargetState]], fixes: Sequence[GatedFix]) -> dict[int, list[int]]:
    """Indices of fixes, in order, by the index of a track; every pair that the exact gate accepts is among them."""
    share_of: Callable[[GroundFix], GateShare] | None = getattr(targets[0][1], "gate_share_of", None)
    if len(targets) * len(fixes) <= FEW_PAIRS or share_of is None:
        every = [j for j, *_ in fixes]
        return {i: every for i, _ in targets}
    cells = _cells([(fix, share_of(fix), gate, j) for j, fix, gate in fixes])
    return {
        i: near
        for i, target in cast("Sequence[tuple[int, CoarselyGated]]", targets)
        if (near := sorted(_in_reach(target.apparent_ned, target.gate_share, cells)))
    }


def _in_reach(position_ned: Vector3, own: GateShare, cells: Sequence[GateCell]) -> Iterator[int]:
    """Indices of the fixes that a target's gate may accept."""
    north, east, _ = position_ned
    own_nn, own_ee, own_north, own_east = own.nn, own.ee, own.north, own.east
    for cell in cells:
        gate, (nn, ee, off_n, off_e) = cell.gate, cell.bounds
        to_n = dist(own_north, cell.reference.north)
        reach_n = sqrt(gate * (own_nn + nn + (to_n + off_n) ** 2))
        if not cell.corner[0] - reach_n <= north <= cell.opposite[0] + reach_n:
            continue
        to_e = dist(own_east, cell.reference.east)
        reach_e = sqrt(gate * (own_ee + ee + (to_e + off_e) ** 2))
        if not cell.corner[1] - reach_e <= east <= cell.opposite[1] + reach_e:
            continue
        for fix_n, fix_e, fix_nn, fix_ee, fix_off_n, fix_off_e, j in cell.members:
            n, e, off_n, off_e = fix_n - north, fix_e - east, to_n + fix_off_n, to_e + fix_off_e
            if n * n <= gate * (own_nn + fix_nn + off_n * off_n) and e * e <= gate * (own_ee + fix_ee + off_e * off_e):
                yield j


def _cells(fixes: list[SharedFix]) -> list[GateCell]:
    """Cells of about CELL fixes: strips by north, cut by east."""
    fixes.sort(key=lambda each: each[0].position_ned[0])
    strips = _cut(fixes, ceil(len(fixes) / ceil(sqrt(len(fixes) / CELL))))
    return [
        _cell(members)
        for strip in strips
        for members in _cut(sorted(strip, key=lambda each: each[0].position_ned[1]), CELL)
    ]


def _cut(fixes: list[SharedFix], length: int) -> Iterator[list[SharedFix]]:
    return (fixes[k : k + length] for k in range(0, len(fixes), length))


def _cell(fixes: list[SharedFix]) -> GateCell:
    reference = fixes[len(fixes) // 2][1]
    members = tuple(
        (
            *fix.position_ned[:2],
            share.nn,
            share.ee,
            dist(share.north, reference.north),
            dist(share.east, reference.east),
            j,
        )
        for fix, share, _, j in fixes
    )
    norths, easts, nn, ee, off_north, off_east, _ = zip(*members, strict=True)
    return GateCell(
        members,
        reference,
        SLACK * max(gate for _, _, gate, _ in fixes),
        (min(norths), min(easts)),
        (max(norths), max(easts)),
        (max(nn), max(ee), max(off_north), max(off_east)),
    )

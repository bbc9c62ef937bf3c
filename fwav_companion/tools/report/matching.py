"""Who is who: tracks and true targets, or the tracks of two filters, as one to one as can be. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot

from fwav_companion.geometry.ellipses import circle_radius
from fwav_companion.tools.report.groups import Group
from fwav_companion.tracking.assignment import least_cost_assignment

FAR_M = 1e9
"""Farther than anything on Earth: no match at all."""
MOST_MATCHED = 60
"""Rows that are matched together; the time taken grows with their cube."""


def matched(distances_m: Sequence[Sequence[float | None]]) -> list[int | None]:
    """The column of each row, no column twice, so that the sum of distances is least; None where none is left.

    An error that is common to all (GNSS, a mount) may bring each track nearer to its neighbour's truth than to its own;
    it does not change the sum's order. ``None`` among the distances: cannot be.
    """
    found: list[int | None] = [None] * len(distances_m)
    rows = range(min(len(distances_m), MOST_MATCHED))
    if not rows:
        return found
    beyond = [FAR_M] * len(rows)  # so that each row may stay alone
    costs = [[FAR_M if cost is None else cost for cost in distances_m[row]] + beyond for row in rows]
    for row, column in zip(rows, least_cost_assignment(costs), strict=True):
        if costs[row][column] < FAR_M:
            found[row] = column
    return found


def apart_m(ours: Sequence[Group], theirs: Sequence[Group]) -> list[list[float | None]]:
    """Between where they ended; None for two that cannot be the same.

    Of a crowd of one label, answers to the same sightings are hardly farther apart than twice what both claim.
    """
    reaches = [[circle_radius(group.believed[-1]["cov"], 0.95) for group in groups] for groups in (ours, theirs)]
    table: list[list[float | None]] = []
    for group, reach_m in zip(ours, reaches[0], strict=True):
        last, row = group.believed[-1], list[float | None]()
        for each, their_reach_m in zip(theirs, reaches[1], strict=True):
            end = each.believed[-1]
            distance_m = hypot(end["north"] - last["north"], end["east"] - last["east"])
            alone = group.name == group.label and each.name == each.label
            same = group.label == each.label and (alone or distance_m <= 2.0 * (reach_m + their_reach_m))
            row.append(distance_m if same else None)
        table.append(row)
    return table

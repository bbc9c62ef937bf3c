"""Rebuilds the association from all tracks, with the present estimates of the biases. Pure.

Early decisions were made before the biases were known, and two targets with swapped tracks keep each other in place.
The rebuilt association replaces the present one if it explains the tracks better.
"""

from __future__ import annotations

from collections.abc import Generator, Mapping

import numpy as np

from fwav_companion.ground.fusion.association import SHARE, associate
from fwav_companion.ground.fusion.fused_targets import TargetBooks
from fwav_companion.ground.fusion.place_index import PlaceIndex, nis
from fwav_companion.ground.fusion.reported_tracks import ReportingVehicle

TARGET_COST = 9.21
"""Cost of a further target, as an NIS (2 dof) that 1 of 100 true tracks exceeds."""
BETTER = 5.0
"""Cost by which the rebuilt association must be better."""


def improved(
    books: TargetBooks, vehicles: Mapping[str, ReportingVehicle], now: float
) -> Generator[None, None, TargetBooks | None]:
    """The rebuilt association with the present ids; None if the present association is as good.

    It pauses after each vehicle, and while it compares.
    """
    rebuilt = TargetBooks()
    index = PlaceIndex(())
    for vehicle in sorted(vehicles.values(), key=lambda each: (-len(each.tracks), each.name)):
        associate(rebuilt, vehicle, index, now)
        yield
    cost = yield from _cost(rebuilt, vehicles, now)
    if cost > (yield from _cost(books, vehicles, now)) - BETTER:
        return None
    return books.renamed(rebuilt)


def _cost(books: TargetBooks, vehicles: Mapping[str, ReportingVehicle], now: float) -> Generator[None, None, float]:
    """Cost of an association: the misfit of the tracks with their targets, and a cost for every target.

    It pauses after each SHARE of tracks.
    """
    cost, tracks_since = 0.0, 0
    for target in books.targets.values():
        cost += TARGET_COST
        tracks_since += len(target.members)
        if tracks_since >= SHARE:
            tracks_since = 0
            yield
        tracks = [(vehicles[name], number) for name, number in target.members.items() if name in vehicles]
        known = [(vehicle, vehicle.tracks[number]) for vehicle, number in tracks if number in vehicle.tracks]
        places = np.array([vehicle.corrected(track, now) for vehicle, track in known])
        spreads = np.array([vehicle.spread(track) for vehicle, track in known])
        if len(known) < 2:
            continue
        information = np.linalg.inv(spreads)
        mean = np.linalg.solve(information.sum(axis=0), np.einsum("mij,mj->i", information, places))
        cost += float(np.sum(nis(places - mean, spreads)))
    return cost

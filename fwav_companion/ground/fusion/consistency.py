"""Detection of a vehicle that is wrong, and of two vehicles that disagree without a third. Pure.

A vehicle is wrong if the shift of its targets against targets on which at least two others agree is far beyond the
sigmas that it states for its own biases. If only two vehicles disagree, neither is blamed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fwav_companion.ground.fusion.association import tolerance_m
from fwav_companion.ground.fusion.fused_targets import FusedTarget
from fwav_companion.ground.fusion.place_index import PlaceIndex
from fwav_companion.ground.fusion.registration import REACH_M, registered
from fwav_companion.ground.fusion.reported_tracks import Array, ReportingVehicle

WRONG = 18.42
"""NIS of a shift (2 dof) that 1 of 10 000 right vehicles exceeds."""
WRONG_BIASES = 21.11
"""NIS of three estimated biases that 1 of 10 000 right vehicles exceeds."""
RIGHT = 9.21
"""NIS within which a vehicle that was left out is admitted again: 99 % of right vehicles are within it."""
LEAST_VOTES = 3
"""Least number of tracks that agree on the shift: two agree by chance where targets are dense."""
LEAST_SHARE = 0.6
"""Share of the vehicle's tracks near others' targets that must agree."""
NEAREST = 16
"""Nearest targets of a track that may be the same thing: beyond them the scene is a crowd that decides nothing."""


@dataclass(slots=True)
class VehicleShift:
    """The shift of one vehicle against the others."""

    metres: Array
    nis: float
    """Normalised square of the shift by the stated bias sigmas, 2 degrees of freedom."""
    others: tuple[str, ...]
    """Other vehicles that see these targets, those with most of them first."""
    corroborated: bool
    """Whether most of these targets are seen by at least two others, which agree."""
    pairs: dict[int, int]
    """Target id by track number."""

    @property
    def length_m(self) -> float:
        """Length of the shift, metres."""
        return float(np.hypot(*self.metres))


def shift_of(vehicle: ReportingVehicle, index: PlaceIndex, now: float) -> VehicleShift | None:
    """The shift of a vehicle against targets that others see; None if too few tracks agree on one.

    The shift is measured without the vehicle's estimated biases, which may already include it.
    """
    tracks = [track for track in vehicle.tracks.values() if track.confirmed]
    near: dict[int, FusedTarget] = {}
    for label in dict.fromkeys(track.label for track in tracks):
        places = np.array([track.at(now) for track in tracks if track.label == label])
        for target in index.near(label, places, most=NEAREST, reach_m=REACH_M)[1]:
            if target.members.keys() - {vehicle.name}:
                near[target.id] = target
    others = list(near.values())
    if len(tracks) < LEAST_VOTES or len(others) < LEAST_VOTES:
        return None
    found = registered(
        np.array([track.at(now) for track in tracks]),
        [track.label for track in tracks],
        np.array([target.position for target in others]),
        [target.label for target in others],
        tolerance_m=tolerance_m(tracks),
    )
    comparable = min(len(tracks), len(others))
    if found is None or found.votes < max(LEAST_VOTES, LEAST_SHARE * comparable):
        return None
    seen = [others[target] for _, target in found.pairs]
    spread = np.mean([_prior_spread(vehicle, tracks[track].jacobian) for track, _ in found.pairs], axis=0)
    spread = spread + np.mean([tracks[track].shared for track, _ in found.pairs], axis=0)
    spread = spread + np.mean([target.cov for target in seen], axis=0)
    counts = Counter(name for target in seen for name in target.members if name != vehicle.name)
    double = sum(len(target.members.keys() - {vehicle.name}) >= 2 for target in seen)
    return VehicleShift(
        metres=found.metres,
        nis=float(found.metres @ np.linalg.solve(spread, found.metres)),
        others=tuple(name for name, _ in counts.most_common(3)),
        corroborated=2 * double > len(seen),
        pairs={tracks[track].track: others[target].id for track, target in found.pairs},
    )


def wrong_by_biases(
    vehicles: Mapping[str, ReportingVehicle], targets: Sequence[FusedTarget]
) -> tuple[str, float] | None:
    """The vehicle whose estimated biases are furthest beyond its prior, if two others corroborate; with its NIS.

    In a joint solution of three vehicles, two thirds of a wrong vehicle's error are assigned to it, and a third to each
    of the others.
    """
    corroborated: Counter[str] = Counter()
    for target in targets:
        if len(target.members) >= 3:
            corroborated.update(target.members.keys())
    worst: tuple[str, float] | None = None
    for name, count in corroborated.items():
        vehicle = vehicles.get(name)
        if vehicle is None or count < 2:
            continue
        sigmas = np.maximum(vehicle.sigmas, 1e-3)
        excess = float(np.sum((vehicle.bias / sigmas) ** 2))
        if excess > WRONG_BIASES and (worst is None or excess > worst[1]):
            worst = (name, excess)
    return worst


def _prior_spread(vehicle: ReportingVehicle, jacobian: Array) -> Array:
    spread: Array = jacobian @ np.diag(vehicle.sigmas**2) @ jacobian.T
    return spread

"""Which vehicle is wrong, where one is; and where two disagree without a third. Pure.

A vehicle is wrong when the shift of its targets against those that at least two others agree on is far beyond what it
states of its own biases. Of two vehicles that disagree, neither is blamed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from fwav_companion.ground.fusion.association import PlaceIndex, tolerance_m
from fwav_companion.ground.fusion.fused_targets import FusedTarget
from fwav_companion.ground.fusion.registration import registered
from fwav_companion.ground.fusion.reported_tracks import Array, ReportingVehicle

WRONG = 18.42
"""NIS of a shift that 1 of 10 000 right vehicles exceeds."""
WRONG_BIASES = 21.11
"""The same of three estimated biases."""
RIGHT = 9.21
"""NIS within which a vehicle that was left out is admitted again: 99 % of right ones are."""
LEAST_VOTES = 3
"""Tracks that must agree on the shift: two agree by chance where targets are dense."""
LEAST_SHARE = 0.6
"""Share of the vehicle's tracks near others' targets that must agree."""
CELLS = 2


@dataclass(slots=True)
class VehicleShift:
    """The shift of one vehicle against the others."""

    metres: Array
    nis: float
    """Against the stated biases, 2 degrees of freedom."""
    others: tuple[str, ...]
    """Vehicles that see the targets against which it is shifted, those with most of them first."""
    corroborated: bool
    """Whether most of these targets are seen by two others or more, which agree."""
    pairs: dict[int, int]
    """Target by track."""

    @property
    def length_m(self) -> float:
        """Length of the shift, metres."""
        return float(np.hypot(*self.metres))


def shift_of(vehicle: ReportingVehicle, index: PlaceIndex, now: float) -> VehicleShift | None:
    """The shift of a vehicle against targets that others see; None where too few tracks agree on one.

    The shift is measured without the vehicle's estimated biases, which may have followed it.
    """
    tracks = [track for track in vehicle.tracks.values() if track.confirmed]
    near: dict[int, FusedTarget] = {}
    for track in tracks:
        for target in index.near(track.label, track.at(now), CELLS):
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

    In a joint solution of three, a wrong vehicle takes two thirds of its error, and each of the others a third of it.
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

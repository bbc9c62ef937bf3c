"""The fused picture of a demonstration against the truth. Pure."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import cos, hypot, log, radians, sin, sqrt
from typing import Any

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane

NEAR_M = 5.0
"""Half the least distance of two true targets, metres: a fused target belongs to the true target within it."""
SCALE_95 = sqrt(-2.0 * log(0.05))
INSIDE_999 = 13.82
"""Chi-square quantile, 99.9 %, 2 degrees of freedom."""


class FusedScore(msgspec.Struct, frozen=True, kw_only=True):
    """One true target against the fused picture."""

    label: str
    north: float
    east: float
    """True place from the origin, metres."""
    count: int
    """Number of fused targets that belong to it: one is right."""
    error_m: float | None
    """Horizontal error of the nearest fused target, metres."""
    claimed95_m: float | None
    """Larger semi-axis of the nearest fused target's 95 % ellipse, metres."""
    nis: float | None
    """Normalised square of the error by the claimed covariance."""
    vehicles: tuple[str, ...] = ()
    """Vehicles whose tracks the nearest fused target has."""

    @property
    def trouble(self) -> str | None:
        """Why this fails the demonstration; None if it does not."""
        name = f"{self.label} at {self.north:.0f} m north, {self.east:.0f} m east"
        if self.count != 1:
            return f"{name}: {self.count} fused targets, wanted one"
        if self.nis is not None and self.nis > INSIDE_999:
            return f"{name}: error {self.error_m:.2f} m, beyond its claimed 99.9 %"
        if len(self.vehicles) < 2:
            return f"{name}: seen by {len(self.vehicles)} vehicle, wanted two or more"
        return None


def fleet_scores(truth: Mapping[str, Any], fused: Sequence[Mapping[str, Any]]) -> tuple[list[FusedScore], int]:
    """The score of each true target, and the number of other fused targets. ``truth``: a header line of the mock."""
    origin = truth["origin"]
    plane = TangentPlane(Geodetic.from_degrees(origin["lat"], origin["lon"], origin["alt_amsl"]))
    targets = truth["targets"]
    of: list[list[tuple[float, Mapping[str, Any]]]] = [[] for _ in targets]
    ghosts = 0
    for each in fused:
        north, east = _place(plane, each)
        distances = [hypot(north - target["north"], east - target["east"]) for target in targets]
        nearest = min(range(len(targets)), key=distances.__getitem__)
        if distances[nearest] <= NEAR_M and each["label"] == targets[nearest]["label"]:
            of[nearest].append((distances[nearest], each))
        else:
            ghosts += 1
    return [_score(plane, target, found) for target, found in zip(targets, of, strict=True)], ghosts


def _score(
    plane: TangentPlane, target: Mapping[str, Any], found: Sequence[tuple[float, Mapping[str, Any]]]
) -> FusedScore:
    if not found:
        return FusedScore(
            label=target["label"], north=target["north"], east=target["east"], count=0, error_m=None,
            claimed95_m=None, nis=None,
        )  # fmt: skip
    error_m, nearest = min(found, key=lambda pair: pair[0])
    north, east = _place(plane, nearest)
    ellipse = nearest["ellipse"]
    turn = radians(ellipse["bearing_deg"])
    d_n, d_e = north - target["north"], east - target["east"]
    along, across = d_n * cos(turn) + d_e * sin(turn), d_e * cos(turn) - d_n * sin(turn)
    nis = (SCALE_95 * along / ellipse["major_m"]) ** 2 + (SCALE_95 * across / ellipse["minor_m"]) ** 2
    return FusedScore(
        label=target["label"],
        north=target["north"],
        east=target["east"],
        count=len(found),
        error_m=error_m,
        claimed95_m=ellipse["major_m"],
        nis=nis,
        vehicles=tuple(nearest["vehicles"]),
    )


def _place(plane: TangentPlane, target: Mapping[str, Any]) -> tuple[float, float]:
    north, east, _ = plane.ned_from_geodetic(Geodetic.from_degrees(target["lat"], target["lon"], 0.0))
    return north, east

"""The ground model as the smoother's: surface, height source, and how far targets and readings depart from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import hypot
from typing import TypeAlias

import numpy as np

from fwav_companion.estimation.errors import Array
from fwav_companion.estimation.ground import GroundSurface, LevelGround
from fwav_companion.types import Bias, ErrorPriors, GroundFix, GroundReference, HeightReference, SurfaceShape

ReferenceNow: TypeAlias = Callable[[], GroundReference]
"""The ground model at present: home and an elevation model are moved in flight."""

GROUND_CHANGE_M = 3.0
"""One sigma by which the ground's level under a rangefinder departs from that under its first reading."""
_STEEP = 0.02
"""Horizontal part of the column of the height, below which a ray does not show the height: it looks straight down."""


def level_at_home() -> GroundReference:
    """Flat ground at the origin's altitude."""
    return GroundReference(HeightReference.ALTITUDE)


@dataclass(frozen=True)
class MappedGround:
    """An elevation model; outside of it flat ground at the origin's altitude."""

    surface: SurfaceShape

    def height(self, place: Array) -> tuple[Array, Array]:
        """Heights (T,) m at places (2, T), and slopes (2, T)."""
        found = [self.surface.at(north, east) or (0.0, 0.0, 0.0) for north, east in place.T.tolist()]
        heights, *slopes = np.array(found).reshape(-1, 3).T
        return heights, np.array(slopes)


def surface_of(reference: GroundReference) -> GroundSurface:
    """The smoother's ground. Where the height counts from the ground itself, the ground is at zero."""
    if reference.surface is not None:
        return MappedGround(reference.surface)
    by_altitude = reference.height in (HeightReference.ALTITUDE, HeightReference.RANGE)
    return LevelGround(reference.level_m if by_altitude else 0.0)


def height_wander_m(reference: GroundReference, priors: ErrorPriors) -> float:
    """One sigma of the slow error of the camera's height above the surface, metres.

    A constant height does not follow the vehicle's own motion, and the ground under a rangefinder rises and falls.
    """
    match reference.height:
        case HeightReference.CONSTANT:
            return priors.height_noise_m
        case HeightReference.RANGE:
            return GROUND_CHANGE_M
        case _:
            return 0.0


def target_height(fix: GroundFix, priors: ErrorPriors) -> tuple[float, float]:
    """Height of a target above the surface, and its one sigma: of its own height, and of the ground's there, metres.

    The fix scales its column of the ground's height by the doubt of the level at its place; the column of the camera's
    height has the same horizontal part without it.
    """
    sighting, sigma_m = fix.sighting, priors.sigma(Bias.TERRAIN)
    by_ground, by_height = (hypot(*fix.bias_jacobian[bias][:2]) for bias in (Bias.TERRAIN, Bias.HEIGHT))
    ground_m = 0.0 if not any(fix.bias_jacobian[Bias.TERRAIN]) else sigma_m
    if ground_m and by_height > _STEEP:
        ground_m *= by_ground / by_height
    return sighting.anchor_height_m, hypot(sighting.anchor_sigma_m, ground_m)

"""The height of targets: a ground surface, and each target's height above it with a prior.

Home's altitude, a fixed height below the camera and flat terrain are `LevelGround`; a map gives a surface with slopes;
a roof, a landmark and the white part of a map's error are a target's own height above the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from fwav_companion.estimation.errors import Array

WIDE_PLACE_M = 1000.0  # sigma of a place that nothing is known of
LEAST_PLACE_M = 1e-3  # a survey of zero sigma becomes this
TARGET_SIZE = 3  # unknowns of a target: north, east, height above the surface


class GroundSurface(Protocol):
    """Height of the ground above the origin as a function of the place."""

    def height(self, place: Array) -> tuple[Array, Array]:
        """Heights (T,) m at places (2, T), and slopes (2, T): the height's derivative by north and by east."""
        ...


@dataclass(frozen=True)
class LevelGround:
    """Ground of one height."""

    height_m: float = 0.0

    def height(self, place: Array) -> tuple[Array, Array]:
        """Constant, without slope."""
        return np.full(place.shape[1], self.height_m), np.zeros_like(place)


@dataclass(frozen=True)
class TargetPrior:
    """What is known of a target before it is seen; one sigma."""

    place: tuple[float, float] = (0.0, 0.0)  # m north, east
    place_sigma_m: float = WIDE_PLACE_M
    height_m: float = 0.0  # above the surface
    height_sigma_m: float = 0.0

    @property
    def surveyed(self) -> bool:
        """Whether the place is a landmark's."""
        return self.place_sigma_m < WIDE_PLACE_M

    def mean(self) -> Array:
        """(3,)."""
        return np.array([*self.place, self.height_m])

    def precision(self) -> Array:
        """(3,) of north, east, height."""
        place, height = max(self.place_sigma_m, LEAST_PLACE_M), max(self.height_sigma_m, LEAST_PLACE_M)
        return np.array([place, place, height]) ** -2.0


UNKNOWN_TARGET = TargetPrior()

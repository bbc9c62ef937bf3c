"""How a ground model shows the height of the camera and of targets, for an estimator that follows whole flights."""

from __future__ import annotations

from enum import StrEnum
from typing import Protocol

import msgspec


class HeightReference(StrEnum):
    """Source of the camera's height above the ground."""

    ALTITUDE = "altitude"
    """The vehicle's altitude and the ground's."""
    RANGE = "range"
    """A rangefinder; the vehicle's altitude between its readings, and before the first one."""
    CONSTANT = "constant"
    """A configured height below the camera."""
    TERRAIN_REPORT = "terrain_report"
    """The autopilot's height above terrain."""


class SurfaceShape(Protocol):
    """An elevation model about the world's origin."""

    def at(self, north_m: float, east_m: float) -> tuple[float, float, float] | None:
        """Height above the origin, metres, and its derivatives by north and by east; None where it is not known."""


class GroundReference(msgspec.Struct, frozen=True):
    """Height source and shape of the ground. Equal ones give equal heights."""

    height: HeightReference
    level_m: float = 0.0
    """Level of flat ground above the origin, metres; with CONSTANT the height of the camera above the ground."""
    surface: SurfaceShape | None = None
    """The ground's shape; None: flat."""

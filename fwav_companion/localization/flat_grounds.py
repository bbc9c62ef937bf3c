"""Level grounds: the surface at home's height, and a fixed height below the camera."""

from __future__ import annotations

from typing import Any

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization.ground import Intersection, camera_above_flat, flat_distance
from fwav_companion.types import NoFix, Reason, Sighting


class HomeGround:
    """The level surface at home's altitude: the take-off ground, until the autopilot moves home."""

    def __init__(self) -> None:
        self.home_down_m = 0.0
        """Of the surface, below the world's origin."""

    def home_moved(self, home_down_m: float) -> None:
        """The surface lies there from now on."""
        self.home_down_m = home_down_m

    def placed(self, plane: TangentPlane, take_off: Geodetic, undulation_m: float | None) -> str:  # noqa: ARG002
        """Nothing depends on it."""
        return ""

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """By the camera's altitude; in a relative world by the autopilot's height above home."""
        height_m = self.height_m(sighting)
        if height_m is None:
            return NoFix(Reason.NO_HEIGHT)
        distance_m = flat_distance(direction, height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(camera_above_flat(sighting, height_m), distance_m, height_m, "home")

    def status(self) -> dict[str, Any]:
        """Where the surface lies."""
        return {"model": "home", "home_down_m": self.home_down_m}

    def height_m(self, sighting: Sighting) -> float | None:
        """Of the camera above the surface; None where nothing tells it."""
        if sighting.relative:
            return sighting.camera_height_above_home_m
        return self.home_down_m - sighting.camera_ned[2]


class FixedGround:
    """A level surface at a height below the camera that the configuration states."""

    def __init__(self, height_m: float) -> None:
        self._height_m = height_m

    def home_moved(self, home_down_m: float) -> None:
        """Home has no part in it."""

    def placed(self, plane: TangentPlane, take_off: Geodetic, undulation_m: float | None) -> str:  # noqa: ARG002
        """Nothing depends on it."""
        return ""

    def status(self) -> dict[str, Any]:
        """The height below the camera."""
        return {"model": "fixed", "height_m": self._height_m}

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """At the stated height, whatever the autopilot tells."""
        distance_m = flat_distance(direction, self._height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(
            camera_above_flat(sighting, self._height_m), distance_m, self._height_m, "fixed", carried=True
        )

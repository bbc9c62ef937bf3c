"""What a ground must answer: where a ray meets it, and how an error of height moves that point."""

from __future__ import annotations

from typing import Any, Protocol

import msgspec

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.types import NoFix, Reason, Sighting

LEVEL_NORMAL: Vector3 = (0.0, 0.0, 1.0)

LEAST_DESCENT = 1e-6
"""Of a unit ray, downward: below it there is no ground in any sense, and the division would tell a place anyway."""


class Intersection(msgspec.Struct, frozen=True, gc=False):
    """A ray has met the ground."""

    camera_ned: Vector3
    """The ray's start in the world of the answer; in a relative world (0, 0, -height)."""
    distance_m: float
    """Along the unit ray."""
    height_m: float
    """The camera above the ground right below it."""
    ground: str
    """Who answered: home, fixed, rangefinder, terrain."""
    normal: Vector3 = LEVEL_NORMAL
    """Unit normal of the ground at the point, NED, downward."""
    carried: bool = False
    """The ground is told by its distance from the camera, so its level shares the camera's errors."""
    surveyed: bool = False
    """The ground is an elevation model, whose own error is Bias.TERRAIN."""
    height_noise_m: float | None = None
    """One sigma of the height, fresh in this sample; None: [uncertainty] height_noise_m."""
    height_by_rotation: Vector3 = ZERO3
    """d(height)/d(rotation vector of the vehicle, NED), m/rad: where the height was measured along a tilted beam."""


class Ground(Protocol):
    """A model of the ground."""

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """Where the ray from the sighting's camera along ``direction``, a unit vector in NED, meets the ground."""

    def home_moved(self, home_down_m: float) -> None:
        """The home surface lies ``home_down_m`` below the world's origin from now on."""

    def placed(self, plane: TangentPlane, take_off: Geodetic, undulation_m: float | None) -> str:
        """The world has its origin, or the take-off place or the undulation is known better; what to tell, or ""."""

    def status(self) -> dict[str, Any]:
        """For the status file: the model by name, and what it does about the ground."""


def camera_above_flat(sighting: Sighting, height_m: float) -> Vector3:
    """The camera in the world of the answer: as told, or in a relative world right above the point below it."""
    return (0.0, 0.0, -height_m) if sighting.relative else sighting.camera_ned


def flat_distance(direction: Vector3, height_m: float) -> float | NoFix:
    """How far along a unit ray a level surface lies that is ``height_m`` below its start."""
    if not direction[2] > LEAST_DESCENT:
        return NoFix(Reason.ABOVE_HORIZON)
    return height_m / direction[2]

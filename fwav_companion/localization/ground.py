"""The protocol of a ground model, its intersection with a ray, and the level grounds.

A level ground is the horizontal surface at home's altitude, or one at a configured height below the camera.
"""

from __future__ import annotations

from typing import Protocol

import msgspec

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import ZERO3, Vector3
from fwav_companion.types import GroundReference, HeightReference, NoFix, Reason, Sighting, TakeOff
from fwav_companion.types.flight_status import GroundReport

LEVEL_NORMAL: Vector3 = (0.0, 0.0, 1.0)

LEAST_DESCENT = 1e-6
"""Down component of a unit ray below which the ray does not meet a level ground."""


class Intersection(msgspec.Struct, frozen=True, gc=False):
    """The intersection of a ray with the ground."""

    camera_ned: Vector3
    """Start of the ray in the world of the fix, NED, metres; in a relative world (0, 0, -height)."""
    distance_m: float
    """Distance along the unit ray, metres."""
    height_m: float
    """Height of the camera above the ground right below it, metres."""
    ground: str
    """Name of the ground model: home, fixed, rangefinder or terrain."""
    normal: Vector3 = LEVEL_NORMAL
    """Unit normal of the ground at the point, NED, downward."""
    moves_with_camera: bool = False
    """Whether the ground is known by its distance from the camera; its level then shares the camera's errors."""
    surveyed: bool = False
    """Whether the ground is an elevation model, whose error is Bias.TERRAIN."""
    uneven: bool = False
    """Whether Bias.TERRAIN counts although the ground is not an elevation model: [uncertainty] terrain_m is set."""
    level_doubt_m: float = 0.0
    """One sigma of the ground's level in addition to Bias.TERRAIN, metres: of an elevation model whose shift to the
    take-off height is not confirmed."""
    height_noise_m: float | None = None
    """One sigma of the height, independent in every fix, metres; None: [uncertainty] height_noise_m."""
    height_by_rotation: Vector3 = ZERO3
    """d(height)/d(rotation vector of the vehicle, NED), m/rad; not zero for a height along a tilted beam."""


class Ground(Protocol):
    """A model of the ground."""

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection of the ground with the ray from the sighting's camera along ``direction``, a unit vector in
        NED.
        """

    def home_moved(self, home_down_m: float) -> None:
        """Set the home surface to ``home_down_m`` below the world's origin, metres."""

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:
        """Set the world's origin, the take-off place and the geoid undulation; the notice for people, or ""."""

    def status(self) -> GroundReport:
        """Name and state of the model, for the status."""

    def reference(self) -> GroundReference:
        """The height source and the ground's shape, for an estimator that follows whole flights."""


def camera_above_flat(sighting: Sighting, height_m: float) -> Vector3:
    """The camera position in the world of the fix, NED: as paired, in a relative world right above the origin."""
    return (0.0, 0.0, -height_m) if sighting.relative else sighting.camera_ned


def lowered(meeting: Intersection, raised_m: float) -> Intersection:
    """The intersection of the same ray from a camera ``raised_m`` lower, on level ground."""
    north, east, down = meeting.camera_ned
    height_m = meeting.height_m - raised_m
    return msgspec.structs.replace(
        meeting,
        camera_ned=(north, east, down + raised_m),
        distance_m=meeting.distance_m * (height_m / meeting.height_m),
        height_m=height_m,
    )


def flat_distance(direction: Vector3, height_m: float) -> float | NoFix:
    """The distance along a unit ray to the level surface ``height_m`` below its start, metres."""
    if not direction[2] > LEAST_DESCENT:
        return NoFix(Reason.ABOVE_HORIZON)
    return height_m / direction[2]


class HomeGround:
    """The level surface at home's altitude: the take-off ground, until the autopilot moves home."""

    def __init__(self) -> None:
        self.home_down_m = 0.0
        """Depth of the surface below the world's origin, metres."""

    def home_moved(self, home_down_m: float) -> None:
        """Set the depth of the surface."""
        self.home_down_m = home_down_m

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:  # noqa: ARG002
        """Do nothing: the surface does not depend on the origin."""
        return ""

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection by the camera's altitude, in a relative world by its height above home."""
        height_m = self.height_m(sighting)
        if height_m is None:
            return NoFix(Reason.NO_HEIGHT)
        distance_m = flat_distance(direction, height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(camera_above_flat(sighting, height_m), distance_m, height_m, "home")

    def status(self) -> GroundReport:
        """Name of the model and depth of the surface."""
        return GroundReport(model="home", home_down_m=self.home_down_m)

    def reference(self) -> GroundReference:
        """Flat ground at the surface's level."""
        return GroundReference(HeightReference.ALTITUDE, -self.home_down_m)

    def height_m(self, sighting: Sighting) -> float | None:
        """The height of the camera above the surface, metres; None where it is not known."""
        if sighting.relative:
            return sighting.camera_height_above_home_m
        return self.home_down_m - sighting.camera_ned[2]


class AltitudeGround(HomeGround):
    """The level surface at a configured altitude; home does not move it."""

    def __init__(self, alt_amsl_m: float) -> None:
        super().__init__()
        self._alt_amsl_m = alt_amsl_m
        self._is_placed = False

    def home_moved(self, home_down_m: float) -> None:
        """Do nothing: the altitude is configured."""

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:  # noqa: ARG002
        """Set the depth of the surface below the origin."""
        self._is_placed = True
        self.home_down_m = plane.origin.alt_amsl_m - self._alt_amsl_m
        return ""

    def height_m(self, sighting: Sighting) -> float | None:
        """The height of the camera above the surface, metres; None in a world without altitudes."""
        return None if sighting.relative or not self._is_placed else super().height_m(sighting)

    def status(self) -> GroundReport:
        """Name of the model and depth of the surface."""
        return GroundReport(model="altitude", home_down_m=self.home_down_m)


class FixedGround:
    """The level surface at a configured height below the camera."""

    def __init__(self, height_m: float) -> None:
        self._height_m = height_m

    def home_moved(self, home_down_m: float) -> None:
        """Do nothing: the surface does not depend on home."""

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:  # noqa: ARG002
        """Do nothing: the surface does not depend on the origin."""
        return ""

    def status(self) -> GroundReport:
        """Name of the model and height of the camera above the surface."""
        return GroundReport(model="fixed", height_m=self._height_m)

    def reference(self) -> GroundReference:
        """The configured height of the camera."""
        return GroundReference(HeightReference.CONSTANT, self._height_m)

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection at the configured height; the autopilot's height is not used."""
        distance_m = flat_distance(direction, self._height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(
            camera_above_flat(sighting, self._height_m), distance_m, self._height_m, "fixed", moves_with_camera=True
        )

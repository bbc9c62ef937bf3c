"""Sights of landmarks: the intersections of their rays with the level surface at the landmark's known altitude."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.geometry.earth import TangentPlane
from fwav_companion.geometry.vectors import Vector3
from fwav_companion.localization.ground import Intersection, flat_distance
from fwav_companion.localization.localizer import Localizer
from fwav_companion.types import (
    ErrorPriors,
    GroundFix,
    GroundReference,
    HeightReference,
    Landmark,
    LandmarkRecord,
    LandmarkSight,
    LandmarkState,
    NoFix,
    Sighting,
    TakeOff,
)
from fwav_companion.types.flight_status import GroundReport


class KnownLevel:
    """The level surface at a known altitude: a ground without an error of its own."""

    def __init__(self, down_m: float) -> None:
        self._down_m = down_m

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection by the camera's altitude above sea level."""
        height_m = self._down_m - sighting.camera_ned[2]
        distance_m = flat_distance(direction, height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(sighting.camera_ned, distance_m, height_m, "landmark")

    def home_moved(self, home_down_m: float) -> None:
        """Do nothing: the level is known."""

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:  # noqa: ARG002
        """Do nothing: the level is known."""
        return ""

    def status(self) -> GroundReport:
        """The name of the model."""
        return GroundReport(model="landmark")

    def reference(self) -> GroundReference:
        """Flat ground at the known level."""
        return GroundReference(HeightReference.ALTITUDE, -self._down_m)


class LandmarkSights:
    """Finds sights of the configured landmarks, in the local world."""

    def __init__(self, landmarks: Sequence[Landmark], priors: ErrorPriors, *, min_height_m: float) -> None:
        self.landmarks = tuple(landmarks)
        self._index = {landmark.label: i for i, landmark in enumerate(self.landmarks)}
        self._priors = priors
        self._min_height_m = min_height_m
        self._places: list[tuple[Vector3, Localizer]] = []
        self.unapplied = tuple(LandmarkRecord(each.label, LandmarkState.NOT_APPLIED) for each in self.landmarks)
        """Record of each landmark for a run in which no filter uses the sights."""

    def on_origin(self, plane: TangentPlane) -> None:
        """Set the world's origin."""
        places = [plane.ned_from_geodetic(landmark.place) for landmark in self.landmarks]
        self._places = [
            (place, Localizer(KnownLevel(place[2]), self._priors, min_height_m=self._min_height_m)) for place in places
        ]

    def sights(self, sightings: Sequence[Sighting]) -> tuple[LandmarkSight, ...]:
        """The sights of landmarks among the sightings of a frame; empty in a relative world."""
        if not self._places:
            return ()
        found = []
        for sighting in sightings:
            index = self._index.get(sighting.detection.label)
            if index is None or sighting.relative:
                continue
            (north_m, east_m, _), localizer = self._places[index]
            fix = localizer.locate(sighting)
            if isinstance(fix, GroundFix):
                found.append(LandmarkSight(index, fix, north_m, east_m))
        return tuple(found)

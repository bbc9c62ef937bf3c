"""The ground by an elevation model, or by the autopilot's TERRAIN_REPORT where there is no model.

The model is shifted to the take-off ground only where that is known: by HOME_POSITION, by a landing, by arming, or
because the vehicle stands. If the vehicle is first heard in the air, the model keeps its own heights. The square of a
shift is part of the variance of the fixes until HOME_POSITION, a landing or a landmark confirms the shift.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import StrEnum
from math import cos, degrees, hypot, isnan, radians, sin, sqrt

import msgspec

from fwav_companion.geometry.earth import ECCENTRICITY2, SEMI_MAJOR_M, Geodetic, TangentPlane
from fwav_companion.geometry.vectors import Vector3, unit
from fwav_companion.localization.elevation import Cell, ElevationModel
from fwav_companion.localization.ground import Intersection, camera_above_flat, flat_distance
from fwav_companion.localization.ground_profile import turned_distances
from fwav_companion.localization.ray_search import Hit, end_of_cells, first_hit
from fwav_companion.types import GroundReference, HeightReference, NoFix, Reason, Sighting, TakeOff, TakeOffSource
from fwav_companion.types.flight_status import GroundReport

MOST_SHIFT_M = 30.0
"""Largest shift of a model, metres: ArduPilot's TERRAIN_OFS_MAX. More means a datum other than the configured one."""

CONFIRMED = (TakeOffSource.HOME_POSITION, TakeOffSource.LANDING)
"""Sources of a take-off place that is known to be on the ground. A vehicle that stands or is armed may be in a hand, on
a roof, or flying by hand launch."""

WORTH = 0.7
"""Ratio of the sigma of a shift by a landmark to that of the present shift, below which the model is shifted again: a
few times a flight, and not at every sight."""
ABSOLUTE_ALTITUDE_SIGMA_M = 5.0
"""One sigma of the vehicle's altitude above sea level against a model that is not shifted, metres: 1.5 to 2 times the
horizontal error of consumer GNSS, 2 to 3 m."""


class TerrainShift(msgspec.Struct, frozen=True):
    """Shift of an elevation model to the take-off height."""

    shift_m: float
    """Metres up; 0 where no take-off place is known."""
    sigma_m: float
    """One sigma of the level by it, in addition to [uncertainty] terrain_m, metres."""
    source: TakeOffSource


class Datum(StrEnum):
    """Vertical datum of an elevation file; the file does not state it."""

    EGM96 = "egm96"
    EGM2008 = "egm2008"
    """Mostly within 1 m of EGM96; the shift to the take-off height absorbs the difference."""
    ELLIPSOID = "ellipsoid"


class TerrainGround:
    """The surface of an elevation model, shifted to the take-off height."""

    def __init__(self, model: ElevationModel | None, datum: Datum) -> None:
        """``model`` None: the ground is by TERRAIN_REPORT only."""
        self._model = model
        self._datum = datum
        self._plane: TangentPlane | None = None
        self._trouble: Reason | None = Reason.NO_POSITION
        self.shift: TerrainShift | None = None
        """Shift of the model to the take-off height; None while it has none, and without a model."""
        self._raised_m = 0.0
        self._before: TerrainShift | None = None
        """Shift before the first one by a landmark; None while no landmark has shifted the model."""

    def home_moved(self, home_down_m: float) -> None:
        """Do nothing: the model keeps its shift to the take-off height."""

    def on_origin(self, plane: TangentPlane, take_off: TakeOff, undulation_m: float | None) -> str:
        """Shift the model to the ground at the take-off place, where one is known; the notice for people."""
        self._plane, self._trouble = plane, None
        if self._model is None:
            return "terrain: no elevation files; the ground is the autopilot's TERRAIN_REPORT"
        return self._shift(self._model, take_off, undulation_m)

    def _shift(self, model: ElevationModel, take_off: TakeOff, undulation_m: float | None) -> str:
        self.shift, self._before, self._raised_m = None, None, 0.0
        if self._datum is Datum.ELLIPSOID:
            if undulation_m is None:
                self._trouble = Reason.NO_HEIGHT
                return "terrain: heights above the ellipsoid need the autopilot's alt_ellipsoid, not heard yet"
            self._raised_m = -undulation_m
        model_m = model.height_m(take_off.place.lat_deg, take_off.place.lon_deg) + self._raised_m
        unshifted = TerrainShift(0.0, ABSOLUTE_ALTITUDE_SIGMA_M, take_off.source)
        if take_off.source is TakeOffSource.POSES:
            return ""
        if take_off.source is TakeOffSource.ASSUMED:
            self.shift = unshifted
            return (
                "terrain: the take-off place is not known (no HOME_POSITION, first heard in the air?); the model's "
                "heights are used as they are"
            )
        if isnan(model_m):
            self.shift = unshifted
            return "terrain: the take-off lies outside the elevation model; its heights are used as they are"
        shift_m = take_off.place.alt_amsl_m - model_m
        if abs(shift_m) > MOST_SHIFT_M:
            self._trouble = Reason.TERRAIN_UNFIT
            return (
                f"terrain: the model lies {-shift_m:+.1f} m from the take-off height, more than {MOST_SHIFT_M:.0f} m; "
                f"no fixes: is its datum {self._datum}?"
            )
        confirmed = take_off.source in CONFIRMED
        self.shift = TerrainShift(shift_m, 0.0 if confirmed else abs(shift_m), take_off.source)
        self._raised_m += shift_m
        by = "" if confirmed else f" (by {take_off.source.value}: not confirmed yet)"
        to = "height where the vehicle landed" if take_off.source is TakeOffSource.LANDING else "take-off height"
        return f"terrain: datum {self._datum}, shifted by {shift_m:+.1f} m to the {to}{by}"

    def shown(self, place: Geodetic, too_high_m: float, sigma_m: float) -> str:
        """Shift the model to the ground at a landmark, while the shift is not confirmed; the notice, or "".

        ``too_high_m``: reported minus true altitude of the vehicle, by sights of the landmark. ``sigma_m``: one sigma
        of the new shift. The shift is replaced if ``sigma_m`` is clearly less than the sigma of the present one.
        """
        if self._model is None or self._trouble is not None or self.shift is None:
            return ""
        if not sigma_m < WORTH * self.shift.sigma_m:
            return ""
        unshifted_m = self._raised_m - self.shift.shift_m
        model_m = self._model.height_m(place.lat_deg, place.lon_deg) + unshifted_m
        shift_m = place.alt_amsl_m + too_high_m - model_m
        if isnan(model_m) or abs(shift_m) > MOST_SHIFT_M:
            return ""
        before, self._before = self.shift, self._before or self.shift
        self._shift_to(TerrainShift(shift_m, sigma_m, TakeOffSource.LANDMARK))
        return f"terrain: shifted by {shift_m:+.1f} m by a landmark ({before.shift_m:+.1f} m before)"

    def taken_back(self) -> str:
        """Return to the shift before the one by a landmark, which turned out wrong; the notice, or ""."""
        if self._before is None:
            return ""
        before, self._before = self._before, None
        self._shift_to(before)
        return f"terrain: shifted by {before.shift_m:+.1f} m again: the landmark that moved it is left out"

    def _shift_to(self, shift: TerrainShift) -> None:
        self._raised_m += shift.shift_m - (0.0 if self.shift is None else self.shift.shift_m)
        self.shift = shift

    def meet(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        """The intersection with the model; without a model, with a level at the autopilot's height above terrain."""
        if self._model is None or sighting.relative:
            return self._meet_report(sighting, direction)
        if self._plane is None or self._trouble is not None:
            return NoFix(self._trouble or Reason.NO_POSITION)
        return self._meet_model(self._model, self._plane, sighting, direction)

    def status(self) -> GroundReport:
        """Name, source, datum and shift of the model, and the reason why it gives no fixes."""
        return GroundReport(
            model="terrain",
            source="TERRAIN_REPORT" if self._model is None else "files",
            datum=self._datum.value,
            shift_m=0.0 if self.shift is None else self.shift.shift_m,
            shift_sigma_m=None if self.shift is None else self.shift.sigma_m,
            shift_source=None if self.shift is None else self.shift.source.value,
            trouble=None if self._model is None or self._trouble is None else self._trouble.value,
        )

    def reference(self) -> GroundReference:
        """The model's shape; without a model, or without an origin, the autopilot's height above terrain."""
        if self._model is None:
            return GroundReference(HeightReference.TERRAIN_REPORT)
        if self._plane is None:
            return GroundReference(HeightReference.ALTITUDE)
        surface = ElevationSurface(self._model, self._plane, self._raised_m)
        return GroundReference(HeightReference.ALTITUDE, surface=surface)

    def _meet_model(
        self, model: ElevationModel, plane: TangentPlane, sighting: Sighting, direction: Vector3
    ) -> Intersection | NoFix:
        camera = plane.geodetic_from_ned(sighting.camera_ned)
        below_m = model.height_m(degrees(camera.lat), degrees(camera.lon)) + self._raised_m
        if isnan(below_m):
            inside = model.covers(degrees(camera.lat), degrees(camera.lon))
            return NoFix(Reason.NO_TERRAIN if inside else Reason.BEYOND_TERRAIN)
        height_m = camera.alt_amsl_m - below_m
        if height_m <= 0.0:
            return NoFix(Reason.TOO_LOW)
        hit = first_hit(model, plane, start_ned=sighting.camera_ned, direction=direction, raised_m=self._raised_m)
        if hit is None:
            return NoFix(self._why_none(model, plane, sighting.camera_ned, direction))
        return Intersection(
            sighting.camera_ned,
            hit.distance_m,
            height_m,
            "terrain",
            normal=_normal(hit),
            surveyed=True,
            level_doubt_m=hypot(hit.cell.filled_sigma_m, 0.0 if self.shift is None else self.shift.sigma_m),
        )

    def _why_none(self, model: ElevationModel, plane: TangentPlane, start: Vector3, direction: Vector3) -> Reason:
        """The reason why a ray meets no ground: it rises, meets a void, or leaves the model."""
        if not direction[2] > 0.0:
            return Reason.ABOVE_HORIZON
        ended = end_of_cells(model, plane, start, direction, self._raised_m)
        return Reason.NO_TERRAIN if ended is not None and model.covers(*ended) else Reason.BEYOND_TERRAIN

    def turned_distances(self, sighting: Sighting, direction: Vector3, turns: Sequence[float]) -> list[float] | None:
        """Distances to the model along the ray turned up by each of the rising angles, radians; None without a model.

        The list is shorter than ``turns`` where the model ends, or has a void, before the last one.
        """
        if self._model is None or self._plane is None or sighting.relative:
            return None
        return turned_distances(self._model, self._plane, sighting.camera_ned, direction, self._raised_m, turns=turns)

    def _meet_report(self, sighting: Sighting, direction: Vector3) -> Intersection | NoFix:
        height_m = sighting.state.terrain_height_m
        if height_m is None:
            return NoFix(Reason.NO_HEIGHT)
        camera, vehicle = sighting.camera_height_above_home_m, sighting.state.height_above_home_m
        if camera is not None and vehicle is not None:
            height_m += camera - vehicle  # the lever arm of the camera
        distance_m = flat_distance(direction, height_m)
        if isinstance(distance_m, NoFix):
            return distance_m
        return Intersection(camera_above_flat(sighting, height_m), distance_m, height_m, "terrain", surveyed=True)


class ElevationSurface(msgspec.Struct, frozen=True):
    """An elevation model about the world's origin: a snapshot that later shifts do not change."""

    model: ElevationModel
    plane: TangentPlane
    raised_m: float
    """Height by which the model is shifted, metres up."""

    def at(self, north_m: float, east_m: float) -> tuple[float, float, float] | None:
        """Height above the origin, metres, and its derivatives by north and by east; None outside the model."""
        place = self.plane.geodetic_from_ned((north_m, east_m, 0.0))
        lat_deg, lon_deg = degrees(place.lat), degrees(place.lon)
        cell = self.model.cell_at(lat_deg, lon_deg)
        if cell is None:
            return None
        by_north, by_east = _slope(cell, lat_deg, lon_deg)
        height_m = cell.height_m(lat_deg, lon_deg) + self.raised_m - self.plane.origin.alt_amsl_m
        return height_m, by_north, by_east


def _normal(hit: Hit) -> Vector3:
    """The unit normal of the surface at the point, NED, downward.

    The surface is down = -height(north, east), so the normal is (dh/dnorth, dh/deast, 1), normalised.
    """
    return unit((*_slope(hit.cell, hit.lat_deg, hit.lon_deg), 1.0))


def _slope(cell: Cell, lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """The derivatives of the height by north and by east.

    The steps of the lattice are converted to metres by the radii of curvature in the meridian and the prime vertical.
    """
    south, east = cell.fractions(lat_deg, lon_deg)
    _, b, c, d = cell.polynomial()
    lat = radians(lat_deg)
    w = sqrt(1.0 - ECCENTRICITY2 * sin(lat) ** 2)
    north_m = radians(cell.lat_step_deg) * SEMI_MAJOR_M * (1.0 - ECCENTRICITY2) / w**3
    east_m = radians(cell.lon_step_deg) * SEMI_MAJOR_M * cos(lat) / w
    return -(b + d * east) / north_m, (c + d * south) / east_m

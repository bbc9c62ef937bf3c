"""The ground of `locate`: flat, or an elevation model. PURE."""

from __future__ import annotations

from math import cos, degrees, hypot, isnan, radians
from typing import Protocol

from fwav_companion.geometry.earth import SEMI_MAJOR_M, TangentPlane
from fwav_companion.geometry.vectors import Vector3, add, cross, norm, scale, subtract, unit
from fwav_companion.localization.elevation import ElevationModel
from fwav_companion.localization.ground_profile import turned_distances
from fwav_companion.localization.ground_shape import (
    MOST_TURN,
    NEEDED_TURNS,
    TURN_SIGMAS,
    RayOnSurface,
    level_scatter_m,
)
from fwav_companion.localization.ray_search import end_of_cells, first_hit

LEAST_DESCENT = 1e-4
"""Least downward part of a unit ray: 0.006 degrees below the horizon."""
FARTHEST_M = 20_000.0


class Surface(Protocol):
    """The ground under the targets, in local NED."""

    def meet(self, camera_ned: Vector3, direction: Vector3) -> Vector3 | str:
        """The first point of a unit ray on the ground, or the named reason why there is none."""

    def shape_sigma_m(self, camera_ned: Vector3, direction: Vector3, point: Vector3, tilt: float) -> float | str:
        """One sigma of the level by the shape of the ground about a ray's end; or why one answer cannot tell.

        ``tilt``: one sigma of the ray's angle in its vertical plane, radians.
        """

    def level(self, north: float, east: float) -> tuple[float, float, float] | None:
        """(down, d down/d north, d down/d east) of the ground; None outside of it."""

    def sigma_m(self, height_m: float, north: float, east: float) -> float:
        """One sigma of the ground's level at a target, seen from ``height_m`` above."""


class FlatSurface:
    """Level ground at one altitude, with relief around it."""

    def __init__(
        self, down_m: float, sigma_m: float, sigma_per_height: float = 0.0, level_sigma_m: float = 0.0
    ) -> None:
        """``level_sigma_m``: of the level as a whole, beside the relief."""
        self._level_sigma = level_sigma_m
        self._down = down_m
        self._sigma = sigma_m
        self._per_height = sigma_per_height

    def meet(self, camera_ned: Vector3, direction: Vector3) -> Vector3 | str:
        """The intersection; "too_low" below the ground, "above_horizon" for a ray that does not descend."""
        height = self._down - camera_ned[2]
        if height <= 0.0:
            return "too_low"
        if direction[2] <= LEAST_DESCENT or height / direction[2] > FARTHEST_M:
            return "above_horizon"
        return add(camera_ned, scale(direction, height / direction[2]))

    def shape_sigma_m(self, camera_ned: Vector3, direction: Vector3, point: Vector3, tilt: float) -> float | str:  # noqa: ARG002
        """0: it has no shape."""
        return 0.0

    def level(self, north: float, east: float) -> tuple[float, float, float] | None:  # noqa: ARG002
        """The same everywhere."""
        return (self._down, 0.0, 0.0)

    def sigma_m(self, height_m: float, north: float, east: float) -> float:  # noqa: ARG002
        """The relief: a floor, or a part of the height above ground if that is more."""
        return hypot(self._level_sigma, max(self._sigma, self._per_height * height_m))


class TerrainSurface:
    """An elevation model, raised to the vertical scale of the answer."""

    def __init__(self, model: ElevationModel, plane: TangentPlane, raised_m: float, sigma_m: float) -> None:
        """``raised_m`` is added to the model's heights to give altitudes of ``plane``."""
        self._model, self._plane, self._raised, self._sigma = model, plane, raised_m, sigma_m

    def meet(self, camera_ned: Vector3, direction: Vector3) -> Vector3 | str:
        """The first intersection."""
        below = self.level(camera_ned[0], camera_ned[1])
        if below is None:
            return "beyond_terrain"
        if camera_ned[2] >= below[0]:
            return "too_low"
        hit = first_hit(self._model, self._plane, camera_ned, direction, self._raised)
        if hit is None:
            if direction[2] <= 0.0:
                return "above_horizon"
            end = end_of_cells(self._model, self._plane, camera_ned, direction, self._raised)
            return "no_terrain" if end is not None and self._model.covers(*end) else "beyond_terrain"
        return add(camera_ned, scale(direction, hit.distance_m))

    def shape_sigma_m(self, camera_ned: Vector3, direction: Vector3, point: Vector3, tilt: float) -> float | str:
        """By one walk along the ground below the ray; "two_grounds" where an edge makes two answers."""
        level = self.level(point[0], point[1])
        if level is None or tilt <= 0.0:
            return 0.0
        ray = RayOnSurface(direction, unit((-level[1], -level[2], 1.0)), norm(subtract(point, camera_ned)))
        if ray.descent <= LEAST_DESCENT:
            ray = RayOnSurface(direction, (0.0, 0.0, 1.0), ray.distance_m)
        by_level = self._sigma * hypot(direction[0], direction[1]) / ray.distance_m
        sigma = min(hypot(tilt, by_level), MOST_TURN)
        turns = [each * sigma for each in TURN_SIGMAS]
        distances = turned_distances(self._model, self._plane, camera_ned, direction, self._raised, turns=turns)
        if len(distances) < NEEDED_TURNS:
            return "beyond_terrain"
        linear_m = sigma * ray.distance_m * norm(cross(direction, ray.normal)) / ray.descent
        scatter_m = level_scatter_m(ray, sigma, distances, linear_m=linear_m)
        return "two_grounds" if scatter_m is None else scatter_m

    def level(self, north: float, east: float) -> tuple[float, float, float] | None:
        """The height of the cell below and its slope."""
        place = self._plane.geodetic_from_ned((north, east, 0.0))
        lat_deg, lon_deg = degrees(place.lat), degrees(place.lon)
        cell = self._model.cell_at(lat_deg, lon_deg)
        if cell is None:
            return None
        height = cell.height_m(lat_deg, lon_deg)
        if isnan(height):
            return None
        south, along = cell.fractions(lat_deg, lon_deg)
        _, b, c, d = cell.polynomial()
        north_m = radians(cell.lat_step_deg) * SEMI_MAJOR_M
        east_m = radians(cell.lon_step_deg) * SEMI_MAJOR_M * cos(place.lat)
        down = self._plane.origin.alt_amsl_m - height - self._raised
        return (down, (b + d * along) / north_m, -(c + d * south) / east_m)

    def sigma_m(self, height_m: float, north: float, east: float) -> float:  # noqa: ARG002
        """That of the model's heights, and of a void that was filled."""
        place = self._plane.geodetic_from_ned((north, east, 0.0))
        cell = self._model.cell_at(degrees(place.lat), degrees(place.lon))
        return self._sigma if cell is None else hypot(self._sigma, cell.filled_sigma_m)

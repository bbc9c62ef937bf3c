"""`locate` over an edge of an elevation model: a wider claim, or the reason; a second view settles it."""

from __future__ import annotations

import numpy as np

from fwav_companion.geometry.earth import Geodetic, TangentPlane
from fwav_companion.localization import ElevationModel, ElevationTile
from fwav_companion.tools.locate.estimate import SightError, locate
from fwav_companion.tools.locate.shots import Sight, SightsEstimate
from fwav_companion.tools.locate.surfaces import TerrainSurface
from tests.locate.test_fusion import SHARED, camera, seen, shot

LAT, LON, STEP = 47.0, 11.0, 1.0 / 108000.0
"""Samples of 1.03 m to the north and 0.70 m to the east."""


def surface(wall_m: float) -> TerrainSurface:
    """Level ground at 0 with a wall along the line 6 m south of the origin."""
    wall_row = 300 + 6
    tile = ElevationTile(
        LAT + 300 * STEP, LON - 300 * STEP, STEP, STEP, 601, 601,
        lambda i, _: wall_m if i in (wall_row, wall_row + 1) else 0.0, "wall",
    )  # fmt: skip
    return TerrainSurface(ElevationModel([tile]), TangentPlane(Geodetic.from_degrees(LAT, LON, 0.0)), 0.0, 0.3)


QUIET = tuple(float(each) for each in 0.2 * SHARED)


def from_sides(azimuths: list[float], wall_m: float) -> SightsEstimate | SightError:
    shots, sights = [], []
    for index, azimuth in enumerate(azimuths):
        at, axes = camera(azimuth, 40.0, 60.0)
        shots.append(shot(f"{index}.jpg", at, axes))
        sights.append(Sight(index, seen(at, axes, np.zeros(3)), "t"))
    return locate(shots, sights, surface(wall_m), [QUIET])


def test_ray_that_grazes_a_wall_has_a_wider_claim_or_is_refused() -> None:
    level, wall = from_sides([0.0], 0.0), from_sides([0.0], 4.8)  # the ray passes 0.2 m above the wall
    assert isinstance(level, SightsEstimate)
    if isinstance(wall, SightsEstimate):
        assert wall.places[0].cov[0][0] > 2.0 * level.places[0].cov[0][0]
    else:
        assert wall.reason == "two_grounds"


def test_second_view_without_the_wall_settles_the_place() -> None:
    both = from_sides([0.0, 180.0], 4.8)
    assert isinstance(both, SightsEstimate)
    assert np.linalg.norm(both.places[0].ned) < 0.5

"""Voids of an elevation model: filled across up to 90 m with the relief of their edges as sigma, else no ground."""

import numpy as np
import pytest
from made_up_terrain import LAT, LON, PLANE, STEP, from_array
from true_flights import PRIORS, Scene

from fwav_companion.localization import Datum, ElevationModel, Localizer, TerrainGround
from fwav_companion.types import GroundFix, NoFix, Reason, TakeOff, TakeOffSource

METRES_NORTH = STEP * 111_200.0
"""One second of arc, 30.9 m; to the east 20.9 m."""


def holed(rows: int, columns: int, relief_m: float = 0.0) -> np.ndarray:
    """A slope with a void of this size about its middle; the eastern half is higher by ``relief_m``."""
    heights = 500.0 + 2.0 * np.arange(41.0)[:, None] + np.zeros((41, 41))
    heights[:, 21:] += relief_m
    top, left = 20 - rows // 2, 20 - columns // 2
    heights[top : top + rows, left : left + columns] = np.nan
    return heights


def model_of(heights: np.ndarray) -> ElevationModel:
    return ElevationModel([from_array(heights, LAT + 20 * STEP, LON - 20 * STEP)])


@pytest.mark.parametrize(("rows", "columns"), [(1, 1), (1, 9), (9, 3)])
def test_void_of_up_to_90_m_is_filled_from_its_edges(rows: int, columns: int) -> None:
    cell = model_of(holed(rows, columns)).cell_at(LAT - 0.2 * STEP, LON)
    assert cell is not None
    assert cell.height_m(LAT - 0.2 * STEP, LON) == pytest.approx(540.4, abs=1e-6)  # the slope goes on
    assert 0.0 <= cell.filled_sigma_m <= 2.0 * 4  # half of the range of the edges, of which the slope is a part


def test_void_between_different_edges_has_their_relief_as_sigma() -> None:
    cell = model_of(holed(9, 2, relief_m=30.0)).cell_at(LAT, LON - 0.3 * STEP)
    assert cell is not None
    assert cell.filled_sigma_m == pytest.approx(15.0, abs=0.5)


def test_void_wider_than_90_m_is_none() -> None:
    assert model_of(holed(4, 5)).cell_at(LAT, LON) is None


def test_fix_on_a_filled_void_claims_its_sigma_and_a_wide_one_is_refused() -> None:
    target = (0.0, 0.0)
    sighting = Scene(pitch_deg=10.0, target=target, vehicle=(0.0, 0.0), height_m=60.0).sighting()

    def locate(heights: np.ndarray) -> GroundFix | NoFix:
        ground = TerrainGround(model_of(heights - 40.0), Datum.EGM96)
        ground.on_origin(PLANE, TakeOff(PLANE.origin, TakeOffSource.ASSUMED), None)
        return Localizer(ground, PRIORS, min_height_m=0.5).locate(sighting)

    whole, filled = locate(holed(0, 0)), locate(holed(9, 2, relief_m=0.01))
    assert isinstance(whole, GroundFix)
    assert isinstance(filled, GroundFix)
    assert filled.cov[2][2] >= whole.cov[2][2]
    steep = locate(holed(9, 2, relief_m=8.0))
    assert isinstance(steep, GroundFix)
    assert steep.cov[2][2] - whole.cov[2][2] > 10.0  # (8 / 2)^2, and what the shape adds
    assert locate(holed(9, 9)) == NoFix(Reason.NO_TERRAIN)

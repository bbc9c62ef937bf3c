"""A landmark in view shows the error of the vehicle's altitude, and so where an elevation model lies."""

import pytest
from flying import LINK, Companion
from surface_tiles import surface_tile

from fwav_companion.recording.line_types import TerrainLine
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from sitl_mock import Options, TargetOptions, scenario, simulate

ALTITUDE_M = 4.0
"""Reported minus true altitude above sea level."""
SETTINGS = ("camera.readout_s=0.0", "camera.mount.pitch_deg=-55", "ground.model=terrain", "uncertainty.terrain_m=0.5",
            'ground.terrain=["survey.tif"]', "ground.terrain_datum=egm96")  # fmt: skip


@pytest.mark.parametrize("smoother", [None, SmootherOptions()], ids=["filter", "smoother"])
def test_a_model_without_a_take_off_is_shifted_by_what_a_landmark_shows(smoother):
    """First heard in the air, 4 m too high by its receiver: the model follows as far as sights show it."""
    targets = (TargetOptions(label="mark", north=3.0, east=2.0), TargetOptions(label="car", north=-6.0, east=4.0))
    options = scenario("in_the_air", Options(seed=4)).but(
        {
            "seconds": 20.0,
            "camera.fps": 4.0,
            "targets": targets,
            "biases.altitude_m": ALTITUDE_M,
            "flight.pattern": "orbit",
        }
    )
    mock = simulate(options)
    place = mock.world.place(mock.scene[0].at(0.0))
    text = (
        f'{LINK}[camera]\ncalibration = "camera.yaml"\n[[landmark]]\nlabel = "mark"\nsigma_m = 0.05\n'
        f"lat = {place.lat:.9f}\nlon = {place.lon:.9f}\nalt_amsl = {place.alt_amsl:.4f}\n"
    )
    companion = Companion(
        SETTINGS, unix_minus_host_s=mock.unix_minus_host_s, elevation=(surface_tile(mock),), text=text,
        smoother=smoother,
    )  # fmt: skip
    for _ in mock.drive(companion):
        pass
    companion.finish()
    shifts = [line for line in companion.lines if isinstance(line, TerrainLine)]
    assert shifts[0].source == "assumed"
    last = shifts[-1]
    assert last.source == "landmark"
    assert last.sigma_m < 3.5
    assert abs(last.shift_m - ALTITUDE_M) < 3.0 * last.sigma_m
    assert companion.lines[-1].terrain.source == "landmark"

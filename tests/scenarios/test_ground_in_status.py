"""The ground model in the status: why a rangefinder is not used, and the shift of an elevation model."""

from math import nan

import pytest
from flying import Companion, fly

from fwav_companion.localization import ElevationTile
from sitl_mock import scenario, simulate


def status(companion: Companion):
    return companion.pipeline.status(companion._now).sight.ground


def test_a_missing_rangefinder_is_reported_with_its_count():
    settings = ["ground.model=rangefinder"]
    without = status(fly(scenario("default").but({"seconds": 6.0, "autopilot.rangefinder": False}), settings).companion)
    assert without.fallback == "no_range"
    assert without.fallbacks["no_range"] > 30
    with_one = status(fly(scenario("default").but({"seconds": 6.0}), settings).companion)
    assert with_one.fallback is None


@pytest.mark.parametrize(("height_m", "trouble"), [(512.0, None), (400.0, "terrain_unfit"), (nan, None)])
def test_a_models_shift_to_the_take_off_height_is_reported(height_m, trouble):
    tile = ElevationTile(48.2, 11.5, 0.001, 0.001, 200, 200, lambda row, column: height_m, "made")
    mock = simulate(scenario("unbiased").but({"seconds": 6.0}))
    companion = Companion(
        ["ground.model=terrain", 'ground.terrain=["made.tif"]', "ground.terrain_datum=egm96"],
        unix_minus_host_s=mock.unix_minus_host_s,
        elevation=(tile,),
    )
    for _ in mock.drive(companion):
        pass
    reported = status(companion)
    assert (reported.model, reported.datum, reported.trouble) == ("terrain", "egm96", trouble)
    assert reported.shift_m == pytest.approx(7.0 if height_m == 512.0 else 0.0, abs=0.5)

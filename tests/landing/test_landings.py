"""Whole landings of the mock's copter by LANDING_TARGET, one draw each; ``print_figures.py`` flies forty of a kind."""

import pytest
from landing_flights import ON_BOAT, ONE_TAG, drawn, land, land_exactly

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(("scenario", "target", "most_m"), [("land", ONE_TAG, 0.06), ("land_boat", ON_BOAT, 0.12)])
def test_copter_comes_down_on_the_pad_nearly_as_by_exact_angles(scenario, target, most_m):
    options = drawn(scenario, 1)
    landing = land(options, target)
    assert landing.miss_m < most_m
    assert landing.miss_m < land_exactly(options).miss_m + 0.03
    assert landing.frames > 400
    assert landing.sent >= 0.95 * landing.frames
    assert landing.squares < 3.0


def test_pilot_reads_the_landing_from_first_sight_to_the_ground():
    texts = land(drawn("land", 1), ONE_TAG).texts
    assert [text.split(":")[0] for text in texts] == ["pad seen", "pad lost", "landed"]

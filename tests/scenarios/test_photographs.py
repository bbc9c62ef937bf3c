"""A photograph every few seconds: every target is confirmed, once."""

import pytest
from flying import fly

from sitl_mock import TargetOptions, scenario

HERD = tuple(
    TargetOptions(label="cow", north=-24.0 + 16.0 * i, east=-18.0 + 12.0 * j) for i in range(4) for j in range(4)
)


@pytest.mark.slow
@pytest.mark.parametrize("every_s", [4.0, 10.0, 30.0])
@pytest.mark.parametrize("seed", range(1, 4))
@pytest.mark.parametrize("herd", [False, True])
def test_every_target_is_confirmed_as_one_track(every_s, seed, herd):
    """60 m high with drawn errors and misses; of the herd, one is out of view, and ten photographs show nine thrice."""
    different = {"seed": seed, "camera.fps": 1.0 / every_s} | ({"targets": HERD} if herd else {})
    lines = fly(scenario("photographs").but(different)).companion.targets("cow")
    confirmed = {line["track"] for line in lines if line["state"] in ("confirmed", "coasting")}
    least = {4.0: 16, 10.0: 15, 30.0: 9} if herd else {4.0: 3, 10.0: 3, 30.0: 2}
    assert len(confirmed) in range(least[every_s], 17 if herd else 4)

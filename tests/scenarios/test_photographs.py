"""A photograph every few seconds: what was seen three to five times is confirmed, once."""

from collections import Counter

import pytest
from draws import first_of
from flying import fly

from sitl_mock import TargetOptions, scenario

HERD = tuple(
    TargetOptions(label="cow", north=-24.0 + 16.0 * i, east=-18.0 + 12.0 * j) for i in range(4) for j in range(4)
)


@pytest.mark.slow
@pytest.mark.parametrize("every_s", [4.0, 10.0, 30.0])
@pytest.mark.parametrize("seed", first_of(*range(1, 6), few=2))
@pytest.mark.parametrize("herd", [False, True])
def test_every_target_seen_three_times_is_confirmed_as_one_track(every_s, seed, herd):
    """60 m high with drawn errors, misses and a detector without clutter."""
    different = {"seed": seed, "camera.fps": 1.0 / every_s} | ({"targets": HERD} if herd else {})
    lines = fly(scenario("photographs").but(different)).companion.targets("cow")
    seen = Counter(line["track"] for line in lines if line["fix"] is not None)
    confirmed = {line["track"] for line in lines if line["state"] in ("confirmed", "coasting")}
    often = {track for track, count in seen.items() if count >= 5}
    assert often <= confirmed
    assert len(confirmed) <= (16 if herd else 3)
    assert len(confirmed) >= 0.8 * sum(count >= 3 for count in seen.values())

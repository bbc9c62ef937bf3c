"""A wing that heaves as fast as positions come: they report a climb that does not exist."""

from statistics import mean, median

import pytest
from flying import fly

from fwav_companion.types import NoticeCode
from sitl_mock import TargetOptions, scenario

SETTINGS = ("tracking.self_calibration=true",)
SIX = tuple(
    TargetOptions(north=north, east=east)
    for north, east in ((4.4, -6.1), (-7.1, 5.1), (-1.0, 4.0), (-7.5, -0.8), (3.4, 4.1), (6.7, 6.0))
)
HOVER = {"flight.pattern": "hover", "flight.pitch_deg": 0.0, "flight.height_m": 20.0, "flight.flapping_hz": 9.65}
ORBIT = {"flight.half_axes_m": (6.4, 6.4), "flight.height_m": 10.6, "flight.speed_m_s": 2.8, "flight.flapping_hz": 9.99}
CLUTTERED = {"camera.clutter": 0.1, "camera.readout_s": 0.015, "seconds": 60.0}


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("flown", [HOVER, ORBIT | {"flight.flapping_pitch_deg": 0.0}], ids=["hover", "orbit"])
def test_targets_under_a_heaving_vehicle_are_as_right_as_claimed(flown):
    """Four flights of either kind: the height runs away in none, and the mean normalised square is 2 when honest.

    Of the hovers it was 22 to 45, with heights 7 m off, and of the orbits 2 to 16.
    """
    errors, squares = list[float](), list[float]()
    for seed in range(1, 5):
        flight = fly(scenario("default").but(CLUTTERED | flown | {"seed": seed, "targets": SIX}), SETTINGS)
        assert NoticeCode.PRIOR_EXCEEDED not in flight.companion.codes
        late = [
            line
            for line in flight.companion.targets("target")
            if line.state == "confirmed" and flight.seen_at_s(line) > 30.0
        ]
        assert len({line.track for line in late}) <= 8
        found = [flight.relative_error(line) for line in late[::10]]
        errors.append(median(error for error, _ in found))
        squares.append(mean(square for _, square in found))
    assert max(errors) < 1.0
    assert 0.5 < mean(squares) < 5.0

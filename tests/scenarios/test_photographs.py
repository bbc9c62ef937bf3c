"""A photograph every few seconds: every target is confirmed, once."""

import pytest
from draws import slow_of
from flying import fly

from fwav_companion.recording.line_types import CalibrationLine
from sitl_mock import TargetOptions, scenario

SETTINGS = (
    "camera.readout_s=0",
    "uncertainty.pixel_noise_px=1.5",
    "uncertainty.time_offset_sigma_s=0.2",
    "tracking.self_calibration=true",
)
HERD = tuple(
    TargetOptions(label="cow", north=-24.0 + 16.0 * i, east=-18.0 + 12.0 * j) for i in range(4) for j in range(4)
)


@pytest.mark.parametrize("every_s", [4.0, 10.0, 30.0])
@pytest.mark.parametrize("seed", slow_of(1, 2, 3, few=1))
@pytest.mark.parametrize("herd", [False, True])
def test_every_target_is_confirmed_as_one_track(every_s, seed, herd):
    """60 m high with drawn errors and misses; of the herd, one is out of view, and ten photographs show nine thrice."""
    different = {"seed": seed, "camera.fps": 1.0 / every_s} | ({"targets": HERD} if herd else {})
    lines = fly(scenario("photographs").but(different)).companion.targets("cow")
    confirmed = {line.track for line in lines if line.is_confirmed}
    least = {4.0: 16, 10.0: 15, 30.0: 9} if herd else {4.0: 3, 10.0: 3, 30.0: 2}
    assert len(confirmed) in range(least[every_s], 17 if herd else 4)


@pytest.mark.parametrize("attitudes_hz", slow_of(4.0, 50.0, few=1))
def test_photographs_show_the_delay_and_claim_no_more(attitudes_hz):
    """25 photographs at 6 m/s, stamps 0.31 s early: one sigma of what 12 flights find is 0.03 s, as claimed.

    The sum of squares has 12 degrees of freedom: 3.1 to 33 holds 99 % of it.
    """
    rates = {"ATTITUDE": attitudes_hz, "ATTITUDE_QUATERNION": attitudes_hz, "GLOBAL_POSITION_INT": 4.0}
    early = {"camera.fps": 0.25, "seconds": 100.0, "biases.time_offset_s": -0.31, "autopilot.rates_hz": rates}
    early["autopilot.true_ceiling_hz"] = attitudes_hz
    squares = errors = 0.0
    for seed in range(1, 13):
        lines = fly(scenario("photographs").but({"seed": seed, **early}), SETTINGS).companion.lines
        last = [line for line in lines if isinstance(line, CalibrationLine)][-1]
        assert last.status in ("time", "calibrated"), last.reason
        error_s = last.time_offset_s + 0.31
        errors += error_s**2
        squares += (error_s / last.time_offset_sigma_s) ** 2
    assert (errors / 12) ** 0.5 < 0.05
    assert 3.1 < squares < 33.0

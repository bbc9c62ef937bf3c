"""An EKF reset: the autopilot's position jumps beyond its velocity, once, in the middle of a flight."""

from itertools import pairwise
from math import cos, hypot, sin

import pytest
from flying import fly
from scipy.stats import chi2

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.recording.line_types import SightingLine
from fwav_companion.telemetry.hermite_series import HermiteSeries
from fwav_companion.telemetry.position_jump import LEAST_JUMP_M, PositionJumps
from fwav_companion.tracking.smoothed.solve_jobs import SmootherOptions
from fwav_companion.types import NoticeCode
from sitl_mock import Options, scenario

AT_S, JUMP = 8.0, (4.0, -3.0)
RESET = scenario("default", Options(seed=2)).but(
    {
        "seconds": 14.0,
        "autopilot.position_shifts": ((AT_S, AT_S, *JUMP),),
        "autopilot.position_wander": "smooth",
        "camera.clutter": 0.0,
        "camera.missed": 0.0,
    }
)


def test_a_reset_is_reported_once_and_splits_the_history():
    flown = fly(RESET, sightings=True)
    assert flown.companion.codes.count(NoticeCode.POSITION_JUMPED) == 1
    sightings = [line for line in flown.companion.lines if isinstance(line, SightingLine) and line.camera_ned]
    steps = [
        hypot(b.camera_ned[0] - a.camera_ned[0], b.camera_ned[1] - a.camera_ned[1])
        for a, b in pairwise(sightings)
        if b.time_boot - a.time_boot < 0.05
    ]
    assert max(steps) > 4.0, "the jump lies between two frames"
    assert not [step for step in steps if 1.5 < step < 4.0], "no position is interpolated across it"


@pytest.mark.parametrize(
    ("settings", "smoother"), [((), None), (("tracking.self_calibration=true",), SmootherOptions())],
    ids=["filter", "smoother"],
)  # fmt: skip
def test_one_track_goes_on_and_its_claim_holds(settings, smoother):
    flown = fly(RESET, settings, sightings=True, smoother=smoother)
    lines = [line for line in flown.companion.targets("target") if line.state == "confirmed"]
    assert len({line.track for line in lines}) == 1
    for line in lines[::20]:
        (nn, _, _), (_, ee, _), _ = line.cov
        assert flown.error_m(line) ** 2 < chi2.ppf(0.9999, 2) * max(nn, ee)


def test_a_quiet_flight_has_no_reset():
    flown = fly(RESET.but({"autopilot.position_shifts": ()}))
    assert NoticeCode.POSITION_JUMPED not in flown.companion.codes


def test_a_turn_is_no_jump_and_a_step_of_the_position_is_one():
    """Ten positions a second on a circle of 10 m at 10 m/s: 1 g of turn."""
    jumps = PositionJumps()
    for k in range(50):
        at = 0.1 * k
        place, velocity = (10.0 * cos(at), 10.0 * sin(at), 0.0), (-10.0 * sin(at), 10.0 * cos(at), 0.0)
        assert jumps.on_position(BootNs(k * 100_000_000), place, velocity) is None
    moved = (place[0] + 1.0 + LEAST_JUMP_M, place[1] + 1.0, 0.0)
    assert jumps.on_position(BootNs(5_000_000_000), moved, velocity) is not None
    assert jumps.on_position(BootNs(50_000_000_000), (0.0, 0.0, 0.0), velocity) is None, "a long silence is not judged"


def test_values_are_not_interpolated_across_a_split():
    series = HermiteSeries()
    for k, value in enumerate((0.0, 1.0, 12.0, 13.0)):
        series.insert(BootNs(k * 100_000_000), (value,), (10.0,))
    series.split_at(BootNs(200_000_000))
    assert series.at(BootNs(150_000_000)).values[0] == pytest.approx(1.5)
    assert series.at(BootNs(200_000_000)).values[0] == pytest.approx(12.0)
    assert series.at(BootNs(250_000_000)).values[0] == pytest.approx(12.5)
    assert series.at(BootNs(50_000_000)).values[0] == pytest.approx(0.5)

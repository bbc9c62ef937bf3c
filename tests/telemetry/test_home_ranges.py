"""Homes that the vehicle's own position contradicts are refused; every other home is followed."""

import pytest
from telemetry_messages import Autopilot

from fwav_companion.telemetry import HomeMoved

LAT, LON = 473_977_420, 85_455_940
GROUND_MM = 500_000


def at_site(first: str) -> Autopilot:
    autopilot = Autopilot()
    if first == "position":
        autopilot.send("GLOBAL_POSITION_INT", 100, alt=512_000, relative_alt=12_000)
    return autopilot


@pytest.mark.parametrize("first", ["position", "home"])
@pytest.mark.parametrize(
    "home",
    [
        {"latitude": LAT, "longitude": LON, "altitude": 0},
        {"latitude": LAT + 20_000_000, "longitude": LON, "altitude": GROUND_MM},
        {"latitude": LAT, "longitude": LON, "altitude": 50_000_000},
    ],
)
def test_a_home_at_altitude_zero_or_far_away_moves_nothing(first: str, home: dict[str, int]) -> None:
    autopilot = at_site(first)
    autopilot.send("HOME_POSITION", 200, **home)
    autopilot.send("GLOBAL_POSITION_INT", 300, alt=512_000, relative_alt=12_000)
    world = autopilot.telemetry.world
    assert world.home_down_m == 0.0
    assert not [event for event in autopilot.events if isinstance(event, HomeMoved)]
    assert world.take_off.place == world.plane.origin
    autopilot.send("HOME_POSITION", 400, latitude=LAT, longitude=LON, altitude=GROUND_MM + 700)
    assert world.home_down_m == pytest.approx(-0.7)


def test_a_home_by_the_sea_is_at_altitude_zero() -> None:
    autopilot = Autopilot()
    autopilot.send("GLOBAL_POSITION_INT", 100, alt=12_400, relative_alt=12_000)
    autopilot.send("HOME_POSITION", 200, latitude=LAT, longitude=LON, altitude=0)
    assert autopilot.telemetry.world.home_down_m == pytest.approx(0.4)

"""The height by a barometer alone: relative to its mean on the ground, with a sigma that grows, or not at all."""

from __future__ import annotations

import random
from math import exp

import pytest
from telemetry_messages import MS, Autopilot

from fwav_companion.geometry.stamps import BootNs
from fwav_companion.telemetry.barometer import altitude_of_pressure_m
from fwav_companion.types import VehicleState

ARMED = 128
GROUND_M = 431.0
"""What the barometer shows on the ground: another zero than any map's."""


def pressure_hpa(altitude_m: float) -> float:
    """Pressure of an isothermal layer at 288.15 K about the sea level: g / (R T) = 1.186e-4 / m, to 1 % below 500 m."""
    return 1013.25 * exp(-1.186e-4 * altitude_m)


READINGS = {
    "VFR_HUD": lambda altitude_m: {"alt": altitude_m},
    "ALTITUDE": lambda altitude_m: {"altitude_monotonic": altitude_m, "altitude_relative": float("nan")},
    "SCALED_PRESSURE": lambda altitude_m: {"press_abs": pressure_hpa(altitude_m)},
}


class Flight:
    """A vehicle without a global position: some seconds on the ground, then a climb."""

    def __init__(self, *sources: str, armed_at_s: float = 20.0, noise_m: float = 0.0) -> None:
        self.autopilot, self.sources = Autopilot(), sources
        self.armed_at_s, self.noise_m, self.rng = armed_at_s, noise_m, random.Random(3)
        self.now_ms = 0

    def fly(self, until_s: float, height_m: float = 0.0, offset_m: float = GROUND_M) -> None:
        while self.now_ms < 1000 * until_s:
            if self.now_ms % 1000 == 0:
                armed = self.now_ms >= 1000 * self.armed_at_s
                self.autopilot.send("HEARTBEAT", self.now_ms, base_mode=ARMED if armed else 0)
            self.autopilot.send("ATTITUDE", self.now_ms)
            if self.now_ms % 100 == 0:
                for source in self.sources:
                    altitude_m = offset_m + height_m + self.rng.gauss(0.0, self.noise_m)
                    self.autopilot.send(source, self.now_ms, **READINGS[source](altitude_m))
            self.now_ms += 20

    @property
    def state(self) -> VehicleState:
        state = self.autopilot.telemetry.state_at(BootNs((self.now_ms - 120) * MS))
        assert isinstance(state, VehicleState)
        return state

    @property
    def source(self) -> str | None:
        return self.autopilot.telemetry.status(self.autopilot.host(self.now_ms)).height_source


@pytest.mark.parametrize("source", READINGS)
def test_height_without_a_position_is_that_above_the_mean_on_the_ground(source: str) -> None:
    flight = Flight(source, noise_m=0.05)
    flight.fly(20.0)
    flight.fly(30.0, height_m=12.0)
    assert flight.state.height_above_home_m == pytest.approx(12.0, abs=0.3)
    assert flight.source == f"barometer ({source})"


def test_sigma_of_a_barometric_height_is_a_metre_and_a_metre_more_in_ten_minutes() -> None:
    flight = Flight("VFR_HUD")
    flight.fly(20.0)
    flight.fly(30.0, height_m=5.0)
    assert flight.state.height_bias_m == pytest.approx(1.0 + 10.0 / 600.0, abs=0.01)
    flight.fly(320.0, height_m=5.0)
    assert flight.state.height_bias_m == pytest.approx(1.5, abs=0.01)


def test_weather_before_arming_moves_the_mean_and_not_the_height() -> None:
    flight = Flight("VFR_HUD", armed_at_s=600.0)
    for k in range(60):
        flight.fly(10.0 * (k + 1), offset_m=GROUND_M + 0.05 * k)
    flight.fly(610.0, height_m=8.0, offset_m=GROUND_M + 3.0)
    assert flight.state.height_above_home_m == pytest.approx(8.0, abs=0.4)


def test_flight_that_is_first_heard_in_the_air_has_no_barometric_height_and_says_so() -> None:
    flight = Flight("VFR_HUD", armed_at_s=0.0)
    flight.fly(20.0, height_m=30.0)
    assert flight.state.height_above_home_m is None
    report = flight.autopilot.telemetry.status(flight.autopilot.host(flight.now_ms))
    assert (report.height_source, report.barometer_starts_in_air) == (None, True)


def test_flight_that_is_first_heard_in_the_air_without_a_barometer_blames_none() -> None:
    flight = Flight(armed_at_s=0.0)
    flight.fly(5.0)
    assert not flight.autopilot.telemetry.status(flight.autopilot.host(flight.now_ms)).barometer_starts_in_air


def test_flight_first_heard_in_the_air_has_its_barometric_height_after_it_was_disarmed() -> None:
    flight = Flight("VFR_HUD", armed_at_s=0.0)
    flight.fly(5.0, height_m=30.0)
    flight.armed_at_s = 30.0
    flight.fly(30.0)
    flight.fly(40.0, height_m=9.0)
    assert flight.state.height_above_home_m == pytest.approx(9.0, abs=0.3)


def test_preferred_source_is_chosen_on_the_ground_and_kept_in_the_air() -> None:
    flight = Flight("SCALED_PRESSURE")
    flight.fly(10.0)
    assert flight.source == "barometer (SCALED_PRESSURE)"
    flight.sources = ("SCALED_PRESSURE", "VFR_HUD")
    flight.fly(20.0)
    assert flight.source == "barometer (VFR_HUD)"
    flight.sources = ("SCALED_PRESSURE", "VFR_HUD", "ALTITUDE")
    flight.fly(30.0, height_m=6.0)
    assert flight.source == "barometer (VFR_HUD)", "ALTITUDE has no mean on the ground"
    flight.sources = ("SCALED_PRESSURE",)
    flight.fly(40.0, height_m=6.0)
    assert flight.source == "barometer (SCALED_PRESSURE)", "the one in use fell silent"
    assert flight.state.height_above_home_m == pytest.approx(6.0, abs=0.3)


def test_better_heights_are_preferred_to_a_barometer() -> None:
    flight = Flight("VFR_HUD")
    flight.fly(25.0, height_m=0.0)
    for ms in range(flight.now_ms, flight.now_ms + 1000, 100):
        flight.autopilot.send("GLOBAL_POSITION_INT", ms, lat=0, lon=0, relative_alt=7_000)
        flight.autopilot.send("ATTITUDE", ms)
    flight.now_ms += 1000
    assert flight.state.height_above_home_m == pytest.approx(7.0)
    assert flight.state.height_bias_m is None
    assert flight.source == "GLOBAL_POSITION_INT"


@pytest.mark.parametrize("press_abs", [0.0, -5.0, float("nan"), float("inf"), 5000.0])
def test_implausible_pressure_is_counted_and_shows_no_height(press_abs: float) -> None:
    flight = Flight()
    flight.fly(5.0)
    flight.autopilot.send("SCALED_PRESSURE", flight.now_ms, press_abs=press_abs)
    assert flight.autopilot.telemetry.status(flight.autopilot.host(flight.now_ms)).refused == {"SCALED_PRESSURE": 1}


def test_altitude_of_a_pressure_is_that_of_the_standard_atmosphere() -> None:
    """ISO 2533, geopotential altitudes: 954.61 hPa at 500 m, 898.75 at 1000 m, 701.08 at 3000 m."""
    for altitude_m, hpa in ((0.0, 1013.25), (500.0, 954.61), (1000.0, 898.75), (3000.0, 701.08)):
        assert altitude_of_pressure_m(hpa) == pytest.approx(altitude_m, abs=1.0)

"""The motion: derivatives match the positions and angles, and each pattern has its configured shape."""

from math import atan2, cos, degrees, hypot, pi

import numpy as np
import pytest
from scipy.signal import butter, freqz
from scipy.spatial.transform import Rotation

from sitl_mock import FlightOptions
from sitl_mock.flight import Flight
from sitl_mock.gyro import SAMPLE_HZ, Gyro, TwoPole

PATTERNS = ["hover", "orbit", "figure_eight", "racetrack", "waypoints"]
WAYPOINTS = ((0.5, -3.0, 1.0, 15.0, 30.0), (4.0, 2.0, 1.5, 9.0, 200.0), (9.0, 0.0, 0.0, 1.0, 390.0))
CALM = {"wander_m": 0.0, "wander_deg": 0.0, "heave_m": 0.0, "flapping_roll_deg": 0.0}


@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("takeoff", [None, 2.0])
def test_velocity_and_body_rates_are_the_derivatives(pattern, takeoff):
    flight = Flight(
        FlightOptions(
            pattern=pattern, half_axes_m=(22.0, 11.0), turn_deg_s=7.0, takeoff_at_s=takeoff, waypoints=WAYPOINTS
        ),
        seed=3,
    )
    h = 1e-5
    for t in (0.7, 3.3, 8.21, 60.05):
        before, state, after = flight.at(t - h), flight.at(t), flight.at(t + h)
        difference = (np.array(after.position) - before.position) / (2 * h)
        np.testing.assert_allclose(state.velocity, difference, atol=1e-6)
        turned = Rotation.from_matrix(before.ned_from_body).inv() * Rotation.from_matrix(after.ned_from_body)
        np.testing.assert_allclose(state.rates, turned.as_rotvec() / (2 * h), atol=1e-6)
        assert flight.rates(t) == state.rates


def test_the_figure_eight_has_its_axes_and_its_mean_speed():
    flight = Flight(FlightOptions(pattern="figure_eight", half_axes_m=(22.0, 11.0), speed_m_s=5.0, **CALM), seed=1)
    states = [flight.at(i * 0.05) for i in range(1200)]
    north, east = (np.array([s.position[axis] for s in states]) for axis in (0, 1))
    assert np.ptp(north) == pytest.approx(44.0, abs=0.1)
    assert np.ptp(east) == pytest.approx(22.0, abs=0.1)
    assert np.mean([hypot(*s.velocity[:2]) for s in states]) == pytest.approx(5.0, rel=0.02)
    headings = [s.euler[2] - atan2(s.velocity[1], s.velocity[0]) for s in states]
    np.testing.assert_allclose(np.cos(headings), 1.0, atol=1e-9)


def test_an_orbit_looks_at_its_centre():
    flight = Flight(FlightOptions(pattern="orbit", half_axes_m=(8.0, 8.0), centre=(100.0, 50.0), **CALM), seed=1)
    for t in (0.0, 1.0, 5.0):
        state = flight.at(t)
        toward = (100.0 - state.position[0], 50.0 - state.position[1])
        assert hypot(*toward) == pytest.approx(8.0)
        assert cos(atan2(toward[1], toward[0]) - state.euler[2]) == pytest.approx(1.0)


def test_flapping_has_its_amplitude_and_frequency():
    flight = Flight(FlightOptions(pattern="hover", flapping_hz=7.0, flapping_pitch_deg=4.0, **CALM), seed=2)
    pitch = np.array([degrees(flight.at(i * 0.002).euler[1]) for i in range(5000)])
    assert pitch.max() == pytest.approx(41.0, abs=0.01)
    assert pitch.min() == pytest.approx(33.0, abs=0.01)
    crossings = np.sum((pitch[:-1] < 37.0) & (pitch[1:] >= 37.0))
    assert 69 <= crossings <= 71


def test_on_the_ground_before_takeoff_and_at_height_after():
    flight = Flight(FlightOptions(pattern="hover", takeoff_at_s=5.0, climb_s=4.0, **CALM), seed=1)
    assert flight.at(4.9).position[2] == 0.0
    assert flight.at(9.1).position[2] == pytest.approx(-12.0)


def test_waypoints_are_reached_in_their_time_and_left_at_rest():
    options = FlightOptions(
        pattern="waypoints", waypoints=WAYPOINTS, centre=(0.0, 0.0), flapping_pitch_deg=0.0, pitch_deg=0.0, **CALM
    )
    flight = Flight(options, seed=1)
    for at_s, north, east, up, heading_deg in WAYPOINTS:
        state = flight.at(at_s)
        assert state.position == pytest.approx((north, east, -up), abs=1e-12)
        assert degrees(state.euler[2]) == pytest.approx(heading_deg)
        assert state.velocity == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
    assert flight.at(0.0).position == flight.at(0.5).position
    assert flight.at(60.0).position == flight.at(9.0).position
    sinking = max(flight.at(4.0 + i * 0.01).velocity[2] for i in range(500))
    assert sinking == pytest.approx(1.875 * 8.0 / 5.0, rel=1e-3)  # a minimum-jerk course's peak over its mean


@pytest.mark.parametrize("waypoints", [(), (WAYPOINTS[0],), (WAYPOINTS[1], WAYPOINTS[0])])
def test_waypoints_that_are_no_course_are_refused(waypoints):
    with pytest.raises(ValueError, match="rising time"):
        Flight(FlightOptions(pattern="waypoints", waypoints=waypoints), seed=1)


def test_an_unknown_pattern_is_refused():
    with pytest.raises(KeyError, match="figure_eight"):
        Flight(FlightOptions(pattern="loop"), seed=1)


def test_the_two_pole_filter_is_scipy_s_butterworth():
    filtered = TwoPole(20.0, 1000.0)
    impulse = (0.25, 1.0, -0.5)
    responses = np.array([filtered.step(impulse if i == 0 else (0.0, 0.0, 0.0)) for i in range(4000)])
    response = responses[:, 1]
    b, a = butter(2, 20.0, fs=1000.0)
    frequencies = np.array([1.0, 5.0, 12.0, 20.0, 50.0])
    _, theirs = freqz(b, a, worN=frequencies, fs=1000.0)
    ours = [np.sum(response * np.exp(-2j * pi * f * np.arange(4000) / 1000.0)) for f in frequencies]
    np.testing.assert_allclose(ours, theirs, atol=1e-9)
    np.testing.assert_allclose(responses, response[:, None] * np.array(impulse), atol=1e-15)


@pytest.mark.parametrize("flapping_hz", [5.0, 12.0])
def test_rates_come_late_and_smaller_by_the_filter(flapping_hz):
    """About 11 ms at flapping frequencies, as with ArduPilot's filter at 20 Hz."""
    options = FlightOptions(pattern="hover", flapping_hz=flapping_hz, flapping_modulation=0.0, **CALM)
    flight = Flight(options, seed=1)
    gyro = Gyro(flight, 20.0)
    times = 1.0 + np.arange(0, 2.0, 0.004)
    true = np.array([flight.rates(t)[1] for t in times])
    felt = np.array([gyro.rates(t)[1] for t in times])
    phase = np.exp(-2j * pi * flapping_hz * times)
    ratio = np.sum(felt * phase) / np.sum(true * phase)
    lag_s = -np.angle(ratio) / (2 * pi * flapping_hz)
    b, a = butter(2, 20.0, fs=SAMPLE_HZ)
    _, theirs = freqz(b, a, worN=[flapping_hz], fs=SAMPLE_HZ)
    assert ratio == pytest.approx(theirs[0], abs=2e-3)
    assert 0.0105 < lag_s < 0.0135


def test_the_gyro_answers_the_recent_past_and_jumps_ahead():
    flight = Flight(FlightOptions(), seed=1)
    gyro, forward = Gyro(flight, 20.0), Gyro(flight, 20.0)
    late = gyro.rates(5.0)
    assert forward.rates(4.8) != late
    np.testing.assert_allclose(forward.rates(5.0), late, atol=1e-6)
    np.testing.assert_allclose(gyro.rates(4.9), forward.rates(4.9), atol=1e-6)
    np.testing.assert_allclose(gyro.rates(50.0), Gyro(flight, 20.0).rates(50.0), atol=1e-12)


def test_without_a_filter_rates_are_true():
    flight = Flight(FlightOptions(), seed=1)
    assert Gyro(flight, 0.0).rates(3.21) == flight.rates(3.21)

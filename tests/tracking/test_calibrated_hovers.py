"""What a hover shows of the camera, and what it hides: the place claims what is hidden."""

from functools import cache

import numpy as np
import pytest
from draws import first_of
from simulated_flight import Flight
from simulated_world import World
from smoothed_flights import tracked

from fwav_companion.types import BIAS_COUNT, Bias
from fwav_companion.types.calibration_report import CalibrationStatus

TARGET = (4.0, 3.0)
HOVER = {"shape": "hover", "height_m": 10.0, "targets": (TARGET,)}


@cache
def hovered(delay_s=0.0, **options):
    """(last state of the oldest confirmed track, report) after a hover."""
    best = tracker = None
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = delay_s
    for tracker, tracks in tracked(World(Flight(**HOVER, **options, biases=biases))):  # noqa: B007 - the last is read
        for track in tracks:
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best, tracker.calibration


def shaking():
    return hovered(seed=6, seconds=20, fps=15)


def calm():
    return hovered(seed=6, seconds=20, fps=15, flapping_deg=0.0)


def beating(seed):
    """Ten seconds at a steady 10 Hz."""
    return hovered(delay_s=0.03, flapping_hz=10.0, seed=seed, seconds=10.0, attitude_hz=100.0)


def error_of(track):
    return float(np.hypot(*np.subtract(track.position_ned[:2], TARGET)))


def square_of(track):
    """Squared error of the place, normalised by its claim."""
    error = np.subtract(track.position_ned[:2], TARGET)
    return float(error @ np.linalg.solve(np.array(track.cov)[:2, :2], error))


def test_a_hover_shows_the_delay_and_its_place_claims_the_hidden_mount():
    track, report = shaking()
    assert report.status is CalibrationStatus.TIME
    assert report.time_offset_s == pytest.approx(0.0, abs=0.002)
    assert np.sqrt(track.cov[0][0]) > 0.15  # the mount's prior is still in it


@pytest.mark.parametrize("flight", [shaking, calm])
def test_what_a_hover_says_of_the_mount_and_the_place_is_within_its_claims(flight):
    track, report = flight()
    assert square_of(track) < 9.0
    assert np.all(np.abs(report.mount) < 3.0 * np.array(report.mount_sigma))
    assert abs(report.time_offset_s) < 3.0 * report.time_offset_sigma_s


@pytest.mark.xfail(
    strict=True,
    reason="the mount is estimated by noise: 0.34, -0.82, -0.47 degrees, each within 1.5 sigmas; the place is off by "
    "0.17 m with a sigma of 0.17 m",
)
def test_a_hover_leaves_the_mount_alone():
    track, report = shaking()
    assert report.mount == (0.0, 0.0, 0.0)
    assert report.mount_sigma == pytest.approx(np.radians([1, 1, 1]))
    assert error_of(track) < 0.02


@pytest.mark.xfail(
    strict=True,
    reason="the vehicle's sway shows the delay to 0.018 s of its 0.05 s: status time; the place is off by 0.17 m with "
    "a sigma of 0.17 m",
)
def test_what_does_not_shake_shows_no_delay():
    track, report = calm()
    assert report.status is CalibrationStatus.WAITING
    assert report.time_offset_sigma_s == 0.05
    assert error_of(track) < 0.03


WRONG_BEAT = pytest.mark.xfail(
    strict=True, reason="0.1298 s is claimed with a sigma of 0.1 ms: the search's cost of 0.03 s is higher by 13"
)


@pytest.mark.parametrize("seed", [pytest.param(2, marks=WRONG_BEAT), 5, pytest.param(7, marks=pytest.mark.slow)])
def test_the_delay_of_a_steady_beat_is_within_its_claim(seed):
    _, report = beating(seed)
    assert abs(report.time_offset_s - 0.03) < 3.0 * report.time_offset_sigma_s


@pytest.mark.xfail(
    strict=True,
    reason="one delay is claimed with a sigma of 0.1 ms: that of the next beat costs more by 13 (seed 2, where the "
    "claim is a beat off) and by 17 (seed 5), beyond the 9 of a rival",
)
@pytest.mark.parametrize("seed", first_of(2, 5, 7))
def test_delays_a_beat_apart_are_reported_and_not_guessed_between(seed):
    """A hover at a steady 10 Hz repeats itself every 100 ms, well within the prior; one delay fits better by chance."""
    _, report = beating(seed)
    assert report.status is CalibrationStatus.AMBIGUOUS
    beats = [round((delay - 0.03) / 0.1) for delay in report.alternatives]
    assert 0 in beats
    assert len(beats) > 1
    assert report.alternatives == pytest.approx([0.03 + 0.1 * beat for beat in beats], abs=0.002)
    assert (report.time_offset_s, report.time_offset_sigma_s) == (0.0, 0.05)
    assert report.mount == (0.0, 0.0, 0.0)

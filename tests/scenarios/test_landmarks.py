"""Landmarks: with one in view targets are right to a decimetre on a receiver of 1 m, and the claim says so.

The mock draws every bias from the configured priors, an error of the altitude above sea level, and the survey's own.
One target a flight is judged, since a flight's biases are one draw.
"""

from functools import partial
from random import Random
from statistics import median

import numpy as np
import pytest
from draws import slow_of
from flying import LINK, Companion
from kept import kept
from scipy.stats import binom, chi2

from fwav_companion.types import LandmarkState, NoticeCode
from sitl_mock import Options, Simulation, TargetOptions, scenario, simulate
from sitl_mock.earth import Place

SURVEY_M = 0.05
MARKS = {"mark": (3.0, -2.0), "second": (-3.0, -2.0), "third": (0.0, 4.0)}
TARGET = TargetOptions(label="target", north=-2.0, east=2.5)
SOME, MANY, SECONDS = 18, 30, 45.0
"""Flights in the slow part and by night. Of 18 whose claims are half or twice the error, the sum of squares is outside
its limits in 99 cases of a hundred; of the figure eights, whose claims are large, 16 did not show half of them."""
OVER_THE_TARGETS = {"default": {}, "figure_eight": {"flight.half_axes_m": (10.0, 6.0)}}


def flown(
    name: str, seed: int, marks: dict, seconds: float, settings=(), **differences
) -> tuple[Simulation, Companion]:
    """A flight over landmarks; ``marks``: label -> error of the configured place, (north, east) in metres."""
    scene = tuple(TargetOptions(label=label, north=n, east=e) for label, (n, e) in MARKS.items() if label in marks)
    altitude_m = Random(f"{seed}/altitude").gauss(0.0, 2.0)
    options = scenario(name, Options(seed=seed)).but(
        {
            "seconds": seconds, "targets": (*scene, TARGET), "biases.altitude_m": altitude_m,
            "autopilot.position_wander": "smooth", **OVER_THE_TARGETS[name], **differences,
        }
    )  # fmt: skip
    mock = simulate(options)
    text = LINK + '[camera]\ncalibration = "camera.yaml"\n'
    for target in mock.scene[:-1]:
        rng = Random(f"{seed}/survey/{target.label}")
        wrong = (*marks[target.label], 0.0)
        surveyed = [x + rng.gauss(0.0, SURVEY_M) + off for x, off in zip(target.at(0.0), wrong, strict=True)]
        place = mock.world.place(tuple(surveyed))
        text += f'[[landmark]]\nlabel = "{target.label}"\nlat = {place.lat:.9f}\nlon = {place.lon:.9f}\n'
        text += f"alt_amsl = {place.alt_amsl:.4f}\nsigma_m = {SURVEY_M}\n"
    companion = Companion(settings, unix_minus_host_s=mock.unix_minus_host_s, text=text)
    for _ in mock.drive(companion):
        pass
    companion.finish()
    return mock, companion


def ended(mock: Simulation, companion: Companion) -> tuple[float, float, float]:
    """Horizontal error of the target at the end, metres; one sigma claimed, larger semi-axis; normalised square."""
    lines = [line for line in companion.targets("target") if line.is_confirmed]
    origin = companion.pipeline.telemetry.world.plane.origin
    shift = mock.world.ned(Place(origin.lat_deg, origin.lon_deg, origin.alt_amsl_m))
    true = mock.scene[-1].at(0.0)
    error = np.array([lines[-1].north - (true[0] - shift[0]), lines[-1].east - (true[1] - shift[1])])
    cov = np.array(lines[-1].cov)[:2, :2]
    return (
        float(np.hypot(*error)),
        float(np.linalg.eigvalsh(cov)[-1] ** 0.5),
        float(error @ np.linalg.solve(cov, error)),
    )


CHEAP = {"camera.fps": 10.0, "camera.readout_s": 0.02}
"""A third of the pictures; the unknown readout of a slower camera could be longer, so it is known."""
KNOWN = ("camera.readout_s=0.02",)
CALIBRATED = ("tracking.self_calibration=true",)


def end_of(name: str, settings: tuple[str, ...], differences: dict, seed: int) -> tuple[float, float, float]:
    return ended(*flown(name, seed, {"mark": (0.0, 0.0)}, SECONDS, settings, **differences))


def ends(name: str, settings: tuple[str, ...], flights: int, differences: dict) -> list[tuple[float, float, float]]:
    key = f"landmarks/{name}/{settings}/{differences}"
    return [
        kept(f"{key}/{seed}", partial(end_of, name, settings, differences, seed))
        for seed in range(7000, 7000 + flights)
    ]


def assert_honest(results) -> None:
    flights, squares = len(results), [square for _, _, square in results]
    low, high = chi2.ppf([0.0005, 0.9995], 2 * flights)
    assert low < sum(squares) < high, f"mean square {sum(squares) / flights:.2f}, of 2 when honest"
    inside = sum(square < chi2.ppf(0.9, 2) for square in squares)
    low, high = binom.ppf([0.0005, 0.9995], flights, 0.9)
    assert low <= inside <= high


@pytest.mark.timeout(900)
@pytest.mark.parametrize("flights", slow_of(SOME, MANY, few=1))
@pytest.mark.parametrize(("name", "settings", "error_m"), [("default", (), 0.16), ("figure_eight", CALIBRATED, 0.125)])
def test_near_a_landmark_targets_are_right_to_a_decimetre_and_the_claim_says_so(name, settings, error_m, flights):
    """On a receiver of 1 m, after 45 s; 0.05 m of it is the survey's own error, each axis. On an orbit at one speed an
    older position and another heading look alike: 5 and 10 m from the landmark the best estimate, of all errors
    together with sensitivities without noise, is off by 0.06 and 0.09 m.
    """
    results = ends(name, (*KNOWN, *settings), flights, CHEAP)
    assert_honest(results)
    assert median(sigma for _, sigma, _ in results) < 0.12  # 1.1 m without a landmark
    assert median(error for error, _, _ in results) < error_m


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_the_claim_is_honest_at_30_pictures_a_second_and_with_an_unknown_readout():
    results = ends("default", (), 8, {})
    assert_honest(results)
    assert median(sigma for _, sigma, _ in results) < 0.12


def state_of(companion: Companion) -> dict[str, LandmarkState]:
    return {record.label: record.state for record in companion.pipeline._components.camera.landmarks}


def test_a_landmark_that_disagrees_is_named_and_left_out():
    marks = {"mark": (0.0, 0.0), "second": (1.5, 1.0), "third": (0.0, 0.0)}
    mock, companion = flown("default", 1, marks, 12.0, KNOWN, **CHEAP)
    assert state_of(companion) == {
        "mark": LandmarkState.USED, "second": LandmarkState.LEFT_OUT, "third": LandmarkState.USED,
    }  # fmt: skip
    (text,) = companion.texts(NoticeCode.LANDMARK_LEFT_OUT)
    assert "second" in text
    assert [each.label for each in companion.pipeline.status(companion._now).sight.landmarks if each.refused or
            each.state == "left_out"] == ["second"]  # fmt: skip
    _, sigma_m, square = ended(mock, companion)
    assert sigma_m < 0.3
    assert square < chi2.ppf(0.999, 2)
    shown = {each.label: each for each in companion.lines[-1].landmarks}
    assert [shown[label].state for label in marks] == ["used", "left_out", "used"]
    assert shown["second"].off_m == pytest.approx(np.hypot(1.5, 1.0), abs=0.5)


@pytest.mark.parametrize("setting", ["tracking.filter=lowpass", "tracking.motion=moving"])
def test_a_filter_that_uses_no_landmark_is_reported_once(setting):
    _, companion = flown("default", 1, {"mark": (0.0, 0.0)}, 4.0, [setting])
    assert companion.codes.count(NoticeCode.LANDMARKS_NOT_APPLIED) == 1
    assert [each.state for each in companion.lines[-1].landmarks] == ["not_applied"]
    assert [each.state for each in companion.pipeline.status(companion._now).sight.landmarks] == ["not_applied"]


def over_three(off_m: float, seed: int) -> tuple[list[str], tuple[float, float, float]]:
    """The landmarks that a flight over three leaves out, of which the second is off to some side; the target's end."""
    direction = 2.4 * seed
    marks = dict.fromkeys(MARKS, (0.0, 0.0)) | {"second": (off_m * np.cos(direction), off_m * np.sin(direction))}
    mock, companion = flown("default", seed, marks, SECONDS, KNOWN, **CHEAP)
    labels = [label for label, state in state_of(companion).items() if state is LandmarkState.LEFT_OUT]
    return labels, ended(mock, companion)


def flights_over_three(off_m: float) -> list[tuple[list[str], tuple[float, float, float]]]:
    return [kept(f"landmarks/three/{off_m}/{seed}", partial(over_three, off_m, seed)) for seed in range(1, 13)]


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_of_three_landmarks_the_one_that_is_wrong_by_0_4_m_is_named():
    found = [labels for labels, _ in flights_over_three(0.4)]
    assert sum(labels == ["second"] for labels in found) >= 6


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("off_m", [0.0, 0.4])
def test_of_three_landmarks_none_that_is_right_is_left_out(off_m):
    found = [labels for labels, _ in flights_over_three(off_m)]
    assert {label for labels in found for label in labels} <= ({"second"} if off_m else set())


@pytest.mark.slow
@pytest.mark.timeout(1800)
@pytest.mark.parametrize("off_m", [0.0, 0.4])
def test_over_three_landmarks_the_claim_is_honest_whether_the_wrong_one_is_named_or_not(off_m):
    assert_honest([end for _, end in flights_over_three(off_m)])


def test_a_lone_landmark_far_from_all_that_the_receiver_says_is_left_out():
    _, companion = flown("default", 1, {"mark": (25.0, 0.0)}, 8.0)
    assert state_of(companion) == {"mark": LandmarkState.LEFT_OUT}
    assert companion.codes.count(NoticeCode.LANDMARK_LEFT_OUT) == 1


@pytest.mark.slow
def test_a_position_that_jumps_does_not_cost_a_landmark():
    """Seven metres for the rest of the flight: the landmark that agreed still counts, and the target stays."""
    shifts = ((6.0, 6.0, 5.0, -5.0),)
    mock, companion = flown("default", 3, {"mark": (0.0, 0.0)}, 16.0, **{"autopilot.position_shifts": shifts})
    assert state_of(companion) == {"mark": LandmarkState.USED}
    error_m, _, square = ended(mock, companion)
    assert error_m < 0.5
    assert square < chi2.ppf(0.999, 2)

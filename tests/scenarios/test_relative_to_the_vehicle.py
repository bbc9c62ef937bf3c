"""The target relative to the vehicle while the reported position wanders: right, and as right as claimed."""

from functools import partial
from statistics import mean, median

import pytest
from draws import slow_of
from flying import fly
from kept import kept

from fwav_companion.recording.line_types import CalibrationLine, TargetLine
from sitl_mock import scenario

SETTINGS = ("camera.readout_s=0", "uncertainty.pixel_noise_px=1.5")
LATE = "camera.time_offset_s=0.04"


def relative_errors(name: str, settings: tuple[str, ...], from_s: float, seed: int) -> list[tuple[float, float]]:
    """Errors relative to the vehicle, metres, and their normalised squares, of all fixes after a time of flight."""
    flight = fly(scenario(name).but({"seed": seed}), SETTINGS + settings)
    lines = [line for line in flight.companion.targets("pad") if line.state == "confirmed" and line.fix is not None]
    return [flight.relative_error(line) for line in lines if flight.seen_at_s(line) >= from_s]


def flights(name: str, settings: tuple[str, ...], from_s: float, number: int) -> list[list[tuple[float, float]]]:
    return [
        kept(f"relative/{name}/{settings}/{seed}", partial(relative_errors, name, settings, from_s, seed))
        for seed in range(1, number + 1)
    ]


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("calibrates", [False, True])
def test_a_descent_with_a_wandering_position_ends_right_to_a_decimetre(calibrates):
    """12 flights to 1 m: the lever arm and the mount are left, whatever a position errs by."""
    settings = (LATE, f"tracking.self_calibration={str(calibrates).lower()}")
    ends = [errors[-1][0] for errors in flights("descent_wander", settings, 50.0, 12) if errors]
    assert len(ends) >= 10
    assert median(ends) < 0.06
    assert max(ends) < 0.3


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_calibrated_descent_ends_right_to_centimetres_where_the_lever_arm_is_known():
    """From 1 m, with an exact position: a lever arm known to 3 cm an axis alone would leave 2 cm."""
    exact = tuple(f"uncertainty.{each}" for each in ("position_bias_m=0.0", "position_noise_m=0.01"))
    settings = (LATE, *exact, "uncertainty.lever_arm_sigma_m=0.0", "tracking.self_calibration=true")
    ends = [errors[-1][0] for errors in flights("descent", settings, 50.0, 3) if errors]
    assert len(ends) == 3
    assert max(ends) < 0.03


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", [2, 6])
def test_near_the_ground_a_wandering_position_is_no_mistake_of_the_mount(seed):
    """From 1 m, what it wanders by in ten seconds looks like a mount off by half a turn, and all places as unknown."""
    flight = fly(scenario("descent_wander").but({"seed": seed}), (*SETTINGS, LATE, "tracking.self_calibration=true"))
    assert not [line for line in flight.companion.lines if isinstance(line, CalibrationLine) and line.mistake]
    lines = [line for line in flight.companion.targets("pad") if line.is_confirmed]
    assert len(lines) > 300
    assert max(line.cov[0][0] for line in lines) < 2.0**2


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("number", slow_of(6, 12, few=1))
def test_circles_over_one_target_claim_what_is_true(number):
    """A wander of first order, of which an estimate lags behind: the mean square over the flights, of 2 when honest."""
    squares = [mean(square for _, square in errors) for errors in
               flights("copter_circles", ("tracking.self_calibration=true",), 85.0, number) if errors]  # fmt: skip
    assert len(squares) >= 0.8 * number
    assert 0.8 < mean(squares) < 4.0


@pytest.mark.slow
@pytest.mark.timeout(3600)
def test_circles_over_one_target_claim_what_is_true_without_self_calibration():
    """The same by the filter alone: it must see that the wander is of first order, or its mean square is above 4."""
    squares = [mean(square for _, square in errors) for errors in
               flights("copter_circles", ("tracking.self_calibration=false",), 50.0, 8) if errors]  # fmt: skip
    assert len(squares) == 8
    assert 0.4 < mean(squares) < 3.0


EIGHTS = ("uncertainty.pixel_noise_px=4.0", 'camera.readout_s="unknown"')
"""The mock's noise of detections on figure-eights; its readout is drawn."""
GAP_S, SOON_S = 1.0, 0.3
"""A target is out of view after this, and has just come into view again within that."""


def squares_about_gaps(settings: tuple[str, ...], wander: str, seed: int) -> tuple[list[float], list[float]]:
    """Normalised squares of the target relative to the vehicle while it is out of view, and just after."""
    options = scenario("figure_eight").but({"seed": seed, "autopilot.position_wander": wander})
    flight, seen_s, gap_s = fly(options, EIGHTS + settings), dict[int, float](), dict[int, float]()
    unseen, again = list[float](), list[float]()
    for line in flight.companion.lines:
        if not isinstance(line, TargetLine) or not line.is_confirmed:
            continue
        at_s = flight.seen_at_s(line)
        since_s = at_s - seen_s.setdefault(line.track, at_s)
        if line.fix is not None:
            seen_s[line.track] = at_s
            if since_s > GAP_S:
                gap_s[line.track] = at_s
        if at_s < 20.0:
            continue
        _, square = flight.relative_error(line)
        if line.fix is None and since_s > GAP_S:
            unseen.append(square)
        elif line.fix is not None and at_s - gap_s.get(line.track, -GAP_S) < SOON_S:
            again.append(square)
    return unseen, again


@pytest.mark.timeout(1800)
@pytest.mark.parametrize("number", slow_of(4, 8, few=1))
@pytest.mark.parametrize("wander", ["smooth", "gauss_markov"])
def test_a_target_out_of_view_and_one_that_comes_again_claim_what_is_true(wander, number):
    """Self-calibrating figure-eights, by either kind of wander: the mean square is 2 when honest."""
    settings = ("tracking.self_calibration=true",)
    flights = [
        kept(f"gaps/{settings}/{wander}/{seed}", partial(squares_about_gaps, settings, wander, seed))
        for seed in range(1, number + 1)
    ]
    unseen, again = ([square for flight in flights for square in flight[k]] for k in (0, 1))
    assert len(unseen) > 25 * number
    assert len(again) > 18 * number
    assert 0.4 < mean(unseen) < 3.0
    assert 0.4 < mean(again) < 3.0


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.parametrize("seed", [2, 6, 8])
def test_a_frame_that_misses_a_calibrated_target_is_hardly_worse_than_one_that_shows_it(seed):
    """Three targets, one detection of twenty missed; the vehicle's position is 0.11 s late, 0.09 and 0.04 s early."""
    flight = fly(scenario("three_targets").but({"seed": seed}), (*EIGHTS, "tracking.self_calibration=true"))
    shown, missed = list[float](), list[float]()
    for line in flight.companion.lines:
        if isinstance(line, TargetLine) and line.state == "confirmed" and flight.seen_at_s(line) > 20.0:
            off_m, _ = flight.relative_error(line)
            (missed if line.fix is None else shown).append(off_m**2)
    assert len(missed) > 100
    assert mean(missed) < 1.5**2 * mean(shown)

"""Whether the vehicle's position error moves smoothly: what means of a second say, and what the filter claims then."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from simulated_flight import priors
from wandering_positions import first_order_error, smooth_error

from fwav_companion.tracking.filters import wander_evidence
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.position_wander import position_wander
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate
from fwav_companion.tracking.filters.wander_evidence import MARGIN, WanderEvidence
from fwav_companion.types import BIAS_COUNT, Bias

WANDER = position_wander(1.0, (60.0,))
TIMES = np.arange(0.0, 60.0, 0.2)


def mount(times):
    """(n, 2, 1) displacement by one sigma of a bias that turns with the vehicle: 0.25 m, circles of 9.4 s."""
    turn = 2.0 * np.pi * times / 9.4
    return 0.25 * np.stack((np.cos(turn), np.sin(turn)), 1)[:, :, None]


def evidence_of(errors, off_sigmas, *, seconds=40):
    """The evidence after means of one second, 3 cm of noise each, of a target under a mount off by so many sigmas."""
    rng, evidence = np.random.default_rng(2), WanderEvidence()
    for k in range(seconds):
        window = slice(5 * k, 5 * k + 5)
        rows = mount(TIMES[window]).mean(0)
        north, east = errors[window].mean(0) + off_sigmas * rows[:, 0] + rng.normal(0.0, 0.03, 2)
        mean = PointEstimate(north, east, (0.03**2, 0.0, 0.03**2), tuple(map(tuple, rows.tolist())))
        evidence = evidence.with_mean(mean, 1.0, WANDER.quick_density, WANDER.smooth_density)
    return evidence


@pytest.mark.parametrize("off_sigmas", [0.0, 1.0])
def test_the_kind_of_wander_shows_within_40_seconds_of_circles(off_sigmas):
    for seed in range(8):
        rng = np.random.default_rng(seed)
        assert evidence_of(smooth_error(rng, TIMES, 60.0), off_sigmas).is_smooth
        assert not evidence_of(first_order_error(rng, TIMES, 60.0), off_sigmas).is_smooth


def test_without_evidence_the_error_is_taken_for_smooth():
    assert WanderEvidence().is_smooth


def test_a_gap_begins_new_differences_and_keeps_what_was_shown():
    known = evidence_of(np.zeros((300, 2)), 0.0)
    far = PointEstimate(9.0, 9.0, (0.001, 0.0, 0.001), ((0.0,), (0.0,)))
    later = known.with_mean(far, 20.0, WANDER.quick_density, WANDER.smooth_density)
    later = later.with_mean(far, 1.0, WANDER.quick_density, WANDER.smooth_density)
    assert later.score == known.score > MARGIN


def test_a_receiver_that_begins_to_move_fast_is_believed():
    rng, evidence = np.random.default_rng(3), evidence_of(np.zeros((300, 2)), 0.0)
    for north, east in np.cumsum(rng.normal(0.0, 0.18, (20, 2)), 0):
        mean = PointEstimate(north, east, (0.001, 0.0, 0.001), ((0.0,), (0.0,)))
        evidence = evidence.with_mean(mean, 1.0, WANDER.quick_density, WANDER.smooth_density)
    assert not evidence.is_smooth


def mean_square(kind, flights=12):
    """Mean normalised square relative to the vehicle, of 2 when honest, on circles under a drawn mount."""
    p = priors(mount_x=0.0, position_north=1.0, position_east=1.0, roll=0.25, position_bias_time_s=60.0)
    squares = []
    for seed in range(flights):
        rng = np.random.default_rng(seed)
        wander, off, state = kind(rng, TIMES, 60.0), rng.standard_normal(), None
        for t, rows, error in zip(TIMES, mount(TIMES), wander, strict=True):
            jacobian = np.zeros((3, BIAS_COUNT))
            jacobian[[0, 1], [Bias.POSITION_NORTH, Bias.POSITION_EAST]] = 1.0
            jacobian[:2, Bias.ROLL] = rows[:, 0] / 0.25
            seen = (*(error + off * rows[:, 0] + rng.normal(0.0, 0.1, 2)), 0.0)
            fix = a_fix(t, seen, np.diag([0.01, 0.01, 0.0]), jacobian, p.bias_sigmas)
            state = StaticKalman(p).initiate(fix) if state is None else state.predict(host_ns(t)).update(fix)
            if t > 25.0:
                away = np.array(state.apparent_ned[:2]) - error
                squares.append(away @ np.linalg.solve(np.array(state.relative_cov)[:2, :2], away))
    return np.mean(squares)


@pytest.mark.slow
@pytest.mark.parametrize("kind", [smooth_error, first_order_error])
def test_the_target_relative_to_the_vehicle_is_as_right_as_claimed_under_both_kinds(kind):
    assert 0.8 < mean_square(kind) < 3.0


@pytest.mark.slow
def test_an_error_that_is_taken_for_smooth_is_claimed_too_small(monkeypatch):
    monkeypatch.setattr(wander_evidence, "MARGIN", -1e9)
    assert mean_square(first_order_error) > 3.5

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
from fwav_companion.tracking.filters.wander_evidence import WanderEvidence, with_mean
from fwav_companion.types import BIAS_COUNT, Bias

WANDER = position_wander(1.0, (60.0,))
TIMES = np.arange(0.0, 60.0, 0.2)


def mount(times):
    """(n, 2, 1) displacement by one sigma of a bias that turns with the vehicle: 0.25 m, circles of 9.4 s."""
    turn = 2.0 * np.pi * times / 9.4
    return 0.25 * np.stack((np.cos(turn), np.sin(turn)), 1)[:, :, None]


def a_mean(position, rows, sigma_m=0.03):
    north, east = position
    return PointEstimate(north, east, (sigma_m**2, 0.0, sigma_m**2), tuple(map(tuple, np.asarray(rows).tolist())))


class Witness:
    """One target, and the evidence after its means."""

    def __init__(self, evidence=None):
        self.evidence, self.means = evidence or WanderEvidence(), ()

    def see(self, mean, at_s, interval_s=1.0):
        self.means = with_mean(self.means, mean, interval_s)
        densities = WANDER.quick_density, WANDER.smooth_density
        self.evidence = self.evidence.with_means(self.means, *densities, host_ns(at_s))


def shown(errors, off_sigmas, *, seconds=40):
    """A target after means of one second, 3 cm of noise each, under a mount off by this number of sigmas."""
    rng, target = np.random.default_rng(2), Witness()
    for k in range(seconds):
        window = slice(5 * k, 5 * k + 5)
        rows = mount(TIMES[window]).mean(0)
        target.see(a_mean(errors[window].mean(0) + off_sigmas * rows[:, 0] + rng.normal(0.0, 0.03, 2), rows), k + 1.0)
    return target


@pytest.mark.parametrize("off_sigmas", [0.0, 2.5])
def test_the_kind_of_wander_shows_within_40_seconds_of_circles(off_sigmas):
    for seed in range(6):
        rng = np.random.default_rng(seed)
        assert shown(smooth_error(rng, TIMES, 60.0), off_sigmas).evidence.score > 2.0
        assert shown(first_order_error(rng, TIMES, 60.0), off_sigmas).evidence.score < -2.0


def test_a_constant_bias_is_estimated_and_makes_no_wander():
    biases = shown(np.zeros((300, 2)), 2.0).evidence.smooth
    assert biases.mean == pytest.approx((2.0,), abs=0.3)
    assert biases.cov[0][0] < 0.15


def test_an_estimated_bias_returns_to_its_prior():
    known = shown(np.zeros((300, 2)), 2.0).evidence.smooth
    later = known.decayed((np.exp(-1.0),))
    assert later.mean[0] == pytest.approx(known.mean[0] / np.e)
    assert later.cov[0][0] == pytest.approx(1.0 - (1.0 - known.cov[0][0]) / np.e**2)


def test_before_any_fix_the_odds_are_five_to_three():
    assert WanderEvidence().smooth_share == pytest.approx(5 / 8, abs=0.005)


NOTHING = ((0.0,), (0.0,))


def test_a_gap_begins_new_differences_and_keeps_what_was_shown():
    target = shown(np.zeros((300, 2)), 0.0)
    known = target.evidence.score
    target.see(a_mean((9.0, 9.0), NOTHING), 61.0, interval_s=20.0)
    target.see(a_mean((9.0, 9.0), NOTHING), 62.0)
    assert target.evidence.score == known > 2.0


def test_a_receiver_that_begins_to_move_fast_is_believed():
    rng, target = np.random.default_rng(3), shown(np.zeros((300, 2)), 0.0)
    for k, position in enumerate(np.cumsum(rng.normal(0.0, 0.18, (20, 2)), 0)):
        target.see(a_mean(position, NOTHING), 41.0 + k)
    assert target.evidence.smooth_share < 0.1


def test_a_jump_is_no_wander():
    target = shown(np.zeros((300, 2)), 0.0)
    known = target.evidence.score
    for k in range(3):
        target.see(a_mean((3.0, 0.0), NOTHING), 41.0 + k)
    assert target.evidence.score >= known
    assert target.evidence.until_ns == host_ns(43.0)


def test_a_second_counts_once_for_all_targets():
    errors = first_order_error(np.random.default_rng(1), TIMES, 60.0)
    one, other = Witness(), Witness()
    for k in range(20):
        for witness, at_s in ((one, k + 1.0), (other, k + 1.4)):
            witness.see(a_mean(errors[round(5 * at_s)], NOTHING), at_s)
        other.evidence = one.evidence
        assert other.evidence.until_ns in (0, host_ns(k + 1.0))


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
    monkeypatch.setattr(wander_evidence.WanderEvidence, "smooth_share", 1.0)
    assert mean_square(first_order_error) > 3.5

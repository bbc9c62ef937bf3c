"""Place and wandering error as one Kalman filter in numpy, its transitions by the matrix exponential."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.linalg import block_diag, expm

from fwav_companion.tracking.filters.position_wander import first_place, position_wander
from fwav_companion.tracking.filters.schmidt_kalman import PointEstimate

WANDER = position_wander(1.5, (2.0 / 0.03, 2.0 / 0.2))
"""Two processes."""
BIASES = 3
SHOWS = np.array([1.0, 1.0, 0.0, 1.0, 0.0])
"""The apparent place: the place and the error of each process."""


def apparent(rng):
    root = rng.normal(0.0, 0.2, (2, 2))
    (nn, ne), (_, ee) = (root @ root.T + 0.01 * np.eye(2)).tolist()
    north, east = rng.normal(0.0, 1.0, 2).tolist()
    return PointEstimate(north, east, (nn, ne, ee), tuple(map(tuple, rng.normal(0.0, 0.3, (2, BIASES)).tolist())))


def updated(state, seen, dt):
    return state.update(seen, WANDER, dt, seen)


def mean(table):
    return np.array(table)[:, 0]


def shared(state):
    return np.array([state.north, state.east])[:, :, 1:]


def transition(dt):
    """Of place, then error and rate of each process: critically damped."""
    return block_diag(1.0, *(expm(dt * np.array([[0.0, 1.0], [-(w * w), -2.0 * w]])) for w in WANDER.rates))


STEADY = np.diag([0.0, *(v for w in WANDER.rates for v in (1.5**2 / 2, 1.5**2 / 2 * w * w))])


def test_it_is_the_kalman_filter_of_place_and_two_processes():
    rng = np.random.default_rng(7)
    first = apparent(rng)
    state = first_place(first, WANDER)
    north, east = np.zeros(5), np.zeros(5)
    north[0], east[0] = first.north_m, first.east_m
    cov = STEADY.copy()
    cov[0] = cov[:, 0] = -STEADY @ [0.0, 1.0, 0.0, 1.0, 0.0]  # the place is the apparent place minus the errors
    cov[0, 0] = 1.5**2 + 0.5 * (first.noise[0] + first.noise[2])
    rows = [np.vstack([axis, np.zeros((4, BIASES))]) for axis in first.shared]
    for dt in [1.0, 2.5, 1.0, 40.0, 7.0]:
        move, seen = transition(dt), apparent(rng)
        cov = move @ (cov - STEADY) @ move.T + STEADY
        noise = 0.5 * (seen.cov[0] + seen.cov[2])
        gain = cov @ SHOWS / (SHOWS @ cov @ SHOWS + noise)
        north, east = move @ north, move @ east
        north, east = north + gain * (seen.north_m - SHOWS @ north), east + gain * (seen.east_m - SHOWS @ east)
        rows = [move @ each for each in rows]
        rows = [each + np.outer(gain, of - SHOWS @ each) for each, of in zip(rows, np.array(seen.shared), strict=True)]
        cov = cov - np.outer(gain, SHOWS @ cov)
        state = state.update(seen, WANDER, dt, seen)
        assert mean(state.north) == pytest.approx(north, abs=1e-12)
        assert mean(state.east) == pytest.approx(east, abs=1e-12)
        assert np.array(state.cov) == pytest.approx(cov, abs=1e-12)
        assert shared(state) == pytest.approx(np.array(rows), abs=1e-12)
        place = state.estimate
        assert (place.north_m, place.east_m) == (state.north[0][0], state.east[0][0])
        assert place.noise == pytest.approx((cov[0, 0], 0.0, cov[0, 0]))
        assert place.shared == (state.north[0][1:], state.east[0][1:])


def test_the_errors_move_on_by_their_rates():
    """The states of the errors predicted by the matrix exponential, less themselves, and the covariance of that."""
    rng, dt = np.random.default_rng(10), 8.0
    state = first_place(apparent(rng), WANDER)
    for _ in range(4):
        state = updated(state, apparent(rng), 1.0)
    move = transition(dt)
    north_m, east_m, variance = state.movement(WANDER, dt)
    change = (SHOWS @ (move - np.eye(5)))[None]
    process = STEADY - move @ STEADY @ move.T
    assert north_m == pytest.approx((change @ mean(state.north)).item())
    assert east_m == pytest.approx((change @ mean(state.east)).item())
    assert variance == pytest.approx((change @ np.array(state.cov) @ change.T).item() + SHOWS @ process @ SHOWS)


def test_a_jump_frees_the_error_of_the_first_process_alone():
    state = first_place(apparent(np.random.default_rng(8)), WANDER)
    more = np.subtract(state.with_jump(0.7).cov, state.cov)
    assert more[1, 1] == pytest.approx(0.7)
    assert np.count_nonzero(more) == 1


def test_a_fresh_error_keeps_the_place_and_forgets_the_rest():
    rng = np.random.default_rng(9)
    state = updated(first_place(apparent(rng), WANDER), apparent(rng), 5.0)
    other = position_wander(0.02, (2.0 / 0.1,))
    fresh = state.with_fresh_error(other)
    assert tuple(mean(fresh.north)) == (state.north[0][0], 0.0, 0.0)
    assert tuple(mean(fresh.east)) == (state.east[0][0], 0.0, 0.0)
    assert np.array(fresh.cov) == pytest.approx(np.diag([state.cov[0][0], 0.02**2, 0.02**2 * 0.1**2]))
    assert (shared(fresh)[:, 0] == shared(state)[:, 0]).all()
    assert not shared(fresh)[:, 1:].any()


def test_the_apparent_place_moves_as_the_processes_do_and_at_least_as_a_smooth_error_looks():
    """The mean square movement is 2 (variance - autocovariance); the autocovariance by the matrix exponential."""
    for dt in (0.5, 3.0, 20.0, 300.0):
        each = 1.5**2 / 2
        moved = sum(
            2.0 * each * (1.0 - expm(dt * np.array([[0.0, 1.0], [-(w * w), -2.0 * w]]))[0, 0]) for w in WANDER.rates
        )
        assert WANDER.apparent_noise(dt, 0.0, 1.0) == pytest.approx(moved)
        rate = np.sqrt(np.mean(np.square(WANDER.rates))) * 1.5
        assert WANDER.apparent_noise(dt, 0.04, 1.0) == pytest.approx(max(moved, rate * 0.2 * dt))
        first_order = sum(2.0 * each * (1.0 - np.exp(-0.5 * w * dt)) for w in WANDER.rates)
        assert WANDER.apparent_noise(dt, 0.04, 0.0) == pytest.approx(first_order)
        mixed = 0.25 * max(moved, rate * 0.2 * dt) + 0.75 * first_order
        assert WANDER.apparent_noise(dt, 0.04, 0.25) == pytest.approx(mixed)
    assert position_wander(0.0, (2.0 / 0.1,)).apparent_noise(5.0, 1.0, 1.0) == 0.0


def test_the_integral_time_is_that_of_a_first_order_process():
    wander = position_wander(2.0, (60.0, 30.0, 0.0, float("inf")))
    assert wander.sigma_m == 2.0
    for rate, time_s in zip(wander.rates[:2], (60.0, 30.0), strict=True):
        integral, _ = quad(lambda t, w=rate: (1.0 + w * t) * np.exp(-w * t), 0.0, np.inf)
        assert integral == pytest.approx(time_s)
    assert wander.rates[2:] == (0.0, 0.0), "without a time constant, or with an infinite one, the error is constant"
    assert wander.variance_each == pytest.approx(1.0)

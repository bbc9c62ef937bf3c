"""Where a target out of view is, relative to a vehicle whose position wanders smoothly."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from simulated_flight import priors
from wandering_positions import smooth_error

from fwav_companion.tracking.filters import standing
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias

TIMES = np.arange(0.0, 55.0, 0.2)
SEEN = TIMES < 45.0
JACOBIAN = np.zeros((3, BIAS_COUNT))
JACOBIAN[0, Bias.POSITION_NORTH] = JACOBIAN[1, Bias.POSITION_EAST] = 1.0


FLIGHTS = 30
NOISE_M = 0.1


def flown():
    """The error at the end, metres, and the noisy errors of each second in view, for each flight."""
    for seed in range(FLIGHTS):
        rng = np.random.default_rng(seed)
        wander = smooth_error(rng, TIMES, 60.0)
        yield wander[-1], wander[SEEN] + rng.normal(0.0, NOISE_M, (SEEN.sum(), 2))


def filtered():
    """Errors relative to the vehicle after 10 s out of view and their normalised squares: root mean square, mean."""
    nothing = dict.fromkeys(("heading", "mount_x", "mount_y", "mount_z", "time_offset"), 0.0)
    p = priors(**nothing, position_north=1.0, position_east=1.0)
    errors, squares = [], []
    for last, seen in flown():
        state = None
        for t, place in zip(TIMES[SEEN], seen, strict=True):
            fix = a_fix(t, (*place, 0.0), np.diag([NOISE_M**2, NOISE_M**2, 0.0]), JACOBIAN, p.bias_sigmas)
            state = StaticKalman(p).initiate(fix) if state is None else state.predict(host_ns(t)).update(fix)
        state = state.predict(host_ns(TIMES[-1]))
        away = np.array(state.apparent_ned[:2]) - last
        errors.append(np.hypot(*away))
        squares.append(away @ np.linalg.solve(np.array(state.relative_cov)[:2, :2], away))
    return np.sqrt(np.mean(np.square(errors))), np.mean(squares)


def best():
    """The same of Gaussian process regression by the true correlation, with a place that is not known."""
    apart = (2.0 / 60.0) * np.abs(TIMES[:, None] - TIMES)
    cov = (1.0 + apart) * np.exp(-apart) + 1e4
    gain = np.linalg.solve(cov[np.ix_(SEEN, SEEN)] + NOISE_M**2 * np.eye(SEEN.sum()), cov[SEEN, -1])
    variance = cov[-1, -1] - gain @ cov[SEEN, -1]
    squares = [np.sum((gain @ seen - last) ** 2) for last, seen in flown()]
    return np.sqrt(np.mean(squares)), np.mean(squares) / variance


@pytest.mark.slow
def test_the_rate_of_the_error_foretells_it(monkeypatch):
    error_m, square = filtered()
    best_m, best_square = best()
    assert error_m < 1.08 * best_m
    assert square < 1.3 * best_square
    monkeypatch.setattr(standing, "SHOWN_SMOOTH", 1.0)
    assert filtered()[0] > 1.15 * best_m, "without the rate"

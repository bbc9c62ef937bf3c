"""Claims of fused positions where the time constant of the receiver's wander is not known: 30 s to 30 min."""

import numpy as np
import pytest
from handmade import a_fix, host_ns
from scipy.stats import chi2
from simulated_flight import priors
from wandering_positions import smooth_error

from fwav_companion.config.estimation import UncertaintyConfig
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.types import BIAS_COUNT, Bias

FLIGHTS = 300
JACOBIAN = np.zeros((3, BIAS_COUNT))
JACOBIAN[0, Bias.POSITION_NORTH] = JACOBIAN[1, Bias.POSITION_EAST] = 1.0
PASSES = np.concatenate([start + np.arange(20.0) for start in (0.0, 220.0, 440.0)])
SCHEDULES = {
    "photographs": (np.arange(11) * 30.0, 1.0),
    "passes": (PASSES, 0.3),
    "two minutes": (np.arange(120.0), 0.2),
    "ten minutes": (np.arange(0.0, 600.0, 10.0), 0.2),
}


def unknown():
    """The priors of the configuration's defaults, with the position's bias alone."""
    given = UncertaintyConfig().priors(readout_known=True, surveyed=False)
    names = ("heading", "mount_x", "mount_y", "mount_z", "time_offset")
    only = priors(**dict.fromkeys(names, 0.0), position_north=1.0, position_east=1.0)
    times = {"position_bias_time_s": given.position_bias_time_s, "position_wander_times_s": given.position_times_s}
    return type(only)(**{name: getattr(only, name) for name in only.__struct_fields__} | times)


def share_inside(schedule, *, seed=5):
    """Share of 300 flights, each with its own time constant, whose target lies in the claimed 90 % ellipse."""
    rng, p, inside = np.random.default_rng(seed), unknown(), 0
    times, noise_m = SCHEDULES[schedule]
    for _ in range(FLIGHTS):
        errors = smooth_error(rng, times, np.exp(rng.uniform(np.log(30.0), np.log(1800.0))))
        state = None
        for t, (north, east) in zip(times, errors + rng.normal(0.0, noise_m, errors.shape), strict=True):
            fix = a_fix(t, (north, east, 0.0), np.diag([noise_m**2, noise_m**2, 0.0]), JACOBIAN, p.bias_sigmas)
            state = StaticKalman(p).initiate(fix) if state is None else state.predict(host_ns(t)).update(fix)
        error = np.array(state.position_ned[:2])
        inside += error @ np.linalg.solve(np.array(state.cov)[:2, :2], error) < chi2.ppf(0.9, 2)
    return inside / FLIGHTS


def test_photographs_over_minutes_claim_what_they_show():
    assert 0.85 <= share_inside("photographs") <= 0.95


@pytest.mark.slow
@pytest.mark.parametrize("schedule", [name for name in SCHEDULES if name != "photographs"])
def test_claims_hold_for_receivers_of_any_time_constant(schedule):
    assert 0.85 <= share_inside(schedule) <= 0.95

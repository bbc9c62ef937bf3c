"""Wandering errors within their prior are distinguished from noise, and no claim ignores them."""

import numpy as np
import pytest
from draws import first_of
from scipy.signal import lfilter
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.innovation_consistency import (
    BLOCKS,
    EXCESS,
    EXPECTED,
    SHORTEST_NS,
    InnovationConsistency,
    drift_of,
)
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

STEP_NS = 100_000_000
STEP_S = 0.1
BLOCK = SHORTEST_NS // STEP_NS
NOISE = np.array([[9.0, 3.0], [3.0, 5.0]])
"""Covariance of a pixel, px^2: neither round nor axis-aligned."""
ROOT = np.linalg.cholesky(NOISE)
USED = np.ones(1, bool)


def whitened(difference):
    return np.linalg.solve(ROOT, difference)


def drifted(differences, first_ns=0):
    drift = InnovationConsistency()
    for k, difference in enumerate(differences):
        drift = drift.seen(first_ns + k * STEP_NS, whitened(difference), USED)
    return drift


def gauss_markov(rng, count, time_s):
    """A Gauss-Markov process with variance one."""
    keep = np.exp(-STEP_S / time_s)
    steps = rng.standard_normal(count) * np.sqrt(1.0 - keep**2)
    steps[0] /= np.sqrt(1.0 - keep**2)
    return lfilter([1.0], [1.0, -keep], steps)


def test_noise_does_not_drift():
    rng = np.random.default_rng(1)
    drift = drifted(rng.standard_normal((8000, 2)) @ ROOT.T)
    for scale, closed in enumerate(drift.closed):
        assert closed[BLOCKS] == pytest.approx(8000 // (BLOCK << scale), abs=1)  # each block of noise counts in full
        assert abs(closed[EXCESS]) < 4.0 * np.sqrt(closed[BLOCKS])  # half a chi square of two has the variance 1
    assert 1.0 <= drift.factor < 1.5


def test_a_few_seconds_of_noise_show_no_more_drift_than_noise():
    """The largest of several factors, of a few blocks each, is above one by chance."""
    rng = np.random.default_rng(3)
    found = [drifted(rng.standard_normal((105, 2)) @ ROOT.T) for _ in range(40)]
    assert np.mean([each.factor for each in found]) > 1.12
    assert np.mean([each.shown for each in found]) < 1.1


def test_a_wandering_error_has_its_variance_at_every_block_length():
    """The variance of a sum of white noise and a Gauss-Markov process, term by term."""
    rng, time_s, share = np.random.default_rng(2), 3.0, 0.8
    leaning = gauss_markov(rng, 30_000, time_s)[:, None] * np.array([share, 0.0])
    drift = drifted((rng.standard_normal((30_000, 2)) + leaning) @ ROOT.T)
    for scale, closed in enumerate(drift.closed):
        n = BLOCK << scale
        lags = np.abs(np.subtract.outer(range(n), range(n))) * STEP_S
        more = 0.5 * share**2 * np.exp(-lags / time_s).sum() / n  # along one of two axes
        blocks = 30_000 / n
        assert closed[EXCESS] / closed[BLOCKS] == pytest.approx(more, abs=4.5 * (1.0 + more) / np.sqrt(blocks))
    assert drift.factor == pytest.approx(1.0 + more, rel=0.35)


def test_an_autopilot_that_errs_is_expected_to_drift_until_noise_is_seen():
    erring = drift_of(priors(roll=0.01, pitch=0.01))
    assert (erring.factor, erring.shown, drift_of(priors()).factor) == (EXPECTED, 1.0, 1.0)
    rng = np.random.default_rng(4)
    for k in range(3000):
        erring = erring.seen(k * STEP_NS, whitened(ROOT @ rng.standard_normal(2)), USED)
    assert 1.0 <= erring.factor < 0.35 * EXPECTED


def test_another_base_of_the_clock_changes_nothing():
    differences = np.random.default_rng(6).standard_normal((100, 2))
    assert np.array_equal(drifted(differences, first_ns=-3_000_000_001).closed, drifted(differences).closed)


def test_silence_and_late_measurements_break_nothing():
    drift = drifted([(1.0, 1.0)] * 20)
    after = drift.seen(20 * STEP_NS + 3_600_000_000_000, whitened((1.0, 1.0)), USED)
    late = after.seen(0, whitened((1.0, 1.0)), USED)
    assert np.isfinite(late.closed).all()
    assert late.blocks[0, 0] == 2
    assert np.array_equal(late.closed, after.closed)


@pytest.mark.parametrize("seed", first_of(6, 1))
def test_a_heading_that_wanders_within_its_prior_takes_no_claim_along(seed):
    """Its errors are as small as the prior says, and no constant explains them."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET] = 0.035
    biases[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = np.radians([0.5, 1.0, 2.0])
    flight = Flight(seed=seed, fps=15, biases=biases, heading_wander=np.radians(2.0))
    world, best = World(flight), None
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        for track in tracker.on_frame(view):
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    error = np.subtract(best.position_ned[:2], flight.targets[0])
    assert error @ np.linalg.solve(np.array(best.cov)[:2, :2], error) < 13.8

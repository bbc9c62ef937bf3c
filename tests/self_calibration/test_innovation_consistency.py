"""Wandering errors within their prior are distinguished from noise, and no claim ignores them."""

import numpy as np
import pytest
from scipy.signal import lfilter
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.self_calibration.innovation_consistency import (
    EXCESS,
    EXPECTED,
    SHORTEST_NS,
    WEIGHT,
    InnovationConsistency,
    drift_of,
    wandered,
)
from fwav_companion.self_calibration.joint_filter import CONSIDERED, PixelInnovations
from fwav_companion.self_calibration.pixel_measurement import ROW_COUNT
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

STEP_NS = 100_000_000
STEP_S = 0.1
BLOCK = SHORTEST_NS // STEP_NS
NOISE = np.array([[9.0, 3.0], [3.0, 5.0]])
"""Covariance of a pixel, px^2: neither round nor axis-aligned."""
ROOT = np.linalg.cholesky(NOISE)
USED = np.ones((1, 1), bool)


def an_innovation(difference, cov=NOISE, by_position=((0.0, 0.0), (0.0, 0.0))):
    """``by_position``: derivatives of u and v, pixels per metre north and east."""
    rows, one = np.zeros((1, 2, ROW_COUNT)), np.zeros((1, 1))
    rows[0, :, CONSIDERED] = by_position
    return PixelInnovations(
        difference=np.array([difference]), rows=rows, crossed=rows, cov=np.array([cov]), noise=NOISE[None, None],
        nis=one, log_det=one, score_variance=one, valid=USED,
    )  # fmt: skip


def drifted(differences, reported=None, first_ns=0, **more):
    reported, drift = reported or priors(), InnovationConsistency()
    for k, difference in enumerate(differences):
        drift = drift.seen(
            first_ns + k * STEP_NS,
            an_innovation(difference, **{name: each[k] for name, each in more.items()}),
            USED,
            reported,
        )
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
        assert closed[WEIGHT] == pytest.approx(8000 // (BLOCK << scale), abs=1)  # each block of noise counts in full
        assert abs(closed[EXCESS]) < 4.0 * np.sqrt(closed[WEIGHT])  # half a chi square of two has the variance 1
    assert 1.0 <= drift.factor < 1.5


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
        assert closed[EXCESS] / closed[WEIGHT] == pytest.approx(more, abs=4.5 * (1.0 + more) / np.sqrt(blocks))
    assert drift.factor == pytest.approx(1.0 + more, rel=0.35)


@pytest.mark.parametrize("turning", [0.0, 0.3, np.pi / 4, np.pi / 2])
def test_what_the_vehicles_position_explains_is_no_drift(turning):
    """It wanders by metres, and the target was located by its mean; the image rotates, and over whole turns the mean
    vanishes.
    """
    rng, seconds = np.random.default_rng(3), 60.0
    reported = priors(position_north=1.0, position_east=1.0, position_bias_time_s=60.0)
    unaware, aware = [], []
    for _ in range(12):
        count = int(seconds / STEP_S)
        walk = np.stack([gauss_markov(rng, count, 60.0) for _ in range(2)], -1)
        off = walk - np.cumsum(walk, 0) / np.arange(1, count + 1)[:, None]
        turn = turning * STEP_S * np.arange(count)
        by_position = 8.0 * np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]).transpose(2, 0, 1)
        share = np.array([wandered(k * STEP_S, 60.0) for k in range(count)])
        cov = NOISE + share[:, None, None] * by_position @ by_position.transpose(0, 2, 1)
        seen = np.einsum("kij,kj->ki", by_position, off) + rng.standard_normal((count, 2)) @ ROOT.T
        aware.append(drifted(seen, reported, by_position=by_position, cov=cov).factor)
        unaware.append(drifted(seen).factor)
    assert np.mean(aware) < 1.3
    assert min(unaware) > 3.0


def test_what_wanders_about_its_mean_is_the_double_integral():
    for x in (0.1, 1.0, 5.0):
        t = (np.arange(400) + 0.5) / 400 * x
        expected = 1.0 - 2.0 * np.exp(-t).mean() + np.exp(-np.abs(np.subtract.outer(t, t))).mean()
        assert wandered(60.0 * x, 60.0) == pytest.approx(expected, rel=1e-3)
    assert wandered(0.01, 60.0) == pytest.approx(2.0 / 3.0 * 0.01 / 60.0, rel=1e-3)
    assert wandered(10.0, 0.0) == 0.0


def test_an_autopilot_that_errs_is_expected_to_drift_until_noise_is_seen():
    erring = drift_of(priors(roll=0.01, pitch=0.01))
    assert (erring.factor, erring.shown, drift_of(priors()).factor) == (EXPECTED, 1.0, 1.0)
    rng = np.random.default_rng(4)
    for k in range(3000):
        erring = erring.seen(k * STEP_NS, an_innovation(ROOT @ rng.standard_normal(2)), USED, priors())
    assert 1.0 <= erring.factor < 0.35 * EXPECTED


def test_where_the_vehicles_position_hides_all_else_little_is_expected_to_drift():
    """The estimate is uncertain by the position then, and its claim contains that."""
    reported, erring = priors(position_north=1.0, position_east=1.0), drift_of(priors(roll=0.01, pitch=0.01))
    for k in range(600):
        cov = NOISE + 64.0 * wandered(k * STEP_S, reported.position_bias_time_s) * np.eye(2)
        erring = erring.seen(k * STEP_NS, an_innovation((0.0, 0.0), cov, 8.0 * np.eye(2)), USED, reported)
    assert 1.0 < erring.factor < 2.0


def test_another_base_of_the_clock_changes_nothing():
    differences = np.random.default_rng(6).standard_normal((100, 2))
    assert np.array_equal(drifted(differences, first_ns=-3_000_000_001).closed, drifted(differences).closed)


def test_silence_and_late_measurements_break_nothing():
    drift = drifted([(1.0, 1.0)] * 20)
    after = drift.seen(20 * STEP_NS + 3_600_000_000_000, an_innovation((1.0, 1.0)), USED, priors())
    late = after.seen(0, an_innovation((1.0, 1.0)), USED, priors())
    assert np.isfinite(late.closed).all()
    assert late.blocks[0, 0] == 2
    assert np.array_equal(late.closed, after.closed)


@pytest.mark.parametrize("seed", [1, 6])
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

"""[uncertainty] position_bias_m = "auto": a fix and a track claim what the receiver itself says."""

from math import inf
from types import SimpleNamespace

import numpy as np
import pytest
from draws import first_of
from flying import fly
from handmade import a_fix, host_ns
from msgspec.structs import replace
from simulated_flight import priors

from fwav_companion.recording.line_types import TargetLine
from fwav_companion.telemetry.position_bias import PositionBias
from fwav_companion.tracking.filters.kalman import StaticKalman
from fwav_companion.tracking.filters.moving import MovingKalman
from fwav_companion.types import BIAS_COUNT, Bias
from sitl_mock import scenario

ALL_WELL = {"flags": 0b1111111, "pos_horiz_variance": 0.1}


@pytest.mark.parametrize(
    ("fix_type", "h_acc_m", "sigma_m"),
    [
        (6, 0.014, 0.02),
        (6, 0.0, 0.02),
        (6, 0.3, 0.3),
        (5, 0.11, 0.3),
        (5, 0.7, 1.0),
        (4, 0.2, 1.0),
        (3, 0.5, 1.0),
        (3, 3.2, 5.0),
        (1, 0.0, 1.0),
        (3, 4_294_967.295, 1.0),
        (3, 4000.0, 50.0),
    ],
)
def test_the_sigma_by_fix_type_and_accuracy(fix_type, h_acc_m, sigma_m):
    bias = PositionBias()
    assert bias.sigma_m is None
    bias.on_gps(SimpleNamespace(fix_type=fix_type, h_acc=round(h_acc_m * 1000)))
    assert bias.sigma_m == sigma_m


@pytest.mark.parametrize(
    ("change", "sigma_m"),
    [
        ({}, 0.02),
        ({"pos_horiz_variance": 1.2}, 1.0),
        ({"pos_horiz_variance": float("nan")}, 1.0),
        ({"flags": 0b0001111}, 1.0),
        ({"flags": 0b1111111 | 32768}, 1.0),
        ({"flags": 0b11111111}, 1.0),
    ],
)
def test_an_ardupilot_that_does_not_use_its_receiver(change, sigma_m):
    bias = PositionBias()
    bias.on_gps(SimpleNamespace(fix_type=6, h_acc=14))
    bias.on_ardupilot_filter(SimpleNamespace(**ALL_WELL | change))
    assert bias.sigma_m == sigma_m


@pytest.mark.parametrize(
    ("accuracy_m", "ratio", "flags", "sigma_m"),
    [(0.4, 0.1, 0b111111, 0.02), (3.0, 0.1, 0b111111, 5.0), (0.4, 1.5, 0b111111, 1.0), (inf, 0.1, 1024 | 16, 1.0)],
)
def test_a_px4_that_does_not_use_its_receiver(accuracy_m, ratio, flags, sigma_m):
    bias = PositionBias()
    bias.on_gps(SimpleNamespace(fix_type=6, h_acc=14))
    bias.on_px4_filter(SimpleNamespace(flags=flags, pos_horiz_ratio=ratio, pos_horiz_accuracy=accuracy_m))
    assert bias.sigma_m == sigma_m


def flown(fix_type, settings=()):
    truth = {"autopilot.fix_type": fix_type, "autopilot.h_acc_m": 0.0, "biases.position_m": 0.02, "seconds": 10.0}
    lines = fly(scenario("unbiased").but({**truth, "seed": 3}), settings=settings).companion.lines
    return [line for line in lines if isinstance(line, TargetLine) and line.fix is not None]


def larger(cov):
    return np.sqrt(np.linalg.eigvalsh(np.array(cov)[:2, :2])[-1])


def test_a_flight_claims_what_its_receiver_says():
    usual, fixed = flown(3), flown(6)
    for key, find in {"fix": lambda line: line.fix.cov, "track": lambda line: line.cov}.items():
        before, after = np.array(find(usual[-1])), np.array(find(fixed[-1]))
        gain = np.trace((before - after)[:2, :2])
        assert gain == pytest.approx(2 * (1.0**2 - 0.02**2), rel=0.3 if key == "track" else 1e-6), key


def test_a_configured_sigma_counts_whatever_the_receiver_says():
    lines = flown(6, ["uncertainty.position_bias_m=1.0"])
    assert lines[-1].fix.cov == flown(3, ["uncertainty.position_bias_m=1.0"])[-1].fix.cov
    assert larger(lines[-1].fix.cov) > 1.0


PRIORS = priors(time_offset=0, heading=0, mount_x=0, mount_y=0, mount_z=0, position_north=1.0, position_east=1.0)


def fix_of(t, north, sigma_m, noise_m=0.1):
    jacobian = np.zeros((3, BIAS_COUNT))
    jacobian[0, Bias.POSITION_NORTH] = jacobian[1, Bias.POSITION_EAST] = sigma_m
    fix = a_fix(t, (north, 3.0, 0.0), np.diag([noise_m**2, noise_m**2, 0.0]), jacobian, PRIORS.bias_sigmas)
    state = replace(fix.sighting.state, position_bias_m=sigma_m)
    return replace(fix, sighting=replace(fix.sighting, state=state))


@pytest.mark.parametrize("draws", first_of(100, 200))
def test_claims_hold_where_a_receiver_finds_its_fixed_solution_in_flight(draws):
    """20 s with an error of 1 m, then 10 s of 0.02 m, by draws. Within seconds the track is right, and claims it."""
    rng, squares, errors, noise_m = np.random.default_rng(2), [], [], 0.1
    for _ in range(draws):
        state, coarse, fine = None, rng.normal(), rng.normal() * 0.02
        for t in np.arange(0.0, 30.0, 0.5):
            sigma_m, error = (1.0, coarse) if t < 20.0 else (0.02, fine)
            fix = fix_of(t, 4.0 + error + rng.normal() * noise_m, sigma_m, noise_m)
            state = StaticKalman(PRIORS).initiate(fix) if state is None else state.predict(host_ns(t)).update(fix)
        errors.append(state.position_ned[0] - 4.0)
        squares.append(errors[-1] ** 2 / state.cov[0][0])
    assert np.sqrt(np.mean(np.square(errors))) < 0.06
    assert 0.7 < np.mean(squares) < 1.4


def test_a_worse_receiver_is_not_taken_for_a_new_one():
    state = StaticKalman(PRIORS).initiate(fix_of(0.0, 4.0, 0.02))
    for t in np.arange(0.5, 20.0, 0.5):
        state = state.predict(host_ns(t)).update(fix_of(t, 4.0, 0.02))
    known_m2 = state.cov[0][0]
    for t in np.arange(20.0, 25.0, 0.5):
        state = state.predict(host_ns(t)).update(fix_of(t, 4.5, 1.0))
    assert state.cov[0][0] < 1.5 * known_m2
    assert state.position_ned[0] == pytest.approx(4.0, abs=0.2)


def test_a_moving_target_claims_the_receivers_error_too():
    first, second = (MovingKalman(PRIORS).initiate(fix_of(0.0, 4.0, sigma_m)) for sigma_m in (1.0, 0.3))
    assert first.cov[0][0] - second.cov[0][0] == pytest.approx(1.0 - 0.09, rel=0.01)

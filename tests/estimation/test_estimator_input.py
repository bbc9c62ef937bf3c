"""The estimator on bad input: an answer that claims little, or a named reason."""

import numpy as np
import pytest
from estimated_flights import Planted, flown, standardised
from simulated_flight import Flight

from fwav_companion.estimation.errors import (
    SampleNoise,
    priors,
)
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.kept_sightings import frame_of

TURNS = Flight(seconds=20.0, fps=13.0, shape="turns", height_m=10.0, pitch_deg=0.0, targets=((1.0, 2.0), (-1.5, 1.0)),
               velocities=((0.0, 0.0),) * 2, labels=("", ""))  # fmt: skip


def bare():
    estimator = Estimator(priors(), SampleNoise())
    planted = Planted(TURNS)
    attitudes, positions = planted.telemetry()
    return planted, estimator, attitudes, positions


def fed(estimator, attitudes, positions):
    for sample in attitudes:
        estimator.add_attitude(*sample)
    for sample in positions:
        estimator.add_position(*sample)


def claims_are_sane(estimator, target, t):
    answer = estimator.answer(target, t)
    assert answer is not None
    assert np.isfinite(answer.relative).all()
    eigenvalues = np.linalg.eigvalsh(answer.relative_covariance)
    assert eigenvalues.min() > 0.0
    return answer


def test_samples_that_are_not_finite_are_left_out():
    planted, estimator, attitudes, positions = bare()
    nan = np.full(4, np.nan)
    assert not estimator.add_attitude(0.0, nan)
    assert not estimator.add_position(0.0, nan[:3], nan[:3])
    fed(estimator, attitudes, positions)
    frames = planted.frames()[:30]
    for _, s in frames:
        bad = frame_of(int(s.frame[0]), s.t, s.rays * np.nan, s.tangents)
        assert not len(bad)
        estimator.update(s)
    estimator.solve(frames[-1][0])
    claims_are_sane(estimator, 0, frames[-1][0])


def test_answer_of_one_sighting_is_claimed_no_better_than_its_priors():
    planted, estimator, attitudes, positions = bare()
    fed(estimator, attitudes, positions)
    stamp, s = planted.frames()[20]
    estimator.update(s)
    estimator.solve(stamp)
    answer = claims_are_sane(estimator, int(s.target[0]), stamp)
    assert np.sqrt(answer.relative_covariance[0, 0]) > 0.1


def test_a_thousand_sightings_of_one_frame_are_bounded():
    _, estimator, attitudes, positions = bare()
    fed(estimator, attitudes, positions)
    uv = np.random.default_rng(1).uniform([0, 0], [639, 479], (1000, 2))
    rays, tangents = standardised(uv, 4.0)
    s = frame_of(3, np.full(1000, 5.0), rays, tangents)
    assert len(s) <= 100
    estimator.update(s.with_targets(np.arange(len(s)) % 30))
    estimator.solve(5.0)
    assert len(estimator.live.targets) <= 24


def test_a_vehicle_that_never_moves_waits_with_a_reason():
    flight = Flight(seconds=6.0, fps=5.0, shape="hover", flapping_deg=0.0, pitch_deg=0.0, targets=((0.5, 0.5),))
    estimator = flown(Planted(flight), priors())
    claims_are_sane(estimator, 0, 5.0)
    assert all(s.status == "waiting" and s.reason for s in estimator.self_calibration()[1:4])


@pytest.mark.parametrize("factor", [0.0, 100.0])
def test_priors_of_zero_and_of_a_hundred_times_give_a_finite_claim(factor):
    prior = priors(camera_delay_s=0.05 * factor, mount_rad=0.0175 * factor, heading_rad=0.035 * factor,
                   tilt_rad=0.0087 * factor, height_m=0.5 * factor)  # fmt: skip
    planted = Planted(Flight(seconds=4.0, fps=5.0, shape="turns", pitch_deg=0.0, targets=((1.0, 2.0),)))
    claims_are_sane(flown(planted, prior), 0, 3.8)


def test_telemetry_at_one_hertz_gives_a_finite_claim():
    flight = Flight(seconds=20.0, fps=4.0, shape="turns", flapping_deg=0.0, pitch_deg=0.0, attitude_hz=1.0,
                    targets=((1.0, 2.0),))  # fmt: skip
    claims_are_sane(flown(Planted(flight, position_hz=1.0), priors()), 0, 19.0)


@pytest.mark.parametrize("pitch_deg", [0.0, 80.0])
def test_targets_below_and_near_the_horizon_give_a_finite_claim(pitch_deg):
    where = ((0.0, 0.0),) if pitch_deg == 0 else ((70.0, 0.0),)
    flight = Flight(seconds=4.0, fps=5.0, shape="hover", pitch_deg=pitch_deg, targets=where)
    claims_are_sane(flown(Planted(flight), priors()), 0, 3.8)


@pytest.mark.parametrize("consider", [False, True])
def test_all_sightings_at_one_instant_give_a_claim_no_better_than_one_frames_shared_noise(consider):
    planted, _, attitudes, positions = bare()
    estimator = Estimator(priors(), SampleNoise(), consider=consider)
    fed(estimator, attitudes, positions)
    stamp, s = planted.frames()[20]
    for k in range(30):
        again = frame_of(100 + k, np.full(len(s), stamp), s.rays, s.tangents)
        estimator.update(again.with_targets(s.target))
    estimator.solve(stamp)
    answer = claims_are_sane(estimator, int(s.target[0]), stamp)
    assert np.sqrt(answer.relative_covariance[0, 0]) > 0.1  # mount, heading and height stay unknown
    assert all(status.sigma > 0.0 for status in estimator.self_calibration())


@pytest.mark.parametrize("consider", [False, True])
def test_rays_that_point_up_or_backwards_give_no_claim_that_is_better_than_nothing(consider):
    planted, _, attitudes, positions = bare()
    estimator = Estimator(priors(), SampleNoise(), consider=consider)
    fed(estimator, attitudes, positions)
    frames = planted.frames()[:20]
    for number, (stamp, s) in enumerate(frames):
        behind = frame_of(number, np.full(len(s), stamp), -s.rays, -s.tangents)
        estimator.update(behind.with_targets(s.target))
    estimator.solve(frames[-1][0])
    for target in np.unique(frames[0][1].target).tolist():
        answer = claims_are_sane(estimator, target, frames[-1][0])
        assert np.sqrt(np.linalg.eigvalsh(answer.covariance[:2, :2]).max()) > 0.5
    statuses = estimator.self_calibration()
    assert all(s.status == "waiting" and s.reason for s in statuses[1:4])


def test_sightings_without_a_target_or_a_vehicle_call_for_no_solve():
    planted, _, attitudes, positions = bare()
    estimator = Estimator(priors(), SampleNoise())
    stamp, s = planted.frames()[20]
    estimator.update(s)
    assert not estimator.is_solve_due(stamp)  # no telemetry
    assert estimator.answer(0, stamp) is None
    other = Estimator(priors(), SampleNoise())
    fed(other, attitudes, positions)
    other.update(s.with_targets(np.full(len(s), -1, np.int64)))
    assert not other.is_solve_due(stamp)
    assert other.final_places() == {}

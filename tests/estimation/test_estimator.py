"""The estimator on simulated flights: planted errors within the claims, invariances."""

import numpy as np
import pytest
from estimated_flights import Planted, flown
from simulated_flight import Flight, path

from fwav_companion.estimation.errors import (
    CAMERA_DELAY,
    HEIGHT,
    MOUNT,
    POSITION_DELAY,
    priors,
    with_stored,
)
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.ground import TargetPrior
from fwav_companion.estimation.kept_sightings import frame_of

LATE_AND_CROOKED = np.array([0.035, 0.02, -0.01, 0.015, 0.03, 0, 0, 0.3, 0, 0, 0, 0, 0])
TURNS = Flight(seconds=20.0, fps=13.0, shape="turns", height_m=10.0, pitch_deg=0.0, targets=((1.0, 2.0), (-1.5, 1.0)),
               velocities=((0.0, 0.0),) * 2, labels=("", ""))  # fmt: skip


def relative_error(planted, estimator, target, t):
    """True minus estimated relative place (2,), and the claim's covariance (2, 2)."""
    answer = estimator.answer(target, t)
    camera = path(planted.flight, np.array([t]))[0][0]
    return np.array(planted.flight.targets[target]) - camera[:2] - answer.relative[:2], answer.relative_covariance[
        :2, :2
    ]


@pytest.fixture(scope="module")
def calibrated():
    planted = Planted(TURNS, LATE_AND_CROOKED)
    return planted, flown(planted, priors())


def test_delay_of_a_late_camera_is_found_within_its_claim(calibrated):
    _, estimator = calibrated
    delay = estimator.self_calibration()[CAMERA_DELAY]
    assert delay.status == "calibrated"
    assert delay.sigma < 0.005
    assert abs(delay.estimate - LATE_AND_CROOKED[CAMERA_DELAY]) < 4 * delay.sigma


def test_every_planted_error_is_within_four_sigmas(calibrated):
    _, estimator = calibrated
    statuses = estimator.self_calibration()
    off = [(s.estimate - true) / s.sigma for s, true in zip(statuses, LATE_AND_CROOKED, strict=True)]
    assert np.abs(off).max() < 4.0
    assert all(s.sigma <= s.prior_sigma * 1.0001 for s in statuses)


def test_relative_place_is_within_its_claim(calibrated):
    planted, estimator = calibrated
    for target in (0, 1):
        error, covariance = relative_error(planted, estimator, target, 19.9)
        assert np.hypot(*error) < 0.15
        assert error @ np.linalg.solve(covariance, error) < 18.0


def test_estimate_does_not_depend_on_the_epoch(calibrated):
    planted, estimator = calibrated
    moved = Estimator(priors(), estimator.model.noise)
    attitudes, positions = planted.telemetry()
    later = 4096.0  # a power of two: stamps keep their last bits but twelve
    events = [(t + 0.05, 0, (t + later, q)) for t, q in attitudes]
    events += [(t + 0.05, 1, (t + later, p, v)) for t, p, v in positions]
    events += [(t + 0.25, 2, s) for t, s in planted.frames()]
    for _, kind, value in sorted(events, key=lambda event: event[:2]):
        if kind == 2:
            s = frame_of(int(value.frame[0]), value.t + later, value.rays, value.tangents).with_targets(value.target)
            moved.update(s)
            if moved.is_solve_due(float(s.t[0])):
                moved.solve(float(s.t[0]))
        else:
            (moved.add_attitude, moved.add_position)[kind](*value)
    a, b = estimator.answer(0, 19.9), moved.answer(0, 19.9 + later)
    assert b.relative == pytest.approx(a.relative, abs=0.05 * np.sqrt(a.relative_covariance[0, 0]) + 1e-4)


def test_estimate_does_not_depend_on_names_and_order_of_detections(calibrated):
    planted, estimator = calibrated

    class Renamed(Planted):
        def frames(self, pixel_px=None):
            return [
                (t, s.select(np.arange(len(s))[::-1]).with_targets(7 - s.target[::-1])) for t, s in super().frames()
            ]

    renamed = flown(Renamed(planted.flight, planted.errors), priors())
    a, b = estimator.answer(0, 19.9), renamed.answer(7, 19.9)
    assert b.relative == pytest.approx(a.relative, abs=1e-4)
    assert b.relative_covariance == pytest.approx(a.relative_covariance, rel=1e-3, abs=1e-9)


def test_target_that_the_live_filter_does_not_hold_has_no_pair(calibrated):
    planted, estimator = calibrated
    _, frame = planted.frames()[-1]
    alike = np.ones((len(frame), 3), np.bool_)
    found = estimator.copy().predict(frame, np.array([0, 99, 1]), alike)
    assert set(found.target.tolist()) == {0, 1}


def test_replay_gives_the_same_bytes(calibrated):
    planted, estimator = calibrated
    again = flown(planted, priors())
    assert again.live.mean.tobytes() == estimator.live.mean.tobytes()
    assert again.live.covariance.tobytes() == estimator.live.covariance.tobytes()


def test_a_solve_taken_over_later_is_as_good(calibrated):
    planted, _ = calibrated
    estimator = flown(planted, priors(), take_over_s=0.4)
    for target in (0, 1):
        error, covariance = relative_error(planted, estimator, target, 19.9)
        assert error @ np.linalg.solve(covariance, error) < 18.0


def test_frames_between_start_and_take_over_are_replayed(calibrated):
    planted, _ = calibrated
    times = []

    def observe(estimator, stamp):
        if estimator.live is not None:
            times.append(stamp - estimator.live.t)

    flown(planted, priors(), take_over_s=0.4, observe=observe)
    assert np.abs(times).max() < 1e-9


def test_frames_between_solves_do_not_move_the_shared_parameters(calibrated):
    planted, _ = calibrated
    moved = []

    def observe(estimator, stamp):
        if estimator.live is not None:
            solved = estimator.estimate
            moved.append(np.abs(estimator.live.mean[:13] - solved.mean[:13]).max())

    flown(planted, priors(), observe=observe)
    assert len(moved) > 100
    assert max(moved) == 0.0


@pytest.mark.slow
def test_height_near_the_ground_is_not_drawn_upward_by_noise_of_the_velocities():
    """A derivative that contains the path's noise counts as information on the height: without the considered shared
    parameters the mean square is 12, without the means about the lines between knots 3.6.
    """
    squares = []

    def observe(estimator, stamp):
        if stamp > 30.0 and estimator.live is not None:
            squares.append(estimator.live.mean[HEIGHT] ** 2 / estimator.live.covariance[HEIGHT, HEIGHT])

    for seed in (1, 2):
        flight = Flight(seconds=56.0, fps=8.0, shape="descent", height_m=15.0, pitch_deg=0.0, flapping_deg=0.0,
                        targets=((0.3, 0.2),), seed=seed)  # fmt: skip
        planted = Planted(flight, wander_m=1.0, position_noise_m=0.1, height_noise_m=0.3, velocity_noise_m_s=0.05)
        flown(planted, priors(position_delay_s=0.05), observe=observe, take_over_s=0.5)
    assert np.mean(squares) < 2.5


def test_error_of_a_target_out_of_view_ages_alike_in_many_steps_and_in_one():
    planted = Planted(TURNS, wander_m=1.0, position_noise_m=0.05)
    live = flown(planted, priors()).live
    steps, whole = live.copy(), live.copy()
    for k in range(200):
        steps.predict(live.t + 0.1 * (k + 1))
    whole.predict(live.t + 20.0)
    e = np.ix_(live.errors, live.errors)
    assert steps.covariance[e] == pytest.approx(whole.covariance[e], rel=1e-6)
    assert whole.covariance[e][0, 0] > live.covariance[e][0, 0] + 0.03


def test_consider_mode_keeps_the_configuration_and_claims_its_priors():
    planted = Planted(TURNS, np.zeros(13))
    estimator = flown(planted, priors(), consider=True)
    statuses = estimator.self_calibration()
    assert all(s.estimate == 0.0 and s.sigma == pytest.approx(s.prior_sigma) for s in statuses)
    error, covariance = relative_error(planted, estimator, 0, 19.9)
    assert np.sqrt(covariance[0, 0]) > 0.05
    assert error @ np.linalg.solve(covariance, error) < 18.0


def test_a_landmark_makes_the_absolute_place_known():
    planted = Planted(TURNS, LATE_AND_CROOKED, wander_m=1.0)
    survey = {1: TargetPrior((-1.5, 1.0), 0.02)}
    with_survey = flown(planted, priors(), targets=survey)
    without = flown(planted, priors())
    better, worse = with_survey.answer(0, 19.9), without.answer(0, 19.9)
    assert better.covariance[0, 0] < 0.1 * worse.covariance[0, 0]
    error = better.place[:2] - planted.flight.targets[0]
    assert error @ np.linalg.solve(better.covariance[:2, :2], error) < 18.0


def test_survey_that_two_others_contradict_is_left_out_and_its_true_place_found():
    flight = Flight(seconds=20.0, fps=8.0, shape="turns", height_m=10.0, pitch_deg=0.0,
                    targets=((1.0, 2.0), (-1.5, 1.0), (1.0, -1.5)))  # fmt: skip
    flight.velocities, flight.labels = ((0.0, 0.0),) * 3, ("",) * 3
    survey = {0: TargetPrior((1.0, 2.0), 0.05), 1: TargetPrior((-1.5, 1.4), 0.05), 2: TargetPrior((1.0, -1.5), 0.05)}
    estimator = flown(Planted(flight, LATE_AND_CROOKED, wander_m=1.0), priors(), targets=survey)
    weights = estimator.estimate.surveys
    assert weights[1] < 0.01
    assert min(weights[0], weights[2]) > 0.9
    assert np.hypot(*(estimator.answer(1, 19.9).place[:2] - (-1.5, 1.0))) < 0.15


def test_a_delay_beyond_its_prior_contradicts_the_configuration():
    planted = Planted(TURNS, np.array([0.06, *[0.0] * 11]))
    delay = flown(planted, priors(camera_delay_s=0.01)).self_calibration()[CAMERA_DELAY]
    assert delay.status == "contradicts"
    assert "sigmas from the configuration" in delay.reason


def test_stored_calibration_is_widened_and_never_beyond_the_configuration():
    mean, sigma = np.full(13, 0.01), np.full(13, 0.001)
    mean[5] = np.nan
    prior = with_stored(priors(position_delay_s=0.05), mean, sigma)
    assert prior.sigma[CAMERA_DELAY] == pytest.approx(np.hypot(0.001, 0.002))
    assert prior.sigma[MOUNT] == pytest.approx(np.hypot(0.001, 0.0035))
    assert prior.mean[POSITION_DELAY] == 0.01
    assert prior.mean[4] == 0.0  # the heading is another one at every start

"""Self-calibration off, and a calibration of an earlier flight that is still right or is not."""

from dataclasses import replace

import numpy as np
import pytest
from draws import first_of, first_rows_of
from simulated_flight import Flight, priors
from simulated_world import World
from smoothed_flights import tracked

from fwav_companion.estimation.errors import BODY_SHARED
from fwav_companion.pipeline.self_calibration_notices import SelfCalibrationNotices
from fwav_companion.self_calibration import CalibrationStatus, KeptCalibration
from fwav_companion.types import BIAS_COUNT, Bias, NoticeCode, Reason

TARGET = np.array((2.0, 3.0))
DELAY_S, MOUNT_Y = 0.035, np.radians(1.0)


def flown(flight, **how):
    """(tracker, tracks) after the last frame."""
    world = World(flight)
    return list(tracked(world, **how))[-1]


def off_and_claimed(tracks):
    """Error of the place (2,), and its covariance (2, 2)."""
    (track,) = [track for track in tracks if track.state in ("confirmed", "coasting")]
    return np.array(track.position_ned[:2]) - TARGET, np.array(track.cov)[:2, :2]


@pytest.mark.parametrize("seed", first_of(*range(1, 9), few=3))
def test_without_self_calibration_the_priors_are_in_the_claim_and_nothing_is_estimated(seed):
    flight = Flight(seconds=30.0, fps=10.0, priors=priors(time_offset=0.02)).drawn(seed)
    tracker, tracks = flown(flight, consider=True)
    estimator = tracker._state.estimator
    assert estimator.solves > 3
    assert np.array_equal(estimator.live.mean[:BODY_SHARED], estimator.model.priors.mean)
    assert tracker.calibration is None
    error, claim = off_and_claimed(tracks)
    assert error @ np.linalg.solve(claim, error) < 13.8  # chi-square, 2 degrees of freedom, 99.9 %
    exact = priors(time_offset=0.0, heading=0.0, mount_x=0.0, mount_y=0.0, mount_z=0.0)
    _, known = off_and_claimed(flown(replace(flight, priors=exact, biases=np.zeros(BIAS_COUNT)), consider=True)[1])
    assert np.trace(claim) > 1.5 * np.trace(known)


def earlier(delay_s, mount_y_deg):
    return KeptCalibration(
        time_offset_s=delay_s,
        time_offset_sigma_s=5e-4,
        mount=(0.0, np.radians(mount_y_deg), 0.0),
        mount_sigma=(1e-3, 1e-3, 0.03),
    )


def late_and_crooked(**how):
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET], biases[Bias.MOUNT_Y] = DELAY_S, MOUNT_Y
    return Flight(seed=3, seconds=45.0, biases=biases, **how)


@pytest.mark.parametrize(
    ("kept_s", "kept_deg"), first_rows_of((0.010, -1.0), (0.035, 1.5), (0.020, -1.0), (0.035, 0.9), few=2)
)
def test_a_camera_that_was_moved_since_an_earlier_flight_is_calibrated_again(kept_s, kept_deg):
    tracker, tracks = flown(late_and_crooked(), kept=earlier(kept_s, kept_deg))
    report = tracker.calibration
    assert report.replaced
    assert report.status is CalibrationStatus.CALIBRATED
    assert report.time_offset_s == pytest.approx(DELAY_S, abs=0.002)
    assert np.degrees(report.mount) == pytest.approx([0.0, -1.0, 0.0], abs=0.3)
    error, claim = off_and_claimed(tracks)
    assert error @ np.linalg.solve(claim, error) < 13.8
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    assert news.status(report).replaced
    assert NoticeCode.CALIBRATION_DROPPED in [each.code for each in news.notices(report)]


def test_a_camera_that_was_not_moved_keeps_its_calibration():
    tracker, _ = flown(late_and_crooked(), kept=earlier(DELAY_S + 5e-4, -1.0))
    assert not tracker.calibration.replaced
    assert tracker.calibration.status is CalibrationStatus.CALIBRATED


def test_a_calibration_that_was_dropped_stays_dropped_after_tracks_are_dropped():
    """Where the vehicle's origin changes in flight the estimator begins again, from the configuration."""
    world = World(late_and_crooked())
    frames = tracked(world, kept=earlier(0.010, -1.0))
    tracker = next(tracker for tracker, _ in frames if tracker.calibration.replaced)
    for _ in range(2):
        assert tracker._state.estimator.model.priors.mean[0] == 0.0
        tracker.drop_all(Reason.ORIGIN_SET, world.frames()[0])
        assert tracker.calibration.replaced

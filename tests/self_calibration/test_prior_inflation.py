"""Priors that cannot be right are widened; possible ones are left unchanged."""

import msgspec
import numpy as np
import pytest
from draws import first_of, first_rows_of
from scipy.stats import chi2
from simulated_flight import Flight, priors
from simulated_world import World

from fwav_companion.pipeline.self_calibration_notices import SelfCalibrationNotices
from fwav_companion.self_calibration import CalibrationStatus, KeptCalibration, SharedParameter
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.prior_inflation import PriorInflation, is_plausible, prior_inflations
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias, NoticeCode

TARGET = (2.0, 3.0)
SIGMAS = np.array([0.01, 0.02, 0.02, 0.02, 0.03, 0.5, *[0.0] * 5])
MEANS = np.zeros(SHARED_COUNT)
USED = np.flatnonzero(SIGMAS)


def informed(truth, sigmas, seed=4, measurements=40):
    """A batch fit of invented measurements of everything together, about as accurate as the usual priors."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((measurements, SHARED_COUNT))
    rows[:, USED] = rng.normal(0.0, 1.0 / SIGMAS[USED], (measurements, len(USED)))
    return fitted(rows, rows @ np.array(truth) + rng.normal(0.0, 1.0, measurements), sigmas)


def fitted(rows, seen, sigmas):
    """The batch least-squares fit of the measurements ``seen`` with unit sigma, and these priors."""
    rows = rows[:, USED]
    cov, mean = np.zeros((SHARED_COUNT, SHARED_COUNT)), np.zeros(SHARED_COUNT)
    cov[np.ix_(USED, USED)] = np.linalg.inv(np.diag(np.array(sigmas)[USED] ** -2.0) + rows.T @ rows)
    mean[USED] = cov[np.ix_(USED, USED)] @ rows.T @ seen
    blank = joint_filter(priors(), np.array(sigmas), MEANS[None], MEANS[None])
    return msgspec.structs.replace(blank, mean=mean[None], cov=cov[None])


def test_a_loosened_estimate_is_that_of_the_wider_prior():
    truth = [0.0, 0.01, -0.02, 0.0, 0.0, 3.0, *[0.0] * 5]
    loosening = PriorInflation(SharedParameter.HEIGHT, 0.0, 0.5, 3.0)
    wide = SIGMAS.copy()
    wide[SharedParameter.HEIGHT] = loosening.wider_sigma
    loosened, expected = informed(truth, SIGMAS).inflated(loosening), informed(truth, wide)
    assert loosened.mean == pytest.approx(expected.mean, rel=1e-9, abs=1e-12)
    assert loosened.cov == pytest.approx(expected.cov, rel=1e-9, abs=1e-15)


def test_what_the_flight_says_alone_is_what_it_says_without_the_prior():
    truth = [0.0, 0.0, 0.0, 0.3, 0.0, 4.0, *[0.0] * 5]
    found = {each.parameter: each.alone for each in prior_inflations(informed(truth, SIGMAS), MEANS, SIGMAS)}
    free = SIGMAS.copy()
    free[[SharedParameter.MOUNT_Z, SharedParameter.HEIGHT]] = 1e6
    expected = informed(truth, free)
    assert found.keys() == {SharedParameter.MOUNT_Z, SharedParameter.HEIGHT}
    assert found[SharedParameter.HEIGHT] == pytest.approx(expected.mean[0, SharedParameter.HEIGHT], rel=0.05)
    assert found[SharedParameter.MOUNT_Z] == pytest.approx(expected.mean[0, SharedParameter.MOUNT_Z], rel=0.05)


def found_as(mean, sigma):
    """A joint estimate with this height and sigma; all other unknowns are at their priors."""
    blank = joint_filter(priors(), SIGMAS, MEANS[None], MEANS[None])
    means, cov = np.zeros(SHARED_COUNT), np.diag(SIGMAS**2)
    means[SharedParameter.HEIGHT], cov[SharedParameter.HEIGHT, SharedParameter.HEIGHT] = mean, sigma**2
    return msgspec.structs.replace(blank, mean=means[None], cov=cov[None])


@pytest.mark.parametrize(
    ("found_m", "found_sigma_m", "denied"),
    [(2.5, 0.1, True), (2.3, 0.1, False), (3.5, 0.4, False), (3.7, 0.4, True), (50.0, 0.5, False)],
)
def test_prior_and_estimate_may_differ_by_four_times_the_sum_of_their_sigmas(found_m, found_sigma_m, denied):
    """The correlation of the two errors is not known, so the sum of their sigmas bounds the difference. The prior is
    0.5 m; an estimate that is not sharper has learned nothing."""
    unknowns = [each.parameter for each in prior_inflations(found_as(found_m, found_sigma_m), MEANS, SIGMAS)]
    assert unknowns == [SharedParameter.HEIGHT] * denied


def test_an_unknown_that_a_wrong_prior_bent_is_judged_without_that_prior():
    """The flight measures the sum of mount and height well, and the height alone with the sigma of its prior. A height
    of 30 sigma that is held near 0 appears as a mount error of 13 sigma; with the prior widened the mount is right.
    """
    both = [SharedParameter.MOUNT_Y, SharedParameter.HEIGHT]
    rows = np.zeros((2, SHARED_COUNT))
    rows[0, both] = 30.0 / SIGMAS[both]
    rows[1, SharedParameter.HEIGHT] = 1.0 / SIGMAS[SharedParameter.HEIGHT]
    truth = np.zeros(SHARED_COUNT)
    truth[SharedParameter.HEIGHT] = 30.0 * SIGMAS[SharedParameter.HEIGHT]
    joint = fitted(rows, rows @ truth, SIGMAS)
    assert joint.mean[0, SharedParameter.MOUNT_Y] > 8.0 * SIGMAS[SharedParameter.MOUNT_Y]
    assert [each.parameter for each in prior_inflations(joint, MEANS, SIGMAS)] == [SharedParameter.HEIGHT]


def test_a_prior_that_is_right_is_hardly_ever_denied():
    rng, denied = np.random.default_rng(9), 0
    for seed in range(2000):
        truth = rng.normal(0.0, 1.0, SHARED_COUNT) * SIGMAS
        denied += bool(prior_inflations(informed(truth, SIGMAS, seed, measurements=12), MEANS, SIGMAS))
    assert denied <= 1


def flown(flight, kept=None):
    world, best = World(flight), None
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at, kept)
    for view in world.frames():
        for track in tracker.on_frame(view):
            if track.confirmed_host_ns is not None and (best is None or track.id == best.id):
                best = track
    return best, tracker.calibration


@pytest.mark.parametrize("height_m", first_of(1.5, -1.5))
@pytest.mark.parametrize("seed", first_of(1, 2))
def test_a_filter_that_rests_on_a_denied_prior_is_not_believed_though_it_claims_more(seed, height_m):
    """The target's own filter assumes a height known to 0.2 m, so it claims half of the true error."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET], biases[Bias.HEIGHT] = 0.035, height_m
    sharp = {f"mount_{axis}": np.radians(0.2) for axis in "xyz"}
    reported = priors(height=0.2, heading=np.radians(0.5), **sharp)
    track, report = flown(Flight(seed=seed, seconds=30, biases=biases, priors=reported))
    assert [each.parameter for each in report.denied] == [SharedParameter.HEIGHT]
    error = np.subtract(track.position_ned[:2], TARGET)
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < chi2.ppf(0.99, 2)


@pytest.mark.parametrize(("height_m", "mount_y_deg"), first_rows_of((-2.5, 1.0), (0.0, 6.0), (1.5, 0.0), few=2))
def test_a_height_or_a_mount_far_beyond_its_prior_is_found_and_reported_and_bends_nothing_else(height_m, mount_y_deg):
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET], biases[Bias.HEIGHT] = 0.035, height_m
    biases[[Bias.MOUNT_X, Bias.MOUNT_Y]] = np.radians([0.5, mount_y_deg])
    track, report = flown(Flight(seed=4, seconds=30, biases=biases, priors=priors(height=0.2)))
    error = np.subtract(track.position_ned[:2], TARGET)
    assert report.status is CalibrationStatus.CALIBRATED
    assert np.degrees(report.mount) == pytest.approx([-0.5, -mount_y_deg, 0.0], abs=0.3)
    assert report.height_m == pytest.approx(height_m, abs=0.4)
    assert error @ np.linalg.solve(np.array(track.cov)[:2, :2], error) < 13.8

    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    (reported,) = (each.text for each in news.notices(report) if each.code is NoticeCode.PRIOR_EXCEEDED)
    assert ("height_bias_m" if height_m else "mount_bias_deg") in reported
    assert NoticeCode.PRIOR_EXCEEDED not in [each.code for each in news.notices(report)]


def test_each_denied_prior_is_reported_by_the_key_that_states_it():
    _, report = flown(Flight(seed=4, seconds=30, biases=np.zeros(BIAS_COUNT)))
    assert report.status is CalibrationStatus.CALIBRATED
    denied = (
        PriorInflation(SharedParameter.DELAY, 0.0, 0.01, 0.05),
        PriorInflation(SharedParameter.MOUNT_Y, 0.0, 0.02, np.radians(-6.0)),
        PriorInflation(SharedParameter.HEIGHT, 0.0, 0.5, 5.3),
    )
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    notices = news.notices(msgspec.structs.replace(report, denied=denied))
    reported = [each for each in notices if each.code is NoticeCode.PRIOR_EXCEEDED]
    for notice, figure, key in zip(
        reported,
        ("+50 ms", "-6.0 degrees", "+5.3 m"),
        ("time_offset_sigma_s", "mount_bias_deg", "height_bias_m"),
        strict=True,
    ):
        assert figure in notice.text
        assert key in notice.text


@pytest.mark.parametrize(
    ("kept_s", "kept_deg"), first_rows_of((0.010, -1.0), (0.035, 1.5), (0.020, -1.0), (0.035, 0.0), few=2)
)
def test_a_camera_that_was_moved_since_an_earlier_flight_is_calibrated_again(kept_s, kept_deg):
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET], biases[Bias.MOUNT_Y] = 0.035, np.radians(1.0)
    kept = KeptCalibration(
        time_offset_s=kept_s,
        time_offset_sigma_s=5e-4,
        mount=(0.0, np.radians(kept_deg), 0.0),
        mount_sigma=(1e-3, 1e-3, 0.03),
    )
    _, report = flown(Flight(seed=3, seconds=45, biases=biases), kept)
    assert report.replaced
    assert report.status is CalibrationStatus.CALIBRATED
    assert report.time_offset_s == pytest.approx(0.035, abs=0.002)
    assert np.degrees(report.mount) == pytest.approx([0.0, -1.0, 0.0], abs=0.3)
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    assert news.status(report).replaced
    assert NoticeCode.CALIBRATION_DROPPED in [each.code for each in news.notices(report)]


@pytest.mark.parametrize("height_m", first_of(1.5, 0.0))
def test_a_camera_that_was_not_moved_keeps_its_calibration(height_m):
    """Also where home was set 1.5 m off: the kept calibration contains no height."""
    biases = np.zeros(BIAS_COUNT)
    biases[Bias.TIME_OFFSET], biases[Bias.MOUNT_Y] = 0.035, np.radians(1.0)
    biases[Bias.HEIGHT] = height_m
    kept = KeptCalibration(
        time_offset_s=0.0355,
        time_offset_sigma_s=5e-4,
        mount=(0.001, -np.radians(1.0), 0.02),
        mount_sigma=(1e-3, 1e-3, 0.03),
    )
    _, report = flown(Flight(seed=3, seconds=45, biases=biases, priors=priors(height=0.2)), kept)
    assert not report.replaced
    assert bool(report.denied) is bool(height_m)


@pytest.mark.parametrize(
    ("parameter", "sigmas_off", "plausible"),
    [
        (SharedParameter.HEADING, 3.0, True),
        (SharedParameter.HEADING, 10.0, False),
        (SharedParameter.HEADING, -10.0, False),
        (SharedParameter.HEIGHT, 10.0, True),  # its prior is tested, and widened
    ],
)
def test_an_estimate_that_no_wider_prior_explains_has_diverged(parameter, sigmas_off, plausible):
    joint = found_as(0.0, 0.1)
    mean, cov = joint.mean.copy(), joint.cov.copy()
    mean[0, parameter], cov[0, parameter, parameter] = sigmas_off * SIGMAS[parameter], (0.3 * SIGMAS[parameter]) ** 2
    joint = msgspec.structs.replace(joint, mean=mean, cov=cov)
    assert is_plausible(joint, MEANS, SIGMAS) is plausible

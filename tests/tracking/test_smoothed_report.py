"""Reports of the smoother's shared parameters: states, signs, words, and what the notices and lines make of them."""

from types import SimpleNamespace

import numpy as np
import pytest

from fwav_companion.estimation.answers import ParameterStatus
from fwav_companion.estimation.delay_search import DelayMode
from fwav_companion.estimation.errors import (
    BODY_SHARED,
    CAMERA_DELAY,
    HEIGHT,
    MOUNT,
    PITCH,
    ROLL,
    SampleNoise,
    SharedPriors,
    priors,
)
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pipeline.self_calibration_notices import DENIED_S, SelfCalibrationNotices
from fwav_companion.pipeline.solve_notices import SolveNotices
from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.tools.report.calibration_section import parameter_table
from fwav_companion.tracking.smoothed.smoothed_report import NEVER_SOLVED, smoothed_report
from fwav_companion.types import NoticeCode
from fwav_companion.types.flight_status import SolveReport

PRIORS = priors(position_delay_s=0.01, lever_arm_m=0.02)
KNOWN = 0.1
"""Sigma of a known parameter, of its prior's."""


def estimator_with(off=None, unknown=(), modes=(), weight=1.0):
    """An estimator whose flight shows everything: `off`, errors by index; `unknown`, indices that it does not show."""
    estimator = Estimator(PRIORS, SampleNoise())
    mean, sigma = np.zeros(BODY_SHARED), KNOWN * PRIORS.sigma
    for index, value in (off or {}).items():
        mean[index] = value
    for index in unknown:
        sigma[index] = PRIORS.sigma[index]
    estimator.live = SimpleNamespace(mean=mean, covariance=np.diag(sigma**2))
    estimator.solves = 1
    found = [DelayMode(cost, mean + np.eye(BODY_SHARED)[CAMERA_DELAY] * delay, {}) for cost, delay in modes]
    estimator.estimate = SimpleNamespace(modes=tuple(found), weight=weight)
    return estimator


def report_of(estimator):
    return smoothed_report(estimator, HostNs(0))


def by_name(report):
    return {each.name: each for each in report.parameters}


def test_flight_that_shows_everything_is_calibrated_without_a_reason():
    report = report_of(estimator_with({CAMERA_DELAY: 0.02}))
    assert (report.status, report.reason) == (CalibrationStatus.CALIBRATED, None)
    assert {each.status for each in report.parameters} == {"calibrated"}
    assert report.keep.time_offset_s == pytest.approx(0.02)


def test_estimator_without_a_solve_waits_for_a_target():
    report = report_of(Estimator(PRIORS, SampleNoise()))
    assert (report.status, report.reason) == (CalibrationStatus.WAITING, NEVER_SOLVED)
    assert by_name(report)["time_offset_s"].status == "waiting"


def test_parameter_that_the_flight_does_not_show_says_what_it_waits_for():
    report = report_of(estimator_with(unknown=[CAMERA_DELAY]))
    assert report.status is CalibrationStatus.WAITING
    assert report.reason == "time_offset_s: turns or shaking while a target is in view"
    assert by_name(report)["height_m"].status == "calibrated"


def test_mount_is_reported_as_a_correction_in_degrees_and_counts_the_attitude():
    report = report_of(estimator_with({MOUNT.start: 0.01, ROLL: 0.005, MOUNT.stop - 1: -0.02}))
    found = by_name(report)
    assert found["mount_x_deg"].estimate == pytest.approx(-np.degrees(0.015))
    assert found["mount_z_deg"].estimate == pytest.approx(np.degrees(0.02))
    assert found["roll_deg"].estimate == pytest.approx(np.degrees(0.005))
    assert np.radians([found[f"mount_{axis}_deg"].estimate for axis in "xyz"]) == pytest.approx(report.mount)


def test_delay_beyond_its_prior_contradicts_by_sigmas_and_key_and_is_still_known():
    report = report_of(estimator_with({CAMERA_DELAY: 0.3}))
    assert report.status is CalibrationStatus.TIME
    assert report.reason == (
        "time_offset_s: 6.0 sigmas from the configuration ([uncertainty] time_offset_sigma_s = 0.05)"
    )
    assert report.keep is None
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.01)
    assert news.configuration_lines(report) == ["[camera] time_offset_s = 0.3100"]


@pytest.mark.parametrize(("index", "partner", "axis"), [(0, ROLL, "x"), (1, PITCH, "y"), (2, None, "z")])
def test_turned_mount_is_named_with_its_axis_and_the_sign_of_a_correction(index, partner, axis):
    off = {MOUNT.start + index: 0.4} | ({} if partner is None else {partner: 0.1})
    report = report_of(estimator_with(off))
    assert by_name(report)[f"mount_{axis}_deg"].status == "contradicts"
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    notices = [notice for _ in range(DENIED_S) for notice in news.notices(report)]
    (text,) = [notice.text for notice in notices if notice.code is NoticeCode.PRIOR_EXCEEDED]
    total = np.degrees(0.4 if partner is None else 0.5) / (1 - KNOWN**2)  # without the pull of its prior
    assert text == (
        f"self-calibration: mount is {-total:+.1f} degrees off about body {axis}, beyond [uncertainty] mount_bias_deg"
    )


def test_contradiction_is_noticed_once_and_only_after_it_has_lasted():
    news = SelfCalibrationNotices(((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)), 0.0)
    high, right = report_of(estimator_with({HEIGHT: 5.0})), report_of(estimator_with())

    def exceeded(report):
        return [n.text for n in news.notices(report) if n.code is NoticeCode.PRIOR_EXCEEDED]

    assert [exceeded(each) for each in (high, high, right, high, high)] == [[]] * 5
    assert "+5.1 m off" in exceeded(high)[0]
    assert exceeded(high) == []


def test_rival_delays_are_ambiguous_until_one_is_left_and_far_rivals_do_not_count():
    unsure = {"unknown": [CAMERA_DELAY]}
    report = report_of(estimator_with(modes=[(0.0, 0.02), (3.0, -0.18), (20.0, 0.2)], **unsure))
    assert report.status is CalibrationStatus.AMBIGUOUS
    assert report.alternatives == pytest.approx((0.02, -0.18))
    assert report_of(estimator_with(modes=[(0.0, 0.02), (20.0, 0.2)], **unsure)).alternatives == ()


def test_solve_that_refuses_half_of_the_sightings_says_what_to_check():
    assert "check the camera's calibration" in report_of(estimator_with(unknown=[CAMERA_DELAY], weight=0.4)).reason


def test_sigmas_are_those_of_the_posterior_and_of_the_configuration():
    found = by_name(report_of(estimator_with()))["position_delay_s"]
    assert (found.sigma, found.prior_sigma) == pytest.approx((0.001, 0.01))


def test_estimate_without_its_prior_is_that_of_the_measurements():
    prior, measured, sigma, noise = 0.1, 1.0, 0.5, 0.2  # oracle: the product of two Gaussians
    variance = 1 / (1 / sigma**2 + 1 / noise**2)
    both = variance * (prior / sigma**2 + measured / noise**2)
    status = ParameterStatus("x", both, variance**0.5, prior, sigma, "calibrated", None)
    assert status.alone == pytest.approx(measured)
    assert ParameterStatus("x", 0.1, sigma, prior, sigma, "waiting", None).alone == 0.1


def test_report_lists_parameters_but_not_those_that_are_stated_as_exact():
    exact = Estimator(
        SharedPriors(PRIORS.mean, np.where(np.arange(BODY_SHARED) == HEIGHT, 0.0, PRIORS.sigma)), SampleNoise()
    )
    text = parameter_table(report_of(exact).parameters)
    assert "time_offset_s" in text
    assert "height_m" not in text
    assert parameter_table(()) == ""


def test_late_solves_are_reported_again_when_they_are_ten_times_as_many():
    news = SolveNotices()
    counts = [len(news.notices(SolveReport(taken=20, late=late))) for late in (0, 1, 2, 9, 10, 11, 99, 100)]
    assert counts == [0, 1, 0, 0, 1, 0, 0, 1]

"""The mount as reported and kept: its claims cover the truth over flights whose heading errs as its prior says."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest
from handmade import BOOT_NS
from pixel_covariances import pixel_noise
from scipy.spatial.transform import Rotation
from simulated_flight import Flight, path, priors
from simulated_world import World

from fwav_companion.self_calibration import CalibrationStatus
from fwav_companion.self_calibration.assessment import assessed
from fwav_companion.self_calibration.delayed_poses import delayed_poses
from fwav_companion.self_calibration.joint_filter import joint_filter
from fwav_companion.self_calibration.measurement_batch import measurement_batch
from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT, SharedParameter, predict
from fwav_companion.self_calibration.posterior import MOUNT_AXES, with_drift
from fwav_companion.tracking import TrackingOptions, make_tracker
from fwav_companion.types import BIAS_COUNT, Bias

SIGMAS = np.array((0.05, *np.radians([1.0, 1.0, 1.0, 2.0]), *[0.0] * 6))
MEANS = np.zeros(SHARED_COUNT)
USED = [*range(5), SHARED_COUNT, SHARED_COUNT + 1]
FLIGHTS = 300


def seen_from_a_flight():
    """(information of the flight's pixels about USED, mean down direction in the body)."""
    flight = Flight(fps=3)
    world = World(flight)
    fixes = [fix for view in world.frames() for fix in view.fixes]
    information = np.zeros((len(USED), len(USED)))
    for fix in fixes:
        batch = measurement_batch([(1, fix)], delayed_poses([fix.sighting.state], (0.0,), world.state_at), (1.0,))
        at = predict(batch, np.array([[flight.targets[0]]]), MEANS[None])
        rows = at.rows[0, 0][:, USED]
        information += rows.T @ np.linalg.solve(pixel_noise(batch, at.rows, flight.priors)[0, 0], rows)
    _, ypr = path(flight, np.array([(fix.sighting.boot_ns - BOOT_NS) * 1e-9 for fix in fixes]))
    down = Rotation.from_euler("ZYX", ypr).inv().apply([0.0, 0.0, 1.0]).mean(0)
    return information, tuple(map(float, down))


def as_joint(mean, cov):
    full_mean, full = np.zeros(SHARED_COUNT + 2), np.zeros((SHARED_COUNT + 2,) * 2)
    full_mean[USED], full[np.ix_(USED, USED)] = mean, cov
    blank = joint_filter(priors(), SIGMAS, MEANS[None], MEANS[None])
    return msgspec.structs.replace(blank, mean=full_mean[None], cov=full[None], tracks=(1,))


def test_reported_and_kept_mounts_are_covered_over_drawn_headings():
    information, down = seen_from_a_flight()
    prior = np.diag([*(s**-2 for s in SIGMAS[:5]), 1e-6, 1e-6])
    cov = np.linalg.inv(information + prior)
    root, rng = np.linalg.cholesky(information), np.random.default_rng(5)
    told_in, kept_in = np.zeros(3), np.zeros(3)
    for _ in range(FLIGHTS):
        truth = np.array([*rng.standard_normal(5) * SIGMAS[:5], 0.0, 0.0])
        mean = cov @ (information @ truth + root @ rng.standard_normal(len(USED)))
        assessment = assessed(as_joint(mean, cov), (MEANS, SIGMAS), axes=(down, (0.0, 0.0, 1.0)))
        assert assessment.status is CalibrationStatus.CALIBRATED
        reported, kept = assessment.parameters, assessment.keep
        mount, heading = truth[1:4], truth[4]
        expected = mount - heading * np.array(down)
        told_in += [abs(reported[i][0] - x) < 1.96 * reported[i][1] for i, x in zip(MOUNT_AXES, expected, strict=True)]
        kept_in += [abs(m - x) < 1.96 * s for m, x, s in zip(kept.mount, mount, kept.mount_sigma, strict=True)]
        assert reported[SharedParameter.MOUNT_Z][1] < 0.35 * SIGMAS[SharedParameter.MOUNT_Z]
    share = np.concatenate([told_in, kept_in]) / FLIGHTS
    assert np.all(share > 0.95 - 3.3 * np.sqrt(0.95 * 0.05 / FLIGHTS))
    assert np.all(share < 0.95 + 3.3 * np.sqrt(0.95 * 0.05 / FLIGHTS))


def test_a_drift_near_the_bound_does_not_turn_the_answer_on_and_off():
    joint = as_joint(np.zeros(len(USED)), np.diag([*SIGMAS[:5] ** 2, 1.0, 1.0]))

    def by(drift, before=None):
        return assessed(joint, (MEANS, SIGMAS), drift=SimpleNamespace(factor=1.0, shown=drift), before=before)

    little, large = by(5.9), by(6.3)
    assert little.constant
    assert not large.constant
    assert by(6.3, little).constant
    assert not by(6.7, little).constant
    assert not by(6.3, large).constant


@pytest.mark.parametrize(("heading_sigmas", "believed"), [(3.0, True), (-12.0, False)])
def test_an_estimate_that_contradicts_the_prior_of_the_heading_is_not_believed(heading_sigmas, believed):
    """All angles are known to a tenth of their priors. The mount's own prior is contradicted, which is allowed."""
    mean = np.array([0.0, 0.0, 0.0, 6.0 * SIGMAS[3], heading_sigmas * SIGMAS[4], 0.0, 0.0])
    joint = as_joint(mean, np.diag([*(0.1 * SIGMAS[:5]) ** 2, 1.0, 1.0]))
    assessment = assessed(joint, (MEANS, SIGMAS), drift=SimpleNamespace(factor=1.0, shown=1.0))
    assert assessment.denied
    assert (assessment.status is CalibrationStatus.CALIBRATED) is believed
    assert assessment.constant is believed


def test_a_heading_error_is_reported_as_a_rotation_about_down():
    biases = np.zeros(BIAS_COUNT)
    mount, heading = np.radians([0.5, 1.0, 2.0]), np.radians(3.0)
    biases[Bias.TIME_OFFSET], biases[Bias.HEADING] = 0.035, heading
    biases[[Bias.MOUNT_X, Bias.MOUNT_Y, Bias.MOUNT_Z]] = mount
    flight = Flight(seed=2, seconds=45, fps=15, biases=biases)
    world = World(flight)
    tracker = make_tracker(TrackingOptions(self_calibration=True), flight.priors, world.state_at)
    for view in world.frames():
        tracker.on_frame(view)
    report = tracker.calibration
    pitched = Rotation.from_euler("ZYX", [0.0, np.radians(flight.pitch_deg), 0.0])
    through_truth = Rotation.from_rotvec([0, 0, heading]) * pitched
    correction = through_truth.inv() * pitched * Rotation.from_rotvec(-mount)
    assert report.status is CalibrationStatus.CALIBRATED
    assert np.degrees(report.mount) == pytest.approx(np.degrees(correction.as_rotvec()), abs=0.4)


def test_what_drifts_is_as_if_measured_with_as_much_more_noise():
    """The wider claim is the posterior of the same priors and of measurements with their variance times the same
    factor.
    """
    information, _ = seen_from_a_flight()
    prior, wider = np.diag([*(s**-2 for s in SIGMAS[:5]), 1e-6, 1e-6]), 5.0
    joint = as_joint(np.zeros(len(USED)), np.linalg.inv(information + prior))
    wide = with_drift(joint, SIGMAS, wider)
    expected = np.linalg.inv(prior + information / wider)[:5, :5]
    assert wide[:5, :5] == pytest.approx(expected, rel=1e-3, abs=1e-9)
    assert wide[SharedParameter.HEADING, SharedParameter.HEADING] < SIGMAS[SharedParameter.HEADING] ** 2

"""What limits a target: the variance that each cause adds, against the covariance that the filter itself claims."""

import numpy as np
import pytest
from flying import fly

from fwav_companion.self_calibration import SharedParameter
from fwav_companion.tracking import bias_shares
from sitl_mock import scenario

QUIET = {"seconds": 25.0, "autopilot.rates_hz": {"ATTITUDE_QUATERNION": 100.0}}


def shares_of(settings=(), **differences):
    """(shares, horizontal variance) of the target at the end of a flight."""
    options = scenario("default").but({**QUIET, **{k.replace("__", "."): v for k, v in differences.items()}})
    companion = fly(options, settings).companion
    ((_, target),) = companion.pipeline.best_targets.items()
    (nn, _, _), (_, ee, _), _ = target.cov
    return bias_shares(target, companion.config.priors), nn + ee, target


def test_shares_and_noise_are_the_whole_variance():
    shares, total, target = shares_of()
    nn, _, ee = target.apparent.noise
    assert sum(shares.values()) + nn + ee == pytest.approx(total, rel=1e-6)
    assert all(share >= 0.0 for share in shares.values())


def test_a_cause_that_is_known_has_no_share():
    settings = ("uncertainty.mount_bias_deg=0.0", "uncertainty.position_bias_m=0.0", "camera.readout_s=0.0")
    shares, _, _ = shares_of(settings)
    assert shares.get("mount", 0.0) == shares.get("readout", 0.0) == 0.0
    assert shares["position"] == pytest.approx(0.0, abs=1e-6)
    assert shares["heading"] > 0.0


def test_the_share_of_a_receiver_is_its_variance():
    """25 s show nothing of an error that wanders over minutes: 2 sigma^2 in the plane."""
    shares, total, _ = shares_of(("uncertainty.position_bias_m=2.0", "uncertainty.position_bias_time_s=1800.0"))
    assert shares["position"] == pytest.approx(8.0, rel=0.15)
    assert shares["position"] / total > 0.9


def test_the_joint_estimates_shares_are_what_conditioning_takes_away():
    """Of a multivariate normal, knowing g takes P[t, g] inv(P[g, g]) P[g, t]: by inverting the whole matrix."""
    settings = ("tracking.self_calibration=true",)
    _, _, target = shares_of(settings, seconds=40.0)
    calibrator = getattr(target, "calibrator", None)
    if calibrator is None:
        pytest.skip("this flight did not calibrate its camera")
    assessment, track = calibrator.assessment, target.track
    found = assessment.bias_shares(track)
    cov = assessment.estimated.cov
    place = 13 + 2 * assessment.estimated.joint.tracks.index(track)
    own = [place, place + 1]
    for first, group in ((SharedParameter.HEADING, [4]), (SharedParameter.MOUNT_X, [1, 2, 3])):
        block = cov[np.ix_([*own, *group], [*own, *group])]
        known = np.linalg.inv(np.linalg.inv(block)[:2, :2])  # covariance of the target given the group
        assert found[first] == pytest.approx(np.trace(cov[np.ix_(own, own)] - known), rel=1e-3, abs=1e-9)

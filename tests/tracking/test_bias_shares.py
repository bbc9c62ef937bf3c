"""What limits a target: the variance that each cause adds, against the covariance that the filter itself claims."""

from types import SimpleNamespace

import numpy as np
import pytest
from flying import fly

from fwav_companion.self_calibration.pixel_measurement import SHARED_COUNT
from fwav_companion.self_calibration.posterior import bias_shares as joint_shares
from fwav_companion.tracking import bias_shares
from sitl_mock import scenario

QUIET = {"seconds": 15.0, "autopilot.rates_hz": {"ATTITUDE_QUATERNION": 100.0}}


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
    """15 s show nothing of an error that wanders over minutes: 2 sigma^2 in the plane."""
    shares, total, _ = shares_of(("uncertainty.position_bias_m=2.0", "uncertainty.position_bias_time_s=1800.0"))
    assert shares["position"] == pytest.approx(8.0, rel=0.15)
    assert shares["position"] / total > 0.9


def test_the_joint_estimates_shares_are_what_conditioning_takes_away():
    """Of a multivariate normal, knowing a group leaves inv(inv(P)[t, t]) of the target's covariance."""
    rng, first = np.random.default_rng(1), SHARED_COUNT + 4
    root = rng.normal(size=(first + 2, first + 2))
    cov = root @ root.T
    joint = SimpleNamespace(cov=cov[None], first=first, place_of=lambda track: first if track == 7 else None)
    own = [first, first + 1]
    found = joint_shares(joint, 7)
    for cause, group in (("heading", [4]), ("mount", [1, 2, 3]), ("position", list(range(SHARED_COUNT, first)))):
        block = cov[np.ix_([*own, *group], [*own, *group])]
        known = np.linalg.inv(np.linalg.inv(block)[:2, :2])
        assert found[cause] == pytest.approx(np.trace(cov[np.ix_(own, own)] - known), rel=1e-6)
    assert joint_shares(joint, 8) == {}

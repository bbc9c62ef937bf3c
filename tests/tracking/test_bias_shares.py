"""What limits a target: the variance that each cause adds, against the covariance that the filter itself claims."""

import pytest
from flying import fly

from fwav_companion.tracking import shares_of
from sitl_mock import scenario

LOW_PASS = ("tracking.filter=lowpass", "tracking.self_calibration=false")
QUIET = {"seconds": 15.0, "autopilot.rates_hz": {"ATTITUDE_QUATERNION": 100.0}}


def shares_at_the_end(settings=(), **differences):
    """(shares, horizontal variance) of the target at the end of a flight."""
    options = scenario("default").but({**QUIET, **{k.replace("__", "."): v for k, v in differences.items()}})
    companion = fly(options, (*LOW_PASS, *settings)).companion
    ((_, target),) = companion.pipeline.best_targets.items()
    (nn, _, _), (_, ee, _), _ = target.cov
    return shares_of(target), nn + ee, target


def test_shares_and_noise_are_the_whole_variance():
    shares, total, target = shares_at_the_end()
    nn, _, ee = target.apparent.noise
    assert sum(shares.values()) + nn + ee == pytest.approx(total, rel=1e-6)
    assert all(share >= 0.0 for share in shares.values())


def test_a_cause_that_is_known_has_no_share():
    settings = ("uncertainty.mount_bias_deg=0.0", "uncertainty.position_bias_m=0.0", "camera.readout_s=0.0")
    shares, _, _ = shares_at_the_end(settings)
    assert shares.get("mount", 0.0) == shares.get("readout", 0.0) == 0.0
    assert shares["position"] == pytest.approx(0.0, abs=1e-6)
    assert shares["heading"] > 0.0


def test_the_share_of_a_receiver_is_its_variance():
    """15 s show nothing of an error that wanders over minutes: 2 sigma^2 in the plane."""
    shares, total, _ = shares_at_the_end(("uncertainty.position_bias_m=2.0", "uncertainty.position_bias_time_s=1800.0"))
    assert shares["position"] == pytest.approx(8.0, rel=0.15)
    assert shares["position"] / total > 0.9

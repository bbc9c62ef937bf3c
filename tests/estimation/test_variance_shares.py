"""Shares of causes in a target's variance, against the inverse of a precision."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

from fwav_companion.estimation.errors import BODY_SHARED, CAMERA_DELAY, HEIGHT
from fwav_companion.estimation.variance_shares import variance_shares
from fwav_companion.estimation.wander import SMOOTH, Wander

E = BODY_SHARED


@dataclass
class LiveStub:
    """A live filter of the target 4: its covariance, and that with the base state."""

    own: np.ndarray
    by_base: np.ndarray
    covariance: np.ndarray
    size: int = BODY_SHARED
    error: int = E
    curved: int = 0
    wanders: tuple = (Wander(0.1, (30.0,), SMOOTH, (0.0, 0.1)),) * 2
    carrier: SimpleNamespace = field(default_factory=lambda: SimpleNamespace(path=SimpleNamespace(breaks=[])))

    def __contains__(self, target):
        return target == 4

    def place(self, target):
        return np.zeros(3), self.own

    def cross(self, target):
        return self.by_base


@pytest.fixture
def live():
    """A live filter of one target: its place is wrong by its own noise, the delay, the height and the error now."""
    sigma = np.full(E + 3, 0.1)
    sigma[[CAMERA_DELAY, HEIGHT]] = 0.02, 0.5
    covariance = np.diag(sigma**2)
    sensitivity = np.zeros((3, E + 3))
    sensitivity[0, CAMERA_DELAY], sensitivity[1, HEIGHT], sensitivity[0, E] = 5.0, 0.7, 1.0
    own = np.diag([0.01, 0.04, 0.25]) + sensitivity @ covariance @ sensitivity.T
    return LiveStub(own, sensitivity @ covariance, covariance)


def test_share_is_the_variance_that_is_lost_when_the_cause_is_known(live):
    shares = variance_shares(live, 4)
    assert shares["time"] == pytest.approx((5.0 * 0.02) ** 2)
    assert shares["height"] == pytest.approx((0.7 * 0.5) ** 2)
    assert shares["position"] == pytest.approx(0.1**2)
    assert shares["mount"] == pytest.approx(0.0, abs=1e-12)
    assert shares["terrain"] == pytest.approx(0.0, abs=1e-12)


def test_noise_that_the_smoothing_of_the_path_leaves_is_no_share_of_the_receiver(live):
    """With an exact receiver the error now is that noise alone; a part of it was called the position's share."""
    exact, rough = (Wander(sigma_m, (30.0,), SMOOTH, (0.05, 0.1)) for sigma_m in (0.0, 0.05))
    assert variance_shares(replace(live, wanders=(exact, exact)), 4)["position"] == 0.0
    assert variance_shares(replace(live, wanders=(rough, rough)), 4)["position"] == pytest.approx(0.5 * 0.1**2)


def test_no_share_exceeds_the_targets_variance(live):
    live.by_base = 100.0 * np.ones((3, E + 3))
    assert max(variance_shares(live, 4).values()) <= np.trace(live.own[:2, :2])


def test_target_that_is_not_held_has_no_shares(live):
    assert variance_shares(live, 5) == {}
    assert variance_shares(None, 4) == {}

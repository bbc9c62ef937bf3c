"""Errors that targets share: against the conditional covariance, and against a ray that is turned and moved."""

import numpy as np
import pytest
from estimated_flights import Planted
from simulated_flight import Flight, path

from fwav_companion.estimation.common_errors import common_errors
from fwav_companion.estimation.errors import BODY_SHARED, GIMBAL_HEADING, GIMBAL_SHARED, HEADING, SampleNoise, priors
from fwav_companion.estimation.estimator import Estimator
from fwav_companion.estimation.initiation import begin_target
from tests.estimation.test_variance_shares import LiveStub


def drawn(size, errors_of):
    """A live filter of one target with a covariance drawn at random, and the rows of its errors now."""
    n = size + 3
    root = np.random.default_rng(size).standard_normal((n + 3, n + 3))
    whole = root @ root.T
    live = LiveStub(whole[n:, n:], whole[n:, :n], whole[:n, :n], size=size, error=size)
    live.mean = np.zeros(n)
    rows = np.zeros((3, n))
    for row, columns in enumerate(errors_of):
        rows[row, columns] = 1.0
    return live, rows


@pytest.mark.parametrize(("size", "headings"), [(BODY_SHARED, [HEADING]), (GIMBAL_SHARED, [HEADING, GIMBAL_HEADING])])
def test_columns_explain_what_the_target_would_lose_if_the_errors_were_known(size, headings):
    live, rows = drawn(size, [[size], [size + 1], headings])
    found = common_errors(live, 4)
    b, c = rows @ live.covariance @ rows.T, live.by_base @ rows.T
    known = c @ np.linalg.solve(b, c.T)
    columns = np.array([found.north, found.east]) * found.sigmas
    assert np.allclose(columns @ columns.T, known[:2, :2])
    assert np.allclose(np.square(found.sigmas), np.diag(b))
    height = (live.own - known)[:, 2]
    assert np.allclose(np.array(found.height) * np.sqrt(height[2]), height[:2])


def test_target_that_is_not_held_shares_nothing_known():
    live, _ = drawn(BODY_SHARED, [[BODY_SHARED], [BODY_SHARED + 1], [HEADING]])
    assert common_errors(live, 5) is None
    assert common_errors(None, 4) is None


def test_a_first_sighting_moves_with_the_position_and_turns_with_the_heading():
    """One ray: an error north moves its foot north; a heading that is too large turns it clockwise."""
    planted = Planted(Flight(seconds=3.0, shape="hover", height_m=10.0, targets=((2.0, 3.0),)), height_noise_m=1e-3)
    noise = SampleNoise(attitude_rad=planted.attitude_noise, position_wander_m=1.0)
    known = priors(camera_delay_s=0.0, mount_rad=0.0, heading_rad=0.05, tilt_rad=0.0, height_m=0.0)
    estimator = Estimator(known, noise)
    attitudes, positions = planted.telemetry()
    for t, q in attitudes:
        estimator.add_attitude(t, q)
    for t, p, v in positions:
        estimator.add_position(t, p, v)
    stamp, sighting = planted.frames()[-1]
    assert estimator.begin(stamp)
    estimator.live.predict(stamp)
    assert begin_target(estimator.live, 0, sighting, moving=False)
    found, camera = common_errors(estimator.live, 0), path(planted.flight, np.array([stamp]))[0][0]
    north_m, east_m = 2.0 - camera[0], 3.0 - camera[1]
    assert found.north == pytest.approx((1.0, 0.0, -east_m), abs=0.05)
    assert found.east == pytest.approx((0.0, 1.0, north_m), abs=0.05)
    assert found.sigmas == pytest.approx((1.0, 1.0, 0.05), rel=0.02)

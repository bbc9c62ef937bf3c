"""A path shows the height by its length, beyond what errors of the position imitate."""

from types import SimpleNamespace

import numpy as np
import pytest

from fwav_companion.self_calibration.baseline import Baseline


def shows(positions, drop_m, sigma_m):
    baseline = Baseline()
    for position in positions:
        poses = SimpleNamespace(position_ned=np.array([[position]], float))
        baseline = baseline.with_batch(SimpleNamespace(poses=poses, drop_m=np.array([drop_m])))
    return baseline.shows_height(sigma_m)


@pytest.mark.parametrize(
    ("north_m", "climb_m", "drop_m", "sigma_m", "shown"),
    [
        (3.0, 0.0, 20.0, 1.0, False),  # a hover: what its position wanders by
        (8.0, 0.0, 14.0, 1.0, True),
        (8.0, 0.0, 40.0, 1.0, False),  # 11 degrees of parallax
        (3.0, 0.0, 6.0, 1.0, False),  # half of the height, but a receiver's error may be as much
        (3.0, 0.0, 6.0, 0.3, True),
        (0.0, 5.0, 15.0, 1.0, True),  # heights do not wander
        (0.0, 2.0, 15.0, 1.0, False),
    ],
)
def test_length_over_height_and_over_the_position_error(north_m, climb_m, drop_m, sigma_m, shown):
    path = [(0.0, 0.0, -drop_m), (0.5 * north_m, 0.0, -drop_m), (north_m, 0.0, -drop_m - climb_m)]
    assert shows(path, drop_m, sigma_m) is shown


def test_a_path_that_comes_back_is_as_long_as_its_farthest_point():
    assert shows([(0.0, 0.0, -10.0), (0.0, 6.0, -10.0), (0.0, 0.0, -10.0)], 10.0, 1.0)


def test_without_a_measurement_nothing_is_shown():
    assert not Baseline().shows_height(1.0)

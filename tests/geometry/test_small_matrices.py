"""Algebra of small matrices on plain tuples, compared with numpy."""

from math import inf

import numpy as np
import pytest

from fwav_companion.geometry.small_matrices import squared_distance


def test_squared_distances_are_those_of_numpy():
    rng = np.random.default_rng(1)
    for off, root in zip(rng.normal(size=(20, 2)), rng.normal(size=(20, 2, 2)), strict=True):
        cov = root @ root.T
        found = squared_distance(*off, (cov[0, 0], cov[0, 1], cov[1, 1]))
        assert found == pytest.approx(off @ np.linalg.solve(cov, off), rel=1e-9)


@pytest.mark.parametrize("cov", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (1.0, 2.0, 1.0), (float("nan"), 0.0, 1.0)])
def test_nothing_is_near_by_a_covariance_without_extent(cov):
    assert squared_distance(1.0, 1.0, cov) == inf

"""The claimed radius against scipy's non-central truth and plain sampling."""

import numpy as np
import pytest
from draws import first_of
from scipy.integrate import dblquad
from scipy.stats import chi2

from fwav_companion.geometry.ellipses import circle_radius, radius_95, semi_axes, share_within


def horizontal(larger: float, smaller: float, bearing: float):
    c, s = np.cos(bearing), np.sin(bearing)
    turn = np.array([[c, -s], [s, c]])
    flat = turn @ np.diag([larger**2, smaller**2]) @ turn.T
    return ((flat[0, 0], flat[0, 1], 0.3), (flat[1, 0], flat[1, 1], -0.2), (0.3, -0.2, 9.0))


@pytest.mark.parametrize("share", [0.5, 0.9, 0.95, 0.999])
def test_a_round_covariance_has_rayleighs_radius(share):
    assert circle_radius(horizontal(2.0, 2.0, 0.4), share) == pytest.approx(2.0 * chi2.ppf(share, 2) ** 0.5, rel=1e-9)


@pytest.mark.parametrize("ratio", [1e-6, 0.01, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("share", first_of(0.95, 0.5, 0.999))
def test_an_elongated_one_holds_the_share_by_sampling(ratio, share):
    radius = circle_radius(horizontal(1.0, ratio, -1.1), share)
    cov = np.array(horizontal(1.0, ratio, -1.1))[:2, :2]
    points = np.random.default_rng(3).multivariate_normal([0.0, 0.0], cov, 400_000)
    inside = (np.hypot(*points.T) <= radius).mean()
    assert inside == pytest.approx(share, abs=4.0 * (share * (1 - share) / 400_000) ** 0.5)


def test_the_share_is_that_of_the_integral():
    def density(y, x):
        return np.exp(-0.5 * ((x / 1.5) ** 2 + (y / 0.4) ** 2)) / (2 * np.pi * 1.5 * 0.4)

    expected, _ = dblquad(density, -2.0, 2.0, lambda x: -((4 - x * x) ** 0.5), lambda x: (4 - x * x) ** 0.5)
    assert share_within(2.0, 1.5, 0.4) == pytest.approx(expected, abs=1e-8)


def test_a_line_has_the_radius_of_one_dimension_and_a_point_has_none():
    assert circle_radius(horizontal(1.0, 0.0, 0.7), 0.95) == pytest.approx(1.959964, abs=2e-3)
    assert circle_radius(horizontal(0.0, 0.0, 0.0), 0.95) == 0.0


def test_semi_axes_are_the_eigenvalues():
    larger, smaller, bearing = semi_axes(horizontal(3.0, 0.7, 0.9))
    assert (larger, smaller, bearing) == pytest.approx((3.0, 0.7, 0.9))


@pytest.mark.parametrize("ratio", np.linspace(0.0, 1.0, 47))
def test_the_quick_95_percent_radius_is_the_exact_one_to_a_thousandth(ratio):
    cov = horizontal(1.7, 1.7 * ratio, 0.8)
    assert radius_95(cov) == pytest.approx(circle_radius(cov, 0.95), rel=1.5e-3)


def test_the_quick_95_percent_radius_of_no_covariance():
    assert np.isnan(radius_95(horizontal(float("nan"), 1.0, 0.0)))
    assert np.isnan(radius_95(((np.inf, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))))
    assert radius_95(horizontal(0.0, 0.0, 0.0)) == 0.0

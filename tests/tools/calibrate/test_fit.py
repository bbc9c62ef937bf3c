"""The fit of a chosen lens: corners by the tests' own projection, noise added."""

import numpy as np
import pytest
from drawn_boards import NARROW, PAPER, WIDE, views

from fwav_companion.tools.calibrate.lens_fit.lens_fit import FittedLens, fit_lens
from fwav_companion.tools.calibrate.lens_fit.reprojection import RADIAL, BoardView, project

LENSES = {
    "the paper's": (PAPER, {"reach": 0.42, "share": 0.35}, 2),
    "a pinhole of 30 degrees": (NARROW, {"reach": 0.16, "share": 0.2}, 2),
    "a fisheye of 200 degrees": (WIDE, {"reach": 1.45, "share": 0.7}, 4),
}


def fit(lens, seed=1, count=16, **where):
    seen = [BoardView(*view) for view in views(lens, np.random.default_rng(seed), count, **where)]
    result = fit_lens(seen, lens.size)
    assert isinstance(result, FittedLens), result
    return result


def ray_errors(lens, fitted, angles):
    """(A, 8, 2) pixels by which rays come out elsewhere, in eight directions."""
    phi = np.arange(8) * np.pi / 4
    theta, phi = np.meshgrid(angles, phi, indexing="ij")
    rays = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    pixels, _, _ = project(fitted.lens, rays.reshape(-1, 3))
    return pixels.reshape(*theta.shape, 2) - lens.pixels(rays)


@pytest.mark.parametrize("name", LENSES)
def test_without_noise_the_lens_comes_back(name):
    lens, where, _ = LENSES[name]
    fitted = fit(lens, noise=0.0, **where)
    assert np.abs(ray_errors(lens, fitted, np.linspace(0.01, fitted.accuracy.reached, 9))).max() < 1e-3
    assert fitted.noise_px < 1e-4
    assert not fitted.dropped


@pytest.mark.parametrize("name", LENSES)
def test_with_noise_it_comes_back_within_its_claim(name):
    lens, where, coefficients = LENSES[name]
    fitted = fit(lens, **where)
    truth = np.array([*lens.centre, lens.aspect, *lens.c, 0.0])[: len(fitted.lens)]
    assert fitted.noise_px == pytest.approx(0.1, rel=0.1)
    assert fitted.coefficients in {coefficients, coefficients + 1}  # one in twenty too many
    if fitted.coefficients >= len(lens.c):
        error = fitted.lens - truth
        assert error @ np.linalg.solve(fitted.accuracy.covariance, error) < 26.1  # 99.9 % of chi2 with 8
    miss = np.degrees(np.abs(ray_errors(lens, fitted, np.array([0.5 * fitted.accuracy.reached]))).max() / lens.c[0])
    sigma = np.degrees(fitted.ray_sigmas(np.array([0.5 * fitted.accuracy.reached]))[0][0])
    assert miss < 3.5 * sigma
    assert sigma < 0.3


def test_a_200_degree_lens_is_found_beyond_90():
    fitted = fit(WIDE, count=24, **LENSES["a fisheye of 200 degrees"][1])
    assert 95.0 < np.degrees(fitted.accuracy.reached) <= np.degrees(fitted.accuracy.supported) < 103.0


def test_narrow_pictures_support_few_coefficients_however_many_the_lens_has():
    """Only the middle of a 200 degree lens is shown."""
    lens, where, _ = LENSES["a fisheye of 200 degrees"]
    fitted = fit(lens, **{**where, "reach": 0.2, "share": 0.4})
    assert fitted.coefficients <= 2
    assert np.degrees(fitted.accuracy.reached) < 40.0
    assert np.degrees(fitted.accuracy.supported) < 75.0


def test_what_lies_beyond_the_corners_is_claimed_no_better_than_it_is():
    """Up to the supported angle rays are right to a few of MOST_DRIFT_PX, although no corner was there."""
    lens, where, _ = LENSES["a fisheye of 200 degrees"]
    for seed in range(4):
        fitted = fit(lens, seed, **{**where, "reach": 0.8})
        assert fitted.accuracy.supported > fitted.accuracy.reached
        beyond = np.linspace(fitted.accuracy.reached, fitted.accuracy.supported, 5)
        assert np.abs(ray_errors(lens, fitted, beyond)).max() < 4.0


def test_the_derivatives_are_those_of_the_function():
    rng = np.random.default_rng(5)
    lens, points, h = np.array([320.0, 240.0, 1.01, 300.0, 5.0, -3.0, 0.4]), rng.normal(size=(20, 3)), 1e-6
    _, by_point, by_lens = project(lens, points)
    for k, step in enumerate(h * np.eye(3)):
        tried = (project(lens, points + step)[0] - project(lens, points - step)[0]) / (2.0 * h)
        assert by_point[:, :, k] == pytest.approx(tried, rel=1e-5, abs=1e-4)
    for k, step in enumerate(h * np.eye(len(lens))):
        tried = (project(lens + step, points)[0] - project(lens - step, points)[0]) / (2.0 * h)
        assert by_lens[:, :, k] == pytest.approx(tried, rel=1e-5, abs=1e-4)


def test_a_point_on_the_axis_has_derivatives_too():
    lens = np.array([320.0, 240.0, 1.0, 300.0, 5.0])
    pixels, by_point, by_lens = project(lens, np.array([[0.0, 0.0, 2.0]]))
    assert pixels[0] == pytest.approx([320.0, 240.0])
    assert by_point[0] == pytest.approx(np.array([[150.0, 0.0, 0.0], [0.0, 150.0, 0.0]]), abs=1e-6)
    assert np.isfinite(by_lens).all()
    assert by_lens[0, 0, RADIAL] == pytest.approx(0.0, abs=1e-6)

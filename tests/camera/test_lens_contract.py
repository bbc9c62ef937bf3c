"""Properties of every lens model, one suite for all."""

from math import atan2, hypot, inf, nan, pi

import numpy as np
import pytest
from camera_lenses import LENSES, directions, fractions, ray_at
from hypothesis import given, settings
from hypothesis import strategies as st

from fwav_companion.camera.batch import camera_rays_from_pixels
from fwav_companion.types import Lens, NoRay, Ray, Reason

pytestmark = pytest.mark.parametrize("lens", LENSES.values(), ids=LENSES.keys())
repeatable = settings(derandomize=True, max_examples=60, deadline=None)


def angle_between(a, b):
    return 2.0 * np.arcsin(min(1.0, 0.5 * np.linalg.norm(np.subtract(a, b))))


@repeatable
@given(fraction=fractions, direction=directions)
def test_a_ray_comes_back_from_its_pixel(lens: Lens, fraction, direction):
    ray = ray_at(min(fraction * lens.max_angle, 3.14), direction)

    pixel = lens.pixel_from_camera_point(ray)
    back = lens.camera_ray_from_pixel(*pixel)

    assert angle_between(ray, back) <= 1e-9
    assert hypot(*back) == pytest.approx(1.0, abs=1e-12)


@repeatable
@given(across=st.floats(0.0, 1.0), down=st.floats(0.0, 1.0))
def test_a_pixel_of_the_image_comes_back_from_its_ray_or_is_refused(lens: Lens, across, down):
    width, height = lens.image_size
    u, v = across * width - 0.5, down * height - 0.5

    ray = lens.camera_ray_from_pixel(u, v)

    if isinstance(ray, NoRay):
        assert ray.reason is Reason.OUTSIDE_LENS
    else:
        assert lens.pixel_from_camera_point(ray) == pytest.approx((u, v), abs=1e-9)
        assert atan2(hypot(ray[0], ray[1]), ray[2]) <= lens.max_angle + 2e-9


@repeatable
@given(fraction=fractions, direction=directions, length=st.sampled_from([1e-6, 0.3, 1.0, 1e7]))
def test_a_pixel_does_not_depend_on_how_far_the_point_is(lens: Lens, fraction, direction, length):
    ray = ray_at(0.999 * fraction * min(lens.max_angle, 3.1), direction)

    near = lens.pixel_from_camera_point(ray)
    far = lens.pixel_from_camera_point(tuple(length * x for x in ray))

    assert far == pytest.approx(near, abs=1e-9)


@repeatable
@given(excess=st.floats(1e-6, 1.0), direction=directions)
def test_what_lies_beyond_the_valid_range_is_refused(lens: Lens, excess, direction):
    angle = lens.max_angle + excess * (pi - lens.max_angle)
    if angle <= lens.max_angle:  # a lens that sees the whole sphere
        return

    assert lens.pixel_from_camera_point(ray_at(angle, direction)) == NoRay(Reason.OUTSIDE_LENS)


@pytest.mark.parametrize("bad", [nan, inf, -inf, 1e300, -1e300])
def test_what_is_no_pixel_has_no_ray(lens: Lens, bad):
    for u, v in ((bad, 10.0), (10.0, bad), (bad, bad)):
        assert isinstance(lens.camera_ray_from_pixel(u, v), NoRay)
        assert isinstance(lens.camera_ray_and_derivatives_from_pixel(u, v), NoRay)


@pytest.mark.parametrize("point", [(0.0, 0.0, 0.0), (nan, 0.0, 1.0), (0.0, 0.0, inf), (inf, inf, inf), (0.0, nan, nan)])
def test_what_is_no_point_has_no_pixel(lens: Lens, point):
    assert isinstance(lens.pixel_from_camera_point(point), NoRay)


def test_straight_behind_is_nowhere_in_the_image(lens: Lens):
    assert isinstance(lens.pixel_from_camera_point((0.0, 0.0, -1.0)), NoRay)


@repeatable
@given(fraction=st.one_of(st.floats(0.0, 0.98), st.just(0.0)), direction=directions)
def test_derivatives_of_the_ray_agree_with_differences(lens: Lens, fraction, direction):
    u, v = lens.pixel_from_camera_point(ray_at(fraction * lens.max_angle, direction))
    h = 1e-4

    found = lens.camera_ray_and_derivatives_from_pixel(u, v)

    assert isinstance(found, Ray)
    assert found.direction == lens.camera_ray_from_pixel(u, v)
    by_u = np.subtract(lens.camera_ray_from_pixel(u + h, v), lens.camera_ray_from_pixel(u - h, v)) / (2 * h)
    by_v = np.subtract(lens.camera_ray_from_pixel(u, v + h), lens.camera_ray_from_pixel(u, v - h)) / (2 * h)
    assert found.d_du == pytest.approx(by_u, rel=1e-5, abs=1e-8)
    assert found.d_dv == pytest.approx(by_v, rel=1e-5, abs=1e-8)


def test_many_at_once_are_each_as_one(lens: Lens):
    rng = np.random.default_rng(5)
    width, height = lens.image_size
    pixels = rng.uniform((-20.0, -20.0), (width + 20.0, height + 20.0), (500, 2))
    pixels[:3] = (lens.principal_point, (nan, 3.0), (inf, 3.0))

    rays, seen = camera_rays_from_pixels(lens, pixels)

    for pixel, ray, ok in zip(pixels, rays, seen, strict=True):
        one = lens.camera_ray_from_pixel(*pixel)
        assert ok == (not isinstance(one, NoRay))
        if ok:
            assert angle_between(ray, one) <= 1e-7
            assert lens.pixel_from_camera_point(tuple(7.0 * ray)) == pytest.approx(tuple(pixel), abs=1e-6)
        else:
            assert np.isnan(ray).all()

"""The inverse lens against bisection in 60-digit decimals, independent of our code."""

from decimal import Decimal, getcontext
from math import atan2, cos, hypot, pi, sin

import pytest
from camera_lenses import LENSES

from fwav_companion.camera import KannalaBrandt
from fwav_companion.camera.radial_polynomial import first_not_positive

FISHEYES = {name: lens for name, lens in LENSES.items() if isinstance(lens, KannalaBrandt) and not lens.skew}


def angle_by_bisection(k, radius: float, end: float) -> float:
    getcontext().prec = 60
    coefficients, goal = [Decimal(x) for x in k], Decimal(radius)
    low, high = Decimal(0), Decimal(end)
    for _ in range(120):
        middle = (low + high) / 2
        r = sum(c * middle ** (2 * i + 1) for i, c in enumerate(coefficients))
        low, high = (middle, high) if r < goal else (low, middle)
    return float(low)


@pytest.mark.parametrize("lens", FISHEYES.values(), ids=FISHEYES.keys())
def test_the_angle_of_a_pixel(lens: KannalaBrandt):
    (u0, v0), (m_u, m_v) = lens.principal_point, lens.pixels_per_mm
    for i in range(1, 60):
        radius, direction = lens.largest_radius * (i / 60.0), 2.4 * i
        u, v = u0 + m_u * radius * cos(direction), v0 + m_v * radius * sin(direction)
        exact = angle_by_bisection(lens.k_mm, hypot((u - u0) / m_u, (v - v0) / m_v), lens.largest_angle)

        x, y, z = lens.camera_ray_from_pixel(u, v)

        assert abs(atan2(hypot(x, y), z) - exact) < 1e-12


def test_the_range_ends_at_the_fold():
    """R' = 1 - 0.3 theta^2 is zero at sqrt(1 / 0.3)."""
    assert LENSES["folds inside the image"].max_angle == pytest.approx((1.0 / 0.3) ** 0.5, abs=2e-6)


@pytest.mark.parametrize(
    ("coefficients", "end", "expected"),
    [
        ((1.0,), 10.0, None),
        ((1.0, -1.0), 10.0, 1.0),
        ((1.0, -1.0), 0.5, None),
        ((-1.0, 1.0), 10.0, 0.0),
        ((4.0, -4.0, 1.0), 10.0, 2.0),  # touches zero and rises again
        ((4.0000001, -4.0, 1.0), 10.0, None),
        ((6.0, -11.0, 6.0, -1.0), 10.0, 1.0),  # three roots: the first
        ((0.24, -1.0, 1.0), 10.0, 0.4),  # two roots close together
    ],
)
def test_the_first_place_where_a_polynomial_is_not_positive(coefficients, end, expected):
    found = first_not_positive(coefficients, end)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-6))


def test_the_gauge_of_millimetres_does_not_matter():
    """Ten times the millimetres and a tenth of the pixels per millimetre are the same lens."""
    one = KannalaBrandt((3.55, 0.03), (188.0, 188.0), (320.0, 240.0), (640, 480))
    other = KannalaBrandt((35.5, 0.3), (18.8, 18.8), (320.0, 240.0), (640, 480))

    assert other.max_angle == pytest.approx(one.max_angle, abs=1e-12)
    assert other.camera_ray_from_pixel(100.0, 50.0) == pytest.approx(one.camera_ray_from_pixel(100.0, 50.0), abs=1e-13)


@pytest.mark.parametrize(
    ("k", "per_mm", "angle"),
    [
        ((0.0,), (1.0, 1.0), None),
        ((1.0,), (0.0, 1.0), None),
        ((1.0,), (1.0, 1.0), 4.0),
        ((float("nan"),), (1.0, 1.0), pi),
    ],
)
def test_numbers_that_are_no_lens_are_refused(k, per_mm, angle):
    with pytest.raises(ValueError, match="must"):
        KannalaBrandt(k, per_mm, (5.0, 5.0), (10, 10), max_angle=angle)

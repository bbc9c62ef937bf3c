"""The paper's single angle comes out of the full geometry as a special case, in our axes and through its own."""

from math import atan2, cos, hypot, pi, radians, sin, tan

import pytest
from paper_axes import (
    camera_ray_from_paper,
    ned_from_paper_point,
    paper_from_camera_ray,
    paper_point_from_ned,
    pixel_from_paper_pixel,
)
from true_flights import PRIORS

from fwav_companion.camera import KannalaBrandt
from fwav_companion.geometry.mounts import body_from_camera_from_euler
from fwav_companion.geometry.rotations import matrix_from_quaternion, quaternion_from_euler
from fwav_companion.geometry.vectors import multiply
from fwav_companion.localization import FixedGround, HomeGround, Localizer
from fwav_companion.types import Detection, Sighting, VehicleState

LENS = KannalaBrandt((3.55, 0.03, 0.0, 0.0, 0.0), (188.0, 188.0), (320.0, 240.0), (640, 480))
LEFT, RIGHT = (136.374666982652, 412.828664814575), (503.625333017348, 412.828664814575)
PAPERS_OWN_PIXEL = (147.17133518542525, 423.6253330173481)


def sighting(pixel, *, relative=True, pitch_deg=37.0) -> Sighting:
    q = quaternion_from_euler(0.0, radians(pitch_deg), 0.0)
    mount = body_from_camera_from_euler(0.0, radians(-90.0), 0.0)
    state = VehicleState(0, q, (0.0, 0.0, 0.0), 0.0, 0.0, None, None, 0.0, 10.0)
    ray = LENS.camera_ray_and_derivatives_from_pixel(*pixel)
    ned_from_camera = multiply(matrix_from_quaternion(q), mount)
    camera = (0.0, 0.0, 0.0) if relative else (0.0, 0.0, -10.0)
    return Sighting(
        0, 0, 0, 0, Detection(*pixel), ray, (4.0, 4.0), 0.0, 0.0, state, mount, ned_from_camera, camera, 10.0, relative
    )


@pytest.mark.parametrize("relative", [True, False])
@pytest.mark.parametrize("ground", [HomeGround(), FixedGround(10.0)], ids=["home", "fixed"])
@pytest.mark.parametrize(("pixel", "north", "east"), [(LEFT, 4.0, -3.0), (RIGHT, 4.0, 3.0)])
def test_four_metres_ahead_and_three_aside(relative, ground, pixel, north, east):
    fix = Localizer(ground, PRIORS, min_height_m=0.5).locate(sighting(pixel, relative=relative))

    assert fix.position_ned == pytest.approx((north, east, 0.0), abs=1e-9)


def papers_point(u: float, v: float, beta: float, h: float) -> tuple[float, float]:
    """The paper's equations (8) to (20) with atan2 for its arccos and arctan, its inverse of r by bisection."""
    x, y = (u - 320.0) / 188.0, (v - 240.0) / 188.0
    low, high = 0.0, 1.5
    for _ in range(200):
        theta = 0.5 * (low + high)
        low, high = (theta, high) if 3.55 * theta + 0.03 * theta**3 < hypot(x, y) else (low, theta)
    phi = atan2(y, x)
    xc, yc, zc = sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)
    xw, yw, zw = xc * cos(beta) + zc * sin(beta), yc, -xc * sin(beta) + zc * cos(beta)
    theta_w, phi_w = atan2(hypot(xw, yw), zw), atan2(yw, xw)
    return h * tan(theta_w) * cos(phi_w), h * tan(theta_w) * sin(phi_w)


def test_the_papers_own_equations_agree_through_the_adapter():
    forward, left = papers_point(*PAPERS_OWN_PIXEL, radians(37.0), 10.0)
    pixel = pixel_from_paper_pixel(*PAPERS_OWN_PIXEL, (320.0, 240.0), (188.0, 188.0))
    fix = Localizer(HomeGround(), PRIORS, min_height_m=0.5).locate(sighting(pixel))

    assert (forward, left) == pytest.approx((4.0, 3.0), abs=1e-9)
    assert pixel == pytest.approx(LEFT, abs=1e-9)
    assert paper_point_from_ned(*fix.position_ned[:2], 0.0) == pytest.approx((forward, left), abs=1e-9)


def test_the_papers_axes_and_back():
    assert camera_ray_from_paper((1.0, 2.0, 3.0)) == (-2.0, -1.0, 3.0)
    assert paper_from_camera_ray(camera_ray_from_paper((1.0, 2.0, 3.0))) == (1.0, 2.0, 3.0)
    assert ned_from_paper_point(4.0, 3.0, 0.0) == pytest.approx((4.0, -3.0))
    assert ned_from_paper_point(4.0, 3.0, pi / 2) == pytest.approx((3.0, 4.0))  # eastward: its left is north
    assert paper_point_from_ned(*ned_from_paper_point(4.0, 3.0, 1.1), 1.1) == pytest.approx((4.0, 3.0))

"""The mock's own geometry against three independent implementations."""

import cv2
import numpy as np
import pymap3d
import pytest
from scipy.spatial.transform import Rotation

from sitl_mock.earth import ARDUPILOT_SPHERE_M, PX4_SPHERE_M, ArduPilotProjection, Place, Px4Projection, World
from sitl_mock.lens import Lens
from sitl_mock.options import CameraOptions
from sitl_mock.rotation import (
    apply,
    apply_transposed,
    body_rates,
    matrix_from_euler,
    matrix_from_rotation_vector,
    quaternion_from_euler,
    times,
)

ORIGINS = [Place(48.1, 11.5, 519.0), Place(-54.6, 179.9999, 20.0), Place(78.2, -15.0, 0.0), Place(0.0, 0.0, 100.0)]
RNG = np.random.default_rng(7)
ANGLES = RNG.uniform(-1.5, 1.5, (20, 3))


@pytest.mark.parametrize("euler", [tuple(map(float, row)) for row in ANGLES])
def test_rotations_are_scipy_s(euler):
    theirs = Rotation.from_euler("ZYX", euler[::-1])
    np.testing.assert_allclose(matrix_from_euler(*euler), theirs.as_matrix(), atol=1e-14)
    w, x, y, z = quaternion_from_euler(*euler)
    assert (Rotation.from_quat([x, y, z, w]) * theirs.inv()).magnitude() < 1e-14
    np.testing.assert_allclose(matrix_from_rotation_vector(euler), Rotation.from_rotvec(euler).as_matrix(), atol=1e-14)
    vector = (1.0, -2.0, 0.5)
    np.testing.assert_allclose(apply(matrix_from_euler(*euler), vector), theirs.apply(vector), atol=1e-14)
    np.testing.assert_allclose(
        apply_transposed(matrix_from_euler(*euler), vector), theirs.inv().apply(vector), atol=1e-14
    )
    square = times(matrix_from_euler(*euler), matrix_from_euler(*euler))
    np.testing.assert_allclose(square, (theirs * theirs).as_matrix(), atol=1e-14)


def test_body_rates_are_what_a_small_turn_in_the_body_is():
    euler, rates, dt = np.array([0.3, 0.6, -1.2]), np.array([0.4, -1.1, 0.7]), 1e-6
    before = Rotation.from_euler("ZYX", (euler - rates * dt / 2)[::-1])
    after = Rotation.from_euler("ZYX", (euler + rates * dt / 2)[::-1])
    turned = (before.inv() * after).as_rotvec() / dt
    np.testing.assert_allclose(body_rates(euler[0], euler[1], *rates), turned, atol=1e-8)


@pytest.mark.parametrize("origin", ORIGINS)
@pytest.mark.parametrize("ned", [(0.0, 0.0, 0.0), (40.0, -25.0, -12.0), (3000.0, 4000.0, -300.0)])
def test_the_world_is_pymap3d_s_tangent_plane(origin, ned):
    world = World(origin)
    place = world.place(ned)
    theirs = pymap3d.geodetic2ned(place.lat, place.lon, origin.alt_amsl, origin.lat, origin.lon, origin.alt_amsl)
    np.testing.assert_allclose(world.ned(place)[:2], theirs[:2], atol=1e-6)
    np.testing.assert_allclose(world.ned(place), ned, atol=1e-6)
    assert place.alt_amsl == origin.alt_amsl - ned[2]


@pytest.mark.parametrize("origin", ORIGINS[:3])
@pytest.mark.parametrize(
    ("projection", "radius"), [(ArduPilotProjection, ARDUPILOT_SPHERE_M), (Px4Projection, PX4_SPHERE_M)]
)
def test_local_frames_lie_on_a_sphere_and_round_trip(origin, projection, radius):
    local = projection(origin)
    for xyz in [(0.0, 0.0, 0.0), (500.0, -300.0, -40.0), (-20.0, 35.0, 2.0)]:
        np.testing.assert_allclose(local.local(local.place(xyz)), xyz, atol=2e-3)
    one_north = local.local(Place(origin.lat + 0.01, origin.lon, origin.alt_amsl))
    assert one_north[0] == pytest.approx(np.radians(0.01) * radius, rel=1e-6)


def test_a_sphere_is_not_the_ellipsoid():
    """The difference that a companion must not hide: metres in a kilometre of north."""
    origin = Place(0.0, 10.0, 0.0)
    place = World(origin).place((1000.0, 0.0, 0.0))
    assert 6.0 < ArduPilotProjection(origin).local(place)[0] - 1000.0 < 7.5


def test_the_lens_is_opencv_s_fisheye_inside_80_degrees():
    options = CameraOptions(k_mm=(3.55, 0.03, -0.01, 0.002, -0.0005), max_angle_deg=90.0)
    lens, k = Lens(options), options.k_mm
    theta, phi = RNG.uniform(0.0, np.radians(80.0), 200), RNG.uniform(-np.pi, np.pi, 200)
    points = np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=1) * 7.0
    f = 188.0 * k[0]
    K = np.array([[f, 0.0, 320.0], [0.0, f, 240.0], [0.0, 0.0, 1.0]])
    theirs, _ = cv2.fisheye.projectPoints(points[None], np.zeros(3), np.zeros(3), K, np.array(k[1:]) / k[0])
    np.testing.assert_allclose([lens.pixel(tuple(p)) for p in points], theirs[0], atol=1e-9)


def test_the_lens_knows_its_edge():
    lens = Lens(CameraOptions(max_angle_deg=75.0))
    assert not np.isfinite(lens.pixel((1.0, 0.0, 0.0))[0])
    assert not np.isfinite(lens.pixel((0.0, 0.0, -1.0))[0])
    assert lens.pixel((0.0, 0.0, 1.0)) == (320.0, 240.0)
    assert lens.sees(-0.5, -0.5)
    assert not lens.sees(639.5, 0.0)

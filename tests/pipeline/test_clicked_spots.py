"""Clicked spots: predicted pixels and Jacobians of a pinhole camera, by its textbook formulas."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from pinhole_camera import FOCAL_PX, LOOKS_DOWN, MS, Camera, Pinhole

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.pairing import CameraView
from fwav_companion.pipeline.clicked_spots import MOST_SPOTS, ClickedSpots, spot_view
from fwav_companion.types.spots import CLICK_LABEL, FollowSpot, ReleaseSpot


def frame(number, at_ms):
    return SimpleNamespace(picture=number, at=at_ms * MS)


@pytest.fixture
def spots():
    made = ClickedSpots(Camera())
    for number in range(10):
        made.on_picture(frame(number, 100 * number))
    return made


def test_the_order_names_the_picture_that_was_clicked_on_and_its_pixel(spots):
    assert spots.follow((400.0, 100.0), HostNs(330 * MS), 5.0) == 1
    (order,) = spots.take_orders()
    assert isinstance(order, FollowSpot)
    assert (order.spot, order.picture, order.view.at) == (1, 3, (400.0, 100.0))
    assert order.view.pixel_from_ground == pytest.approx((0.0, 50.0, -50.0, 0.0), abs=1e-6)
    assert not spots.has_orders


def test_the_prediction_moves_with_the_vehicle(spots):
    """After 0.2 s and 1 m of flight the spot is 50 pixels further down."""
    spots.follow((400.0, 100.0), HostNs(300 * MS), 5.0)
    views = spots.views(frame(11, 500))
    assert views.picture == 11
    assert views.views[1].at == pytest.approx((400.0, 150.0))
    assert views.views[1].reach_px > 3.0 * 0.1 * 50.0
    assert spots.views(frame(12, 3000)).views == {}, "outside the picture"


def test_a_smaller_picture_gets_its_own_pixels():
    camera = Camera()
    camera.scale = 2.0  # of a picture of 320 x 240
    spots = ClickedSpots(camera)
    spots.on_picture(frame(0, 300))
    spots.follow((400.0, 100.0), HostNs(300 * MS), 5.0)
    (order,) = spots.take_orders()
    assert order.view.at == pytest.approx((199.75, 49.75))
    assert order.view.pixel_from_ground == pytest.approx((0.0, 25.0, -25.0, 0.0), abs=1e-6)


def test_a_click_of_another_time_is_no_order(spots):
    assert spots.follow((400.0, 100.0), HostNs(1500 * MS), 5.0) is None
    assert not spots.has_orders


def track(number, spot, place=(1.0, 2.0, 0.0)):
    detection = SimpleNamespace(detector_id=spot)
    fix = SimpleNamespace(sighting=SimpleNamespace(detection=detection))
    cov = ((0.04, 0.0, 0.0), (0.0, 0.04, 0.0), (0.0, 0.0, 0.04))
    return SimpleNamespace(id=number, label=CLICK_LABEL, fix=fix, apparent_ned=place, relative_cov=cov)


def test_the_track_of_a_spot_predicts_it_and_its_end_widens_the_search(spots):
    spots.follow((320.0, 240.0), HostNs(300 * MS), 5.0)
    spots.take_orders()
    spots.on_tracks([track(8, 1, place=(2.5, 1.0, 0.0))])
    assert spots.views(frame(20, 500)).views[1].at == pytest.approx((370.0, 240.0))
    reach_px = spots.views(frame(20, 500)).views[1].reach_px
    spots.on_tracks([])
    assert not spots.has_orders
    assert spots.views(frame(20, 500)).views[1].reach_px > reach_px + 3.0 * 0.2 * 50.0


def test_the_number_of_spots_is_bounded_and_stop_releases_all(spots):
    for _ in range(MOST_SPOTS + 2):
        spots.follow((320.0, 240.0), HostNs(300 * MS), 5.0)
    orders = spots.take_orders()
    assert [order.spot for order in orders if isinstance(order, ReleaseSpot)] == [1, 2]
    spots.on_refused(6)
    spots.release_all()
    assert [order.spot for order in spots.take_orders()] == [3, 4, 5]


def test_the_jacobian_of_a_tilted_camera_is_that_of_differences_in_numpy():
    from scipy.spatial.transform import Rotation

    down = np.array(LOOKS_DOWN)
    tilted = Rotation.from_euler("xyz", (0.3, -0.4, 0.7)).as_matrix() @ down
    camera = CameraView(Pinhole(), tuple(map(tuple, tilted)), (1.0, -2.0, -12.0))
    place = np.array([1.0, -2.0, -12.0]) + tilted @ (np.array([0.1, -0.05, 1.0]) * 13.0)

    def pixel(ned):
        x, y, z = tilted.T @ (ned - np.array([1.0, -2.0, -12.0]))
        return np.array([320.0 + FOCAL_PX * x / z, 240.0 + FOCAL_PX * y / z])

    seen = spot_view(camera, tuple(place), 0.0)
    assert seen is not None
    step = 1e-4
    columns = [(pixel(place + step * axis) - pixel(place - step * axis)) / (2 * step) for axis in np.eye(3)[:2]]
    assert np.reshape(seen.pixel_from_ground, (2, 2)) == pytest.approx(np.transpose(columns), rel=0.02, abs=0.5)

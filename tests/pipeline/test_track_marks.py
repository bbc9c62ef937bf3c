"""Tracks in a picture of the preview: pixels and ellipses of a pinhole camera, by its textbook formulas."""

from __future__ import annotations

from types import SimpleNamespace

import pytest
from pinhole_camera import MS, Camera

from fwav_companion.pipeline.track_marks import track_marks
from fwav_companion.types import TrackState

COV = ((0.04, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.5))
"""0.2 m north and 0.1 m east, one sigma."""


def track(number, north, east, state=TrackState.CONFIRMED):
    return SimpleNamespace(
        id=number, label="tag36h11:0", state=state, apparent_ned=(north, east, 0.0), relative_cov=COV
    )


def frame(at_ms):
    return SimpleNamespace(picture=5, at=at_ms * MS)


def test_a_track_is_where_the_camera_sees_it_with_its_ellipse():
    """10 m below: 50 px a metre; north is up."""
    seen = track(1, 1.0, 2.0)
    answer = track_marks(Camera(), frame(0), [seen], seen)
    (mark,) = answer.marks
    assert answer.picture == 5
    assert mark.at == pytest.approx((420.0, 190.0))
    assert mark.cov == pytest.approx((25.0, 0.0, 100.0))
    assert (mark.track, mark.label, mark.state, mark.selected) == (1, "tag36h11:0", "confirmed", True)


def test_the_mark_follows_the_flight_and_leaves_with_the_picture():
    seen = track(1, 1.0, 2.0, TrackState.COASTING)
    (mark,) = track_marks(Camera(), frame(200), [seen], None).marks
    assert mark.at == pytest.approx((420.0, 240.0))
    assert (mark.state, mark.selected) == ("coasting", False)
    assert track_marks(Camera(), frame(5000), [seen], seen).marks == ()


def test_the_selected_track_is_there_however_many_there_are():
    tracks = [track(number, 0.01 * number, 0.0) for number in range(100)]
    marks = track_marks(Camera(), frame(0), tracks, tracks[99]).marks
    assert marks[0].track == 99
    assert len(marks) == 32


def test_a_picture_of_half_the_size_gets_its_own_pixels():
    camera = Camera()
    camera.scale = 2.0
    (mark,) = track_marks(camera, frame(0), [track(1, 0.0, 2.0)], None).marks
    assert mark.at == pytest.approx(((420.0 + 0.5) / 2 - 0.5, (240.0 + 0.5) / 2 - 0.5))
    assert mark.cov == pytest.approx((6.25, 0.0, 25.0))


def test_without_a_clock_nothing_is_marked():
    camera = Camera()
    camera.picture_rows = lambda _frame: None
    assert track_marks(camera, frame(0), [track(1, 0.0, 2.0)], None).marks == ()

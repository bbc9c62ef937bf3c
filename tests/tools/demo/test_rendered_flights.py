"""The demonstration's statistics on one short flight: the same pictures, detector and pipeline in invented time.

``python tests/support/rendered_flights.py --seeds 20`` is the whole of it: 100 tags, all found, 89 % within the claimed
95 % radius, which is 1.5 times the RMS error.
"""

import pytest
from rendered_flights import results

from fwav_companion.pairing.anchors import marker_centre
from fwav_companion.types import Frame
from fwav_companion.vision.wire import parse_frame

pytestmark = pytest.mark.slow


def test_every_tag_that_was_readable_is_found_where_it_was_claimed(flight):
    everything = list(results(*flight))
    due = [each for each in everything if each.usable_frames >= 10]
    assert len(due) >= 2
    assert all(each.found for each in due)
    assert not any(each.beyond999 for each in everything)
    assert all(1.5 < each.claimed95_m < 4.0 for each in everything if each.found)


def test_what_was_seen_was_used(flight):
    companion, _ = flight
    summary = companion.lines[-1]
    assert summary.fixes > 20
    assert set(summary.dropped) <= {"no_clock"}


def test_the_detector_places_tags_as_surely_as_it_claims(flight):
    """The centre is the one that pairing takes: where the diagonals cross in space, not in the lens's image."""
    companion, _ = flight
    squares = []
    for line in companion.detections.splitlines():
        frame = parse_frame(line, None, companion.wall_clock)
        if not isinstance(frame, Frame):
            continue
        true = {f"tag36h11:{view.tag_id}": view.pixel for view in companion.eye.views(frame.number)}
        for found in frame.detections:
            assert found.sigma is not None
            (u, v), (centre_u, centre_v) = true[found.label], marker_centre(found, companion.calibration.lens)
            squares.append(((centre_u - u) ** 2 + (centre_v - v) ** 2) / (2 * found.sigma[0] ** 2))
    assert len(squares) > 20
    assert 0.2 < sum(squares) / len(squares) < 1.5

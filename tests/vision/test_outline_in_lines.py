"""Outline and foot of a detection survive the line, the recording and the scale; what is no outline is ignored."""

import json

import pytest

from fwav_companion.pairing.placement import Scaling
from fwav_companion.vision.frame_receiver import read_clocks
from fwav_companion.vision.wall_clock import WallClock
from fwav_companion.vision.wire import encode_frame, parse_frame

OUTLINE = [[10.0, 20.0], [30.0, 21.0], [29.0, 40.0]]
FOOT = [19.0, 39.5]


def parsed(**fields):
    arrival_ns, unix_ns = read_clocks()
    detection = {"u": 20.0, "v": 30.0, **fields}
    line = json.dumps({"time_unix": unix_ns / 1e9, "detections": [detection]})
    return parse_frame(line, arrival_ns, WallClock(arrival_ns, unix_ns))


def test_outline_and_foot_are_read_recorded_and_read_again():
    frame = parsed(outline=OUTLINE, foot=FOOT)
    (detection,) = frame.detections
    assert detection.outline == tuple(map(tuple, OUTLINE))
    assert detection.foot == tuple(FOOT)
    recorded = json.loads(encode_frame(frame, 0))["detections"][0]
    assert (recorded["outline"], recorded["foot"]) == (OUTLINE, FOOT)
    assert "outline" not in json.loads(encode_frame(parsed(), 0))["detections"][0]


def test_outline_and_foot_are_scaled_about_the_edge_of_the_image():
    (detection,) = parsed(outline=OUTLINE, foot=FOOT).detections
    scaled = Scaling(2.0, 3.0).detection(detection)
    assert scaled.outline == tuple((2.0 * (u + 0.5) - 0.5, 3.0 * (v + 0.5) - 0.5) for u, v in OUTLINE)
    assert scaled.foot == (38.5, 119.5)


@pytest.mark.parametrize("outline", [[[1.0, 2.0]], "x", 7, [[0.0, 0.0]] * 17, [[1.0], [2.0], [3.0]], {"a": 1}])
def test_what_is_no_outline_is_another_programs_field(outline):
    (detection,) = parsed(outline=outline, foot="left").detections
    assert (detection.outline, detection.foot, detection.u) == (None, None, 20.0)

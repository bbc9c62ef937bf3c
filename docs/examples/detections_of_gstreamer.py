"""Sends what a detector finds in a GStreamer pipeline: ``python detections_of_gstreamer.py "v4l2src"``.

Any source that stamps its buffers at the capture, as v4l2src and libcamerasrc do. ``find`` is yours to replace.
"""

import json
import socket
import sys
from itertools import count

import cv2
import gi
import numpy as np

gi.require_version("Gst", "1.0")
from gi.repository import Gst  # noqa: E402

COMPANION = ("127.0.0.1", 14601)
REST = "videoconvert ! video/x-raw,format=BGR ! appsink name=pictures max-buffers=1 drop=true"
LEAST_LEVEL, LEAST_PIXELS = 240, 9


def find(picture):
    """(left, top, width, height), label and score of each thing, in edges of pixels: here bright lamps."""
    bright = cv2.inRange(picture, (LEAST_LEVEL,) * 3, (255,) * 3)
    _, _, things, _ = cv2.connectedComponentsWithStats(bright)
    return [(row[:4], "lamp", 1.0) for row in things[1:].tolist() if row[4] >= LEAST_PIXELS]


def detection(box, label, score):
    """A thing as the companion takes it; pixels count from their centres there."""
    left, top, width, height = (float(side) for side in box)
    edges = [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5]
    u, v = (edges[0] + edges[2]) / 2, (edges[1] + edges[3]) / 2
    return {"u": u, "v": v, "label": label, "score": min(1.0, score), "box": edges}


def frames(source, pictures=None):
    """Frames as the companion takes them. A buffer's time counts from the pipeline's start, on CLOCK_MONOTONIC."""
    Gst.init(None)
    pipeline = Gst.parse_launch(f"{source} ! {REST}")
    pipeline.set_state(Gst.State.PLAYING)
    sink = pipeline.get_by_name("pictures")
    for number in count() if pictures is None else range(pictures):
        sample = sink.emit("pull-sample")
        if sample is None:  # the end of the stream
            return
        buffer, shape = sample.get_buffer(), sample.get_caps().get_structure(0)
        width, height = shape.get_value("width"), shape.get_value("height")
        data = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8)
        rows = data.reshape(height, -1)[:, : 3 * width]  # rows are padded to four bytes
        yield {
            "time_monotonic": (pipeline.get_base_time() + buffer.pts) / 1e9,
            "frame": number,
            "size": [width, height],
            "detections": [detection(*each) for each in find(np.ascontiguousarray(rows).reshape(height, width, 3))],
        }


if __name__ == "__main__":
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as companion:
        for frame in frames(sys.argv[1]):
            companion.sendto(json.dumps(frame).encode(), COMPANION)

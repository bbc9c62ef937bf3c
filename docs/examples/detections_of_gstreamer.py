"""Sends what a detector finds in a GStreamer pipeline: ``python detections_of_gstreamer.py "v4l2src"``.

Any source that stamps its buffers at the capture, as v4l2src and libcamerasrc do. ``find`` is yours to replace.
"""

import json
import socket
import sys

import cv2
import numpy as np
from gi.repository import Gst

COMPANION = ("127.0.0.1", 14601)
REST = "videoconvert ! video/x-raw,format=BGR ! appsink name=pictures max-buffers=1 drop=true"


def find(picture):
    """Detections: here lamps, by their middles and boxes. Pixels count from their centres, so edges are half less."""
    _, _, things, _ = cv2.connectedComponentsWithStats(cv2.inRange(picture, (240, 240, 240), (255, 255, 255)))
    for left, top, width, height, _ in things[1:].tolist():
        box = [left - 0.5, top - 0.5, left + width - 0.5, top + height - 0.5]
        yield {"u": (box[0] + box[2]) / 2, "v": (box[1] + box[3]) / 2, "label": "lamp", "score": 1.0, "box": box}


def frames(source):
    """Frames as the companion takes them. A buffer's time counts from the pipeline's start, on CLOCK_MONOTONIC."""
    Gst.init(None)
    pipeline = Gst.parse_launch(f"{source} ! {REST}")
    pipeline.set_state(Gst.State.PLAYING)
    while sample := pipeline.get_by_name("pictures").emit("pull-sample"):  # none: the end of the stream
        buffer, shape = sample.get_buffer(), sample.get_caps().get_structure(0)
        width, height = shape.get_value("width"), shape.get_value("height")
        rows = np.frombuffer(buffer.extract_dup(0, buffer.get_size()), np.uint8).reshape(height, -1)
        picture = np.ascontiguousarray(rows[:, : 3 * width]).reshape(height, width, 3)  # rows are padded to four bytes
        time = {"time_monotonic": (pipeline.get_base_time() + buffer.pts) / 1e9}
        yield {**time, "size": [width, height], "detections": list(find(picture))}


if __name__ == "__main__":
    companion = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    for frame in frames(sys.argv[1]):
        companion.sendto(json.dumps(frame).encode(), COMPANION)

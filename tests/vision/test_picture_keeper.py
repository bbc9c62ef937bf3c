"""Which pictures are kept, and that they reach the daemon as JPEG without delaying the detector."""

import json
import os
import threading

import cv2
import numpy as np
import pytest

from fwav_companion.vision.images import Picture
from fwav_companion.vision.picture_keeper import MOST_WAITING, PictureKeeper
from fwav_companion.vision.task import KEPT_PICTURE

FOUND = [{"u": 1.0, "v": 2.0, "label": "a"}]


class DaemonSide:
    """Receives pictures: (frame of the wire format, decoded picture)."""

    def __init__(self):
        self.got, self.changed = [], threading.Condition()

    def send(self, message, descriptor):
        data = os.pread(descriptor, 1 << 22, 0)
        assert message.startswith(KEPT_PICTURE)
        pixels = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
        with self.changed:
            self.got.append((json.loads(message[len(KEPT_PICTURE) : -1]), pixels))
            self.changed.notify_all()

    def wait_for(self, count):
        with self.changed:
            assert self.changed.wait_for(lambda: len(self.got) >= count, 20.0)


def picture(number):
    return Picture(np.full((48, 64), 10 * number, np.uint8), {"time_monotonic": float(number)}, number, 0.004)


@pytest.mark.parametrize(
    ("rule", "numbers"), [(1, [0, 1, 2, 3, 4, 5, 6]), (3, [0, 3, 6]), ("detections", [1, 4]), (0, [])]
)
def test_the_rule_chooses(rule, numbers):
    side = DaemonSide()
    keeper = PictureKeeper(rule, side.send)
    for number in range(7):
        keeper.offer(picture(number), FOUND if number in (1, 4) else [])
        side.wait_for(sum(each <= number for each in numbers))
    assert [frame["frame"] for frame, _ in side.got] == numbers
    for frame, pixels in side.got:
        assert frame["time_monotonic"] == frame["frame"]
        assert frame["exposure_s"] == 0.004
        assert frame["detections"] == []
        assert pixels.shape == (48, 64)
        assert abs(float(pixels.mean()) - 10.0 * frame["frame"]) < 1.0


def test_pictures_beyond_what_is_compressed_are_left_out_and_the_detector_waits_for_none(caplog):
    free, side = threading.Event(), DaemonSide()

    def slow(message, descriptor):
        free.wait(20.0)
        side.send(message, descriptor)

    keeper = PictureKeeper(1, slow)
    for number in range(20):
        keeper.offer(picture(number), [])
    free.set()
    side.wait_for(MOST_WAITING)
    assert len(side.got) <= MOST_WAITING + 1
    assert caplog.text.count("compresses pictures too slowly") == 1

"""Cameras: what is asked of a driver, what comes, and that the newest picture is taken.

picamera2 and V4L2 are pretended here, by picamera2's public manual and V4L2's specification.
"""

import asyncio
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest
from test_supervisor import Daemon

from fwav_companion.vision.delivery import DeliveredPicture, DeliveryMeter
from fwav_companion.vision.images import Picture, SourceEndedError, SourceLostError
from fwav_companion.vision.newest_picture import NewestPicture
from fwav_companion.vision.sources import capture, open_source
from fwav_companion.vision.sources.capture import DeviceSource, VideoSource, set_up
from fwav_companion.vision.task import VisionTask

PRETENDED = Path(__file__).parent / "pretended"


def read_all(source, work_s=0.0):
    """What a source delivers to a detector that takes so long, and the error at its end."""
    seen = []
    while True:
        try:
            seen.append(source.read(5.0))
        except (SourceEndedError, SourceLostError) as error:
            return seen, error
        time.sleep(work_s)


@pytest.fixture
def picamera2(monkeypatch):
    monkeypatch.syspath_prepend(str(PRETENDED))
    sys.modules.pop("picamera2", None)
    import picamera2

    picamera2.Picamera2.made.clear()
    yield picamera2.Picamera2
    sys.modules.pop("picamera2", None)


def test_libcamera_is_asked_for_size_rate_exposure_and_gain(picamera2):
    task = VisionTask("libcamera:1", size=(800, 600), fps=40.0, exposure_s=0.002, gain=4.0)
    source = open_source(task)
    picture = source.read(5.0)
    (camera,) = picamera2.made
    assert camera.config == {
        "main": {"size": (800, 600), "format": "YUV420"},
        "controls": {"FrameDurationLimits": (25000, 25000), "ExposureTime": 2000, "AnalogueGain": 4.0},
    }
    assert picture.pixels.shape == (600, 800), "without the padding of its rows"
    assert (picture.exposure_s, picture.clock) == (0.002, "sensor")
    assert 0.0 < time.monotonic() - picture.stamp["time_monotonic"] < 5.0
    source.close()
    deadline = time.monotonic() + 5.0
    while camera.state != "closed" and time.monotonic() < deadline:
        time.sleep(0.01)
    assert camera.state == "closed"


@pytest.mark.parametrize("detector", ["color", "onnx"])
def test_libcamera_gives_colour_in_opencvs_order_where_the_detector_wants_it(picamera2, detector):
    source = open_source(VisionTask("libcamera:0", detector=detector, model="m", size=(64, 48)))
    picture = source.read(5.0)
    assert picture.pixels.shape == (48, 64, 3)
    assert picture.pixels[0, 0, :2].tolist() == [10, 20]
    assert picamera2.made[0].config["controls"] == {}
    source.close()


def test_a_libcamera_that_is_not_there_or_vanishes_is_lost(picamera2):
    with pytest.raises(SourceLostError, match=r"^libcamera:5: list index out of range$"):
        open_source(VisionTask("libcamera:5"))
    source = open_source(VisionTask("libcamera:0", size=(16, 16)))
    assert "timed out" in str(read_all(source)[1])


class Driver:
    """A V4L2 camera as OpenCV shows it."""

    def __init__(self, pictures=(), stamp_s=None):
        self.set_to, self.pictures, self.stamp_s = {}, iter(pictures), stamp_s

    def set(self, key, value):
        self.set_to[key] = value

    def get(self, key):
        if key == cv2.CAP_PROP_POS_MSEC:
            return 1e3 * (time.monotonic() - 0.01 if self.stamp_s is None else self.stamp_s)
        return self.set_to.get(key, 0.0)

    def isOpened(self):
        return True

    def read(self):
        pixels = next(self.pictures, None)
        return pixels is not None, pixels

    def release(self):
        pass


def test_v4l2_is_asked_for_size_rate_exposure_and_gain():
    driver = Driver()
    set_up(driver, VisionTask("/dev/video0", size=(1280, 720), fps=60.0, exposure_s=0.002, gain=30.0))
    assert driver.set_to == {
        cv2.CAP_PROP_BUFFERSIZE: 1,
        cv2.CAP_PROP_FOURCC: cv2.VideoWriter.fourcc(*"MJPG"),
        cv2.CAP_PROP_FRAME_WIDTH: 1280,
        cv2.CAP_PROP_FRAME_HEIGHT: 720,
        cv2.CAP_PROP_FPS: 60.0,
        cv2.CAP_PROP_AUTO_EXPOSURE: 1.0,
        cv2.CAP_PROP_EXPOSURE: 20,  # of 100 us
        cv2.CAP_PROP_GAIN: 30.0,
    }
    small = Driver()
    set_up(small, VisionTask("/dev/video0", size=(640, 480)))
    assert cv2.CAP_PROP_FOURCC not in small.set_to
    assert small.set_to[cv2.CAP_PROP_AUTO_EXPOSURE] == 3.0


def device(monkeypatch, driver, **settings):
    monkeypatch.setattr(capture.os, "access", lambda *_: True)
    monkeypatch.setattr(capture.cv2, "VideoCapture", lambda *_: driver)
    return DeviceSource(VisionTask("/dev/video0", **settings))


def test_a_truncated_jpeg_is_left_out_and_a_camera_that_was_pulled_out_is_lost(monkeypatch):
    grey = np.zeros((4, 4, 3), np.uint8)
    source = device(monkeypatch, Driver([grey, None, None, grey]), exposure_s=0.004)
    read = [source.read(1.0) for _ in range(4)]
    assert [picture is None for picture in read] == [False, True, True, False]
    assert read[0].exposure_s == pytest.approx(0.004)
    none, lost = read_all(source)
    assert set(none) == {None}
    assert "stopped sending" in str(lost)


@pytest.mark.parametrize("stamp_s", [0.0, 1.7e9])
def test_a_drivers_stamp_that_jumps_is_replaced_by_the_arrival(monkeypatch, stamp_s):
    source = device(monkeypatch, Driver([np.zeros((4, 4, 3), np.uint8)] * 2, stamp_s=stamp_s))
    picture = source.read(1.0)
    assert picture.clock == "arrival"
    assert time.monotonic() - picture.stamp["time_monotonic"] < 5.0


class Counting:
    """A source that numbers its pictures."""

    def __init__(self, count, interval_s=0.002):
        self.numbers, self.interval_s, self.closed = iter(range(count)), interval_s, False

    def read(self, timeout_s):
        time.sleep(self.interval_s)
        number = next(self.numbers, None)
        if number is None:
            raise SourceEndedError("the end")
        return Picture(np.zeros((2, 2), np.uint8), {"time_monotonic": float(number)}, number)

    def close(self):
        self.closed = True


def test_the_newest_picture_is_taken_and_the_others_are_counted():
    inner = Counting(100)
    seen, _ = read_all(NewestPicture(inner), work_s=0.05)
    numbers = [picture.number for picture in seen]
    assert numbers == sorted(numbers)
    assert numbers[-1] == 99, "the last one is delivered before the end is"
    assert len(seen) < 60
    assert len(seen) + sum(picture.skipped for picture in seen) == 100
    assert inner.closed


def test_an_error_of_a_drivers_binding_is_a_loss_and_not_a_silence():
    source = Counting(1)
    source.numbers = iter(["not a number"])
    seen, lost = read_all(NewestPicture(source))
    assert seen == []
    assert isinstance(lost, SourceLostError)
    assert source.closed


def test_a_video_faster_than_the_detector_skips_and_counts(tmp_path):
    path = tmp_path / "flight.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 50.0, (64, 48))
    for level in range(60):
        writer.write(np.full((48, 64, 3), 4 * level, np.uint8))
    writer.release()
    seen, _ = read_all(VideoSource(str(path)), work_s=0.1)
    assert [picture.number for picture in seen] == sorted(picture.number for picture in seen)
    assert all(abs(float(p.pixels.mean()) - 4 * p.number) < 6.0 for p in seen)
    assert len(seen) <= 20
    assert seen[-1].number + 1 == len(seen) + sum(picture.skipped for picture in seen)


def delivered(i, *, look, at_s=None):
    at_s = i / 30.0 if at_s is None else at_s
    return DeliveredPicture(
        arrived_s=at_s, detected_s=at_s + 0.02, size=(640, 480), look=look, stamp_s=at_s - 0.04, clock="sensor"
    )


def test_what_the_camera_delivers_is_measured():
    meter = DeliveryMeter()
    assert meter.report() is None
    for i in range(100):
        meter.add(delivered(i, look=i))
    report = meter.report()
    assert (report.size, report.clock, report.skipped, report.frozen) == ((640, 480), "sensor", 0, False)
    assert (report.fps, report.age_s, report.detector_hz) == pytest.approx((30.0, 0.04, 50.0))


def test_a_camera_that_repeats_one_picture_is_frozen_until_it_shows_another():
    meter = DeliveryMeter()
    for i in range(45):
        meter.add(delivered(i, look=7))
    assert not meter.is_frozen
    for i in range(45, 90):
        meter.add(delivered(i, look=7))
    assert meter.is_frozen
    meter.add(delivered(90, look=8))
    assert not meter.is_frozen


def test_another_interpreter_prefers_its_own_numpy(tmp_path):
    """A stand-in for the system's Python, with a numpy of its own and picamera2 beside it, as Debian installs them."""
    system = tmp_path / "dist-packages"
    (system / "numpy").mkdir(parents=True)
    real = Path(np.__file__).parent
    (system / "numpy" / "__init__.py").write_text(
        f"__path__ = [{str(real)!r}]\n"
        f"exec(compile(open({str(real / '__init__.py')!r}).read(), {str(real / '__init__.py')!r}, 'exec'))\n"
        "__version__ = '1.24.2+system'\n"
    )
    (system / "picamera2.py").write_text(
        "import numpy\nclass Picamera2:\n    def __init__(self, number):\n"
        "        raise RuntimeError(f'it saw numpy {numpy.__version__}')\n"
    )
    python = tmp_path / "python3"
    python.write_text(f'#!/bin/sh\nPYTHONPATH={system} exec {sys.executable} -S "$@"\n')
    python.chmod(0o755)

    async def watch(interpreter):
        daemon = Daemon(VisionTask("libcamera:0", python=interpreter))
        daemon.process.start()
        await daemon.until(lambda: bool(daemon.states))
        daemon.process.close()
        return daemon.states[-1]

    assert asyncio.run(watch(str(python))) == (False, "libcamera:0: it saw numpy 1.24.2+system")
    assert "picamera2 is not installed for this interpreter" in asyncio.run(watch(""))[1]

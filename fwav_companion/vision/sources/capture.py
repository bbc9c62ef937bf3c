"""Sources that OpenCV opens: USB cameras and video files.

A USB camera's driver stamps each frame on CLOCK_MONOTONIC, and OpenCV passes the stamp on. A file is played at its own
rate, as if it were live.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import cv2

from fwav_companion.vision.images import Picture, Pixels, SourceEndedError, SourceLostError
from fwav_companion.vision.task import VisionTask

LIKELY_AGE_S = 1.0
"""Largest age of a driver's stamp, seconds: an older one, or one in the future, is on another clock."""
MOST_FAILURES = 10
"""Unreadable pictures in a row after which a camera counts as lost: touching a cable truncates one or two."""
EXPOSURE_UNIT_S = 1e-4
"""Unit of V4L2_CID_EXPOSURE_ABSOLUTE, seconds (V4L2 specification, camera control reference)."""
MOST_RAW_PX = 640 * 480
"""Most pixels of a raw picture: more exceed USB 2 at 30 frames/s, 16 bits a pixel; cameras then fall to some 5."""
MANUAL, AUTOMATIC = 1.0, 3.0
"""V4L2_EXPOSURE_MANUAL, and aperture priority, the automatic exposure of UVC cameras."""


class _Capture:
    def __init__(self, name: str, opened: cv2.VideoCapture) -> None:
        if not opened.isOpened():
            opened.release()
            raise SourceLostError(f"{name}: cannot be opened")
        self._name = name
        self._capture = opened
        self._number = -1

    def close(self) -> None:
        """Release the source."""
        self._capture.release()

    def _next(self) -> Pixels | None:
        ok, pixels = self._capture.read()
        self._number += 1
        return pixels if ok else None


class DeviceSource(_Capture):
    """A camera at /dev/videoN."""

    def __init__(self, task: VisionTask) -> None:
        path = task.source
        if not os.access(path, os.R_OK):
            why = "no permission to read it" if Path(path).exists() else "it does not exist"
            raise SourceLostError(f"{path}: {why}")
        opened = cv2.VideoCapture(path, cv2.CAP_V4L2)
        set_up(opened, task)
        super().__init__(path, opened)
        self._exposure_s = exposure_of_driver(opened) if task.exposure_s != "auto" else None
        self._failures = 0

    def read(self, timeout_s: float) -> Picture | None:  # noqa: ARG002  # the driver has its own, ten seconds
        """The next frame; None for one that cannot be decoded."""
        pixels = self._next()
        if pixels is None:
            self._failures += 1
            if self._failures >= MOST_FAILURES:
                raise SourceLostError(f"{self._name}: the camera stopped sending pictures")
            time.sleep(0.01)  # a camera that was pulled out fails at once
            return None
        self._failures = 0
        now_s = time.monotonic()
        stamped_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        likely = now_s - LIKELY_AGE_S < stamped_s <= now_s
        return Picture(
            pixels,
            {"time_monotonic": stamped_s if likely else now_s},
            self._number,
            self._exposure_s,
            clock="driver" if likely else "arrival",
        )


def set_up(capture: cv2.VideoCapture, task: VisionTask) -> None:
    """Request size, frame rate, exposure and gain of a V4L2 camera. It takes the nearest values that it supports."""
    capture.set(cv2.CAP_PROP_BUFFERSIZE, 1)
    if task.size:
        width, height = task.size
        if width * height > MOST_RAW_PX:
            capture.set(cv2.CAP_PROP_FOURCC, cv2.VideoWriter.fourcc(*"MJPG"))
        capture.set(cv2.CAP_PROP_FRAME_WIDTH, width)
        capture.set(cv2.CAP_PROP_FRAME_HEIGHT, height)
    if task.fps:
        capture.set(cv2.CAP_PROP_FPS, task.fps)
    if task.exposure_s == "auto":
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, AUTOMATIC)
    else:
        capture.set(cv2.CAP_PROP_AUTO_EXPOSURE, MANUAL)
        capture.set(cv2.CAP_PROP_EXPOSURE, max(1, round(task.exposure_s / EXPOSURE_UNIT_S)))
    if task.gain != "auto":
        capture.set(cv2.CAP_PROP_GAIN, task.gain)


def exposure_of_driver(capture: cv2.VideoCapture) -> float | None:
    """The exposure that the driver really set, seconds; None where it does not report one."""
    units = capture.get(cv2.CAP_PROP_EXPOSURE)
    return units * EXPOSURE_UNIT_S if units > 0.0 else None


class VideoSource(_Capture):
    """A video file."""

    def __init__(self, path: str) -> None:
        super().__init__(path, cv2.VideoCapture(path))
        self._started_s = time.monotonic()

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # a file does not block
        """The next frame at its due time. After a slow detector, frames that are already due are skipped."""
        skipped = 0
        while self._grabbed() and self._due_s() + self._interval_s() < time.monotonic():
            skipped += 1
        ok, pixels = self._capture.retrieve()
        if not ok:
            raise SourceEndedError(f"{self._name}: played to its end")
        due_s = self._due_s()
        time.sleep(max(0.0, due_s - time.monotonic()))
        return Picture(pixels, {"time_monotonic": due_s}, self._number, clock="file", skipped=skipped)

    def _grabbed(self) -> bool:
        if not self._capture.grab():
            raise SourceEndedError(f"{self._name}: played to its end")
        self._number += 1
        return True

    def _due_s(self) -> float:
        return self._started_s + float(self._capture.get(cv2.CAP_PROP_POS_MSEC)) / 1e3

    def _interval_s(self) -> float:
        """Interval of the frames, seconds: after it the next frame replaces a frame."""
        fps = float(self._capture.get(cv2.CAP_PROP_FPS))
        return 1.0 / fps if fps > 0.0 else 0.04

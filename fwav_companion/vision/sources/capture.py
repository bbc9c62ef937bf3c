"""What OpenCV opens itself: USB cameras, RTSP streams, video files.

A USB camera's driver stamps each frame on CLOCK_MONOTONIC, which OpenCV hands on. A stream tells no time of capture at
all: its frames are stamped as they come, and [camera] time_offset_s is for the delay. A file is played at its own pace
as if it were flown now.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import cv2

from fwav_companion.vision.images import Picture, Pixels, SourceEndedError, SourceLostError

LIKELY_AGE_S = 1.0
"""A driver's stamp that is older than this, or from the future, is on another clock."""
STREAM_OPTIONS = "rtsp_transport;tcp|timeout;5000000|fflags;nobuffer"
"""For FFmpeg: whole frames rather than fast ones, five seconds of patience."""


class _Capture:
    def __init__(self, name: str, opened: cv2.VideoCapture) -> None:
        if not opened.isOpened():
            opened.release()
            raise SourceLostError(f"{name}: cannot be opened")
        self._name = name
        self._capture = opened
        self._number = -1

    def close(self) -> None:
        """Let go of it."""
        self._capture.release()

    def _next(self) -> Pixels | None:
        ok, pixels = self._capture.read()
        self._number += 1
        return pixels if ok else None


class DeviceSource(_Capture):
    """/dev/videoN."""

    def __init__(self, path: str) -> None:
        if not os.access(path, os.R_OK):
            raise SourceLostError(f"{path}: {'no permission to read it' if Path(path).exists() else 'not there'}")
        opened = cv2.VideoCapture(path, cv2.CAP_V4L2)
        opened.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        super().__init__(path, opened)

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # the driver's own ten seconds
        """The next frame."""
        pixels = self._next()
        if pixels is None:
            raise SourceLostError(f"{self._name}: no picture comes any more")
        now_s = time.monotonic()
        stamped_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        likely = now_s - LIKELY_AGE_S < stamped_s <= now_s
        return Picture(pixels, {"time_monotonic": stamped_s if likely else now_s}, self._number)


class StreamSource(_Capture):
    """rtsp://."""

    def __init__(self, url: str) -> None:
        os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", STREAM_OPTIONS)
        super().__init__(url, cv2.VideoCapture(url, cv2.CAP_FFMPEG))

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # FFmpeg has its own patience
        """The next frame, stamped as it comes."""
        pixels = self._next()
        if pixels is None:
            raise SourceLostError(f"{self._name}: the stream ended")
        return Picture(pixels, {"time_monotonic": time.monotonic()}, self._number)


class VideoSource(_Capture):
    """A file."""

    def __init__(self, path: str) -> None:
        super().__init__(path, cv2.VideoCapture(path))
        self._started_s = time.monotonic()

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # a file never keeps one waiting
        """The next frame, when it is due."""
        pixels = self._next()
        if pixels is None:
            raise SourceEndedError(f"{self._name}: played to its end")
        due_s = self._started_s + self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        time.sleep(max(0.0, due_s - time.monotonic()))
        return Picture(pixels, {"time_monotonic": due_s}, self._number)

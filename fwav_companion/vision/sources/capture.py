"""Sources that OpenCV opens: USB cameras, RTSP streams, video files.

A USB camera's driver stamps each frame on CLOCK_MONOTONIC, and OpenCV passes the stamp on. A stream does not carry
capture times: its frames are stamped on arrival, and [camera] time_offset_s covers the delay. A file is played at its
own rate, as if it were live.
"""

from __future__ import annotations

import os
import time
from pathlib import Path

import cv2

from fwav_companion.vision.images import Picture, Pixels, SourceEndedError, SourceLostError

LIKELY_AGE_S = 1.0
"""A driver's stamp that is older, or in the future, is on another clock."""
STREAM_OPTIONS = "rtsp_transport;tcp|timeout;5000000|fflags;nobuffer"
"""FFmpeg options: complete frames rather than fast ones, and a timeout of five seconds."""


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

    def __init__(self, path: str) -> None:
        if not os.access(path, os.R_OK):
            why = "no permission to read it" if Path(path).exists() else "it does not exist"
            raise SourceLostError(f"{path}: {why}")
        opened = cv2.VideoCapture(path, cv2.CAP_V4L2)
        opened.set(cv2.CAP_PROP_BUFFERSIZE, 1)
        super().__init__(path, opened)

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # the driver has its own, ten seconds
        """The next frame."""
        pixels = self._next()
        if pixels is None:
            raise SourceLostError(f"{self._name}: the camera stopped sending pictures")
        now_s = time.monotonic()
        stamped_s = self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        likely = now_s - LIKELY_AGE_S < stamped_s <= now_s
        return Picture(pixels, {"time_monotonic": stamped_s if likely else now_s}, self._number)


class StreamSource(_Capture):
    """An RTSP stream."""

    def __init__(self, url: str) -> None:
        os.environ.setdefault("OPENCV_FFMPEG_CAPTURE_OPTIONS", STREAM_OPTIONS)
        super().__init__(url, cv2.VideoCapture(url, cv2.CAP_FFMPEG))

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # FFmpeg has its own
        """The next frame, stamped on arrival."""
        pixels = self._next()
        if pixels is None:
            raise SourceLostError(f"{self._name}: the stream ended")
        return Picture(pixels, {"time_monotonic": time.monotonic()}, self._number)


class VideoSource(_Capture):
    """A video file."""

    def __init__(self, path: str) -> None:
        super().__init__(path, cv2.VideoCapture(path))
        self._started_s = time.monotonic()

    def read(self, timeout_s: float) -> Picture:  # noqa: ARG002  # a file does not block
        """The next frame, at its due time."""
        pixels = self._next()
        if pixels is None:
            raise SourceEndedError(f"{self._name}: played to its end")
        due_s = self._started_s + self._capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
        time.sleep(max(0.0, due_s - time.monotonic()))
        return Picture(pixels, {"time_monotonic": due_s}, self._number)

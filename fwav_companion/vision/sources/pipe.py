"""A named pipe of pictures. Each picture is a line of JSON, then its bytes, row by row.

The line has ``size`` [width, height], ``format`` (gray8 or bgr8), one stamp, and optionally ``frame`` and
``exposure_s``. The writer may come and go: an incomplete picture is lost, and the pipe is reopened.
"""

from __future__ import annotations

import fcntl
import os
import select
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from fwav_companion.vision.images import Picture, SourceLostError, exposure_of, number_of, parse_line, stamp_of

CHANNELS = {"gray8": 1, "bgr8": 3}
LONGEST_LINE = 4096
MOST_PIXELS = 1 << 26
"""Most pixels of a picture: 64 megapixels; cameras of small vehicles have fewer."""
PIPE_BYTES = 1 << 20
"""Size of the pipe that is requested from the kernel, so that a writer does not wait every 64 KiB."""


class PipeSource:
    """The reading end of a pipe."""

    def __init__(self, path: Path) -> None:
        try:
            self._file = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
        except OSError as error:
            raise SourceLostError(f"{path}: {error.strerror}") from None
        with suppress(OSError):
            fcntl.fcntl(self._file, fcntl.F_SETPIPE_SZ, PIPE_BYTES)
        self._path = path
        self._buffer = bytearray()

    def read(self, timeout_s: float) -> Picture | None:
        """The next complete picture."""
        deadline = time.monotonic() + timeout_s
        while (picture := self._taken()) is None:
            if not self._more(deadline - time.monotonic()):
                return None
        return picture

    def close(self) -> None:
        """Close the pipe."""
        os.close(self._file)

    def _more(self, timeout_s: float) -> bool:
        """Wait for bytes; False if none came in time."""
        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        events = poll.poll(max(0.0, timeout_s) * 1e3)
        if not events:
            return False
        data = os.read(self._file, PIPE_BYTES) if events[0][1] & select.POLLIN else b""
        if not data:
            raise SourceLostError("the program that wrote pictures has closed it")
        self._buffer += data
        return True

    def _taken(self) -> Picture | None:
        """The first complete picture, removed from the buffer; None if there is none."""
        end = self._buffer.find(b"\n", 0, LONGEST_LINE)
        if end < 0:
            if len(self._buffer) >= LONGEST_LINE:
                raise SourceLostError(f"{self._path}: a picture without its line of JSON")
            return None
        described = parse_line(bytes(self._buffer[:end]), str(self._path))
        width, height, channels = self._form(described)
        length = width * height * channels
        if len(self._buffer) < end + 1 + length:
            return None
        data = bytes(self._buffer[end + 1 : end + 1 + length])
        del self._buffer[: end + 1 + length]
        shape = (height, width) if channels == 1 else (height, width, channels)
        pixels = np.frombuffer(data, np.uint8).reshape(shape)
        return Picture(pixels, stamp_of(described, str(self._path)), number_of(described), exposure_of(described))

    def _form(self, described: dict[str, Any]) -> tuple[int, int, int]:
        """Width, height and channels of a described picture."""
        size, channels = described.get("size"), CHANNELS.get(str(described.get("format")))
        if (
            channels is None
            or not isinstance(size, list)
            or len(size) != 2
            or not all(isinstance(side, int) and side > 0 for side in size)
            or size[0] * size[1] > MOST_PIXELS
        ):
            raise SourceLostError(f"{self._path}: accepted: size [width, height] and format {' or '.join(CHANNELS)}")
        return size[0], size[1], channels

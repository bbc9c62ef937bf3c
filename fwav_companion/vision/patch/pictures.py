"""Keeps the newest pictures, so that a click can refer to a picture some hundred milliseconds old. PURE."""

from __future__ import annotations

from collections import deque
from typing import Final

import msgspec

from fwav_companion.vision.patch.appearance import Image

MOST_BYTES: Final = 16 * 2**20
"""Most bytes of kept pictures: 54 grey pictures of 640 x 480, 1.8 s at 30 frames/s."""


class KeptPicture(msgspec.Struct, frozen=True):
    """A picture with its number."""

    number: int
    """Counts the pictures of this process; the daemon names pictures by it."""
    grey: Image


class KeptPictures:
    """A ring of pictures within :data:`MOST_BYTES`."""

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._kept: deque[KeptPicture] = deque()
        self._bytes = 0

    def add(self, number: int, grey: Image) -> None:
        """Keep a picture; the oldest ones make room."""
        self._kept.append(KeptPicture(number, grey))
        self._bytes += grey.nbytes
        while self._bytes > self._most_bytes and len(self._kept) > 1:
            self._bytes -= self._kept.popleft().grey.nbytes

    def find(self, number: int) -> Image | None:
        """The picture of this number; None where it is not kept any more."""
        return next((each.grey for each in self._kept if each.number == number), None)

"""SHELL: compresses the pictures that a recording keeps, in a thread of its own, and sends them to the daemon.

A picture travels as a file in memory (memfd_create(2)) whose descriptor goes with a message: a socket's messages are
too short for it. The daemon writes it, within the recording's limits on the disk.
"""

from __future__ import annotations

import logging
import os
import queue
import threading
from collections.abc import Callable
from typing import Final

import cv2

from fwav_companion.vision.images import Found, Picture, frame_bytes
from fwav_companion.vision.task import KEPT_PICTURE, KeptPicturesRule

_log = logging.getLogger(__name__)
QUALITY: Final = 95
"""JPEG quality: 100 kB for 640 x 480. Markers are then found 0.03 px (median) or 0.4 sigma (rms) from their place in
the uncompressed picture, on the flight of ``demo``."""
MOST_WAITING: Final = 4
"""Most pictures that wait for compression: 4 MiB of colour at 640 x 480."""


class PictureKeeper:
    """Chooses pictures, and hands them to the daemon as JPEG."""

    def __init__(self, rule: KeptPicturesRule, send: Callable[[bytes, int], None]) -> None:
        """``send``: sends a message with a descriptor."""
        self._rule = rule
        self._send = send
        self._count = 0
        self._waiting: queue.Queue[Picture] = queue.Queue(MOST_WAITING)
        self._left_out = False
        if rule:
            threading.Thread(target=self._compress, name="kept pictures", daemon=True).start()

    def offer(self, picture: Picture, found: list[Found]) -> None:
        """Keep a picture if the rule selects it; pictures that arrive faster than they are compressed are left out."""
        self._count += 1
        wanted = bool(found) if self._rule == "detections" else self._rule > 0 and (self._count - 1) % self._rule == 0
        if not wanted:
            return
        try:
            self._waiting.put_nowait(picture)
        except queue.Full:
            if not self._left_out:
                _log.warning("[record] pictures: this board compresses pictures too slowly; some are left out")
            self._left_out = True

    def _compress(self) -> None:
        while True:
            picture = self._waiting.get()
            done, jpeg = cv2.imencode(".jpg", picture.pixels, [cv2.IMWRITE_JPEG_QUALITY, QUALITY])
            if done:
                self._hand_over(frame_bytes(picture, []), jpeg.tobytes())

    def _hand_over(self, frame: bytes, jpeg: bytes) -> None:
        descriptor = os.memfd_create("picture", os.MFD_CLOEXEC)
        try:
            with open(descriptor, "wb", closefd=False) as file:
                file.write(jpeg)
            self._send(KEPT_PICTURE + frame + b"}", descriptor)
        finally:
            os.close(descriptor)

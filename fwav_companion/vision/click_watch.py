"""Clicked spots in the camera process: keeps pictures, and asks the daemon where each new one shows the spots."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterable
from typing import Final, Protocol

import msgspec

from fwav_companion.types.spots import QUESTION, FollowSpot, ReleaseSpot, SpotMessage, SpotRefused, SpotViews
from fwav_companion.vision.images import Found, Picture, grey
from fwav_companion.vision.patch import FollowedSpots, KeptPictures, LookRate

ANSWER_S: Final = 0.05
"""Longest wait for the daemon's answer, which takes a millisecond: a frame must not wait for a busy daemon."""

SLOW_S: Final = 0.05
"""Interval of searches for the spots from which it is logged: 20 Hz, below the 30 frames/s of most cameras."""

_log = logging.getLogger(__name__)
_decoder = msgspec.json.Decoder(SpotMessage)
_encode = msgspec.json.Encoder().encode


class DaemonEnd(Protocol):
    """The socket to the daemon."""

    def send(self, message: bytes) -> None:
        """Send one message."""

    def messages(self, timeout_s: float = 0.0) -> list[bytes]:
        """The daemon's messages since the last call; waits for the first."""


class ClickWatch:
    """Keeps the newest pictures, and follows the spots that the daemon orders."""

    def __init__(self, daemon: DaemonEnd) -> None:
        self._daemon = daemon
        self._pictures = KeptPictures()
        self._spots = FollowedSpots(self._pictures)
        self._views: SpotViews | None = None
        self._rate = LookRate()
        self._asked = -1
        """Number of the newest picture in which the spots are looked for."""
        self._is_slow = False

    def begin(self, picture: Picture, number: int, frame: bytes) -> None:
        """Keep a picture before detection, and ask where it shows the spots. ``frame``: that without detections."""
        self._handle(self._daemon.messages())
        self._pictures.add(number, grey(picture.pixels))
        if self._spots and self._rate.is_due(time.monotonic()):
            self._asked = number
            self._daemon.send(QUESTION + frame + b"}")

    def found(self, picture: Picture, number: int) -> list[Found]:
        """Detections of the spots in the picture, after the detector."""
        if not self._spots or self._asked != number:
            return []
        give_up_s = time.monotonic() + ANSWER_S
        while self._views is None or self._views.picture != number:
            left_s = give_up_s - time.monotonic()
            if left_s <= 0.0:
                return []
            self._handle(self._daemon.messages(left_s))
        began_s = time.thread_time()
        found = self._spots.detections(grey(picture.pixels), self._views.views)
        self._rate.spent(time.thread_time() - began_s)
        self._report_slow()
        return found

    def _report_slow(self) -> None:
        """Log once that this board searches for spots less often than at common frame rates."""
        if not self._is_slow and self._rate.interval_s > SLOW_S:
            self._is_slow = True
            _log.warning(
                "clicked spots are looked for at %.0f Hz: at more they would take over a tenth of a core",
                1.0 / self._rate.interval_s,
            )

    def _handle(self, messages: Iterable[bytes]) -> None:
        for data in messages:
            match _decoder.decode(data):
                case FollowSpot() as order:
                    refused = self._spots.follow(order)
                    if refused is not None:
                        self._daemon.send(_encode(SpotRefused(order.spot, refused.value)))
                case ReleaseSpot(spot=spot):
                    self._spots.release(spot)
                case SpotViews() as views:
                    self._views = views

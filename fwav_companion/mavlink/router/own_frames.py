"""Remembers the frames that we sent, to distinguish their echo from frames of a second program with our ids."""

from __future__ import annotations

from collections import deque
from typing import Final

MAX_SENT: Final = 4096
"""Frames of ours that are remembered: 20 s at 200 frames a second, four links included. An echo through a second radio
is up to several seconds late. Memory: 4096 x 120 bytes."""


class OwnFrames:
    """The newest frames of ours, by a hash of all their bytes."""

    def __init__(self) -> None:
        self._order: deque[int] = deque()
        self._hashes: dict[int, None] = {}
        """A dict, because a set that loses an entry with each new one is rebuilt with eight times as many slots: 0.5 MB
        in place of 0.3, and twice that while it is copied."""

    def add(self, frame: bytes) -> None:
        """Take a frame that leaves."""
        key = hash(frame)
        if key in self._hashes:
            return
        self._hashes[key] = None
        self._order.append(key)
        if len(self._order) > MAX_SENT:
            del self._hashes[self._order.popleft()]

    def __contains__(self, frame: bytes) -> bool:
        """Return whether the frame was sent by us lately."""
        return hash(frame) in self._hashes

"""Detects a frame that arrives over two links, so that it is forwarded once."""

from __future__ import annotations

from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

_GENERATION_NS: Final = NS_PER_S // 2
"""Length of a generation; a frame is remembered for one to two of them. A second is more than the delay between
redundant links, and less than 256 frames take at 250 a second: after that, a heartbeat with the same bytes could
arrive by another link."""
_GENERATION_FRAMES: Final = 1024
"""Frames in a generation. Memory is at most 2 x (1024 + those of one reading) x 280 bytes: 2000 frames a second."""


class Duplicates:
    """Remembers frames by all their bytes (with sender and sequence number), and the link of their first arrival.

    Equal bytes on one link are not a duplicate: the peer sent them on purpose. A sender with a separate sequence
    counter for each link (ArduPilot, PX4) sends different bytes on each, so its copies cannot be recognised.
    """

    def __init__(self) -> None:
        self._young: dict[bytes, int] = {}
        self._old: dict[bytes, int] = {}
        self._turn_ns: HostNs | None = None

    def generations(self, now: HostNs) -> tuple[dict[bytes, int], dict[bytes, int]]:
        """Return the current and the previous generation of frames, each frame with its link, after expiring the
        oldest.

        It serves a caller with many frames at one instant, which looks them up as :meth:`came_first_by` does.
        """
        if self._turn_ns is None or now >= self._turn_ns or len(self._young) >= _GENERATION_FRAMES:
            long_ago = self._turn_ns is not None and now >= self._turn_ns + _GENERATION_NS
            self._old = {} if long_ago else self._young
            self._young = {}
            self._turn_ns = HostNs(now + _GENERATION_NS)
        return self._young, self._old

    def came_first_by(self, frame: bytes, link: int) -> int:
        """Return the link on which the frame arrived lately; if there is none, remember and return this link."""
        first = self._old.get(frame, link)
        return first if first != link else self._young.setdefault(frame, link)

"""The same frame over two links: passed on once."""

from __future__ import annotations

from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

_GENERATION_NS: Final = NS_PER_S // 2
"""A frame is remembered for one to two of these: a second is more than redundant links differ by, and less than 256
frames take at 250 a second, after which a heartbeat could come by another link with the same bytes again."""
_GENERATION_FRAMES: Final = 1024
"""At most 2 x (1024 + those of one reading) x 280 bytes: 2000 frames a second."""


class Duplicates:
    """Knows frames by all their bytes, sender and sequence number among them, and by the link they first came by.

    On one link equal bytes are no duplicate: its peer meant them. A sender with a sequence counter of its own for each
    link (ArduPilot, PX4) sends no equal bytes; there nobody can tell.
    """

    def __init__(self) -> None:
        self._young: dict[bytes, int] = {}
        self._old: dict[bytes, int] = {}
        self._turn_ns: HostNs | None = None

    def generations(self, now: HostNs) -> tuple[dict[bytes, int], dict[bytes, int]]:
        """The frames of late and those before, each with its link, once the oldest are forgotten.

        For who has many frames at one instant, and asks as :meth:`came_first_by` does.
        """
        if self._turn_ns is None or now >= self._turn_ns or len(self._young) >= _GENERATION_FRAMES:
            long_ago = self._turn_ns is not None and now >= self._turn_ns + _GENERATION_NS
            self._old = {} if long_ago else self._young
            self._young = {}
            self._turn_ns = HostNs(now + _GENERATION_NS)
        return self._young, self._old

    def came_first_by(self, frame: bytes, link: int) -> int:
        """The link that brought the frame a short while ago; this one, and remembered, where none did."""
        first = self._old.get(frame, link)
        return first if first != link else self._young.setdefault(frame, link)

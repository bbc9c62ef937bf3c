"""The load of one link, measured every second, and the common rate to which fast streams are cut so that all fit.

The cut is the max-min fair allocation (Bertsekas & Gallager, Data Networks, 2nd ed., 6.5.2), with the rate as the
share: slow streams keep every sample, and only streams above the common rate lose some. A second of attitude at 50 Hz
gives way before the one battery message of that second does.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf
from typing import Final, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs, s_from_ns

StreamKey: TypeAlias = tuple[int, int, int]
"""(message id, sender as system << 8 | component, instance)."""
WINDOW_NS: Final = NS_PER_S
MAX_STREAMS: Final = 1024
"""Counted apart in one window; what comes beyond them counts together, as bytes that are not thinned."""


class _Count(msgspec.Struct):
    frames: int = 0
    size: int = 0
    cap_hz: float = inf


class LoadMeter:
    """Bytes of the window that runs, and rates of the last full one."""

    def __init__(self) -> None:
        self._since_ns: HostNs | None = None
        self._counts: dict[StreamKey, _Count] = {}
        self._other = self._left = 0
        self.streams: list[tuple[float, float]] = []
        """(hertz, mean bytes of one) of each stream of telemetry, after the caps of its message."""
        self.other = 0.0
        """Bytes a second of what is never thinned."""
        self.sent: float | None = None
        """Bytes a second that left; None before the first full window."""

    @property
    def offered(self) -> float:
        """Bytes a second that were to leave."""
        return self.other + sum(hz * size for hz, size in self.streams)

    def offer(self, stream: StreamKey, size: int, cap_hz: float) -> None:
        """A frame of telemetry is to leave. ``cap_hz``: the highest rate that its message has here."""
        count = self._counts.get(stream)
        if count is None:
            if len(self._counts) >= MAX_STREAMS:
                self.offer_other(size)
                return
            count = self._counts[stream] = _Count()
        count.frames += 1
        count.size += size
        count.cap_hz = cap_hz

    def offer_other(self, size: int) -> None:
        """A frame that is never thinned is to leave."""
        self._other += size

    def leave(self, size: int) -> None:
        """A frame leaves."""
        self._left += size

    def roll(self, now: HostNs) -> bool:
        """End the window if it is long enough. True: the rates are new."""
        if self._since_ns is None:
            self._since_ns = now
        elapsed_ns = now - self._since_ns
        if elapsed_ns < WINDOW_NS:
            return False
        elapsed_s = s_from_ns(elapsed_ns)
        self.streams = [
            (min(count.frames / elapsed_s, count.cap_hz), count.size / count.frames) for count in self._counts.values()
        ]
        self.other, self.sent = self._other / elapsed_s, self._left / elapsed_s
        self._counts, self._other, self._left, self._since_ns = {}, 0, 0, now
        return True


def common_rate(streams: Iterable[tuple[float, float]], bytes_per_s: float) -> float:
    """The highest rate, hertz, at which ``sum(size * min(rate, it))`` stays within a budget; inf where all fits.

    ``streams``: (rate in hertz, bytes of one message).
    """
    by_rate = sorted(streams)
    sizes_left = sum(size for _, size in by_rate)
    spent = 0.0
    for hz, size in by_rate:
        if spent + hz * sizes_left > bytes_per_s:
            return max(0.0, (bytes_per_s - spent) / sizes_left)
        spent += hz * size
        sizes_left -= size
    return inf

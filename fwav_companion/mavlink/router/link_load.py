"""Measures the load of one link every second, and finds the common rate to which fast streams are cut so that all fit.

The cut is the max-min fair allocation (Bertsekas & Gallager, Data Networks, 2nd ed., 6.5.2), with the rate as the
share: slow streams keep every sample, and only streams above the common rate lose some. Samples of attitude at 50 Hz
are dropped before the one battery message of the same second.
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
"""Streams counted separately in one window; those beyond it are counted together, as bytes that are not thinned."""


class _Count(msgspec.Struct):
    frames: int = 0
    size: int = 0
    cap_hz: float = inf


class LoadMeter:
    """Measures the load of one link: bytes of the current window, and rates of the last full one."""

    def __init__(self) -> None:
        self._since_ns: HostNs | None = None
        self._counts: dict[StreamKey, _Count] = {}
        self._other = self._left = 0
        self.streams: list[tuple[float, float]] = []
        """(rate in hertz, mean size in bytes) of each telemetry stream, after the caps of its message."""
        self.other = 0.0
        """Rate of the messages that are never thinned, bytes a second."""
        self.sent: float | None = None
        """Rate of the frames that left, bytes a second; None before the first full window."""

    @property
    def offered(self) -> float:
        """Load offered to the link, bytes a second."""
        return self.other + sum(hz * size for hz, size in self.streams)

    def offer(self, stream: StreamKey, size: int, cap_hz: float) -> None:
        """Count a telemetry frame offered to the link. ``cap_hz``: the highest rate of its message here."""
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
        """Count an offered frame that is never thinned."""
        self._other += size

    def leave(self, size: int) -> None:
        """Count a frame that leaves."""
        self._left += size

    def roll(self, now: HostNs) -> bool:
        """End the window if it is long enough. Returns True if the rates are new."""
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
    """Return the highest common rate, hertz, at which ``sum(size * min(rate, common))`` stays within a budget; inf if
    all fits.

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

"""How many bytes may leave by a link, so that no buffer behind it fills: a token bucket, and a radio's own word.

RADIO_STATUS.txbuf is the free part of a radio's send buffer, percent. ArduPilot slows its streams below 50 and much
more below 20, and speeds up above 90 (GCS_Common.cpp, handle_radio_status); PX4 multiplies its rates by 0.8 below 25
and by 1.025 above 50 (mavlink_main.cpp, update_radio_status). :class:`RadioBackoff` multiplies what really left.
"""

from __future__ import annotations

from math import ceil, inf

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

DEPTH_S = 0.25
"""Bytes that may leave at once, in seconds of the budget: an autopilot sends a period's messages in one go."""
SMALLEST_DEPTH_BYTES = 300
"""One frame of the longest kind (280 bytes, 293 signed)."""
LONGEST_DEBT_S = 1.0
"""What must leave whatever the budget is remembered for this long at most: telemetry is back a second after it."""
VERY_FULL, FULL, FREE = 20, 50, 90
"""txbuf, percent free: below the first halve, below the second slow down, above the third recover."""
HALVE, SLOWER, RECOVER = 0.5, 0.85, 1.1
"""Factor on the rate at each report; a SiK radio makes one or two a second, so that recovery from a fifth takes 10 s
to 20 s."""
SLOWEST_BYTES_PER_S = 200.0
"""Heartbeats of the autopilot and of our two components (21 bytes each, once a second), and three samples of
telemetry."""
SILENT_NS = 10 * NS_PER_S
"""After so long without a report the radio counts as gone: ten of its periods."""


class ByteBudget:
    """Token bucket: it refills at the budget's rate and never holds more than its depth."""

    def __init__(self) -> None:
        self._level = 0.0
        self._filled_ns: HostNs | None = None

    def fill(self, bytes_per_s: float, now: HostNs) -> None:
        """Refill up to now. To be called before the others. inf: there is no limit now."""
        depth = max(DEPTH_S * bytes_per_s, SMALLEST_DEPTH_BYTES)
        if self._filled_ns is None or bytes_per_s == inf:
            self._level = depth
        else:
            self._level = min(depth, self._level + bytes_per_s * (now - self._filled_ns) / NS_PER_S)
        self._level = max(self._level, -LONGEST_DEBT_S * bytes_per_s)
        self._filled_ns = now

    @property
    def is_free(self) -> bool:
        """A frame may leave: a byte of the budget is left. The last one may overdraw it by itself."""
        return self._level >= 1.0

    def spend(self, size: int) -> None:
        """A frame leaves, whether the budget is free or not."""
        self._level -= size

    def free_at(self, bytes_per_s: float, now: HostNs) -> HostNs:
        """When it is free, if it is filled then and nothing leaves before."""
        missing = max(0.0, 1.0 - self._level)
        return HostNs((self._filled_ns or now) + ceil(missing / bytes_per_s * NS_PER_S))


class RadioBackoff:
    """The rate that the radio behind one link takes."""

    def __init__(self) -> None:
        self.bytes_per_s: float | None = None
        """None: its buffer does not fill."""
        self.txbuf: int | None = None
        """Percent free, as reported last; None before the first report, and after a silence."""
        self._heard_ns: HostNs | None = None

    @property
    def is_heard(self) -> bool:
        """There is a radio behind the link."""
        return self.txbuf is not None

    def on_report(self, txbuf: int, sent: float | None, offered: float, now: HostNs) -> None:
        """Take one report. ``sent``: bytes that left in the last second, None while that is not known; ``offered``:
        bytes that were to leave in it.
        """
        self.txbuf, self._heard_ns = txbuf, now
        if sent is None:
            return
        if txbuf < FULL:
            factor = HALVE if txbuf < VERY_FULL else SLOWER
            before = sent if self.bytes_per_s is None else min(sent, self.bytes_per_s)
            self.bytes_per_s = max(factor * before, SLOWEST_BYTES_PER_S)
        elif txbuf > FREE and self.bytes_per_s is not None:
            self.bytes_per_s *= RECOVER
            if self.bytes_per_s > offered:
                self.bytes_per_s = None

    def expire(self, now: HostNs) -> None:
        """Forget a radio that fell silent."""
        if self._heard_ns is not None and now - self._heard_ns > SILENT_NS:
            self.bytes_per_s = self.txbuf = self._heard_ns = None

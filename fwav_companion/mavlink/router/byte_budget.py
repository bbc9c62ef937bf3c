"""Limits the bytes that leave by a link, so that no buffer behind it fills: a token bucket, and a radio's feedback.

RADIO_STATUS.txbuf is the free part of a radio's send buffer, percent. ArduPilot slows its streams below 50, slows them
more below 20, and speeds up above 90 (GCS_Common.cpp, handle_radio_status). PX4 multiplies its rates by 0.8 below 25
and by 1.025 above 50 (mavlink_main.cpp, update_radio_status). :class:`RadioBackoff` multiplies the rate of the bytes
that actually left.
"""

from __future__ import annotations

from math import ceil, inf

from fwav_companion.geometry.stamps import NS_PER_S, HostNs

DEPTH_S = 0.25
"""Depth of the bucket, seconds of the budget: an autopilot sends the messages of one period in one burst."""
SMALLEST_DEPTH_BYTES = 300
"""Lowest depth, bytes: one frame of the longest kind (280 bytes, 293 signed)."""
LONGEST_DEBT_S = 1.0
"""Longest overdraft, seconds of the budget. Frames that are never thinned may overdraw it; telemetry resumes at most
one second later."""
VERY_FULL, FULL, FREE = 20, 50, 90
"""Thresholds of txbuf, percent free: halve the rate below the first, slow down below the second, recover above the
third. ArduPilot's reaction begins below FULL; ours begins one report earlier, because what leaves until the next report
fills the buffer further: by 12 % of 4 KiB at 1.24 of a radio's 2000 bytes/s, and by a burst of 15 %."""
HALVE, SLOWER, RECOVER = 0.5, 0.85, 1.1
"""Factors on the rate at each report. A SiK radio sends one or two reports a second, so recovery from a fifth of the
rate takes 10 s to 20 s."""
SLOWEST_BYTES_PER_S = 200.0
"""Lower bound of the rate: heartbeats of the autopilot and of our two components (21 bytes each, once a second), and
three samples of telemetry."""
SILENT_NS = 10 * NS_PER_S
"""Time without a report after which the radio counts as gone: ten of its periods."""


class ByteBudget:
    """Token bucket in bytes: refills at the budget's rate, up to its depth."""

    def __init__(self) -> None:
        self._level = 0.0
        self._filled_ns: HostNs | None = None

    def fill(self, bytes_per_s: float, now: HostNs) -> None:
        """Refill up to ``now``; call it before the other methods. inf: no limit holds."""
        depth = max(DEPTH_S * bytes_per_s, SMALLEST_DEPTH_BYTES)
        if self._filled_ns is None or bytes_per_s == inf:
            self._level = depth
        else:
            self._level = min(depth, self._level + bytes_per_s * (now - self._filled_ns) / NS_PER_S)
        self._level = max(self._level, -LONGEST_DEBT_S * bytes_per_s)
        self._filled_ns = now

    @property
    def is_free(self) -> bool:
        """Whether a frame may leave: at least one byte is left. The frame may overdraw the bucket."""
        return self._level >= 1.0

    def spend(self, size: int) -> None:
        """Count a frame that leaves, whether the bucket is free or not."""
        self._level -= size

    def free_at(self, bytes_per_s: float, now: HostNs) -> HostNs:
        """Return the time at which the bucket is free if nothing leaves until then."""
        missing = max(0.0, 1.0 - self._level)
        return HostNs((self._filled_ns or now) + ceil(missing / bytes_per_s * NS_PER_S))


class RadioBackoff:
    """Estimates the byte rate that the radio behind one link can take."""

    def __init__(self) -> None:
        self.bytes_per_s: float | None = None
        """Limit, bytes a second; None: the radio's buffer does not fill."""
        self.txbuf: int | None = None
        """Last reported free part of the buffer, percent; None before the first report and after a silence."""
        self._heard_ns: HostNs | None = None

    @property
    def is_heard(self) -> bool:
        """Whether a radio behind the link is heard."""
        return self.txbuf is not None

    def on_report(self, txbuf: int, sent: float | None, offered: float, now: HostNs) -> None:
        """Adapt the rate to one report. ``sent``: bytes that left in the last second, None if unknown; ``offered``:
        bytes offered to the link in it.
        """
        before_txbuf = txbuf if self.txbuf is None else self.txbuf
        self.txbuf, self._heard_ns = txbuf, now
        if sent is None:
            return
        next_txbuf = txbuf + min(0, txbuf - before_txbuf)
        if next_txbuf < FULL:
            factor = HALVE if txbuf < VERY_FULL else SLOWER
            before = sent if self.bytes_per_s is None else min(sent, self.bytes_per_s)
            self.bytes_per_s = max(factor * before, SLOWEST_BYTES_PER_S)
        elif txbuf > FREE and self.bytes_per_s is not None:
            self.bytes_per_s *= RECOVER
            if self.bytes_per_s > offered:
                self.bytes_per_s = None

    def expire(self, now: HostNs) -> None:
        """Forget a silent radio."""
        if self._heard_ns is not None and now - self._heard_ns > SILENT_NS:
            self.bytes_per_s = self.txbuf = self._heard_ns = None

"""One direction of a faulty wire: delay, jitter, loss, damage, single bytes, silence. Pure; order is kept."""

from __future__ import annotations

from random import Random

from sitl_mock.options import WireOptions

BYTE_NS = 10_000_000_000 // 921_600
"""Duration of one byte at 921600 baud, ns."""


class Wire:
    """Carries frames with a delay; some are lost or damaged."""

    def __init__(self, options: WireOptions, start_host_ns: int, rng: Random) -> None:
        self._o = options
        self._rng = rng
        self._last_ns = start_host_ns
        self._silences = [(start_host_ns + round(a * 1e9), start_host_ns + round(b * 1e9)) for a, b in options.silences]

    def carry(self, frame: bytes, now_ns: int) -> list[tuple[int, bytes]]:
        """(instant, bytes) of each piece that arrives."""
        if any(a <= now_ns < b for a, b in self._silences):
            return []
        if self._o.loss and self._rng.random() < self._o.loss:
            return []
        if self._o.corruption and self._rng.random() < self._o.corruption:
            frame = self._damaged(frame)
        arrival = now_ns + round(self._o.delay_s * 1e9)
        if self._o.jitter_s:
            arrival += round(self._rng.expovariate(1.0 / self._o.jitter_s) * 1e9)
        arrival = max(arrival, self._last_ns)
        if not self._o.byte_by_byte:
            self._last_ns = arrival
            return [(arrival, frame)]
        pieces = [(arrival + i * BYTE_NS, frame[i : i + 1]) for i in range(len(frame))]
        self._last_ns = pieces[-1][0] if pieces else arrival
        return pieces

    def _damaged(self, frame: bytes) -> bytes:
        damaged = bytearray(frame)
        if damaged:
            damaged[self._rng.randrange(len(damaged))] ^= self._rng.randrange(1, 256)
        return bytes(damaged)

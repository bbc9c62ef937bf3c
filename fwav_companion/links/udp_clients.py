"""Peers of a UDP server: subscribed and refused sources, and the bytes that are passed on. Times are handed in.

A source becomes a client by a valid frame of a station. It stays one while valid frames arrive, and is forgotten after
a silence. A flood of sources does not displace a client that is heard: a source address has a bounded number of places,
a new client replaces only a silent one of the same address, and the last place is kept for an address that has none.
"""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.addresses import SocketAddress
from fwav_companion.links.streams import FrameCutter

MAX_CLIENTS = 16
"""Most clients: more ground stations than one vehicle ever has. Each costs a copy of all sent bytes."""
MAX_CLIENTS_OF_HOST = 8
"""Most clients of one source address: several programs on one computer, or stations behind one NAT."""
YIELDS_AFTER_S = 10.0
"""Silence after which a client yields to a new one of its source address: ten missed heartbeats."""
CLIENT_SILENT_S = 60.0
"""Silence after which a client is removed until it sends again: a minute. Peers send heartbeats at 1 Hz."""
MAX_STRANGERS = 16
"""Most sources without a valid frame so far whose incomplete frames are kept, 280 bytes each: serial bridges cut frames
anywhere. Beyond it, the longest known source is forgotten, and loses at most an incomplete frame."""


class Clients:
    """Client addresses with the time of their last valid frame (seconds of any one clock) and their frame cutters."""

    def __init__(self) -> None:
        self._heard_at: dict[SocketAddress, float] = {}
        self._cutters: dict[SocketAddress, FrameCutter] = {}
        self._strangers: dict[SocketAddress, FrameCutter] = {}
        self.refused = 0
        """Number of valid frames of sources for which there was no room."""

    def __iter__(self) -> Iterator[SocketAddress]:
        """The addresses in order of arrival."""
        return iter(self._heard_at)

    def whole_frames(self, address: SocketAddress, data: bytes) -> bytes:
        """Return the bytes of a source that may be passed on now. A single client without strangers needs no
        cutting.
        """
        if address in self._heard_at:
            if len(self._heard_at) == 1 and not self._strangers:
                return data
            return self._cutters.setdefault(address, FrameCutter()).cut(data)
        if address not in self._strangers and len(self._strangers) >= MAX_STRANGERS:
            del self._strangers[next(iter(self._strangers))]
        return self._strangers.setdefault(address, FrameCutter()).cut(data)

    def on_valid(self, address: SocketAddress, now_s: float) -> bool:
        """Process a valid frame of a source. Returns whether the source is a client now."""
        if address not in self._heard_at and not self._has_place(address[0], now_s):
            self.refused += 1
            return False
        self._heard_at[address] = now_s
        cutter = self._strangers.pop(address, None)
        if cutter is not None:
            self._cutters[address] = cutter
        return True

    def forget_silent(self, now_s: float) -> None:
        """Remove the clients that have been silent for CLIENT_SILENT_S, and all strangers."""
        self._strangers.clear()
        for address in [a for a, heard_at in self._heard_at.items() if now_s - heard_at > CLIENT_SILENT_S]:
            self._forget(address)

    def _has_place(self, host: str, now_s: float) -> bool:
        """Return whether there is room for another client of a source address; one of its own may be removed."""
        own = [address for address in self._heard_at if address[0] == host]
        if len(own) >= MAX_CLIENTS_OF_HOST:
            oldest = min(own, key=self._heard_at.__getitem__)
            if now_s - self._heard_at[oldest] < YIELDS_AFTER_S:
                return False
            self._forget(oldest)
        return len(self._heard_at) < (MAX_CLIENTS - 1 if own else MAX_CLIENTS)

    def _forget(self, address: SocketAddress) -> None:
        del self._heard_at[address]
        self._cutters.pop(address, None)

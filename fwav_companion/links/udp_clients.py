"""Peers of a UDP server: subscribed and refused sources, and the bytes that are passed on. Times are handed in.

A source becomes a client by a valid frame of a station, if there is a place for it (``places``). It stays one while
valid frames arrive, and is forgotten after a silence.
"""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.addresses import SocketAddress
from fwav_companion.links.places import Places
from fwav_companion.links.streams import FrameCutter

CLIENT_SILENT_S = 60.0
"""Silence after which a client is removed until it sends again: a minute. Peers send heartbeats at 1 Hz."""
MAX_STRANGERS = 16
"""Most sources without a valid frame so far whose incomplete frames are kept, 280 bytes each: serial bridges cut frames
anywhere. Beyond it, the longest known source is forgotten, and loses at most an incomplete frame."""


class Clients:
    """Client addresses with their places (times in seconds of any one clock) and their frame cutters."""

    def __init__(self) -> None:
        self._places = Places[SocketAddress](self._forget_cutter, silent_s=CLIENT_SILENT_S)
        self._cutters: dict[SocketAddress, FrameCutter] = {}
        self._strangers: dict[SocketAddress, FrameCutter] = {}
        self.refused = 0
        """Number of valid frames of sources for which there was no room."""

    def __iter__(self) -> Iterator[SocketAddress]:
        """The addresses in order of arrival."""
        return iter(self._places.of)

    def whole_frames(self, address: SocketAddress, data: bytes) -> bytes:
        """Return the bytes of a source that may be passed on now. A single client without strangers needs no
        cutting.
        """
        if address in self._places.of:
            if len(self._places.of) == 1 and not self._strangers:
                return data
            return self._cutters.setdefault(address, FrameCutter()).cut(data)
        if address not in self._strangers and len(self._strangers) >= MAX_STRANGERS:
            del self._strangers[next(iter(self._strangers))]
        return self._strangers.setdefault(address, FrameCutter()).cut(data)

    def on_valid(self, address: SocketAddress, now_s: float) -> bool:
        """Process a valid frame of a source. Returns whether the source is a client now."""
        place = self._places.of.get(address)
        if place is not None:
            place.heard_s = now_s
        elif not self._places.take(address, address[0], now_s):
            self.refused += 1
            return False
        cutter = self._strangers.pop(address, None)
        if cutter is not None:
            self._cutters[address] = cutter
        return True

    def forget_silent(self, now_s: float) -> None:
        """Remove the clients that have been silent for CLIENT_SILENT_S, and all strangers."""
        self._strangers.clear()
        for address in [each for each, place in self._places.of.items() if now_s - place.heard_s > CLIENT_SILENT_S]:
            del self._places.of[address]
            self._forget_cutter(address)

    def _forget_cutter(self, address: SocketAddress) -> None:
        self._cutters.pop(address, None)

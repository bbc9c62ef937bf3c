"""Who spoke to a UDP server of late: bounded, and forgotten when silent."""

from __future__ import annotations

from collections.abc import Iterator

from fwav_companion.addresses import SocketAddress
from fwav_companion.links.framing import FrameCutter

MAX_CLIENTS = 16
"""More ground stations than one vehicle ever has; each costs a copy of everything that is sent."""
CLIENT_SILENT_S = 60.0
"""Peers heartbeat at 1 Hz; after a minute's silence a client is gone, and is learned anew when it speaks."""


class Clients:
    """Addresses by when they were heard last, each with its own cutter. Instants are seconds of any one clock."""

    def __init__(self) -> None:
        self._heard_at: dict[SocketAddress, float] = {}
        self._cutters: dict[SocketAddress, FrameCutter] = {}

    def __iter__(self) -> Iterator[SocketAddress]:
        """The addresses, in the order they were learned."""
        return iter(self._heard_at)

    def whole_frames(self, address: SocketAddress, data: bytes, now_s: float) -> bytes:
        """Remember who sent ``data``; what of it may be passed on now. A lone client needs no cutting."""
        if address not in self._heard_at and len(self._heard_at) >= MAX_CLIENTS:
            self._forget(min(self._heard_at, key=self._heard_at.__getitem__))
        self._heard_at[address] = now_s
        if len(self._heard_at) == 1:
            return data
        return self._cutters.setdefault(address, FrameCutter()).cut(data)

    def forget_silent(self, now_s: float) -> None:
        """Forget who has not been heard for CLIENT_SILENT_S."""
        for address in [a for a, heard_at in self._heard_at.items() if now_s - heard_at > CLIENT_SILENT_S]:
            self._forget(address)

    def _forget(self, address: SocketAddress) -> None:
        del self._heard_at[address]
        self._cutters.pop(address, None)

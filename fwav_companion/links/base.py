"""The protocol of all links, and of the single connections that a link consists of."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Protocol, TypeAlias

from fwav_companion.fair_queues import Origin
from fwav_companion.types.network_status import LinkReport

DRAIN_LIMIT = 64
"""Largest number of reads per wake-up: enough to empty any burst, few enough that no link starves the others."""

READ_BYTES = 65536
"""Size of a read of datagrams: the largest datagram."""

SLICE_BYTES = 2048
"""Bytes of one wake-up, after which the other links have their turn. The worst mixture of bytes costs 4 us a byte, so
that what a stranger sends delays a frame of detections by a few milliseconds. A last datagram may exceed it."""

STREAM_READ_BYTES = 8192
"""Largest read of a stream; a server may read eight streams in a turn."""


class LinkState(StrEnum):
    """State of a link."""

    IDLE = "idle"
    """Not started."""
    OPENING = "opening"
    """The first attempt, or one after a loss, is under way."""
    UP = "up"
    """Bytes can pass. A UDP or TCP server is up while it listens, with or without clients."""
    DOWN = "down"
    """It could not be opened, or was lost; the next attempt follows."""
    CLOSED = "closed"
    """Closed by the service, permanently."""


OnBytes: TypeAlias = Callable[[str, bytes], bool]
"""(link's name, received bytes): whole datagrams, several joined; or any piece of a stream. Returns whether they held a
valid frame of a sender that may subscribe to the link."""

OnRefused: TypeAlias = Callable[[str, str], None]
"""(link's name, peer's address): called if there is no room for a peer, at most once a minute for a link."""

OnState: TypeAlias = Callable[[str, bool, str], None]
"""(link's name, whether it is up now, why not): called when the link comes up, is lost, or first fails to open."""


class Link(Protocol):
    """A named link that reconnects by itself."""

    @property
    def name(self) -> str:
        """The configured name."""

    @property
    def state(self) -> LinkState:
        """The present state."""

    def start(self) -> None:
        """Begin to connect. Called once, from a running loop."""

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Send whole frames without blocking. Frames that cannot leave soon are dropped and counted, never cut.

        ``origin``: where forwarded frames came from; None for the service's messages, which leave before them.
        """

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes, without waiting for the loop."""

    def close(self) -> None:
        """Close the link permanently and at once; no callback follows."""

    @property
    def source(self) -> str:
        """Host from which the bytes came that are being passed on; "" where the link has only one peer."""

    def status(self) -> LinkReport:
        """State, reason, counters, and the entries of this kind of link."""


class Traffic:
    """Counters of one link over all its connections."""

    __slots__ = ("bytes_in", "bytes_out", "dropped", "source")

    def __init__(self) -> None:
        self.bytes_in = 0
        self.bytes_out = 0
        self.dropped = 0
        """Number of writes, a slow line's of at most 280 bytes, that did not leave."""
        self.source = ""
        """Host from which the bytes came that are being passed on; "" where a link has only one peer."""


class LinkReceiver:
    """Callbacks from a connection to its link: received bytes, and the loss of the connection."""

    __slots__ = ("on_bytes", "on_lost", "refused", "traffic")

    def __init__(
        self,
        on_bytes: Callable[[bytes], bool],
        on_lost: Callable[[str], None],
        traffic: Traffic,
        refused: Callable[[str], None] = lambda _peer: None,
    ) -> None:
        self.on_bytes = on_bytes
        """Called with received bytes. Returns whether they held a valid frame that subscribes its source."""
        self.refused = refused
        """Called with the address of a peer for which there is no room."""
        self.on_lost = on_lost
        """Called with the reason. Further calls have no effect."""
        self.traffic = traffic


class Connection(Protocol):
    """One open connection. It is used once: after its loss the opener opens another."""

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Send whole frames as :meth:`Link.send` does."""

    def poll(self) -> None:
        """Pass on received bytes, as :meth:`Link.poll` does."""

    def close(self) -> None:
        """Release the connection at once, without calling ``on_lost``."""

    def status(self) -> LinkReport:
        """Report with the entries of this kind of connection alone, for example its clients."""


class Opener(Protocol):
    """Opens one connection after the other; kinds of links differ only in their opener."""

    async def open(self, receiver: LinkReceiver) -> Connection:
        """A new connection that calls ``receiver``. OSError or LinkError if it cannot be opened now."""

    def close(self) -> None:
        """Abandon an attempt that is still under way."""

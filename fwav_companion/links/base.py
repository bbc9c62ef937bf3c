"""The one protocol of all links, and of the single connections they are made of."""

from __future__ import annotations

from collections.abc import Callable
from enum import StrEnum
from typing import Protocol, TypeAlias

DRAIN_LIMIT = 64
"""Reads of one wake: enough to empty any burst, few enough that no link starves the others."""

READ_BYTES = 65536
"""The largest datagram; CPython gives back what a read does not fill."""


class LinkState(StrEnum):
    """Where a link is in its life."""

    IDLE = "idle"
    """Not started."""
    OPENING = "opening"
    """The first try, or one after a loss, is under way."""
    UP = "up"
    """Bytes can pass. A UDP or TCP server is up while it listens, with or without clients."""
    DOWN = "down"
    """It could not be opened, or was lost; it is tried again."""
    CLOSED = "closed"
    """For good."""


OnBytes: TypeAlias = Callable[[str, bytes], None]
"""(link's name, bytes that arrived): whole datagrams, several joined; or any piece of a stream."""

OnState: TypeAlias = Callable[[str, bool, str], None]
"""(link's name, whether it is up now, why not): told when it comes up, is lost, or first fails to open."""


class Link(Protocol):
    """A named way in and out that stays connected by itself."""

    @property
    def name(self) -> str:
        """As configured."""

    @property
    def state(self) -> LinkState:
        """Where it is in its life."""

    def start(self) -> None:
        """Begin to connect; from a running loop, once."""

    def send(self, data: bytes) -> None:
        """Send whole frames. Never blocks: what cannot leave soon is dropped and counted, never cut."""

    def close(self) -> None:
        """End it for good, at once; no callback follows."""

    def status(self) -> dict[str, object]:
        """For the status file: state, why, counters, and what the kind of link has to tell."""


class Traffic:
    """Counters of one link through all its connections."""

    __slots__ = ("bytes_in", "bytes_out", "dropped")

    def __init__(self) -> None:
        self.bytes_in = 0
        self.bytes_out = 0
        self.dropped = 0
        """Calls of ``send`` whose bytes did not leave."""


class Ear:
    """What a connection tells its link: bytes, and its own end."""

    __slots__ = ("heard", "lost", "traffic")

    def __init__(self, heard: Callable[[bytes], None], lost: Callable[[str], None], traffic: Traffic) -> None:
        self.heard = heard
        self.lost = lost
        """Called with the reason; more than once does no harm."""
        self.traffic = traffic


class Connection(Protocol):
    """One opened connection, used once: lost or closed, it is not opened again."""

    def send(self, data: bytes) -> None:
        """As :meth:`Link.send`."""

    def close(self) -> None:
        """Release it at once; ``lost`` is not called."""

    def status(self) -> dict[str, object]:
        """What this kind has to tell, as its clients."""


class Opener(Protocol):
    """Opens one connection after the other; the only thing that kinds of links differ in."""

    async def open(self, ear: Ear) -> Connection:
        """A new connection that tells ``ear``. OSError or LinkError where it cannot be had now."""

    def close(self) -> None:
        """Give up what may still be under way between two tries."""

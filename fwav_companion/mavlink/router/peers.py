"""Lists the (system, component) pairs heard on a link, their last arrival, and their lost frames.

Sequence numbers give the true loss only here, on one link and before any filtering (MAVLink guide, packet_loss).
"""

from __future__ import annotations

from operator import attrgetter
from typing import Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.definitions import Definition
from fwav_companion.mavlink.wire.frames import RawFrame

SILENT_NS: Final = 60 * NS_PER_S
"""Silence after which a component is forgotten: sixty missed heartbeats. Earlier, commands to a vehicle behind a radio
that fades for some seconds would be lost; later, a few bytes are wasted on a link where it is no longer heard."""
MAX_PEERS: Final = 512
"""Most peers on all links together: 128 vehicles with four components each, 0.5 kB each without their streams. Beyond
it, peers that were heard only for a moment are removed, then silent ones. If there are none, the host with most on
stations' links yields one to a host with fewer, or to the vehicle's links; otherwise a newcomer teaches no route:
invented senders do not take the place of a peer that is heard, and keep no other host out."""
ESTABLISHED_NS: Final = NS_PER_S
"""Time over which a peer must be heard before a newcomer cannot take its place."""
ABSENT_NS: Final = 5 * NS_PER_S
"""Silence of an established peer after which a newcomer can take its place: five missed heartbeats."""
MAX_PEER_STREAMS: Final = 2048
"""Most streams of all peers together, 300 bytes each."""
_LATE: Final = 32
"""Sequence numbers before the next one that count as late frames: more than UDP and bonded radios reorder."""
_WINDOW: Final = (1 << _LATE) - 1
_count: Final = attrgetter("count")
_BURST_NS: Final = NS_PER_S // 2
"""Time within which a jump of nearly 256 sequence numbers is a repeated frame instead of a loss."""
RESTART_NS: Final = 2 * NS_PER_S
"""Time for which a clock must stay lower before it counts as a restart: three messages at 1 Hz."""
UNKNOWN: Final = -1
"""Key of the one stream for all messages of unknown ids of a peer: they are all routed alike, and any sender could fill
a table with their ids."""


class PeerStream:
    """One message of one peer on one link: its count, and its destinations, which the router fills in."""

    __slots__ = ("asks_rates", "count", "definition", "direct", "peer", "plan", "targeted", "watched")

    def __init__(self, peer: Peer, definition: Definition | None) -> None:
        self.peer = peer
        self.definition = definition
        self.count = 0
        self.plan = -1
        """Version of the routing tables for which the fields below hold."""
        self.targeted = definition is not None and definition.target_system_offset >= 0
        self.direct: tuple[str, ...] | None = None
        """Names of the links that every frame goes to unchanged; None if each frame needs a decision."""
        self.asks_rates = False
        """Whether it may change the rates of the autopilot that it goes to."""
        self.watched = False
        """Whether this service reads the message."""


class PeerClock:
    """Clock of a peer by its SYSTEM_TIME messages: finds a restart that one frame cannot feign."""

    __slots__ = ("_boot_ms", "_since_ns", "_suspect_ms")

    def __init__(self) -> None:
        self._boot_ms = 0
        """Last accepted clock, milliseconds."""
        self._suspect_ms = 0
        self._since_ns: HostNs | None = None
        """Arrival of the first of the lower clocks; None while the clock has not gone back."""

    def on_stamp(self, boot_ms: int, now: HostNs) -> HostNs | None:
        """Process a clock. Returns when it became lower, after it has stayed lower for RESTART_NS; otherwise None."""
        if boot_ms >= self._boot_ms:
            self._boot_ms, self._since_ns = boot_ms, None
            return None
        if self._since_ns is None or boot_ms < self._suspect_ms:
            self._since_ns = now
        self._suspect_ms = boot_ms
        return self._since_ns if now - self._since_ns >= RESTART_NS else None


class Peer:
    """One (system, component) on one link."""

    __slots__ = (
        "_missing",
        "_missing_before",
        "_missing_received",
        "clock",
        "component",
        "last_ns",
        "late",
        "lost",
        "next_seq",
        "repeated",
        "since_ns",
        "source",
        "streams",
        "system",
    )

    def __init__(self, frame: RawFrame, now: HostNs, source: str = "") -> None:
        self.source = source
        """Host that it was first heard from; "" where the link has only one peer."""
        self.system = frame.system
        self.component = frame.component
        self.since_ns = self.last_ns = now
        """Times of its first and last frame."""
        self.next_seq = frame.seq
        self.lost = 0
        """Missing frames, by their sequence numbers; a lower bound for a gap of more than 255 frames."""
        self.late = 0
        """Frames that arrived after their successors."""
        self.repeated = 0
        self.streams: dict[int, PeerStream] = {}
        """Streams by message id."""
        self.clock: PeerClock | None = None
        """Clock of the peer; None before its first SYSTEM_TIME."""
        self._missing = 0
        """Window of the last 32 sequence numbers, as in IPsec (RFC 4303, 3.4.3): bit b is set while the number
        ``_missing_before - 1 - b`` is missing. One integer, because strangers can invent every peer."""
        self._missing_before = frame.seq
        self._missing_received = 0
        """:attr:`next_seq` and :attr:`received` when the window was last changed. Since then all frames came in order
        or were repeated ones, so the window is moved when it is needed, not with each frame."""

    def gives_way(self, now: HostNs) -> bool:
        """Return whether a newcomer may take its place."""
        return self.last_ns - self.since_ns < ESTABLISHED_NS or now - self.last_ns >= ABSENT_NS

    @property
    def received(self) -> int:
        """Number of frames received, without repeated ones."""
        received: int = sum(map(_count, self.streams.values())) - self.repeated
        return received

    def on_gap(self, seq: int, now: HostNs) -> None:
        """Process a frame that is not the next one. Call it before ``last_ns`` is set."""
        received, before, missing = self.received, self.next_seq, self._missing
        if missing:
            if received - self._missing_received > _LATE:
                missing = 0  # the counter of 8 bits may have wrapped since
            else:
                missing = missing << ((before - self._missing_before) & 0xFF) & _WINDOW
        behind = (before - seq) & 0xFF
        if behind <= _LATE:
            if missing >> behind - 1 & 1:
                self.late += 1
                self.lost -= 1
                self._missing, self._missing_before = missing ^ 1 << behind - 1, before
                self._missing_received = received
                return
            if now - self.last_ns < _BURST_NS:
                self.repeated += 1
                return
        gap = -behind & 0xFF
        self.lost += gap
        self.next_seq = self._missing_before = (seq + 1) & 0xFF
        self._missing = (missing << gap + 1 | (1 << gap + 1) - 2) & _WINDOW
        self._missing_received = received

    def known_stream(self, frame: RawFrame) -> PeerStream | None:
        """Return the stream of the frame's message; None if it is new."""
        return self.streams.get(UNKNOWN if frame.definition is None else frame.msgid)

    def add_stream(self, frame: RawFrame) -> PeerStream:
        """Add the stream of the frame's message."""
        stream = PeerStream(self, frame.definition)
        self.streams[UNKNOWN if frame.definition is None else frame.msgid] = stream
        return stream

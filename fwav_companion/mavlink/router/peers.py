"""Who is heard on a link: the (system, component) pairs, when they spoke last, and what was lost of them.

Sequence numbers tell a loss truly only here, on one link and before anything is filtered (MAVLink guide, packet_loss).
"""

from __future__ import annotations

from typing import Any, Final

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.definitions import Definition
from fwav_companion.mavlink.wire.frames import RawFrame

SILENT_NS: Final = 60 * NS_PER_S
"""A component that missed sixty heartbeats in a row is not there any more. Forgetting it early would lose commands to a
vehicle behind a radio that fades for some seconds; late costs a few bytes to where it was."""
MAX_PEERS: Final = 1024
"""On one link: 250 vehicles with four components each. When there are more, the longest silent eighth is forgotten."""
_LATE: Final = 32
"""So many sequence numbers are still taken for late rather than lost: more than UDP and bonded radios reorder."""
_BURST_NS: Final = NS_PER_S // 2
"""Nearly a whole round of 256 frames within this is no loss but a frame that was sent twice."""
UNKNOWN: Final = -1
"""The one stream that all messages of unknown ids of a peer share: they are all routed alike, and cannot be counted
apart without a table that strangers fill."""


class PeerStream:
    """One message of one peer on one link: how many came, and where they go. The router fills in the latter."""

    __slots__ = ("asks_rates", "count", "definition", "direct", "peer", "plan", "routes", "targeted", "watched")

    def __init__(self, peer: Peer, definition: Definition | None) -> None:
        self.peer = peer
        self.definition = definition
        self.count = 0
        self.plan = -1
        """The version of the routing tables for which the rest holds."""
        self.targeted = definition is not None and definition.target_system_offset >= 0
        self.direct: tuple[str, ...] | None = None
        """Names of the links where every frame goes as it is; None where each frame has to be looked at."""
        self.routes: dict[int, Any] = {}
        """The links it goes to by what it is meant for, (system << 8 | component)."""
        self.asks_rates = False
        """It may change the rates of the autopilot that it goes to."""
        self.watched = False
        """Somebody here wants to read it."""


class Peer:
    """One (system, component) on one link."""

    __slots__ = (
        "_missing",
        "boot_ms",
        "component",
        "last_ns",
        "late",
        "lost",
        "next_seq",
        "repeated",
        "streams",
        "system",
    )

    def __init__(self, frame: RawFrame, now: HostNs) -> None:
        self.system = frame.system
        self.component = frame.component
        self.last_ns = now
        """When it was heard last."""
        self.next_seq = frame.seq
        self.lost = 0
        """Frames that never came, by their sequence numbers. Of a silence longer than 255 frames, a lower bound."""
        self.late = 0
        """Frames that came after their successors."""
        self.repeated = 0
        self.streams: dict[int, PeerStream] = {}
        """By message id."""
        self.boot_ms = 0
        """Its clock, as SYSTEM_TIME told it last."""
        self._missing: dict[int, int] = {}
        """Sequence number -> how many frames had been received when it was missed."""

    @property
    def received(self) -> int:
        """Frames, but for repeated ones."""
        return sum(stream.count for stream in self.streams.values()) - self.repeated

    def on_gap(self, seq: int, now: HostNs) -> None:
        """A frame came that is not the next one. To be called before ``last_ns`` is set."""
        received = self.received
        behind = (self.next_seq - seq) & 0xFF
        missed_at = self._missing.get(seq)
        if behind <= _LATE and missed_at is not None and received - missed_at <= _LATE:
            del self._missing[seq]
            self.late += 1
            self.lost -= 1
            return
        if behind <= _LATE and now - self.last_ns < _BURST_NS:
            self.repeated += 1
            return
        gap = (seq - self.next_seq) & 0xFF
        self.lost += gap
        for back in range(1, min(gap, _LATE) + 1):
            self._missing[(seq - back) & 0xFF] = received
        self.next_seq = (seq + 1) & 0xFF

    def stream(self, frame: RawFrame) -> PeerStream:
        """That of the frame's message, made where it is met for the first time."""
        key = UNKNOWN if frame.definition is None else frame.msgid
        stream = self.streams.get(key)
        if stream is None:
            stream = self.streams[key] = PeerStream(self, frame.definition)
        return stream

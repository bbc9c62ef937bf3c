"""Our place in the MAVLink network: bytes of every link in, messages for us and bytes for other links out."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Final

import msgspec

from fwav_companion.errors import EncodeError
from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.codec import decode, pack
from fwav_companion.mavlink.codec import frame as frame_bytes
from fwav_companion.mavlink.definitions import BY_NAME, constant
from fwav_companion.mavlink.duplicates import Duplicates
from fwav_companion.mavlink.peers import UNKNOWN, Stream
from fwav_companion.mavlink.routing import COMMANDS, REQUEST_DATA_STREAM, LinkPolicy, Port, Router
from fwav_companion.mavlink.scanner import FLAG_SIGNED, RawFrame
from fwav_companion.mavlink.signing import Signature, Signer, SigningClock, Verifier
from fwav_companion.mavlink.statistics import LinkStatistics, StatisticsTaker
from fwav_companion.nouns import Destination, Message, Outgoing

__all__ = ["LinkPolicy", "Node", "Received", "SigningPolicy"]

UNADOPTED_SYSTEM: Final = 1
"""Our system id until the vehicle's is known."""
GROUND_STATION_NS: Final = 5 * NS_PER_S
"""A ground station that missed five heartbeats is not there (MAVLink guide, heartbeat)."""
QUIET_NS: Final = 50 * NS_PER_MS
"""A stream that pauses so long pauses between frames: more than the 16 ms that USB serial adapters gather bytes for."""
_HEARTBEAT: Final = BY_NAME["HEARTBEAT"]
_SYSTEM_TIME: Final = BY_NAME["SYSTEM_TIME"]
_RADIO_STATUS: Final = BY_NAME["RADIO_STATUS"].msgid
_TYPE_OFFSET: Final = _HEARTBEAT.fields["type"].offset
_BOOT_OFFSET: Final = _SYSTEM_TIME.fields["time_boot_ms"].offset
_COMMAND_OFFSET: Final = BY_NAME["COMMAND_LONG"].fields["command"].offset
_MAV_TYPE_GCS: Final = constant("MAV_TYPE_GCS")
_SET_MESSAGE_INTERVAL: Final = constant("MAV_CMD_SET_MESSAGE_INTERVAL")
_ANSWERS: Final = frozenset({BY_NAME["COMMAND_ACK"].msgid})
"""Messages that name their receiver and yet ask nothing of it: taken unsigned where telemetry is."""


class SigningPolicy(msgspec.Struct, frozen=True, kw_only=True):
    """With a key, every frame of ours is signed, and of others' only signed ones are read."""

    key: bytes
    """32 bytes."""
    timestamp: int
    """To begin with, from :func:`~fwav_companion.mavlink.signing.starting_timestamp`."""
    accept_unsigned: frozenset[str] = frozenset()
    """Links by which unsigned telemetry is read all the same; never what asks something of us."""


class Received(msgspec.Struct):
    """What some bytes of a link came to."""

    messages: list[Message]
    """Those that are wanted and meant for us or for all, in order."""
    forwards: list[tuple[str, bytes]]
    """(link, frame as it came), to be sent in order."""
    rate_request: str = ""
    """Who asked for other message rates in a frame that goes on to an autopilot: it may undo ours."""


class Node:
    """Feed it the bytes of each link, send what it hands back. Our components share the vehicle's system id."""

    def __init__(
        self,
        links: Sequence[LinkPolicy],
        wanted: Iterable[str],
        *,
        components: Iterable[int] = (191, 100),
        signing: SigningPolicy | None = None,
    ) -> None:
        """``wanted``: names of the messages to decode. ``components``: ours. Links are up until told otherwise."""
        self._wanted = frozenset(BY_NAME[name].msgid for name in wanted)
        self._router = Router(links, UNADOPTED_SYSTEM, frozenset(components))
        self._ports = {port.name: port for port in self._router.ports}
        self._several = len(self._ports) > 1
        self._duplicates = Duplicates()
        self._sequences: dict[tuple[str, int], int] = {}
        self._accept_unsigned = signing.accept_unsigned if signing else frozenset()
        self._clock = SigningClock(signing.timestamp) if signing else None
        self._verifier = Verifier(signing.key, self._clock) if signing and self._clock else None
        self._signers = (
            {port.name: Signer(signing.key, port.index & 0xFF, self._clock) for port in self._router.ports}
            if signing and self._clock
            else {}
        )
        self._settle_ns: dict[str, HostNs] = {}
        self._statistics = StatisticsTaker(self._router)

    @property
    def system(self) -> int:
        """The system id that we speak with."""
        return self._router.system

    @property
    def signing_clock(self) -> SigningClock | None:
        """Its timestamp is to be kept; None without a key."""
        return self._clock

    def adopt(self, system: int) -> None:
        """Speak with the vehicle's system id from now on."""
        self._router.adopt(system)

    def link_up(self, link: str) -> None:
        """The link is connected, perhaps to somebody else than before."""
        self._router.set_up(self._ports[link], True)

    def link_down(self, link: str) -> None:
        """Nothing goes to the link, and who was behind it is forgotten."""
        self._router.set_up(self._ports[link], False)
        self._settle_ns.pop(link, None)

    # In.

    def receive(self, link: str, data: bytes, now: HostNs) -> Received:
        """Bytes came by a link."""
        port = self._ports[link]
        port.bytes_in += len(data)
        self._router.sweep(now)
        received = self._take(port, port.scanner.feed(data), now)
        if port.scanner.undecided:
            self._settle_ns[link] = HostNs(now + QUIET_NS)
        elif self._settle_ns:
            self._settle_ns.pop(link, None)
        return received

    @property
    def wake_at(self) -> HostNs | None:
        """When :meth:`on_wake` is due; None while nothing waits, which is nearly always."""
        return min(self._settle_ns.values(), default=None)

    def on_wake(self, now: HostNs) -> Received:
        """A stream has been quiet: what may be a frame of an unknown id and waits for what follows, is one."""
        received = Received([], [])
        for link in [link for link, due in self._settle_ns.items() if due <= now]:
            del self._settle_ns[link]
            port = self._ports[link]
            settled = self._take(port, port.scanner.settle(), now)
            received.messages += settled.messages
            received.forwards += settled.forwards
            received.rate_request = settled.rate_request or received.rate_request
        return received

    def _take(self, port: Port, frames: Sequence[RawFrame], now: HostNs) -> Received:
        """The relay's hot path: for most frames a few look-ups, worked out when the tables last changed."""
        received = Received([], [])
        peers, router, forwards = port.peers, self._router, received.forwards
        for frame in frames:
            peer = peers.get(frame.system << 8 | frame.component)
            if peer is None:
                if not self._is_new(port, frame, now):
                    continue
                peer = router.learn(port, frame, now)
            seq = frame.seq
            if seq == peer.next_seq:
                peer.next_seq = (seq + 1) & 0xFF
            else:
                peer.on_gap(seq, now)
            peer.last_ns = now
            stream = peer.streams.get(frame.msgid) or peer.stream(frame)
            stream.count += 1
            if self._several and self._duplicates.came_by_another(frame.data, port.index, now):
                port.duplicates += 1
                continue
            if stream.plan != router.version:
                router.plan(port, frame, stream)
                stream.watched = self._watches(frame)
            if stream.direct is None:
                self._forward(port, frame, stream, received, now)
            else:
                for name in stream.direct:
                    forwards.append((name, frame.data))
            if stream.watched:
                self._read(port, frame, received, now)
                peers = port.peers
        return received

    def _is_new(self, port: Port, frame: RawFrame, now: HostNs) -> bool:
        """Somebody speaks here for the first time: not ourselves through a crossed wire, nor a copy from elsewhere."""
        if self._router.is_own(frame):
            port.echoes += 1
            return False
        if self._duplicates.came_by_another(frame.data, port.index, now):
            port.duplicates += 1
            return False
        return True

    def _watches(self, frame: RawFrame) -> bool:
        definition = frame.definition
        return definition is not None and (
            definition.msgid in self._wanted or definition is _HEARTBEAT or definition is _SYSTEM_TIME
        )

    def _forward(self, port: Port, frame: RawFrame, stream: Stream, received: Received, now: HostNs) -> None:
        """A frame that names a receiver, or that some link thins."""
        msgid = frame.msgid if frame.definition is not None else UNKNOWN
        outs = self._router.route_of(port, frame, stream)
        if not outs and msgid == REQUEST_DATA_STREAM and not port.forwards_rate_requests:
            port.stopped += 1
        for index in outs:
            out = self._router.ports[index]
            if out.thinner.limits(msgid) and not self._passes(out, frame, now):
                out.thinned += 1
                continue
            received.forwards.append((out.name, frame.data))
            if stream.asks_rates and out.is_autopilot and _asks_rates(frame):
                received.rate_request = f"{frame.system}/{frame.component} on {port.name}"

    def _passes(self, out: Port, frame: RawFrame, now: HostNs) -> bool:
        offset = frame.definition.instance_offset if frame.definition else -1
        instance = _payload_byte(frame, offset) if offset >= 0 else 0
        return out.thinner.passes(frame.msgid, frame.system << 8 | frame.component, instance, now)

    def _read(self, port: Port, frame: RawFrame, received: Received, now: HostNs) -> None:
        """A message that somebody here watches, if it is meant for us and may be believed."""
        definition = frame.definition
        if definition is None:
            return
        targeted = definition.target_system_offset >= 0
        if targeted and not self._router.is_for_us(frame.target_system, frame.target_component):
            return
        if definition is _SYSTEM_TIME:
            self._notice_reboot(port, frame, now)
        signed = False
        if self._verifier is not None:
            signed = frame.signed
            if not (self._is_genuine(port, frame, now) if signed else self._accepts_unsigned(port, frame, targeted)):
                return
        if definition is _HEARTBEAT and not port.is_autopilot and _payload_byte(frame, _TYPE_OFFSET) == _MAV_TYPE_GCS:
            port.ground_station_ns = now
        if definition.msgid in self._wanted:
            received.messages.append(decode(frame, port.name, signed=signed))

    def _is_genuine(self, port: Port, frame: RawFrame, now: HostNs) -> bool:
        if self._verifier is None:
            return False
        verdict = self._verifier.verify(frame.data, frame.system, frame.component, now)
        if verdict is not Signature.GENUINE:
            port.refused_signatures += 1
        return verdict is Signature.GENUINE

    def _accepts_unsigned(self, port: Port, frame: RawFrame, targeted: bool) -> bool:
        """A radio cannot sign. What asks something of us must be signed, by whatever link it comes."""
        if frame.msgid == _RADIO_STATUS:
            return True
        accepted = port.name in self._accept_unsigned and (not targeted or frame.msgid in _ANSWERS)
        port.refused_unsigned += not accepted
        return accepted

    def _notice_reboot(self, port: Port, frame: RawFrame, now: HostNs) -> None:
        boot_ms = int.from_bytes(frame.payload[_BOOT_OFFSET : _BOOT_OFFSET + 4], "little")
        peer = port.peers[frame.system << 8 | frame.component]
        if boot_ms < peer.boot_ms:
            self._router.forget_system(frame.system)
            peer = self._router.learn(port, frame, now)
            peer.next_seq = (frame.seq + 1) & 0xFF
        peer.boot_ms = boot_ms

    # Out.

    def encode(self, outgoing: Outgoing, now: HostNs) -> list[tuple[str, bytes]]:
        """(link, frame) for every link that the message goes to, each with the next sequence number of its component
        on that link: so each peer counts losses truly. EncodeError if there is no such message, field or link.
        """
        self._router.sweep(now)
        definition, payload = pack(outgoing.name, outgoing.fields)
        component = outgoing.component
        frames = []
        for port in self._ports_to(outgoing, now):
            if port.thinner.limits(definition.msgid):
                sender = self.system << 8 | component
                if not port.thinner.passes(definition.msgid, sender, 0, now):
                    port.thinned += 1
                    continue
            key = (port.name, component)
            seq = self._sequences.get(key, 0)
            self._sequences[key] = (seq + 1) & 0xFF
            signer = self._signers.get(port.name)
            flags = FLAG_SIGNED if signer else 0
            data = frame_bytes(definition, payload, self.system, component, seq, flags)
            frames.append((port.name, signer.sign(data, now) if signer else data))
        return frames

    def _ports_to(self, outgoing: Outgoing, now: HostNs) -> list[Port]:
        ports = [port for port in self._router.ports if port.up]
        match outgoing.to:
            case Destination.EVERYONE:
                return ports
            case Destination.GROUND_LINKS:
                return [port for port in ports if not port.is_autopilot]
            case Destination.GROUND:
                through_autopilot = not self.hears_ground_station(now)
                return [port for port in ports if through_autopilot or not port.is_autopilot]
            case Destination.AUTOPILOT:
                autopilots = [port for port in ports if port.is_autopilot]
                return [port for port in autopilots if port.hears_system(self.system)] or autopilots
            case Destination.REPLY:
                if outgoing.link not in self._ports:
                    raise EncodeError(f"{outgoing.name} is to go to link {outgoing.link!r}; there are {[*self._ports]}")
                return [port for port in ports if port.name == outgoing.link]

    def hears_ground_station(self, now: HostNs) -> bool:
        """A ground station's heartbeat was heard on a gcs link lately."""
        heard = (port.ground_station_ns for port in self._router.ports)
        return any(at is not None and now - at <= GROUND_STATION_NS for at in heard)

    def statistics(self, now: HostNs) -> list[LinkStatistics]:
        """What each link carried and lost; rates are those since the last call."""
        return self._statistics.take(now)


def _payload_byte(frame: RawFrame, offset: int) -> int:
    payload = frame.payload
    return payload[offset] if offset < len(payload) else 0


def _asks_rates(frame: RawFrame) -> bool:
    if frame.msgid not in COMMANDS:
        return True
    command = frame.payload[_COMMAND_OFFSET : _COMMAND_OFFSET + 2]
    return int.from_bytes(command, "little") == _SET_MESSAGE_INTERVAL

"""Our node in the MAVLink network: takes the bytes of every link, returns messages for us and bytes for other links."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.mavlink.router.acceptance import Acceptance
from fwav_companion.mavlink.router.coalescing import coalesced
from fwav_companion.mavlink.router.duplicates import Duplicates
from fwav_companion.mavlink.router.link_reports import LinkReports
from fwav_companion.mavlink.router.peers import UNKNOWN, PeerStream
from fwav_companion.mavlink.router.ration import rejection
from fwav_companion.mavlink.router.reading import FrameReader
from fwav_companion.mavlink.router.routing import SETUP_SIGNING, TIMESYNC, LinkPolicy, Port, Router
from fwav_companion.mavlink.router.sending import Sender
from fwav_companion.mavlink.router.signing_policy import Keyring, SigningPolicy, Trust
from fwav_companion.mavlink.router.station_rates import Why
from fwav_companion.mavlink.router.statistics import StatisticsTaker
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.enums import MAV_COMP_ID_AUTOPILOT1
from fwav_companion.mavlink.wire.foreign_bytes import ForeignBytes
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest, rate_request
from fwav_companion.mavlink.wire.signing import SigningClock
from fwav_companion.types import Message, Notice, Outgoing
from fwav_companion.types.network_status import LinkStatistics

__all__ = ["LinkPolicy", "Node", "Received", "SigningPolicy"]

UNADOPTED_SYSTEM: Final = 1
"""Our system id until the vehicle's is known."""
QUIET_NS: Final = 50 * NS_PER_MS
"""Pause after which a stream is taken to be between frames: above the 16 ms for which USB serial adapters gather
bytes."""
_TC1_OFFSET: Final = BY_NAME["TIMESYNC"].fields["tc1"].offset
_TS1_OFFSET: Final = BY_NAME["TIMESYNC"].fields["ts1"].offset


class PassedRequest(msgspec.Struct, frozen=True):
    """Request for message rates that is forwarded to an autopilot."""

    request: RateRequest
    merged: bool
    """Whether our own rates must follow it in the same write if they are higher."""


class Received(msgspec.Struct):
    """Result of bytes received on a link."""

    messages: list[Message]
    """Wanted messages that are addressed to us or to all and are trusted, in order."""
    forwards: list[tuple[str, bytes]]
    """(link, whole frames as received), to be sent in order; frames of one receive are :func:`coalesced`."""
    frames: Sequence[RawFrame] = ()
    """All accepted frames, for a recording: without duplicates, echoes of ours, frames refused for their signature, and
    SETUP_SIGNING, which carries a key."""
    rate_requests: Sequence[PassedRequest] = ()
    """Rate requests in frames that are forwarded to an autopilot: they may lower our rates."""
    copied: bool = False
    """Whether there were known frames of a known sender that had already arrived by another link."""

    @property
    def subscribes(self) -> bool:
        """Whether a frame with a right checksum arrived from a sender that may subscribe to the link."""
        for frame in self.frames:  # not any(): its generator costs as much as the routing of a frame
            if frame.flow.definition is not None:
                return True
        return self.copied


class Node:
    """Receives, routes and encodes frames: pass in the bytes of each link, send the results. Our components share the
    vehicle's system id.
    """

    def __init__(
        self,
        links: Sequence[LinkPolicy],
        wanted: Iterable[str],
        *,
        components: Iterable[int] = (191, 100),
        signing: SigningPolicy | None = None,
    ) -> None:
        """Start with all links up. ``wanted``: names of the messages to decode. ``components``: ids of our
        components, the companion's first.
        """
        components = tuple(components)
        self._companion = next(iter(components), MAV_COMP_ID_AUTOPILOT1)
        self._keyring = Keyring(signing)
        self._router = Router(links, UNADOPTED_SYSTEM, frozenset(components))
        self._sender = Sender(self._router, self._keyring)
        self._statistics = StatisticsTaker(self._router)
        self._ports = {port.name: port for port in self._router.ports}
        self._duplicates = Duplicates()
        self._acceptance = Acceptance(self._router, self._duplicates, self._sender.own_frames)
        self._foreign = ForeignBytes()
        self._reader = FrameReader(self._router, self._acceptance, wanted, foreign=self._foreign)
        self._reports = LinkReports(self._router.ports)
        self._settle_ns: dict[str, HostNs] = {}
        self._release_ns: dict[str, HostNs] = {}

    @property
    def system(self) -> int:
        """System id that we send with."""
        return self._router.system

    @property
    def signing_clock(self) -> SigningClock | None:
        """Clock whose timestamp must be stored; None without a key."""
        return self._keyring.clock

    def adopt(self, system: int, autopilot: int | None = MAV_COMP_ID_AUTOPILOT1, *, vehicle: int | None = None) -> None:
        """Send with the vehicle's system id from now on. ``autopilot``: component id of its autopilot; None before the
        vehicle is known. ``vehicle``: its system id where we send with another one; None: the same.
        """
        sender = system if vehicle is None else vehicle
        self._router.adopt(system, None if autopilot is None else (sender, autopilot))

    def share(self, own: OwnStreams) -> None:
        """Take the requests of this service: they alone do not send a message to links that merge requests."""
        self._router.share(own)

    @property
    def demanded(self) -> Mapping[int, float]:
        """Highest rate, hertz, that stations on merging links request from the autopilot, by message id."""
        return self._router.merged.demanded

    @property
    def foreign_bytes(self) -> int:
        """Bytes of the accepted frames of other systems than ours, since the start."""
        return self._foreign.beside(self._router.system)

    def link_up(self, link: str) -> None:
        """Note that the link is connected, possibly to another peer than before."""
        self._router.set_up(self._ports[link], True)

    def link_down(self, link: str) -> None:
        """Stop sending to the link, and forget its peers."""
        self._router.set_up(self._ports[link], False)
        self._settle_ns.pop(link, None)

    def receive(self, link: str, data: bytes, now: HostNs, source: str = "") -> Received:
        """Take the bytes that arrived on a link. ``source``: their host; "" where the link has only one peer."""
        port = self._ports[link]
        port.source = source
        port.bytes_in += len(data)
        received = self._take(port, port.scanner.feed(data), now)
        if port.scanner.undecided:
            self._settle_ns[link] = HostNs(now + QUIET_NS)
        elif self._settle_ns:
            self._settle_ns.pop(link, None)
        if self._release_ns:
            self._release(received, now)
        return received

    @property
    def wake_at(self) -> HostNs | None:
        """Time at which :meth:`on_wake` is due; None if nothing waits, which is nearly always the case."""
        if not self._settle_ns and not self._release_ns:
            return None
        return min([*self._settle_ns.values(), *self._release_ns.values()], default=None)

    def on_wake(self, now: HostNs) -> Received:
        """Accept a waiting frame of an unknown id if its stream has been quiet, and release frames held for slow
        links.
        """
        received = Received([], [])
        self._release(received, now)
        for link in [link for link, due in self._settle_ns.items() if due <= now]:
            del self._settle_ns[link]
            port = self._ports[link]
            settled = self._take(port, port.scanner.settle(), now)
            received.messages += settled.messages
            received.forwards += settled.forwards
            received.frames = [*received.frames, *settled.frames]
            received.rate_requests = [*received.rate_requests, *settled.rate_requests]
        return received

    def encode(self, outgoing: Outgoing, now: HostNs) -> list[tuple[str, bytes]]:
        """Return (link, frame) for every link that the message goes to, each with the next sequence number of its
        component on that link. Raises EncodeError if there is no such message, field or link.
        """
        self._router.sweep(now)
        return self._sender.encode(outgoing, now)

    def hears_ground_station(self, now: HostNs) -> bool:
        """Return whether a ground station's heartbeat was heard on a gcs link lately."""
        return self._router.hears_ground_station(now)

    def statistics(self, now: HostNs) -> list[LinkStatistics]:
        """Return the traffic and losses of each link; rates are those since the last call."""
        return self._statistics.take(now)

    def notices(self, now: HostNs) -> list[Notice]:
        """Return the notices of refused frames and requests that are due; call it about once a second."""
        return self._reports.take(now)

    def _release(self, received: Received, now: HostNs) -> None:
        """Forward the held transfer frames that slow links can take now."""
        for name in list(self._release_ns):
            limiter = self._ports[name].limiter
            received.forwards += coalesced([(name, data) for data in limiter.release(now)])
            if limiter.holds_any:
                self._release_ns[name] = limiter.release_at(now)
            else:
                del self._release_ns[name]

    def _take(self, port: Port, frames: Sequence[RawFrame], now: HostNs) -> Received:
        """Process frames. This is the hot path of the relay: most frames need a few look-ups, prepared when the tables
        last changed.
        """
        received = Received([], [], frames)
        router, link, forward, read = self._router, port.index, received.forwards.append, self._reader.read
        count, genuine = self._foreign.add, self._acceptance.is_genuine
        has_key = self._keyring.has_key
        router.sweep(now)
        young, old = self._duplicates.generations(now)
        dropped: list[RawFrame] = []
        for frame in frames:
            data, flow, seq = frame.data, frame.flow, frame.seq
            trust = self._trust(port, frame, received=received, now=now) if has_key else Trust.OPEN
            if trust is None or (flow.version != router.version and not self._attach(port, frame, received, now)):
                dropped.append(frame)
                continue
            stream: PeerStream = flow.stream
            peer = stream.peer
            if seq == peer.next_seq:
                peer.next_seq = (seq + 1) & 0xFF
            else:
                peer.on_gap(seq, now)
            peer.last_ns = now
            stream.count += 1
            if (old.get(data, link) != link or young.setdefault(data, link) != link) and not genuine(port, frame):
                port.duplicates += 1
                received.copied |= self._reader.on_copy(port, frame, now)
                dropped.append(frame)
                continue
            if stream.direct is None or trust is Trust.UNSIGNED_REQUEST:
                self._forward(port, frame, stream=stream, trust=trust, received=received, now=now)
            else:
                for name in stream.direct:
                    forward((name, data))
            if stream.watched and not read(port, frame, trust=trust, messages=received.messages, now=now):
                dropped.append(frame)
            else:
                count(flow.system, data)
        if len(frames) > 1:
            received.forwards = coalesced(received.forwards)
        if dropped:
            received.frames = _without(received.frames, dropped)
        return received

    def _trust(self, port: Port, frame: RawFrame, received: Received, now: HostNs) -> Trust | None:
        """Return the trust level of a frame; None if it teaches no route, and goes at most to ground links."""
        trust = self._keyring.judge(port, frame, now)
        match trust:
            case Trust.NONE:
                received.forwards += self._acceptance.forwards_of_untrusted(port, frame, now)
                return None
            case Trust.RADIO:
                self._reader.on_radio(port, frame, received.messages, now)
                received.forwards += self._acceptance.forwards_of_untrusted(port, frame, now)
                return None
            case Trust.LATE_COPY if not self._acceptance.is_second_copy(port, frame):
                port.late_copy += 1
                return None
        return Trust.SIGNED if trust is Trust.LATE_COPY else trust

    def _attach(self, port: Port, frame: RawFrame, received: Received, now: HostNs) -> bool:
        """Recompute the routing data of a flow. Returns False if its frames are not accepted."""
        router, flow = self._router, frame.flow
        peer = port.peers.get(flow.system << 8 | flow.component) or self._acceptance.new_peer(port, frame, now)
        if peer is None:
            received.forwards += self._acceptance.forwards_of_refused(port, frame, now)
            return False
        flow.stream = stream = router.stream(port, peer, frame, now)
        flow.version = router.version
        if stream.plan != router.version:
            router.plan(port, frame, stream)
            stream.watched = flow.definition is not None and flow.msgid in self._reader.watched
        return True

    def _forward(
        self, port: Port, frame: RawFrame, *, stream: PeerStream, trust: Trust, received: Received, now: HostNs
    ) -> None:
        """Forward a frame that names a receiver, or that a link thins."""
        msgid = UNKNOWN if frame.definition is None else frame.msgid
        sender = frame.system << 8 | frame.component
        outs = self._router.route_of(port, frame, stream)
        if trust is Trust.UNSIGNED_REQUEST and not port.relays_unsigned:
            outs = self._router.on_ground(port, outs)
        if msgid == SETUP_SIGNING:
            received.frames = _without(received.frames, [frame])
        request = rate_request(frame, port.name, port.source) if stream.asks_rates else None
        if request is not None:
            outs = self._admit(port, request, outs=outs, received=received, now=now)
        key, size = (msgid, sender, frame.instance), len(frame.data)
        only_ours = msgid == TIMESYNC and self._answers_us(frame)
        if port.is_gcs and trust is not Trust.SIGNED:
            outs = self._acceptance.granted(outs, key, size, now)
        for out in outs:
            if only_ours and out.merges_rate_requests:
                out.limiter.refuse(key, Why.ONLY_OURS)
            elif out.limiter.holds(msgid, frame.data, (port.name, port.source), now):
                self._release_ns[out.name] = out.limiter.release_at(now)
            elif out.limiter.passes(key, size, now):
                received.forwards.append((out.name, frame.data))

    def _answers_us(self, frame: RawFrame) -> bool:
        """Return whether the frame is a TIMESYNC answer to our request: it would disturb any other component's clock
        filter.
        """
        payload = frame.payload  # without its trailing zeros
        asked = payload[_TS1_OFFSET : _TS1_OFFSET + 8].ljust(8, b"\0")
        answered = any(payload[_TC1_OFFSET : _TC1_OFFSET + 8])
        return answered and int.from_bytes(asked, "little", signed=True) in self._sender.timesyncs

    def _admit(
        self, port: Port, request: RateRequest, outs: tuple[Port, ...], received: Received, now: HostNs
    ) -> tuple[Port, ...]:
        """Return the links that a rate request goes to, and note the request if it reaches an autopilot."""
        if request.once is None and not port.forwards_rate_requests:
            port.stopped += request.by_group or any(out.is_autopilot for out in outs)
            return tuple(out for out in outs if not out.is_autopilot)
        if any(out.is_autopilot for out in outs):
            rationed, source = request.once is None and port.merges_rate_requests, port.source or request.sender
            if rationed and not (self._router.merged.has_room(request, now) and port.ration.takes(source, now)):
                port.stopped += 1
                port.rationed += 1
                port.rationed_sender = f"{request.system}/{request.component} {port.source}".rstrip()
                received.forwards += self._reject(request, now)
                return ()
            self._router.note(request, now)
            if request.once is None:
                passed = PassedRequest(request, merged=port.merges_rate_requests)
                received.rate_requests = [*received.rate_requests, passed]
        return outs

    def _reject(self, request: RateRequest, now: HostNs) -> list[tuple[str, bytes]]:
        answer = rejection(request, self._companion)
        return [] if answer is None else self._sender.encode(answer, now)


def _without(frames: Sequence[RawFrame], dropped: Sequence[RawFrame]) -> Sequence[RawFrame]:
    gone = {id(frame) for frame in dropped}
    return [frame for frame in frames if id(frame) not in gone]

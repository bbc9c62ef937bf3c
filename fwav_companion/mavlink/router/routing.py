"""Decides where a frame goes, by MAVLink's routing rules (developer guide, routing) and the peers heard on each link.

1. To us: a frame without target system, or for system 0; or for our system with no component, component 0, or one of
   ours.
2. To another link: a frame without target system, or for system 0; for another system if that system was heard there;
   for our own system if the target component was heard there, or any component of it if the frame names none.
3. Never back to the link it came from, nor to one where its sender itself was heard: it would be an echo. A sender that
   is heard on an autopilot or payload link is never heard on a link of ground stations.
4. Never SETUP_SIGNING, which carries a key. Never to an autopilot's link: RADIO and RADIO_STATUS, which an autopilot
   takes for those of its own radio, and ADSB_VEHICLE, which it would avoid.
5. A station's request for message rates reaches the autopilot, unless its link stops them (``forward_rate_requests``).
   If the link merges them, our own rates follow (:mod:`~fwav_companion.mavlink.router.station_rates`).

The peers of a link are forgotten when it goes down, and each one after a silence. When the clock of a system
(SYSTEM_TIME) goes back and stays back, its components that have been silent since then are forgotten. Frames are
forwarded byte for byte; frames of unknown ids have no known target and go to every link.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, Literal

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.link_limiter import LinkLimiter
from fwav_companion.mavlink.router.peer_tables import PeerTables
from fwav_companion.mavlink.router.peers import SILENT_NS, UNKNOWN, Peer, PeerClock, PeerStream
from fwav_companion.mavlink.router.ration import Ration
from fwav_companion.mavlink.router.station_rates import MergedRates
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.flow_table import MAX_FLOWS
from fwav_companion.mavlink.wire.frames import RawFrame
from fwav_companion.mavlink.wire.rate_messages import (
    MESSAGE_INTERVAL,
    RATE_REQUESTS,
    REQUEST_DATA_STREAM,
    OwnStreams,
    RateRequest,
)
from fwav_companion.mavlink.wire.scanner import Scanner

SETUP_SIGNING: Final = BY_NAME["SETUP_SIGNING"].msgid
RADIO_REPORTS: Final = frozenset(BY_NAME[name].msgid for name in ("RADIO", "RADIO_STATUS"))
NOT_TO_AUTOPILOTS: Final = RADIO_REPORTS | {BY_NAME["ADSB_VEHICLE"].msgid}
GROUND_STATION_NS: Final = 5 * NS_PER_S
"""Silence after which a ground station is gone: five missed heartbeats (MAVLink guide, heartbeat)."""
TIMESYNC: Final = BY_NAME["TIMESYNC"].msgid
_SWEEP_NS: Final = 5 * NS_PER_S
_MAX_ROUTES: Final = 2048
"""Routes of frames that name a receiver, remembered for all links together; beyond it they are computed again."""


class LinkPolicy(msgspec.Struct, frozen=True):
    """Configuration of one link."""

    name: str
    role: Literal["autopilot", "gcs", "payload"]
    """Peers of the link. ``payload``: programs and devices of this vehicle, which send with their own ids, not with the
    autopilot's."""
    max_rate_hz: Mapping[str, float] = {}
    """Highest rate by message name, hertz, out of this link."""
    forward_rate_requests: Literal["merge"] | bool = "merge"
    """Treatment of a rate request that arrives on this link: it is forwarded to the autopilot and merged with ours,
    forwarded unchanged, or stopped. On an autopilot's link all requests are forwarded unchanged."""
    max_bytes_per_s: float = 0.0
    """Limit of the telemetry that leaves by this link, bytes a second; 0: no limit."""
    relay_unsigned: bool = False
    """With a key: whether unsigned frames that request something of their receiver, or steer it, go from this link to
    the vehicle, if the link accepts unsigned telemetry."""
    datagrams: bool = False
    """Whether the link carries datagrams, which usually begin and end with a frame."""


class Port:
    """State of one link in the router."""

    def __init__(self, index: int, policy: LinkPolicy, max_flows: int) -> None:
        self.index = index
        self.name = policy.name
        self.role = policy.role
        self.is_autopilot = policy.role == "autopilot"
        self.is_gcs = policy.role == "gcs"
        self.merges_rate_requests = policy.forward_rate_requests == "merge" and not self.is_autopilot
        self.forwards_rate_requests = bool(policy.forward_rate_requests) or self.is_autopilot
        self.relays_unsigned = policy.relay_unsigned
        self.limiter = LinkLimiter(
            policy.max_rate_hz, max_bytes_per_s=policy.max_bytes_per_s, to_autopilot=self.is_autopilot
        )
        self.scanner = Scanner(datagrams=policy.datagrams, max_flows=max_flows)
        self.up = True
        self.peers: dict[int, Peer] = {}
        """Peers by (system << 8 | component)."""
        self.bytes_in = 0
        self.duplicates = 0
        self.echoes = 0
        """Our own frames that came back."""
        self.own_ids_on_gcs = 0
        """Frames with the autopilot's ids that came on another role's link."""
        self.id_conflict = 0
        """Frames of a second program with the ids of a component of ours."""
        self.stopped = 0
        """Rate requests that were not forwarded."""
        self.ration = Ration()
        """Ration of rate requests, where they are merged."""
        self.rationed = 0
        """Number of rate requests beyond the ration."""
        self.rationed_sender = ""
        """Ids, and host where a link has several, of the last one of them."""
        self.source = ""
        """Host of the bytes that were received last; "" where the link has only one peer."""
        self.refused_signatures = 0
        """Frames whose signature was not genuine."""
        self.refused_unsigned = 0
        self.late_copy = 0
        """Genuine signed frames with an old timestamp: copies that arrived another way."""
        self.outdated = 0
        """Number of late copies that were the first of their sender, more than a minute behind our own timestamp."""
        self.signed_unverified = 0
        """Signed frames for us while no key is configured."""
        self.ground_station_ns: HostNs | None = None
        """Time of the last ground station heartbeat on this link."""

    def hears_ground_station(self, now: HostNs) -> bool:
        """Return whether a ground station's heartbeat was heard here lately."""
        return self.ground_station_ns is not None and now - self.ground_station_ns <= GROUND_STATION_NS

    def hears_system(self, system: int) -> bool:
        """Return whether any component of the system was heard here."""
        return any(peer.system == system for peer in self.peers.values())


class Router:
    """Routing tables of all links. ``system`` is our id, and the vehicle's unless that is 0."""

    def __init__(self, policies: Sequence[LinkPolicy], system: int, components: frozenset[int]) -> None:
        self.ports = [Port(index, policy, MAX_FLOWS // len(policies)) for index, policy in enumerate(policies)]
        self.system = system
        self.vehicle = system
        """System id of the vehicle: ours, unless the autopilot sends with system 0."""
        self.components = components
        self._autopilot: int | None = None
        """Autopilot's (system << 8 | component); None before the vehicle is known."""
        self.version = 0
        """Version of the tables: it grows with every change, and results of an older version are invalid."""
        self._tables = PeerTables(
            [port.peers for port in self.ports], of_stations=[port.peers for port in self.ports if port.is_gcs]
        )
        self._routes: dict[tuple[PeerStream, int], tuple[Port, ...]] = {}
        """Links by stream and target (system << 8 | component), for one version of the tables."""
        self._routes_version = -1
        self.merged = MergedRates([port.name for port in self.ports if port.merges_rate_requests])
        self._sweep_ns: HostNs | None = None

    def adopt(self, system: int, autopilot: tuple[int, int] | None) -> None:
        """Set our system id, and (system, component) of the vehicle's autopilot."""
        sender = None if autopilot is None else autopilot[0] << 8 | autopilot[1]
        self.vehicle = system if autopilot is None else autopilot[0]
        if system == self.system and sender == self._autopilot:
            return
        renamed = system != self.system
        self.system, self._autopilot = system, sender
        self.version += 1
        for port in self.ports:
            wrong = {system << 8 | component for component in self.components}
            if sender is not None and not port.is_autopilot:
                wrong.add(sender)
            self._tables.forget(port.peers, wrong)
        if renamed:
            self.merged.refresh(system)
            self._apply_caps()

    def share(self, own: OwnStreams) -> None:
        """Set the requests of this service to the autopilot."""
        if self.merged.share(own, self.system):
            self._apply_caps()

    def note(self, request: RateRequest, now: HostNs) -> None:
        """Add a station's rate request if its link merges them."""
        if self.merged.note(request, self.system, now):
            self._apply_caps()

    def on_radio(self, port: Port, txbuf: int, now: HostNs) -> None:
        """Process a report of the free part of the send buffer of the radio behind a link, percent."""
        self.version += port.limiter.on_radio(txbuf, now)

    def _apply_caps(self) -> None:
        own = self.merged.own
        sender = (own.system or self.system) << 8 | own.component
        for port in self.ports:
            link = self.merged.links.get(port.name)
            if link is not None:
                port.limiter.merge(link.caps, sender, link.asked)
        self.version += 1

    def set_up(self, port: Port, up: bool) -> None:
        """Note that a link went up or down: its peers are unknown until they are heard."""
        port.up = up
        self._tables.forget(port.peers, set(port.peers))
        port.scanner.reset()
        port.limiter.disconnect()
        port.ground_station_ns = None
        self.version += 1

    def hears_ground_station(self, now: HostNs) -> bool:
        """Return whether a ground station's heartbeat was heard on a gcs link lately."""
        return any(port.hears_ground_station(now) for port in self.ports if port.is_gcs)

    def is_own(self, frame: RawFrame) -> bool:
        """Return whether the frame carries the ids of one of our components."""
        return frame.system == self.system and frame.component in self.components

    def is_autopilot(self, frame: RawFrame) -> bool:
        """Return whether the frame carries the autopilot's ids."""
        return frame.system << 8 | frame.component == self._autopilot

    def is_for_us(self, target_system: int, target_component: int) -> bool:
        """Return whether the target is one of our components (rule 1)."""
        if target_system == 0:
            return True
        return target_system == self.system and (target_component == 0 or target_component in self.components)

    def learn(self, port: Port, frame: RawFrame, now: HostNs) -> Peer:
        """Add a new peer on a link; without room for it, return a peer that is in no table.

        On a link of ground stations the same holds for a sender that is heard on an autopilot or payload link: a frame
        forged there would take the genuine sender's frames from that link, because they would be an echo (rule 3).
        """
        sender = frame.system << 8 | frame.component
        if port.is_gcs and any(sender in other.peers for other in self.ports if not other.is_gcs):
            return Peer(frame, now)  # the tables, and so all plans, stay as they are
        self.version += 1
        if not port.is_gcs:
            for other in self.ports:
                if other.is_gcs:
                    self._tables.forget(other.peers, {sender})
        return self._tables.add(port.peers, frame, now, port.source)

    def stream(self, port: Port, peer: Peer, frame: RawFrame, now: HostNs) -> PeerStream:
        """Return the stream of a peer's message, and add it if it is new and there is room for it."""
        before = self._tables.peers
        stream = self._tables.stream(port.peers, peer, frame, now)
        self.version += self._tables.peers != before
        return stream

    def on_clock(self, port: Port, frame: RawFrame, boot_ms: int, now: HostNs) -> None:
        """Process a peer's SYSTEM_TIME. A clock that goes back and stays back means a restart: the system may be on
        another link now.
        """
        peer: Peer = frame.flow.stream.peer
        if peer.clock is None:
            peer.clock = PeerClock()
        restarted_ns = peer.clock.on_stamp(boot_ms, now)
        if restarted_ns is not None:
            self._forget_silent(frame.system, restarted_ns)
            self._tables.forget(port.peers, {frame.system << 8 | frame.component})
            peer = self.learn(port, frame, now)
            peer.next_seq = (frame.seq + 1) & 0xFF
            peer.clock = PeerClock()
            peer.clock.on_stamp(boot_ms, now)

    def _forget_silent(self, system: int, since_ns: HostNs) -> None:
        """Forget the components of a system that have been silent since it restarted."""
        self.version += 1
        for port in self.ports:
            old = {sender for sender, peer in port.peers.items() if peer.system == system and peer.last_ns < since_ns}
            self._tables.forget(port.peers, old)

    def sweep(self, now: HostNs) -> None:
        """Forget silent peers. Frequent calls are cheap."""
        if self._sweep_ns is not None and now < self._sweep_ns:
            return
        self._sweep_ns = HostNs(now + _SWEEP_NS)
        for port in self.ports:
            silent = {sender for sender, peer in port.peers.items() if now - peer.last_ns > SILENT_NS}
            self._tables.forget(port.peers, silent)
            self.version += bool(silent)
        if self.merged.expire(self.system, now):
            self._apply_caps()

    def plan(self, port: Port, frame: RawFrame, stream: PeerStream) -> None:
        """Compute where the frames of one message of one sender go, until the tables change."""
        msgid = UNKNOWN if frame.definition is None else frame.msgid
        stream.plan = self.version
        stream.asks_rates = msgid in RATE_REQUESTS and not (msgid == MESSAGE_INTERVAL and port.is_autopilot)
        if stream.targeted or stream.asks_rates or msgid == TIMESYNC:
            stream.direct = None
            return
        outs = self.route(port, frame, 0, 0)
        sender = frame.system << 8 | frame.component
        thinned = any(out.limiter.limits(msgid, sender) for out in outs)
        stream.direct = None if thinned else tuple(out.name for out in outs)

    def route(self, port: Port, frame: RawFrame, target_system: int, target_component: int) -> tuple[Port, ...]:
        """Return the links that a frame received on ``port`` goes to (rules 2 to 5)."""
        if not self._may_pass(port, frame):
            return ()
        sender = frame.system << 8 | frame.component
        no_autopilot = frame.definition is not None and frame.msgid in NOT_TO_AUTOPILOTS
        return tuple(
            out
            for out in self.ports
            if out is not port
            and out.up
            and sender not in out.peers
            and not (no_autopilot and out.is_autopilot)
            and self._reaches(out, target_system, target_component)
        )

    def on_ground(self, port: Port, outs: tuple[Port, ...]) -> tuple[Port, ...]:
        """Return the links to which a frame of ``port`` may go that must not reach the vehicle."""
        return tuple(out for out in outs if out.is_gcs or (port.is_autopilot and not out.is_autopilot))

    def _may_pass(self, port: Port, frame: RawFrame) -> bool:
        if frame.definition is None:
            return True
        if frame.msgid == REQUEST_DATA_STREAM:
            return port.forwards_rate_requests
        return frame.msgid != SETUP_SIGNING

    def _reaches(self, out: Port, target_system: int, target_component: int) -> bool:
        if target_system == 0:
            return True
        if target_system != self.system or target_component == 0:
            return out.hears_system(target_system)
        return (target_system << 8 | target_component) in out.peers

    def are_two_ways(self, first: Port, second: Port, frame: RawFrame) -> bool:
        """Return whether a copy on ``second`` shows a second path to its sender: we never sent it there, so it is no
        echo.
        """
        if first.role != second.role:
            return False
        return second not in self.route(first, frame, frame.target_system, frame.target_component)

    def route_of(self, port: Port, frame: RawFrame, stream: PeerStream) -> tuple[Port, ...]:
        """Return :meth:`route`, remembered while the tables do not change."""
        target_system, target_component = frame.target_system, frame.target_component
        key = (stream, target_system << 8 | target_component)
        if self._routes_version != self.version or len(self._routes) >= _MAX_ROUTES:
            self._routes.clear()
            self._routes_version = self.version
        outs = self._routes.get(key)
        if outs is None:
            outs = self._routes[key] = self.route(port, frame, target_system, target_component)
        return outs

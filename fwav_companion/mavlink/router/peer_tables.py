"""Limits the total number of peers and streams of all links: which may enter the tables, and which are removed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.mavlink.router.peers import ESTABLISHED_NS, MAX_PEER_STREAMS, MAX_PEERS, Peer, PeerStream
from fwav_companion.mavlink.wire.frames import RawFrame

Peers = dict[int, Peer]
"""Peers of one link by (system << 8 | component)."""
CROWDED_NS: Final = 20 * NS_PER_MS
"""Interval of the searches for the host with most peers: one takes a tenth of a millisecond."""


class PeerTables:
    """The tables of all links. A peer without room is in none of them: its frames pass, and teach no route."""

    def __init__(self, tables: Sequence[Peers], *, of_stations: Sequence[Peers] = ()) -> None:
        """``of_stations``: the tables of stations' links."""
        self._tables = tables
        self._of_stations = of_stations
        self.peers = 0
        self.streams = 0
        """Number of streams of all peers."""
        self._full_until_ns: HostNs | None = None
        """Time until which no peer is removed: a search at each frame would cost too much."""
        self._crowded_until_ns: HostNs | None = None
        """The same for the search for the host with most peers, on behalf of stations' links."""

    def add(self, table: Peers, frame: RawFrame, now: HostNs, source: str = "") -> Peer:
        """Return a new peer, which is in the table if there is room. ``source``: its host."""
        peer = Peer(frame, now, source)
        if self.peers < MAX_PEERS or self._make_room(table, now, source) or self._crowd_out(table, source, now):
            table[frame.system << 8 | frame.component] = peer
            self.peers += 1
        return peer

    def stream(self, table: Peers, peer: Peer, frame: RawFrame, now: HostNs) -> PeerStream:
        """Return the stream of a peer's message, which is kept if it is known or there is room."""
        known = peer.known_stream(frame)
        if known is not None:
            return known
        full = self.streams >= MAX_PEER_STREAMS and not self._make_room(table, now, peer.source)
        if full or table.get(frame.system << 8 | frame.component) is not peer:
            return PeerStream(peer, frame.definition)
        self.streams += 1
        return peer.add_stream(frame)

    def forget(self, table: Peers, senders: set[int]) -> None:
        """Forget peers of one link, and free them at once: their streams refer back to them, and garbage collection
        frees such cycles only minutes later.
        """
        for sender in senders & table.keys():
            streams = table.pop(sender).streams
            self.streams -= len(streams)
            self.peers -= 1
            streams.clear()

    def _make_room(self, table: Peers, now: HostNs, source: str) -> bool:
        """Forget up to an eighth of the peers that may be removed, the longest silent first. Returns False if there are
        none. A host on a station's link removes no peer of a host with fewer.
        """
        if self._full_until_ns is not None and now < self._full_until_ns:
            return False
        held = self._held()
        own = held[self._index(table), source] if self._is_of_station(table) else 0
        known = [
            (peer.last_ns, index, sender)
            for index, peers in enumerate(self._tables)
            for sender, peer in peers.items()
            if peer.gives_way(now) and held[index, peer.source] >= own
        ]
        for _, index, sender in sorted(known)[: len(known) // 8 + 1]:
            self.forget(self._tables[index], {sender})
        self._full_until_ns = None if known else HostNs(now + ESTABLISHED_NS)
        return bool(known)

    def _crowd_out(self, table: Peers, source: str, now: HostNs) -> bool:
        """Forget the newest peer of the host that has most on stations' links, if the newcomer's host has fewer.

        Max-min fairness: a stranger that keeps hundreds of invented senders alive keeps no station of another host
        out, nor a component that comes back on the vehicle's links.
        """
        of_station = self._is_of_station(table)
        if of_station and self._crowded_until_ns is not None and now < self._crowded_until_ns:
            return False
        held = self._held()
        most, index, host = max(
            ((n, at, host) for (at, host), n in held.items() if self._is_of_station(self._tables[at])),
            default=(0, 0, ""),
        )
        if of_station:
            self._crowded_until_ns = HostNs(now + CROWDED_NS)
        if held[self._index(table), source] * of_station + 1 >= most:
            return False
        peers = self._tables[index]
        newest = max((peer.since_ns, sender) for sender, peer in peers.items() if peer.source == host)
        self.forget(peers, {newest[1]})
        return True

    def _held(self) -> Counter[tuple[int, str]]:
        """Return the number of peers by (number of the table, host)."""
        return Counter((at, peer.source) for at, peers in enumerate(self._tables) for peer in peers.values())

    def _index(self, table: Peers) -> int:
        return next(at for at, each in enumerate(self._tables) if each is table)

    def _is_of_station(self, table: Peers) -> bool:
        return any(each is table for each in self._of_stations)

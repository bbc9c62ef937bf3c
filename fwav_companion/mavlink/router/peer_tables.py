"""Limits the total number of peers and streams of all links: which may enter the tables, and which are removed."""

from __future__ import annotations

from collections.abc import Sequence

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.peers import ESTABLISHED_NS, MAX_PEER_STREAMS, MAX_PEERS, Peer, PeerStream
from fwav_companion.mavlink.wire.frames import RawFrame

Peers = dict[int, Peer]
"""Peers of one link by (system << 8 | component)."""


class PeerTables:
    """The tables of all links. A peer without room is in none of them: its frames pass, and teach no route."""

    def __init__(self, tables: Sequence[Peers]) -> None:
        self._tables = tables
        self.peers = 0
        self.streams = 0
        """Number of streams of all peers."""
        self._full_until_ns: HostNs | None = None
        """Time until which no peer is removed: a search at each frame would cost too much."""

    def add(self, table: Peers, frame: RawFrame, now: HostNs) -> Peer:
        """Return a new peer, which is in the table if there is room."""
        peer = Peer(frame, now)
        if self.peers < MAX_PEERS or self._make_room(now):
            table[frame.system << 8 | frame.component] = peer
            self.peers += 1
        return peer

    def stream(self, table: Peers, peer: Peer, frame: RawFrame, now: HostNs) -> PeerStream:
        """Return the stream of a peer's message, which is kept if it is known or there is room."""
        known = peer.known_stream(frame)
        if known is not None:
            return known
        full = self.streams >= MAX_PEER_STREAMS and not self._make_room(now)
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

    def _make_room(self, now: HostNs) -> bool:
        """Forget up to an eighth of the peers that may be removed, the longest silent first. Returns False if there are
        none.
        """
        if self._full_until_ns is not None and now < self._full_until_ns:
            return False
        known = [
            (peer.last_ns, index, sender)
            for index, table in enumerate(self._tables)
            for sender, peer in table.items()
            if peer.gives_way(now)
        ]
        for _, index, sender in sorted(known)[: len(known) // 8 + 1]:
            self.forget(self._tables[index], {sender})
        self._full_until_ns = None if known else HostNs(now + ESTABLISHED_NS)
        return bool(known)

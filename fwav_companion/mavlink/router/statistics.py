"""Reports the traffic and losses of each link, for the status file and ONBOARD_COMPUTER_STATUS."""

from __future__ import annotations

from typing import Final

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs, s_from_ns
from fwav_companion.mavlink.router.peers import UNKNOWN, Peer
from fwav_companion.mavlink.router.routing import Port, Router
from fwav_companion.types.network_status import LinkStatistics, PeerStatistics

UNKNOWN_NAME: Final = "unknown"
"""Name of all messages whose ids are not in the dialect."""
MAX_LISTED_PEERS: Final = 64
"""Most peers of all links together that are listed; the others are counted. The status stays below 64 kB."""
_SHORTEST_NS: Final = 200 * NS_PER_MS
"""Shortest time over which rates are measured; within it the last rates are reported again."""


class StatisticsTaker:
    """Reads the counts of all links, and derives the rates since its last reading."""

    def __init__(self, router: Router) -> None:
        self._router = router
        self._taken_ns: HostNs | None = None
        self._counts: dict[tuple[str, int], dict[int, int]] = {}
        self._rates: dict[tuple[str, int], dict[str, float]] = {}

    def take(self, now: HostNs) -> list[LinkStatistics]:
        """Return the statistics of all links, in the order of the configuration."""
        if self._taken_ns is None or now - self._taken_ns >= _SHORTEST_NS:
            self._measure(now)
        return [self._of_port(port, now) for port in self._router.ports]

    def _measure(self, now: HostNs) -> None:
        elapsed_s = s_from_ns(now - self._taken_ns) if self._taken_ns is not None else 0.0
        before, self._counts, self._rates = self._counts, {}, {}
        for port in self._router.ports:
            for sender, peer in port.peers.items():
                key = (port.name, sender)
                counts = {msgid: stream.count for msgid, stream in peer.streams.items()}
                self._rates[key] = _rates(peer, counts, before.get(key, {}), elapsed_s)
                self._counts[key] = counts
        self._taken_ns = now

    def _of_port(self, port: Port, now: HostNs) -> LinkStatistics:
        listed = self._listed(port)
        return LinkStatistics(
            name=port.name,
            up=port.up,
            bytes_in=port.bytes_in,
            bad_checksums=port.scanner.bad_checksums,
            skipped_bytes=port.scanner.skipped_bytes,
            shed_bytes=port.scanner.shed_bytes,
            not_understood=port.scanner.not_understood,
            duplicates=port.duplicates,
            echoes=port.echoes,
            own_ids_on_gcs=port.own_ids_on_gcs,
            id_conflict=port.id_conflict,
            stopped=port.stopped,
            thinned=port.limiter.thinned,
            refused_signatures=port.refused_signatures,
            refused_unsigned=port.refused_unsigned,
            late_copy=port.late_copy,
            outdated=port.outdated,
            signed_unverified=port.signed_unverified,
            ground_station=port.hears_ground_station(now),
            thinning=port.limiter.status(),
            peers=[self._of_peer((port.name, sender), port.peers[sender], now) for sender in listed],
            peers_left_out=len(port.peers) - len(listed),
        )

    def _listed(self, port: Port) -> list[int]:
        """Return the peers of a link that are listed: the vehicle's, and those with the most frames."""
        most = max(1, MAX_LISTED_PEERS // len(self._router.ports))
        if len(port.peers) <= most:
            return sorted(port.peers)
        order = sorted(
            (peer.system != self._router.system, -peer.received, sender) for sender, peer in port.peers.items()
        )
        return sorted(sender for _, _, sender in order[:most])

    def _of_peer(self, key: tuple[str, int], peer: Peer, now: HostNs) -> PeerStatistics:
        return PeerStatistics(
            system=peer.system,
            component=peer.component,
            received=peer.received,
            lost=peer.lost,
            late=peer.late,
            silent_s=max(0.0, s_from_ns(now - peer.last_ns)),
            rates_hz=self._rates.get(key, {}),
        )


def _rates(peer: Peer, counts: dict[int, int], before: dict[int, int], elapsed_s: float) -> dict[str, float]:
    if elapsed_s <= 0.0:
        return {}
    rates = {}
    for msgid, count in counts.items():
        definition = peer.streams[msgid].definition
        name = UNKNOWN_NAME if msgid == UNKNOWN or definition is None else definition.name
        # A peer that restarted counts from zero again.
        came = count - before.get(msgid, 0) if count >= before.get(msgid, 0) else count
        rates[name] = came / elapsed_s
    return rates

"""Places of a server's peers: few, and shared by source address. Times are handed in.

A flood of newcomers displaces no peer that is heard: a source address has a bounded number of places, of its newcomers
the newest waits, and the last place is kept for an address that has none.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from typing import Generic, TypeVar

import msgspec

MAX_PLACES = 16
"""Most peers: more ground stations than one vehicle ever has. Each costs a copy of all sent bytes."""
MAX_PLACES_OF_HOST = 8
"""Most peers of one source address: several programs on one computer, or stations behind one NAT."""
YIELDS_AFTER_S = 10.0
"""Silence after which a peer yields to a new one of its source address: ten missed heartbeats. A peer that has been
there and heard for as long yields to no other one."""

Peer = TypeVar("Peer")


class PeerPlace(msgspec.Struct):
    """The place of one peer."""

    host: str
    since_s: float
    heard_s: float
    """Time of the last valid frame; before the first one, the time at which the place was taken."""


class Places(Generic[Peer]):
    """The peers with their places, in order of arrival."""

    def __init__(self, on_yield: Callable[[Peer], None], *, silent_s: float) -> None:
        """``on_yield``: called with a peer that has lost its place. ``silent_s``: silence after which a peer yields to
        any newcomer.
        """
        self.of: dict[Peer, PeerPlace] = {}
        self._on_yield = on_yield
        self._silent_s = silent_s

    def take(self, peer: Peer, host: str, now_s: float) -> bool:
        """Give a new peer of this source address a place. Returns False if there is none."""
        own = [each for each, place in self.of.items() if place.host == host]
        if len(own) >= MAX_PLACES_OF_HOST or len(self.of) >= MAX_PLACES - bool(own):
            yields = self._yields_to(own, now_s)
            if yields is None:
                return False
            del self.of[yields]
            self._on_yield(yields)
        self.of[peer] = PeerPlace(host, now_s, now_s)
        return True

    def _yields_to(self, own: Sequence[Peer], now_s: float) -> Peer | None:
        """Return the peer that yields to another one beside its ``own``; None if all are kept."""
        if len(own) >= MAX_PLACES_OF_HOST:
            return self._silent(own, YIELDS_AFTER_S, now_s)
        silent = self._silent(self.of, self._silent_s, now_s)
        return self._newcomer(now_s) if silent is None and not own else silent

    def _silent(self, peers: Iterable[Peer], silent_s: float, now_s: float) -> Peer | None:
        """Return the peer that has been silent for longest, if for at least ``silent_s``."""
        oldest = min(peers, key=lambda each: self.of[each].heard_s)
        return oldest if now_s - self.of[oldest].heard_s >= silent_s else None

    def _newcomer(self, now_s: float) -> Peer | None:
        """Return the newest peer of the address with most places, if it is not the only one there and is new.

        So addresses that connect again and again keep no place from an address that has none.
        """
        (host, places), *_ = Counter(place.host for place in self.of.values()).most_common(1)
        newest = next(each for each in reversed(self.of) if self.of[each].host == host)
        return newest if places > 1 and now_s - self.of[newest].since_s < YIELDS_AFTER_S else None

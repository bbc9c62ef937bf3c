"""Keeps what the stations of each link request, and derives the rate of each message of the autopilot on each link.

The autopilot sends every message at the highest rate that this service or a station requests. Each link then gets:

1. a message that a station there requests: at the highest rate requested there, until the station has been silent for
   a minute;
2. a message whose rate is ours (:class:`~fwav_companion.mavlink.wire.rate_messages.OwnStreams`): at the rate that was
   there before our request, or that a station on another link requests; without either, it does not go there;
3. every other message: at the rate at which it arrives;
4. attitude that no station there requests: at a display's rate of 4 Hz at most, where the autopilot states its rates.
   Where it does not, it passes at the rate that was measured before our request, and ATTITUDE at 4 Hz at least.

QGroundControl ignores ATTITUDE permanently once it has seen one ATTITUDE_QUATERNION. ATTITUDE_QUATERNION therefore goes
only to links on which a station requests it, or if the autopilot sends it by itself; a request on another link does not
count.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from math import inf
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.router.never_thinned import is_telemetry
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.enums import MAV_COMP_ID_AUTOPILOT1
from fwav_companion.mavlink.wire.rate_messages import HORIZON_ATTITUDE_HZ, OwnStreams, RateRequest
from fwav_companion.types.messages import ATTITUDE_MESSAGES

FORGOTTEN_NS: Final = 60 * NS_PER_S
"""Time after a station's last heartbeat or request at which its rates are dropped."""
MAX_ASKERS: Final = 8
"""Stations remembered on one link. The last place is kept for a source address that has none: a stranger that speaks
with many ids does not take the rates of a station that is heard."""
YIELDS_NS: Final = 10 * NS_PER_S
"""Silence after which a station yields its place to a new one: ten missed heartbeats."""
MAX_RATES: Final = 128
"""Rates remembered for one station: twice what ArduPilot's groups hold."""
ONCE_NS: Final = 3 * NS_PER_S
"""Time for which an answer to REQUEST_MESSAGE is awaited: it covers the retries of a station."""
MAX_ONCE: Final = 32
"""Most awaited answers on a link; beyond it, the source with most loses its oldest."""
QUATERNION_ID: Final = BY_NAME["ATTITUDE_QUATERNION"].msgid
ATTITUDE_ID: Final = BY_NAME["ATTITUDE"].msgid
ATTITUDE_IDS: Final = frozenset(BY_NAME[name].msgid for name in ATTITUDE_MESSAGES)


class _Asker(msgspec.Struct):
    """Requests of one station, which is identified by (system << 8 | component)."""

    heard_ns: HostNs
    source: str | int
    """Host, or the sender where the link has only one peer."""
    rates: dict[tuple[int, int], float]
    """Rate by (target system, message id), hertz; 0: the station requested a stop."""


class AskedRates:
    """Requests of the stations on one link. The highest requested rate counts."""

    def __init__(self) -> None:
        self._askers: dict[int, _Asker] = {}
        self._once_ns: dict[tuple[str | int, int], HostNs] = {}
        """End of the wait for a single message, by source and message id, the oldest first."""

    def has_room(self, request: RateRequest, now: HostNs) -> bool:
        """Return whether each rate of a request would be remembered."""
        asker = self._askers.get(request.sender)
        if asker is None:
            return len(self._askers) < self._places(request) or self._yields(now) is not None
        rates = {(request.target_system, msgid) for msgid, hz in request.rates.items() if hz is not None}
        return len(asker.rates.keys() | rates) <= MAX_RATES

    def note(self, request: RateRequest, now: HostNs) -> bool:
        """Remember a request. Returns True if a rate changed."""
        if request.once is not None:
            return self._note_once(request, request.once, now)
        asker = self._askers.get(request.sender)
        if asker is None:
            asker = self._add(request, now)
            if asker is None:
                return False
        asker.heard_ns = now
        before = dict(asker.rates)
        for msgid, hz in request.rates.items():
            key = (request.target_system, msgid)
            if hz is None:
                asker.rates.pop(key, None)
            elif key in asker.rates or len(asker.rates) < MAX_RATES:
                asker.rates[key] = hz
        return asker.rates != before

    def heard(self, sender: int, now: HostNs) -> None:
        """Note a heartbeat of (system << 8 | component) on this link."""
        asker = self._askers.get(sender)
        if asker is not None:
            asker.heard_ns = now

    def expire(self, now: HostNs) -> bool:
        """Drop silent stations. Returns True if there were any."""
        silent = [sender for sender, asker in self._askers.items() if now - asker.heard_ns > FORGOTTEN_NS]
        for sender in silent:
            del self._askers[sender]
        for key in [key for key, until in self._once_ns.items() if until < now]:
            del self._once_ns[key]
        return bool(silent)

    def asked_hz(self, system: int, msgid: int) -> float | None:
        """Return the highest rate that a station requests from the system for the message, hertz; None without a
        request.
        """
        asked = [
            hz
            for asker in self._askers.values()
            for target in (system, 0)
            if (hz := asker.rates.get((target, msgid))) is not None
        ]
        return max(asked, default=None)

    def asked_ids(self, system: int) -> Iterable[int]:
        """Return the ids of the messages for which a station requests a rate from the system."""
        return {msgid for asker in self._askers.values() for target, msgid in asker.rates if target in {system, 0}}

    def take_once(self, msgid: int, now: HostNs) -> bool:
        """Return whether a single message of this id is awaited here, and end the wait."""
        if not self._once_ns:
            return False
        until = [self._once_ns.pop(key) for key in [key for key in self._once_ns if key[1] == msgid]]
        return max(until, default=HostNs(0)) >= now

    def _note_once(self, request: RateRequest, msgid: int, now: HostNs) -> bool:
        key = (request.source or request.sender, msgid)
        self._once_ns.pop(key, None)
        if len(self._once_ns) >= MAX_ONCE:
            ((most, _),) = Counter(source for source, _ in self._once_ns).most_common(1)
            del self._once_ns[next(each for each in self._once_ns if each[0] == most)]
        self._once_ns[key] = HostNs(now + ONCE_NS)
        return False

    def _add(self, request: RateRequest, now: HostNs) -> _Asker | None:
        """Remember a new station; None if there is no place for it."""
        if len(self._askers) >= self._places(request):
            silent = self._yields(now)
            if silent is None:
                return None
            del self._askers[silent]
        asker = self._askers[request.sender] = _Asker(now, request.source or request.sender, {})
        return asker

    def _places(self, request: RateRequest) -> int:
        """Return the number of stations beside which the request's source may have another one."""
        source = request.source or request.sender
        return MAX_ASKERS - any(asker.source == source for asker in self._askers.values())

    def _yields(self, now: HostNs) -> int | None:
        """Return the station that has been silent for longest, if it yields its place."""
        silent = min(self._askers, key=lambda one: self._askers[one].heard_ns)
        return silent if now - self._askers[silent].heard_ns >= YIELDS_NS else None


class Why(StrEnum):
    """Reason why a message leaves by a link at a lower rate than it arrives."""

    MAX_RATE = "max_rate_hz"
    """The link's configuration names the message."""
    ASKED = "asked"
    """A station on the link requests this rate."""
    STOPPED = "stopped"
    """A station on the link requested a stop."""
    ONLY_OURS = "only_ours"
    """Only this service requests the message."""
    OWN_RATE = "own_rate"
    """Only this service requests more than came before its request, or than other links request."""
    ATTITUDE = "attitude"
    """No station on the link requests attitude."""
    BYTES = "max_bytes_per_s"
    """The link's budget of bytes is used up."""
    RADIO = "radio_status"
    """The radio's send buffer fills."""


class Cap(msgspec.Struct, frozen=True):
    """The highest rate of one message on one link, hertz; 0: it does not leave there."""

    hz: float
    why: Why


class MergedLink(msgspec.Struct):
    """One link whose requests are merged."""

    asked: AskedRates
    caps: dict[int, Cap]
    """Caps by message id, for the adopted autopilot's messages."""


class MergedRates:
    """Tables of all links whose requests are merged, by link name."""

    def __init__(self, links: Sequence[str]) -> None:
        self.links = {name: MergedLink(AskedRates(), {}) for name in links}
        self.own = OwnStreams(0, MAV_COMP_ID_AUTOPILOT1, {})
        self.demanded: Mapping[int, float] = {}
        """Highest rate that any station requests from the autopilot, hertz, by message id."""

    def share(self, own: OwnStreams, system: int) -> bool:
        """Set the requests of this service. ``system``: our system id. Returns True if caps may have changed."""
        if own == self.own or not self.links:
            return False
        self.own = own
        self.refresh(system)
        return True

    def has_room(self, request: RateRequest, now: HostNs) -> bool:
        """Return whether a station's request exceeds no rate in the tables once it is noted: else the autopilot would
        be asked for a rate that does not end with its station.
        """
        link = self.links.get(request.link)
        if link is None or not request.reaches(request.target_system, self.own.component):
            return True
        if all((hz or 0.0) <= self.demanded.get(msgid, 0.0) for msgid, hz in request.rates.items()):
            return True
        return link.asked.has_room(request, now)

    def note(self, request: RateRequest, system: int, now: HostNs) -> bool:
        """Add a station's request. Returns True if caps may have changed."""
        link = self.links.get(request.link)
        component = self.own.component
        if link is None or not request.reaches(request.target_system, component):
            return False
        changed = link.asked.note(request, now)
        if changed:
            self._refresh(request.rates, system)
        return changed

    def heard(self, link: str, sender: int, now: HostNs) -> None:
        """Note a heartbeat of (system << 8 | component) on a link."""
        if link in self.links:
            self.links[link].asked.heard(sender, now)

    def expire(self, system: int, now: HostNs) -> bool:
        """Drop silent stations. Returns True if caps may have changed."""
        fell_silent = [link.asked.expire(now) for link in self.links.values()]
        if any(fell_silent):
            self.refresh(system)
        return any(fell_silent)

    def refresh(self, system: int) -> None:
        """Recompute every cap."""
        asked = {msgid for link in self.links.values() for msgid in link.asked.asked_ids(system)}
        self.demanded = {}
        for link in self.links.values():
            link.caps = {}
        self._refresh(self.own.before_hz.keys() | asked | ATTITUDE_IDS, system)

    def _refresh(self, msgids: Iterable[int], system: int) -> None:
        """Recompute the caps of these messages. A table that was handed out is replaced, not changed."""
        demanded = dict(self.demanded)
        for link in self.links.values():
            link.caps = dict(link.caps)
        for msgid in msgids:
            asked = {name: link.asked.asked_hz(system, msgid) for name, link in self.links.items()}
            demanded[msgid] = max((hz for hz in asked.values() if hz is not None), default=0.0)
            for name, link in self.links.items():
                elsewhere = [hz for other, hz in asked.items() if other != name and hz is not None]
                cap = self._cap(msgid, asked[name], max(elsewhere, default=0.0))
                if cap is not None and is_telemetry(msgid):
                    link.caps[msgid] = cap
                else:
                    link.caps.pop(msgid, None)
        self.demanded = {msgid: hz for msgid, hz in demanded.items() if hz > 0.0}

    def _cap(self, msgid: int, asked_hz: float | None, elsewhere_hz: float) -> Cap | None:
        if asked_hz is not None:
            return Cap(asked_hz, Why.ASKED if asked_hz > 0.0 else Why.STOPPED)
        before_hz = self.own.before_hz.get(msgid)
        if before_hz is None:
            return None
        if msgid != QUATERNION_ID:
            before_hz = max(before_hz, elsewhere_hz)
        stated = msgid in self.own.stated
        if msgid == ATTITUDE_ID and (before_hz == 0.0 or not stated):
            return Cap(max(before_hz, HORIZON_ATTITUDE_HZ), Why.ATTITUDE)
        if before_hz == 0.0:
            return Cap(0.0, Why.ONLY_OURS)
        if msgid in ATTITUDE_IDS and stated:
            return Cap(min(before_hz, HORIZON_ATTITUDE_HZ), Why.ATTITUDE)
        return None if before_hz == inf else Cap(before_hz, Why.OWN_RATE)

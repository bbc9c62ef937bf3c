"""Derives the rate of each message of the autopilot on each link where stations' requests are merged with ours.

The autopilot sends every message at the highest rate that this service or a station requests. Each link then gets the
rates that its own stations would get without this service:

1. a message that a station there requests: at the highest rate requested there;
2. a message that this service requests and no station there: at the autopilot's own rate for it, or at the rate that a
   station on another link requests; without either, it does not go there;
3. every other message passes;
4. attitude that no station there requests: 4 Hz at most.

QGroundControl ignores ATTITUDE permanently once it has seen one ATTITUDE_QUATERNION. ATTITUDE_QUATERNION therefore goes
only to links on which a station requests it, or if the autopilot sends it by itself; a request on another link does not
count.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from enum import StrEnum
from math import inf
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.asked_rates import AskedRates
from fwav_companion.mavlink.router.never_thinned import is_telemetry
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest

QUATERNION_ID: Final = BY_NAME["ATTITUDE_QUATERNION"].msgid
ATTITUDE_IDS: Final = frozenset({BY_NAME["ATTITUDE"].msgid, QUATERNION_ID})
UNASKED_ATTITUDE_HZ: Final = 4.0
"""Highest rate of attitude that no station requests: enough for a horizon on a display."""
AUTOPILOT_COMPONENT: Final = 1
"""MAV_COMP_ID_AUTOPILOT1: assumed component of the autopilot until one is adopted."""


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
    """Only this service requests more than the autopilot sends by itself, or than other links request."""
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
        self.own = OwnStreams(0, AUTOPILOT_COMPONENT, {})
        self.demanded: Mapping[int, float] = {}
        """Highest rate that any station requests from the autopilot, hertz, by message id."""

    def share(self, own: OwnStreams, system: int) -> bool:
        """Set the requests of this service. ``system``: our system id. Returns True if caps may have changed."""
        if own == self.own or not self.links:
            return False
        self.own = own
        self.refresh(system)
        return True

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
        self._refresh(self.own.by_itself_hz.keys() | asked | ATTITUDE_IDS, system)

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
        by_itself_hz = self.own.by_itself_hz.get(msgid)
        if by_itself_hz is not None and msgid != QUATERNION_ID:
            by_itself_hz = max(by_itself_hz, elsewhere_hz)
        if by_itself_hz == 0.0:
            return Cap(0.0, Why.ONLY_OURS)
        if msgid in ATTITUDE_IDS:
            return Cap(min(by_itself_hz or inf, UNASKED_ATTITUDE_HZ), Why.ATTITUDE)
        return None if by_itself_hz in {None, inf} else Cap(by_itself_hz, Why.OWN_RATE)

"""Remembers the message rates that the stations behind one link request, while these stations are heard."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire.definitions import DEFINITIONS
from fwav_companion.mavlink.wire.rate_messages import RateRequest

FORGOTTEN_NS: Final = 60 * NS_PER_S
"""Time after a station's last heartbeat or request at which its rates are dropped."""
MAX_ASKERS: Final = 8
"""Stations remembered on one link; beyond it, the one silent for longest is dropped."""
MAX_RATES: Final = 128
"""Rates remembered for one station: twice what ArduPilot's groups hold. Unknown messages are not remembered."""
ONCE_NS: Final = 3 * NS_PER_S
"""Time for which an answer to REQUEST_MESSAGE is awaited: it covers the retries of a station."""
MAX_ONCE: Final = 32


class _Asker(msgspec.Struct):
    """Requests of one station, which is identified by (system << 8 | component)."""

    heard_ns: HostNs
    rates: dict[tuple[int, int], float]
    """Rate by (target system, message id), hertz; 0: the station requested a stop."""


class AskedRates:
    """Requests of the stations on one link. The highest requested rate counts."""

    def __init__(self) -> None:
        self._askers: dict[int, _Asker] = {}
        self._once_ns: dict[int, HostNs] = {}

    def note(self, request: RateRequest, now: HostNs) -> bool:
        """Remember a request. Returns True if a rate changed."""
        if request.once is not None:
            return self._note_once(request.once, now)
        asker = self._askers.get(request.sender)
        if asker is None:
            asker = self._add(request.sender, now)
        asker.heard_ns = now
        before = dict(asker.rates)
        for msgid, hz in request.rates.items():
            key = (request.target_system, msgid)
            if hz is None:
                asker.rates.pop(key, None)
            elif key in asker.rates or (msgid in DEFINITIONS and len(asker.rates) < MAX_RATES):
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
        for msgid in [msgid for msgid, until in self._once_ns.items() if until < now]:
            del self._once_ns[msgid]
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
        return bool(self._once_ns) and self._once_ns.pop(msgid, HostNs(0)) >= now

    def _note_once(self, msgid: int, now: HostNs) -> bool:
        if len(self._once_ns) >= MAX_ONCE:
            self._once_ns.clear()
        self._once_ns[msgid] = HostNs(now + ONCE_NS)
        return False

    def _add(self, sender: int, now: HostNs) -> _Asker:
        if len(self._askers) >= MAX_ASKERS:
            del self._askers[min(self._askers, key=lambda one: self._askers[one].heard_ns)]
        asker = self._askers[sender] = _Asker(now, {})
        return asker

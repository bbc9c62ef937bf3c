"""Determines our identity on the network: adopts the autopilot whose system id we use, and follows it."""

from __future__ import annotations

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.heartbeats import Heartbeats, autopilot_from_heartbeat
from fwav_companion.mavlink.client.identity_events import (
    Adopted,
    ArmedChanged,
    AutopilotBack,
    AutopilotLost,
    IdentityEvent,
    NeighbourHeard,
    SeveralHeard,
)
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot

LISTEN_NS = 3 * NS_PER_S
"""Time from the first autopilot heard to the adoption (MAVLink guide, id assignment)."""
SILENCE_NS = 5 * NS_PER_S
"""Silence after which a peer is lost: five missed heartbeats, as is usual on MAVLink networks."""
OVERDUE_NS = 2 * NS_PER_S
"""Silence after which a heartbeat is overdue: one missed heartbeat."""
UNASSIGNED_SYSTEM = 1
"""System id of our heartbeats until an autopilot is adopted."""
SUCCESSION_NS = 30 * NS_PER_S
"""Silence of a disarmed autopilot after which another one may replace it: longer than a reboot or a changed battery."""
MAX_CANDIDATES = 16
"""Autopilots remembered while listening: with more than one, no choice is made anyway."""


class _Other(msgspec.Struct):
    """Another vehicle's autopilot, heard since ours was last heard."""

    autopilot: Autopilot
    first_ns: HostNs
    last_ns: HostNs


class Identity:
    """Adopts one autopilot, follows its heartbeats, and times ours. It reads heartbeats of autopilot links alone.

    With ``configured_system`` 0 it listens for three seconds after it first hears an autopilot, and adopts that one if
    no other was heard. System 0 (Betaflight's) counts only where it is the one heard: any misconfigured device may send
    with it. If several were heard, it adopts none of them: a moment of silence of our vehicle must not lead
    to the adoption of another one. With a configured system it adopts that system's autopilot at once.

    Another autopilot replaces the adopted one only without a configured system, if the adopted one was disarmed when
    last heard and has been silent for SUCCESSION_NS, and if the other one is the only one heard on that link and was
    never heard together with ours. Autopilots copy the heartbeats of their neighbours to all their links, and continue
    while ours has lost its power for a moment: a vehicle that was heard before a heartbeat of ours is a neighbour.
    """

    def __init__(self, configured_system: int, companion_component: int = 191, camera_component: int | None = 100):
        self._configured_system = configured_system
        self.companion_component = companion_component
        self.beats = Heartbeats(companion_component, camera_component)
        """Our heartbeats, which an internal fault stops."""
        self._candidates: dict[int, Autopilot] = {}
        self._candidate_heard_ns: HostNs | None = None
        self._decide_ns: HostNs | None = None
        self._several = False
        self._heard_ns: HostNs | None = None
        self._lost = False
        self._others: dict[int, _Other] = {}
        """Other vehicles' autopilots by system id, at most 254."""
        self._neighbours: set[int] = set()
        """Other systems that were heard with ours or before an adoption; they are never adopted."""
        self.autopilot: Autopilot | None = None
        """Adopted autopilot with its newest mode and link; kept while it is lost."""

    @property
    def system(self) -> int:
        """System id of our messages."""
        if self.autopilot is not None:
            return self.autopilot.our_system
        return self._configured_system or UNASSIGNED_SYSTEM

    @property
    def vehicle(self) -> int:
        """System id of our vehicle: ours, unless its autopilot sends with system 0."""
        return self.system if self.autopilot is None else self.autopilot.system

    @property
    def autopilot_component(self) -> int | None:
        """Component id of our autopilot; None before the vehicle is known."""
        if self.autopilot is not None:
            return self.autopilot.component
        return enums.MAV_COMP_ID_AUTOPILOT1 if self.knows_its_vehicle else None

    @property
    def autopilot_address(self) -> tuple[int, int] | None:
        """(system, component) of the adopted autopilot."""
        return None if self.autopilot is None else (self.autopilot.system, self.autopilot.component)

    @property
    def armed(self) -> bool:
        """Whether the adopted autopilot is armed."""
        return self.autopilot is not None and self.autopilot.armed

    @property
    def knows_its_vehicle(self) -> bool:
        """Whether an autopilot is adopted or the configuration names the system: our messages then belong to that
        vehicle.

        Before that we send only the companion's heartbeats.
        """
        return self.autopilot is not None or bool(self._configured_system)

    @property
    def autopilot_lost(self) -> bool:
        """Whether an autopilot is adopted but not heard now."""
        return self._lost

    def heard_age_s(self, now: HostNs) -> float | None:
        """Return the seconds since the last heartbeat of the adopted autopilot; None before the first."""
        return None if self._heard_ns is None else (now - self._heard_ns) * 1e-9

    def heartbeat_overdue(self, now: HostNs) -> bool:
        """Return whether the adopted autopilot's heartbeat is late: it may be lost soon."""
        return self._heard_ns is not None and now > self._heard_ns + OVERDUE_NS

    @property
    def wake_at(self) -> HostNs | None:
        """Time of the next heartbeat of ours, adoption decision, or loss of a peer."""
        due = [] if self.beats.wake_at is None else [self.beats.wake_at]
        if self._decide_ns is not None:
            due.append(self._decide_ns)
        if self._several and self._candidate_heard_ns is not None:
            due.append(HostNs(self._candidate_heard_ns + SILENCE_NS))
        if self._heard_ns is not None and not self._lost:
            due.append(HostNs(self._heard_ns + SILENCE_NS))
        return min(due, default=None)

    def on_message(self, message: Message, now: HostNs) -> tuple[IdentityEvent, ...]:
        """Process a HEARTBEAT; every other message is ignored."""
        if message.name != "HEARTBEAT":
            return ()
        events = self.on_wake(now)
        if message.fields.type == enums.MAV_TYPE_GCS:
            return events
        heard = autopilot_from_heartbeat(message)
        if heard is None:
            return events
        if self.autopilot is None:
            return events + self._consider(heard, now)
        if (heard.system, heard.component) == (self.autopilot.system, self.autopilot.component):
            return events + self._follow(heard, now)
        if heard.system not in {self.autopilot.system, 0}:
            return events + self._compare(heard, now)
        return events

    def on_wake(self, now: HostNs) -> tuple[IdentityEvent, ...]:
        """End the listening and detect silence. Our heartbeats come from :meth:`heartbeats`."""
        if self._decide_ns is not None and now >= self._decide_ns:
            return self._decide(now)
        if self._several and self._candidate_heard_ns is not None and now >= self._candidate_heard_ns + SILENCE_NS:
            self._several = False
            self._candidates.clear()
        if self._heard_ns is not None and not self._lost and now >= self._heard_ns + SILENCE_NS:
            self._lost = True
            return (AutopilotLost(self.autopilot),) if self.autopilot is not None else ()
        return ()

    def heartbeats(self, now: HostNs, healthy: bool) -> list[Outgoing]:
        """Return the heartbeats that are due. ``healthy`` is False while a peer is missing.

        The camera's waits for the adoption, unless the system is configured: until then the camera cannot be assigned
        to a vehicle.
        """
        return self.beats.due(now, healthy=healthy, with_camera=self.knows_its_vehicle)

    def _consider(self, heard: Autopilot, now: HostNs) -> tuple[IdentityEvent, ...]:
        if self._configured_system:
            return self._adopt(heard, now) if heard.system == self._configured_system else ()
        self._candidate_heard_ns = now
        if self._several or heard.system in self._neighbours:
            return ()
        if self._decide_ns is None:
            self._decide_ns = HostNs(now + LISTEN_NS)
        known = self._candidates.get(heard.system)
        if known is None and len(self._candidates) >= MAX_CANDIDATES:
            return ()
        if known is None or heard.component <= known.component:
            self._candidates[heard.system] = heard
        return ()

    def _decide(self, now: HostNs) -> tuple[IdentityEvent, ...]:
        self._decide_ns = None
        if len(self._candidates) > 1:
            self._candidates.pop(0, None)
        if len(self._candidates) == 1:
            (only,) = self._candidates.values()
            self._candidates.clear()
            return self._adopt(only, self._candidate_heard_ns or now)
        self._several = True
        self._neighbours.update(self._candidates)
        return (SeveralHeard(tuple(sorted(self._candidates))),)

    def _adopt(self, autopilot: Autopilot, heard_ns: HostNs) -> tuple[IdentityEvent, ...]:
        before, self.autopilot = self.autopilot, autopilot
        self._heard_ns = heard_ns
        self._lost = False
        self._others.clear()
        return (Adopted(autopilot, before),)

    def _compare(self, heard: Autopilot, now: HostNs) -> tuple[IdentityEvent, ...]:
        """Note another vehicle, and adopt it if it replaces ours."""
        other = self._others.setdefault(heard.system, _Other(heard, now, now))
        other.autopilot, other.last_ns = heard, now
        return self._adopt(heard, now) if self._replaces(other, now) else ()

    def _replaces(self, other: _Other, now: HostNs) -> bool:
        ours = self.autopilot
        if self._configured_system or ours is None or ours.armed or self._heard_ns is None:
            return False
        if now - self._heard_ns < SUCCESSION_NS or now - other.first_ns < LISTEN_NS:
            return False
        on_link = [
            each.autopilot.system
            for each in self._others.values()
            if each.autopilot.link == ours.link and now - each.last_ns <= SILENCE_NS
        ]
        return on_link == [other.autopilot.system] and other.autopilot.system not in self._neighbours

    def _note_neighbours(self, ours: Autopilot) -> tuple[IdentityEvent, ...]:
        """Note the vehicles that were heard before this heartbeat of ours."""
        new = sorted(self._others.keys() - self._neighbours)
        self._others.clear()
        first = not self._neighbours
        self._neighbours.update(new)
        report = first and new and not self._configured_system
        return (NeighbourHeard(new[0], ours.system),) if report else ()

    def _follow(self, heard: Autopilot, now: HostNs) -> tuple[IdentityEvent, ...]:
        before, self.autopilot, self._heard_ns = self.autopilot, heard, now
        events = self._note_neighbours(heard) if self._others else ()
        if self._lost:
            self._lost = False
            events += (AutopilotBack(heard),)
        if before is not None and before.armed != heard.armed:
            events += (ArmedChanged(heard.armed),)
        return events

"""Determines our identity on the network: adopts the autopilot whose system id we use, and times our heartbeats."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Autopilot, AutopilotKind

LISTEN_NS = 3 * NS_PER_S
"""Time from the first autopilot heard to the adoption (MAVLink guide, id assignment)."""
HEARTBEAT_INTERVAL_NS = NS_PER_S
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

KINDS = {
    enums.MAV_AUTOPILOT_ARDUPILOTMEGA: AutopilotKind.ARDUPILOT,
    enums.MAV_AUTOPILOT_PX4: AutopilotKind.PX4,
}
NO_VEHICLES = frozenset(
    {
        enums.MAV_TYPE_ANTENNA_TRACKER,
        enums.MAV_TYPE_GCS,
        enums.MAV_TYPE_ONBOARD_CONTROLLER,
        enums.MAV_TYPE_GIMBAL,
        enums.MAV_TYPE_ADSB,
        enums.MAV_TYPE_CAMERA,
    }
)
"""Types that are not vehicles, whatever their heartbeat has in ``autopilot``."""


class Adopted(msgspec.Struct, frozen=True):
    """The autopilot is adopted: from now on we send with its system id."""

    autopilot: Autopilot
    before: Autopilot | None = None
    """Autopilot that it replaces."""


class SeveralHeard(msgspec.Struct, frozen=True):
    """Several vehicles were heard and no autopilot was adopted: ``[vehicle] system_id`` must choose."""

    systems: tuple[int, ...]


class NeighbourHeard(msgspec.Struct, frozen=True):
    """Another vehicle is heard beside ours for the first time: it is never adopted."""

    system: int
    ours: int


class AutopilotLost(msgspec.Struct, frozen=True):
    """The adopted autopilot missed five heartbeats."""

    autopilot: Autopilot


class AutopilotBack(msgspec.Struct, frozen=True):
    """The lost autopilot is heard again."""

    autopilot: Autopilot


class ArmedChanged(msgspec.Struct, frozen=True):
    """The vehicle was armed or disarmed."""

    armed: bool


IdentityEvent: TypeAlias = Adopted | SeveralHeard | NeighbourHeard | AutopilotLost | AutopilotBack | ArmedChanged


class _Other(msgspec.Struct):
    """Another vehicle's autopilot, heard since ours was last heard."""

    autopilot: Autopilot
    first_ns: HostNs
    last_ns: HostNs


class Identity:
    """Adopts one autopilot, follows its heartbeats, and times ours. Its heartbeats come from autopilot links alone.

    With ``configured_system`` 0 it listens for three seconds from the first autopilot, and adopts that one if no other
    was heard. If several were heard it adopts none of them: a vehicle that is silent for a moment must not make the
    other one ours. With a configured system it adopts that system's autopilot at once.

    Another autopilot replaces the adopted one only without a configured system, once the adopted one was disarmed when
    last heard and has been silent for SUCCESSION_NS, if it is the only one that is heard on that link, and was never
    heard beside ours. Autopilots copy the heartbeats of their neighbours to all their links, and go on when ours has
    lost its power for a moment: a vehicle that was heard before a heartbeat of ours is a neighbour.
    """

    def __init__(self, configured_system: int, companion_component: int = 191, camera_component: int | None = 100):
        self._configured_system = configured_system
        self.companion_component = companion_component
        self._camera_component = camera_component
        self._candidates: dict[int, Autopilot] = {}
        self._candidate_heard_ns: HostNs | None = None
        self._decide_ns: HostNs | None = None
        self._several = False
        self._heard_ns: HostNs | None = None
        self._lost = False
        self._others: dict[int, _Other] = {}
        """By system, at most 254."""
        self._neighbours: set[int] = set()
        """Systems that were heard beside ours, or beside one another before an adoption: never ours."""
        self._faulted = False
        self._beat_ns: HostNs | None = None
        self.autopilot: Autopilot | None = None
        """Adopted autopilot with its newest mode and link; kept while it is lost."""

    @property
    def system(self) -> int:
        """System id that we send with."""
        if self.autopilot is not None:
            return self.autopilot.system
        return self._configured_system or UNASSIGNED_SYSTEM

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

    def heartbeat_overdue(self, now: HostNs) -> bool:
        """Return whether the adopted autopilot's heartbeat is late: it may be lost soon."""
        return self._heard_ns is not None and now > self._heard_ns + OVERDUE_NS

    @property
    def wake_at(self) -> HostNs | None:
        """Time of the next heartbeat of ours, adoption decision, or loss of a peer."""
        due = [self._beat_ns] if self._beat_ns is not None and not self._faulted else []
        if self._decide_ns is not None:
            due.append(self._decide_ns)
        if self._several and self._candidate_heard_ns is not None:
            due.append(HostNs(self._candidate_heard_ns + SILENCE_NS))
        if self._heard_ns is not None and not self._lost:
            due.append(HostNs(self._heard_ns + SILENCE_NS))
        return min(due, default=None)

    def on_message(self, message: Message, now: HostNs) -> tuple[IdentityEvent, ...]:
        """Take a HEARTBEAT; every other message is ignored."""
        if message.name != "HEARTBEAT":
            return ()
        events = self.on_wake(now)
        if message.fields.type == enums.MAV_TYPE_GCS:
            return events
        heard = _autopilot_from_heartbeat(message)
        if heard is None:
            return events
        if self.autopilot is None:
            return events + self._consider(heard, now)
        if (heard.system, heard.component) == (self.autopilot.system, self.autopilot.component):
            return events + self._follow(heard, now)
        if heard.system != self.autopilot.system:
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
        """Return the heartbeats that are due: one a second each for the companion and its camera, and no heartbeat on a
        fault.

        ``healthy`` is False while a peer is missing: the status is then CRITICAL. The camera's heartbeat waits for the
        adoption, unless the system is configured: until then the camera cannot be assigned to a vehicle.
        """
        if self._faulted or (self._beat_ns is not None and now < self._beat_ns):
            return []
        self._beat_ns = _next_beat(self._beat_ns, now)
        beats = [self._heartbeat(self.companion_component, enums.MAV_TYPE_ONBOARD_CONTROLLER, healthy)]
        if self._camera_component is not None and self.knows_its_vehicle:
            beats.append(self._heartbeat(self._camera_component, enums.MAV_TYPE_CAMERA, healthy))
        return beats

    def fault(self) -> None:
        """Stop the heartbeats on an internal fault, so that the network counts us as lost, which is the truth."""
        self._faulted = True

    def fault_over(self) -> None:
        """Resume the heartbeats after a fault."""
        self._faulted = False

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

    def _heartbeat(self, component: int, mav_type: int, healthy: bool) -> Outgoing:
        fields = {
            "type": mav_type,
            "autopilot": enums.MAV_AUTOPILOT_INVALID,
            "base_mode": 0,
            "custom_mode": 0,
            "system_status": enums.MAV_STATE_ACTIVE if healthy else enums.MAV_STATE_CRITICAL,
            "mavlink_version": enums.MAVLINK_VERSION,
        }
        return Outgoing(name="HEARTBEAT", fields=fields, to=Destination.EVERYONE, component=component)


def _next_beat(due_ns: HostNs | None, now: HostNs) -> HostNs:
    """Return a second after the last one was due, so that the rate does not drift; a second from now after a pause."""
    if due_ns is None or now >= due_ns + HEARTBEAT_INTERVAL_NS:
        return HostNs(now + HEARTBEAT_INTERVAL_NS)
    return HostNs(due_ns + HEARTBEAT_INTERVAL_NS)


def _autopilot_from_heartbeat(message: Message) -> Autopilot | None:
    """Return the flight controller that sent a heartbeat; None for every other kind of component."""
    fields = message.fields
    if fields.autopilot == enums.MAV_AUTOPILOT_INVALID or fields.type in NO_VEHICLES or message.system == 0:
        return None
    return Autopilot(
        system=message.system,
        component=message.component,
        kind=KINDS.get(fields.autopilot, AutopilotKind.OTHER),
        vehicle_type=fields.type,
        armed=bool(fields.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED),
        link=message.link,
    )

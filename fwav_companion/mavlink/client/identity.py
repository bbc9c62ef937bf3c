"""Who we are on the network: which autopilot is ours, and the heartbeats that say that we live."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Autopilot, AutopilotKind

LISTEN_NS = 3 * NS_PER_S
"""From the first autopilot heard to the decision which one is ours (MAVLink guide, id assignment)."""
HEARTBEAT_INTERVAL_NS = NS_PER_S
SILENCE_NS = 5 * NS_PER_S
"""Five missed heartbeats: what peers on the network allow each other."""
OVERDUE_NS = 2 * NS_PER_S
"""One missed heartbeat."""
UNASSIGNED_SYSTEM = 1
"""The system id that our heartbeats carry until an autopilot is adopted."""
MAX_CANDIDATES = 16
"""Autopilots remembered while listening: more than one is already too many to choose from."""

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
"""Types that carry nobody, whatever their heartbeat says in ``autopilot``."""


class Adopted(msgspec.Struct, frozen=True):
    """The autopilot is ours from now on: we speak with its system id."""

    autopilot: Autopilot


class SeveralHeard(msgspec.Struct, frozen=True):
    """More than one vehicle was heard, so none was adopted: ``[vehicle] system_id`` must choose."""

    systems: tuple[int, ...]


class AutopilotLost(msgspec.Struct, frozen=True):
    """The adopted autopilot missed five heartbeats."""

    autopilot: Autopilot


class AutopilotBack(msgspec.Struct, frozen=True):
    """It is heard again."""

    autopilot: Autopilot


class ArmedChanged(msgspec.Struct, frozen=True):
    """The vehicle was armed or disarmed."""

    armed: bool


IdentityEvent: TypeAlias = Adopted | SeveralHeard | AutopilotLost | AutopilotBack | ArmedChanged


class Identity:
    """Adopts one autopilot for good, follows its heartbeats, and times ours.

    With ``configured_system`` 0 it listens for three seconds from the first autopilot and adopts it if it was the only
    one. Several: none, and that does not change while any of them is heard, since a vehicle that falls silent for a
    moment must not make the other one ours. With a configured system it adopts that system's autopilot at once.
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
        self._faulted = False
        self._beat_ns: HostNs | None = None
        self.autopilot: Autopilot | None = None
        """The adopted one, with its newest mode and link; kept while it is lost."""

    @property
    def system(self) -> int:
        """The system id that we speak with."""
        if self.autopilot is not None:
            return self.autopilot.system
        return self._configured_system or UNASSIGNED_SYSTEM

    @property
    def knows_its_vehicle(self) -> bool:
        """An autopilot was adopted, or the configuration names the system: what we say is said for that vehicle.

        Until then our only messages are the companion's heartbeats.
        """
        return self.autopilot is not None or bool(self._configured_system)

    @property
    def autopilot_lost(self) -> bool:
        """An autopilot was adopted, and is not heard now."""
        return self._lost

    def heartbeat_overdue(self, now: HostNs) -> bool:
        """Whether the adopted autopilot's heartbeat is late: it may be lost soon."""
        return self._heard_ns is not None and now > self._heard_ns + OVERDUE_NS

    @property
    def wake_at(self) -> HostNs | None:
        """The next heartbeat of ours, decision, or moment at which a peer counts as lost."""
        due = [self._beat_ns] if self._beat_ns is not None and not self._faulted else []
        if self._decide_ns is not None:
            due.append(self._decide_ns)
        if self._several and self._candidate_heard_ns is not None:
            due.append(HostNs(self._candidate_heard_ns + SILENCE_NS))
        if self._heard_ns is not None and not self._lost:
            due.append(HostNs(self._heard_ns + SILENCE_NS))
        return min(due, default=None)

    def on_message(self, message: Message, now: HostNs) -> tuple[IdentityEvent, ...]:
        """Learn from a HEARTBEAT; every other message is none of this object's business."""
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
        return events

    def on_wake(self, now: HostNs) -> tuple[IdentityEvent, ...]:
        """End the listening and notice silence. Our heartbeats are asked for apart: :meth:`heartbeats`."""
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
        """The heartbeats that are due: one a second each for the companion and its camera, none on a fault.

        ``healthy`` is false while a peer is missing: the status is then CRITICAL. The camera waits for the adoption,
        unless the system was configured: until then nobody could tell whose camera it is.
        """
        if self._faulted or (self._beat_ns is not None and now < self._beat_ns):
            return []
        self._beat_ns = _next_beat(self._beat_ns, now)
        beats = [self._heartbeat(self.companion_component, enums.MAV_TYPE_ONBOARD_CONTROLLER, healthy)]
        if self._camera_component is not None and self.knows_its_vehicle:
            beats.append(self._heartbeat(self._camera_component, enums.MAV_TYPE_CAMERA, healthy))
        return beats

    def fault(self) -> None:
        """Something inside is broken: fall silent, so that the network counts us as lost, which is the truth."""
        self._faulted = True

    def fault_over(self) -> None:
        """The fault is mended: heartbeats go on."""
        self._faulted = False

    def _consider(self, heard: Autopilot, now: HostNs) -> tuple[IdentityEvent, ...]:
        if self._configured_system:
            return self._adopt(heard, now) if heard.system == self._configured_system else ()
        self._candidate_heard_ns = now
        if self._several:
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
        return (SeveralHeard(tuple(sorted(self._candidates))),)

    def _adopt(self, autopilot: Autopilot, heard_ns: HostNs) -> tuple[IdentityEvent, ...]:
        self.autopilot = autopilot
        self._heard_ns = heard_ns
        return (Adopted(autopilot),)

    def _follow(self, heard: Autopilot, now: HostNs) -> tuple[IdentityEvent, ...]:
        before, self.autopilot, self._heard_ns = self.autopilot, heard, now
        events: tuple[IdentityEvent, ...] = ()
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
    """A second after the last one was due, so that the rate does not drift; a second from now after a pause."""
    if due_ns is None or now >= due_ns + HEARTBEAT_INTERVAL_NS:
        return HostNs(now + HEARTBEAT_INTERVAL_NS)
    return HostNs(due_ns + HEARTBEAT_INTERVAL_NS)


def _autopilot_from_heartbeat(message: Message) -> Autopilot | None:
    """The flight controller behind a heartbeat; None for every other kind of component."""
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

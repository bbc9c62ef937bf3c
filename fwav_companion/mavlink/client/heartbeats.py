"""Heartbeats: reads those of autopilots, and times our own."""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Autopilot, AutopilotKind

HEARTBEAT_INTERVAL_NS = NS_PER_S

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


class Heartbeats:
    """Our heartbeats, one a second each of the companion and its camera; none on an internal fault."""

    def __init__(self, companion_component: int, camera_component: int | None) -> None:
        self._companion_component = companion_component
        self._camera_component = camera_component
        self._faulted = False
        self._due_ns: HostNs | None = None

    @property
    def wake_at(self) -> HostNs | None:
        """Time of the next one; None before the first, which is due at once, and on a fault."""
        return None if self._faulted else self._due_ns

    def due(self, now: HostNs, *, healthy: bool, with_camera: bool) -> list[Outgoing]:
        """Return the heartbeats that are due. ``healthy`` False: their status is CRITICAL."""
        if self._faulted or (self._due_ns is not None and now < self._due_ns):
            return []
        self._due_ns = _next_beat(self._due_ns, now)
        beats = [_heartbeat(self._companion_component, enums.MAV_TYPE_ONBOARD_CONTROLLER, healthy)]
        if self._camera_component is not None and with_camera:
            beats.append(_heartbeat(self._camera_component, enums.MAV_TYPE_CAMERA, healthy))
        return beats

    def fault(self) -> None:
        """Stop on an internal fault, so that the network counts us as lost, which is the truth."""
        self._faulted = True

    def fault_over(self) -> None:
        """Resume after a fault."""
        self._faulted = False


def autopilot_from_heartbeat(message: Message) -> Autopilot | None:
    """Return the flight controller that sent a heartbeat; None for every other kind of component."""
    fields = message.fields
    if fields.autopilot == enums.MAV_AUTOPILOT_INVALID or fields.type in NO_VEHICLES:
        return None
    return Autopilot(
        system=message.system,
        component=message.component,
        kind=KINDS.get(fields.autopilot, AutopilotKind.OTHER),
        vehicle_type=fields.type,
        armed=bool(fields.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED),
        link=message.link,
    )


def _heartbeat(component: int, mav_type: int, healthy: bool) -> Outgoing:
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

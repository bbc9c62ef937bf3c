"""Sends the selected target as the autopilot's region of interest. Pure.

By COMMAND_INT with altitude above mean sea level (MAV_FRAME_GLOBAL), which both autopilots take; a COMMAND_LONG is up
to a metre off by its 32-bit degrees, and its altitude counts from home in one autopilot. A lost target clears nothing,
because clearing recentres PX4's gimbal.
"""

from __future__ import annotations

from math import hypot
from typing import Any, Final

from fwav_companion.acting import enums
from fwav_companion.acting.aim import from_vehicle_ned, target_ned
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.geometry.vectors import Vector3, larger_semi_axis, norm, subtract
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Autopilot, Situation
from fwav_companion.types.tracks import Track

INTERVAL_NS: Final = NS_PER_S
MOST_UNANSWERED: Final = 5
FARTHEST_M: Final = 5000.0


class Roi:
    """The region of interest of one selection."""

    def __init__(self, component: int) -> None:
        self._component = component
        self._sent: Vector3 | None = None
        """Place of this selection that was sent last."""
        self._is_set = False
        """Whether the autopilot has a place of ours, of this selection or an earlier one."""
        self._due_ns: HostNs | None = None
        self._unanswered = 0
        self.refusal: str | None = None
        """Why the autopilot does not take it; None where it does."""
        self.withheld: str | None = None
        """Why the present place is not sent; None where it is."""

    def begin(self) -> None:
        """Start with a new selection. Frequent selections send no more often."""
        self._sent, self._unanswered = None, 0
        self.refusal = self.withheld = None

    def clear(self, autopilot: Autopilot) -> list[Outgoing]:
        """The command that ends it, where one was sent."""
        was_set, self._is_set, self._sent = self._is_set, False, None
        return [] if not was_set else [self._command(autopilot, enums.MAV_CMD_DO_SET_ROI_NONE, 0, 0, 0.0)]

    def on_message(self, message: Message, autopilot: Autopilot | None) -> None:
        """Take the autopilot's answer."""
        if autopilot is None or message.name != "COMMAND_ACK":
            return
        if (message.system, message.component) != (autopilot.system, autopilot.component):
            return
        if message.fields.command == enums.MAV_CMD_DO_SET_ROI_LOCATION:
            self._unanswered = 0
            word = enums.RESULTS.get(message.fields.result)
            self.refusal = f"the autopilot answers: {word}" if word is not None else self.refusal

    def due(self, track: Track, situation: Situation, autopilot: Autopilot) -> list[Outgoing]:
        """The command where one is due: at most once a second, and where the target moved by more than its sigma."""
        now, plane = situation.now_ns, situation.plane
        if plane is None or (self._due_ns is not None and now < self._due_ns):
            return []
        place = target_ned(track, now)
        moved_m = None if self._sent is None else norm(subtract(place, self._sent))
        if moved_m is not None and moved_m <= larger_semi_axis(track.relative_cov) and not self._unanswered:
            return []
        self.withheld = _unsafe(track, situation)
        if self.withheld is not None:
            return []
        if self._unanswered >= MOST_UNANSWERED:
            self.refusal = "the autopilot does not answer"
            return []
        self._sent, self._due_ns = place, HostNs(now + INTERVAL_NS)
        self._is_set = True
        self._unanswered += 1
        at = plane.geodetic_from_ned(place)
        number = enums.MAV_CMD_DO_SET_ROI_LOCATION
        return [self._command(autopilot, number, round(at.lat_deg * 1e7), round(at.lon_deg * 1e7), at.alt_amsl_m)]

    def _command(self, autopilot: Autopilot, number: int, x: int, y: int, z: float) -> Outgoing:
        fields: dict[str, Any] = {
            "target_system": autopilot.system,
            "target_component": autopilot.component,
            "frame": enums.MAV_FRAME_GLOBAL,
            "command": number,
            "current": 0,
            "autocontinue": 0,
            "param1": 0.0,
            "param2": 0.0,
            "param3": 0.0,
            "param4": 0.0,
            "x": x,
            "y": y,
            "z": z,
        }
        return Outgoing(name="COMMAND_INT", fields=fields, to=Destination.AUTOPILOT, component=self._component)


def _unsafe(track: Track, situation: Situation) -> str | None:
    """Why an autopilot must not be given this place; None where it may be."""
    state = situation.recent_vehicle
    away = None if state is None else from_vehicle_ned(track, state, situation.host_ns_of(state), situation.now_ns)
    if away is None:
        return "the vehicle's place is unknown"
    if away[2] <= 0.0:
        return "the target is above the vehicle"
    if hypot(away[0], away[1]) > FARTHEST_M:
        return "the target is beyond 5 km"
    return None

"""Takes the control of a gimbal from its manager, keeps it while the manager says so, and gives it back. Pure.

The gimbal manager protocol, version 2. The two autopilots read the id -2 ("me") differently, so our real ids are sent.
PX4 ignores commands that do not come from the primary, so nothing is commanded before the manager's status names us.
The control of another program is never taken, neither at the start nor when it takes ours.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import Enum, auto
from math import isfinite, nan
from typing import Any, Final

import msgspec

from fwav_companion.acting import enums
from fwav_companion.acting.aim import Angles
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Autopilot

LAST_NON_MAVLINK_DEVICE: Final = 6
"""Largest gimbal_device_id of a gimbal behind the autopilot; beyond it, the id is a MAVLink component."""
ASK_NS: Final = NS_PER_S
MOST_ASKED: Final = 5
STATUS_NS: Final = 2 * NS_PER_S
"""Interval at which the status is requested while we have the control: an autopilot may send it rarely."""
MOST_MANAGERS: Final = 8
UNCHANGED: Final = -1.0
FLAGS: Final = (
    enums.GIMBAL_MANAGER_FLAGS_ROLL_LOCK
    | enums.GIMBAL_MANAGER_FLAGS_PITCH_LOCK
    | enums.GIMBAL_MANAGER_FLAGS_YAW_IN_VEHICLE_FRAME
)
"""Yaw counts from the vehicle: a gimbal's own north may be its power-on direction."""
OTHER_MODES: Final = {
    enums.GIMBAL_MANAGER_FLAGS_RETRACT: "retracted",
    enums.GIMBAL_MANAGER_FLAGS_NEUTRAL: "neutral",
    enums.GIMBAL_MANAGER_FLAGS_RC_EXCLUSIVE: "the sticks alone",
}
"""Words for the flags of a status that nothing of ours commands: another program or the pilot set that mode."""


class Control(Enum):
    """State of the control of the gimbal."""

    NONE = auto()
    FINDING = auto()
    TAKING = auto()
    OURS = auto()


class Manager(msgspec.Struct, frozen=True):
    """A gimbal manager that was received."""

    system: int
    component: int
    link: str
    device_id: int
    limits: tuple[Angles, Angles] | None = None

    @property
    def key(self) -> tuple[int, int, int]:
        """Its ids and the gimbal's: one component may manage several."""
        return self.system, self.component, self.device_id


class GimbalManager:
    """The dialogue with the manager of the configured gimbal."""

    def __init__(self, device_id: int, component: int) -> None:
        """``component``: ours, which controls."""
        self._device_id, self._component = device_id, component
        self._managers: dict[tuple[int, int, int], Manager] = {}
        self._gimbal_component = device_id if device_id > LAST_NON_MAVLINK_DEVICE else None
        """Component id of the gimbal; None for one behind the autopilot."""
        self._device_link: str | None = None
        self._autopilot_component: int | None = None
        self.control = Control.NONE
        self.manager: Manager | None = None
        """Manager that controls the configured gimbal; None before it was found."""
        self.primary: tuple[int, int] | None = None
        """(system, component) in control by its newest status; None before the first."""
        self._primary_by: Manager | None = None
        """Manager whose status that was."""
        self.refusal: str | None = None
        """Why the control was not given; None where it was not refused."""
        self.taken_by: tuple[int, int] | None = None
        """Who took the control from us."""
        self.new_mode: str | None = None
        """Mode that another program or the pilot set while we had the control; None while it has ours."""
        self._flags: int | None = None
        """Flags of the newest status with our control."""
        self._asked = 0
        self._quiet_until: HostNs | None = None
        """Instant before which no more requests are sent, however often the control is asked for."""
        self.wake_at: HostNs | None = None
        """Instant of the next request; None where none is due."""

    @property
    def heard(self) -> Manager | None:
        """The configured gimbal's manager, as far as it was heard."""
        return self._chosen()

    def inquire(self, now: HostNs) -> None:
        """Start to ask what the gimbal can do, which commands nothing: `check` reports it before a selection."""
        if self.control is Control.NONE:
            self._asked, self.wake_at = 0, now

    def begin(self, now: HostNs) -> None:
        """Start to take the control."""
        self.control, self._asked = Control.FINDING, 0
        self.refusal = self.taken_by = self.new_mode = self.primary = self.manager = self._flags = None
        self.wake_at = now if self._quiet_until is None else max(now, self._quiet_until)

    def end(self, autopilot: Autopilot | None) -> list[Outgoing]:
        """Give the control back where we have it or asked for it."""
        held, self.control, self.wake_at = self.control, Control.NONE, None
        if autopilot is None or self.manager is None or held not in (Control.TAKING, Control.OURS):
            return []
        return [self._configure(self.manager, 0.0, 0.0)]

    def on_message(self, message: Message, autopilot: Autopilot | None) -> None:
        """Take a message of the vehicle: a manager's information, status or acknowledgement."""
        if autopilot is None or message.system != autopilot.system:
            return
        if message.name in ("GIMBAL_MANAGER_INFORMATION", "GIMBAL_MANAGER_STATUS"):
            self._on_manager(message, autopilot)
        elif message.name == "COMMAND_ACK":
            self._on_answer(message)
        elif message.name == "GIMBAL_DEVICE_ATTITUDE_STATUS" and message.component == self._device_id:
            self._device_link = message.link

    def on_wake(self, now: HostNs, autopilot: Autopilot) -> list[Outgoing]:
        """The requests that are due."""
        if self.wake_at is None or now < self.wake_at:
            return []
        self.wake_at = self._quiet_until = HostNs(now + ASK_NS)
        match self.control:
            case Control.NONE:
                return self._inquire(autopilot)
            case Control.FINDING:
                return self._find(autopilot)
            case Control.TAKING:
                return self._take(autopilot)
            case Control.OURS if self.manager is not None:
                self.wake_at = HostNs(now + STATUS_NS)
                return [self._request(self.manager, enums.GIMBAL_MANAGER_STATUS)]
        self.wake_at = None
        return []

    def point(self, looks: Angles) -> Outgoing | None:
        """The command of these angles, yaw from the vehicle's heading; None without the control.

        Angles alone: ArduPilot drops a message with angles and rates silently.
        """
        if self.control is not Control.OURS or self.manager is None:
            return None
        fields = {
            "target_system": self.manager.system,
            "target_component": self.manager.component,
            "flags": FLAGS,
            "gimbal_device_id": self.manager.device_id,
            "pitch": looks.pitch,
            "yaw": looks.yaw,
            "pitch_rate": nan,
            "yaw_rate": nan,
        }
        return self._to_manager(self.manager, "GIMBAL_MANAGER_SET_PITCHYAW", fields)

    # Steps.

    def _find(self, autopilot: Autopilot) -> list[Outgoing]:
        chosen = self._chosen()
        is_answered = chosen is not None and self._primary_by is not None and self._primary_by.key == chosen.key
        if chosen is not None and self.primary is not None and is_answered:
            self.manager = chosen
            if self.primary not in ((0, 0), self._ours(autopilot)):
                return self._refuse("the gimbal is held by {}/{}: release it there".format(*self.primary))
            self.control, self._asked = Control.TAKING, 0
            return self._take(autopilot)
        if self._asked >= MOST_ASKED:
            return self._refuse("no gimbal manager answers")
        return self._ask(chosen, autopilot)

    def _inquire(self, autopilot: Autopilot) -> list[Outgoing]:
        chosen = self._chosen()
        if self._asked >= MOST_ASKED or (chosen is not None and chosen.limits is not None):
            self.wake_at = None
            return []
        return self._ask(chosen, autopilot)

    def _ask(self, chosen: Manager | None, autopilot: Autopilot) -> list[Outgoing]:
        """The requests for a manager's information and status; before one is known, where it may be."""
        self._asked += 1
        wanted = (enums.GIMBAL_MANAGER_INFORMATION, enums.GIMBAL_MANAGER_STATUS)
        if chosen is not None:
            return [self._request(chosen, message_id) for message_id in wanted]
        behind = Manager(autopilot.system, autopilot.component, autopilot.link, self._device_id)
        places = [behind]
        if self._gimbal_component is not None and self._device_link is not None:
            places.append(Manager(autopilot.system, self._gimbal_component, self._device_link, self._device_id))
        return [self._request(place, message_id) for place in places for message_id in wanted]

    def _take(self, autopilot: Autopilot) -> list[Outgoing]:
        if self.manager is None or self._asked >= MOST_ASKED:
            return self._refuse("the gimbal's manager does not give the control")
        self._asked += 1
        ours = self._ours(autopilot)
        configure = self._configure(self.manager, float(ours[0]), float(ours[1]))
        return [configure, self._request(self.manager, enums.GIMBAL_MANAGER_STATUS)]

    def _refuse(self, why: str) -> list[Outgoing]:
        self.refusal, self.control, self.wake_at = why, Control.NONE, None
        return []

    def _on_manager(self, message: Message, autopilot: Autopilot) -> None:
        fields = message.fields
        key = (message.system, message.component, fields.gimbal_device_id)
        if any(each.system != autopilot.system for each in self._managers.values()):
            self._managers.clear()  # another vehicle was adopted
        known = self._managers.get(key)
        if known is None and len(self._managers) >= MOST_MANAGERS:
            # A component can invent managers; the autopilot's and the gimbal's own take the place of one of those.
            if message.component not in (autopilot.component, self._gimbal_component):
                return
            del self._managers[
                next(other for other in self._managers if self.manager is None or other != self.manager.key)
            ]
        limits = known.limits if known is not None else None
        if message.name == "GIMBAL_MANAGER_INFORMATION":
            limits = _limits(fields)
        self._managers[key] = Manager(message.system, message.component, message.link, key[2], limits)
        self._autopilot_component = autopilot.component
        chosen = self._chosen()
        if chosen is None or chosen.key != key:
            return
        if self.manager is not None:
            self.manager = chosen
        if message.name == "GIMBAL_MANAGER_STATUS":
            self._on_primary((fields.primary_control_sysid, fields.primary_control_compid), autopilot)
            self._on_flags(int(fields.flags))

    def _on_primary(self, primary: tuple[int, int], autopilot: Autopilot) -> None:
        self.primary, self._primary_by = primary, self._chosen()
        ours = primary == self._ours(autopilot)
        if self.control is Control.TAKING and ours:
            self.control = Control.OURS
        elif self.control is Control.OURS and not ours:
            self.control, self.taken_by, self.wake_at = Control.NONE, primary, None
        elif self.control is Control.TAKING and primary != (0, 0):
            self._refuse("the gimbal was taken by {}/{}".format(*primary))

    def _on_flags(self, flags: int) -> None:
        """Notice a mode that began since the last status; one from before our first command ends by that."""
        if self.control is not Control.OURS:
            return
        begun = 0 if self._flags is None else flags & ~self._flags
        self._flags = flags
        self.new_mode = next((word for flag, word in OTHER_MODES.items() if begun & flag), self.new_mode)

    def _on_answer(self, message: Message) -> None:
        manager, fields = self.manager, message.fields
        if manager is None or self.control is not Control.TAKING or message.component != manager.component:
            return
        word = enums.RESULTS.get(fields.result)
        if fields.command == enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE and word is not None:
            self._refuse(f"the gimbal's manager answers: {word}")

    def _chosen(self) -> Manager | None:
        """The configured gimbal's manager; where none has its id, the only one.

        While one controls or gives the control it is the one: another component that claims the same gimbal would hide
        that it gave the control away. Of several that claim it the autopilot's counts.
        """
        if self.manager is not None and self.control in (Control.TAKING, Control.OURS):
            return self._managers.get(self.manager.key)
        own = self._gimbal_component
        known = self._managers.values()
        exact = [each for each in known if each.device_id == self._device_id or each.component == own]
        found = exact or list(known)
        if len(exact) > 1:
            found = [each for each in exact if each.component == self._autopilot_component]
        return found[0] if len(found) == 1 else None

    def _ours(self, autopilot: Autopilot) -> tuple[int, int]:
        return autopilot.our_system, self._component

    def _configure(self, manager: Manager, system: float, component: float) -> Outgoing:
        params = (system, component, UNCHANGED, UNCHANGED, 0.0, 0.0, float(manager.device_id))
        return self._command(manager, enums.MAV_CMD_DO_GIMBAL_MANAGER_CONFIGURE, params)

    def _request(self, manager: Manager, message_id: int) -> Outgoing:
        return self._command(manager, enums.MAV_CMD_REQUEST_MESSAGE, (float(message_id), *(0.0,) * 6))

    def _command(self, manager: Manager, number: int, params: tuple[float, ...]) -> Outgoing:
        fields = {
            "target_system": manager.system,
            "target_component": manager.component,
            "command": number,
            "confirmation": 0,
            **{f"param{index}": value for index, value in enumerate(params, start=1)},
        }
        return self._to_manager(manager, "COMMAND_LONG", fields)

    def _to_manager(self, manager: Manager, name: str, fields: Mapping[str, Any]) -> Outgoing:
        return Outgoing(name=name, fields=fields, to=Destination.REPLY, component=self._component, link=manager.link)


def _limits(fields: Any) -> tuple[Angles, Angles] | None:
    """Least and largest pitch and yaw, radians, equal where it has no such axis; None where they are not a range."""
    low, high = Angles(fields.pitch_min, fields.yaw_min), Angles(fields.pitch_max, fields.yaw_max)
    values = (low.pitch, low.yaw, high.pitch, high.yaw)
    if not all(map(isfinite, values)) or low == high or not (low.pitch <= high.pitch and low.yaw <= high.yaw):
        return None
    return low, high

"""Whether the service may act on the selected target, and why no longer. Pure.

An operator's selection gives the permission; it is of this flight: it does not count before the take-off, and ends with
it. While nothing was selected, nothing is permitted.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Any, Final

import msgspec

from fwav_companion.acting import enums
from fwav_companion.acting.options import ActOptions
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.types.commands import Command
from fwav_companion.types.messages import Message
from fwav_companion.types.situation import Autopilot

SILENCE_NS: Final = 5 * NS_PER_S
"""Longest silence of the selecting station: five missed heartbeats."""


class End(StrEnum):
    """Reason why acting on a target ended."""

    STOPPED = "stopped by the operator"
    TARGET_LOST = "the target was lost"
    NO_PICTURES = "no pictures come"
    STATION_SILENT = "the selecting station is silent"
    DISARMED = "disarmed"
    LANDED = "landed"
    REBOOTED = "the autopilot rebooted"
    REPLACED = "another autopilot"
    FAILSAFE = "failsafe"
    AUTOPILOT_LOST = "the autopilot is silent"
    MODE_CHANGED = "the flight mode changed"
    GIMBAL_MODE = "the gimbal's mode changed"
    CONTROL_TAKEN = "another took the gimbal"
    STICK = "the pilot moved the gimbal"
    GIMBAL_STUCK = "the gimbal does not follow"
    REFUSED = "refused"


class SelectionRefusal(StrEnum):
    """Reason why a selection does not permit to act."""

    NOT_FLYING = "select the target in flight"
    UNTRUSTED = "select on a gcs link, or with a signature"


class Selector(msgspec.Struct, frozen=True):
    """The station that selected the target."""

    system: int
    component: int

    def sent(self, message: Message) -> bool:
        """Return whether a message bears its ids."""
        return (message.system, message.component) == (self.system, self.component)


class Permission:
    """The permission to act; :attr:`selector` is None while there is none."""

    def __init__(self, options: ActOptions) -> None:
        self._gcs_links, self._signed = options.gcs_links, options.signed
        self._ends_by_mode = options.point == "roi"
        self.selector: Selector | None = None
        self._heard_ns: HostNs | None = None
        self._armed = False
        self._status: int | None = None
        self._mode: int | None = None
        self._landed = False

    @property
    def flies(self) -> bool:
        """Whether the vehicle is armed and off the ground, by its newest heartbeat."""
        return self._armed and not self._landed and self._status == enums.MAV_STATE_ACTIVE

    @property
    def wake_at(self) -> HostNs | None:
        """Instant at which the station's silence ends the permission."""
        return None if self._heard_ns is None or self.selector is None else HostNs(self._heard_ns + SILENCE_NS)

    def select(self, command: Command, autopilot: Autopilot | None, now: HostNs) -> SelectionRefusal | None:
        """Take a selection that was obeyed; a refusal leaves no permission.

        Without a key it counts on a gcs link, and from the autopilot itself, which forwards what its own links bring. A
        payload's does not.
        """
        self.selector, self._heard_ns = None, None
        # With a key a command that was obeyed was signed.
        if not self.counts(command, autopilot, signed=True):
            return SelectionRefusal.UNTRUSTED
        if not self.flies:
            return SelectionRefusal.NOT_FLYING
        self.selector, self._heard_ns = Selector(command.system, command.component), now
        return None

    def counts(self, sent: Command | Message, autopilot: Autopilot | None, *, signed: bool) -> bool:
        """Return whether a station may speak for its operator in this way."""
        if self._signed:
            return signed
        by_autopilot = autopilot is not None and (sent.system, sent.component) == (
            autopilot.system,
            autopilot.component,
        )
        return by_autopilot or sent.link in self._gcs_links

    def withdraw(self) -> None:
        """End the permission."""
        self.selector, self._heard_ns = None, None

    def on_message(self, message: Message, autopilot: Autopilot | None, now: HostNs) -> End | None:
        """Take any message; the reason why it ends the permission."""
        is_selector = self.selector is not None and self.selector.sent(message)
        # What could not have selected does not keep the permission of a station that is gone.
        if is_selector and self.counts(message, autopilot, signed=message.signed):
            self._heard_ns = now
        if autopilot is None or (message.system, message.component) != (autopilot.system, autopilot.component):
            return None
        if message.name == "HEARTBEAT":
            return self._on_heartbeat(message.fields)
        if message.name == "EXTENDED_SYS_STATE":
            self._landed = message.fields.landed_state == enums.MAV_LANDED_STATE_ON_GROUND
            return End.LANDED if self._landed else None
        return None

    def on_wake(self, now: HostNs) -> End | None:
        """End.STATION_SILENT once the station has been silent."""
        due = self.wake_at
        return End.STATION_SILENT if due is not None and now >= due else None

    def _on_heartbeat(self, fields: Any) -> End | None:
        armed, status = bool(fields.base_mode & enums.MAV_MODE_FLAG_SAFETY_ARMED), int(fields.system_status)
        mode_changed = self._mode is not None and fields.custom_mode != self._mode
        self._armed, self._status, self._mode = armed, status, fields.custom_mode
        if not armed:
            self._landed = False
            return End.DISARMED
        if status >= enums.MAV_STATE_CRITICAL:
            return End.FAILSAFE
        if status < enums.MAV_STATE_ACTIVE:  # both autopilots stand by on the ground
            return End.LANDED
        return End.MODE_CHANGED if mode_changed and self._ends_by_mode else None

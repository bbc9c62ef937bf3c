"""Events of our identity: an autopilot is adopted, lost, back or armed; another vehicle is heard."""

from __future__ import annotations

from typing import TypeAlias

import msgspec

from fwav_companion.types.situation import Autopilot


class Adopted(msgspec.Struct, frozen=True):
    """The autopilot is adopted: from now on we send with its system id."""

    autopilot: Autopilot
    before: Autopilot | None = None
    """Autopilot that it replaces."""


class SeveralHeard(msgspec.Struct, frozen=True):
    """Several vehicles were heard and no autopilot was adopted: ``[vehicle] system_id`` must choose."""

    systems: tuple[int, ...]


class NeighbourHeard(msgspec.Struct, frozen=True):
    """Another vehicle than ours is heard for the first time: it is never adopted."""

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

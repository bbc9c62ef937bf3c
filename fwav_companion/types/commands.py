"""Commands (MAV_CMD) to the service's components, and their answers."""

from __future__ import annotations

from enum import IntEnum

import msgspec

from fwav_companion.types.messages import Outgoing


class CommandResult(IntEnum):
    """Result codes of MAV_RESULT."""

    ACCEPTED = 0
    DENIED = 2
    """The command is known, its parameters are not valid."""
    UNSUPPORTED = 3
    FAILED = 4
    """The command is valid and could not be executed."""


class Command(msgspec.Struct, frozen=True, kw_only=True):
    """A COMMAND_LONG or COMMAND_INT that addresses one of the service's components."""

    number: int
    """Command number, MAV_CMD."""
    params: tuple[float, float, float, float, float, float, float]
    """param1 to param7 as received, possibly not finite; x and y of a COMMAND_INT are the fifth and sixth."""
    system: int
    """System id of the sender."""
    component: int
    """Component id of the sender."""
    link: str
    """Name of the link on which the command arrived."""
    to_component: int
    """Component id of the service's component that is addressed."""
    broadcast: bool = False
    """Whether the command was addressed to all systems or components."""


class CommandAnswer(msgspec.Struct, frozen=True):
    """The result for the COMMAND_ACK and the messages that follow it."""

    result: CommandResult
    messages: tuple[Outgoing, ...] = ()

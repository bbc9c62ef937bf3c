"""What somebody asks of us by MAV_CMD, and what is answered."""

from __future__ import annotations

from enum import IntEnum

import msgspec

from fwav_companion.types.messages import Outgoing


class CommandResult(IntEnum):
    """The values of MAV_RESULT that we answer."""

    ACCEPTED = 0
    DENIED = 2
    """Known, but its parameters are not valid."""
    UNSUPPORTED = 3
    FAILED = 4
    """Valid, but it cannot be done."""


class Command(msgspec.Struct, frozen=True, kw_only=True):
    """A COMMAND_LONG or COMMAND_INT that concerns one of our components."""

    number: int
    """MAV_CMD."""
    params: tuple[float, float, float, float, float, float, float]
    """param1 to param7 as they came: not finite is possible. A COMMAND_INT's x and y are the fifth and sixth."""
    system: int
    """The sender's."""
    component: int
    """The sender's."""
    link: str
    """Where it came in."""
    to_component: int
    """The component of ours that is asked."""
    broadcast: bool = False
    """It was addressed to everybody, not to us by name."""


class CommandAnswer(msgspec.Struct, frozen=True):
    """The result for the COMMAND_ACK, and the messages that follow it."""

    result: CommandResult
    messages: tuple[Outgoing, ...] = ()

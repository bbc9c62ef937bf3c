"""Commands to our components: every one is acknowledged, once, and a repeated one is not done twice."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

from fwav_companion.nouns.commands import Command, CommandAnswer
from fwav_companion.nouns.messages import Message, Outgoing
from fwav_companion.nouns.situation import Situation

Handler: TypeAlias = Callable[[Command, Situation], CommandAnswer | None]
"""Does what a command asks; None: it is none of the handler's, which gives UNSUPPORTED."""


class Commands:
    """The door for COMMAND_LONG, COMMAND_INT and PING."""

    def __init__(self, handlers: dict[int, Handler | None], *, require_signed: bool = False):
        """``handlers``: by component of ours; None: it answers what every component answers, and nothing else."""
        self._handlers = handlers
        self._require_signed = require_signed

    def on_message(self, message: Message, situation: Situation) -> list[Outgoing]:
        """The acknowledgement and whatever follows; empty where the message does not concern us."""
        return []

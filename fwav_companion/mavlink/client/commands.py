"""Answers commands to our components: each one is acknowledged once, and a repeated one is not executed twice."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from typing import Any, TypeAlias

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.commands import Command, CommandAnswer, CommandResult
from fwav_companion.types.messages import Destination, Message, Outgoing
from fwav_companion.types.situation import Situation

Handler: TypeAlias = Callable[[Command, Situation], CommandAnswer | None]
"""Executes a command; None: the handler does not know it, and the answer is UNSUPPORTED."""
Maker: TypeAlias = Callable[[Situation], Mapping[str, Any] | None]
"""Returns the fields of a message that may be requested; None: not available now."""

REPEATED_NS = 5 * NS_PER_S
"""Time for which a command's answer is kept: senders repeat an unacknowledged command for a few seconds."""
MAX_CONVERSATIONS = 16
AUTOPILOT_VERSION = 148
CAPABILITIES = enums.MAV_PROTOCOL_CAPABILITY_COMMAND_INT | enums.MAV_PROTOCOL_CAPABILITY_MAVLINK2


class _Done(msgspec.Struct, frozen=True):
    """Last command from one sender to one component, and its answer."""

    command: Command
    answer: CommandAnswer
    at_ns: HostNs


class Commands:
    """Answers COMMAND_LONG, COMMAND_INT and PING.

    Every component of ours answers a request for AUTOPILOT_VERSION, and for each message registered with
    :meth:`provide`; all other commands go to the component's handler.
    """

    def __init__(
        self,
        handlers: Mapping[int, Handler | None],
        *,
        require_signed: bool = False,
        version: tuple[int, int, int] = (0, 0, 0),
    ):
        """Start without kept answers. ``handlers``: handler by component of ours; the first component answers PING."""
        self._handlers = dict(handlers)
        self._require_signed = require_signed
        self._version = version
        self._makers: dict[tuple[int, int], tuple[str, Maker]] = {}
        self._done: dict[tuple[int, int, int], _Done] = {}
        self.system = 0
        """Our configured system id; 0: that of the adopted autopilot. Until one is adopted, no command is answered."""
        self.refused_unsigned = 0
        for component in self._handlers:
            self.provide(component, AUTOPILOT_VERSION, "AUTOPILOT_VERSION", self._autopilot_version)

    def provide(self, component: int, message_id: int, name: str, maker: Maker) -> None:
        """Register a message that the component sends on REQUEST_MESSAGE for this id."""
        self._makers[(component, message_id)] = (name, maker)

    def on_message(self, message: Message, situation: Situation) -> list[Outgoing]:
        """Return the acknowledgement and the messages that follow it; empty if the message is not addressed to us."""
        system = self.system or (situation.autopilot.our_system if situation.autopilot is not None else 0)
        if system == 0 or (message.system == system and message.component in self._handlers):
            return []
        if message.name == "PING":
            return self._on_ping(message)
        if message.name not in {"COMMAND_LONG", "COMMAND_INT"}:
            return []
        target = (message.fields.target_system, message.fields.target_component)
        if target[0] not in {0, system} or (target[1] != 0 and target[1] not in self._handlers):
            return []
        if target[0] == system and target[1] != 0:
            return self._answer(_command(message, target[1], broadcast=False), message.signed, situation)
        addressed = [target[1]] if target[1] != 0 else list(self._handlers)
        answers = [self._answer(_command(message, one, broadcast=True), message.signed, situation) for one in addressed]
        return [outgoing for answer in answers for outgoing in answer]

    def _answer(self, command: Command, signed: bool, situation: Situation) -> list[Outgoing]:
        if self._require_signed and not signed:
            self.refused_unsigned += 1
            return [] if command.broadcast else [_acknowledgement(command, CommandResult.DENIED)]
        answer = self._remembered(command, situation.now_ns)
        if answer is None:
            answer = self._do(command, situation)
            if answer is None:
                self._done.pop(_conversation(command), None)
                return [] if command.broadcast else [_acknowledgement(command, CommandResult.UNSUPPORTED)]
            self._remember(command, answer, situation.now_ns)
        return [_acknowledgement(command, answer.result), *answer.messages]

    def _do(self, command: Command, situation: Situation) -> CommandAnswer | None:
        requested = _requested_message(command)
        if requested is not None and (command.to_component, requested) in self._makers:
            name, maker = self._makers[(command.to_component, requested)]
            fields = maker(situation)
            if fields is None:
                return CommandAnswer(CommandResult.FAILED)
            reply = Outgoing(
                name=name, fields=fields, to=Destination.REPLY, component=command.to_component, link=command.link
            )
            return CommandAnswer(CommandResult.ACCEPTED, (reply,))
        handler = self._handlers[command.to_component]
        return handler(command, situation) if handler is not None else None

    def _remembered(self, command: Command, now: HostNs) -> CommandAnswer | None:
        """Return the answer to the sender's last command if this one repeats it; None if that answer carried messages,
        which are computed again.
        """
        done = self._done.get(_conversation(command))
        if done is None or now - done.at_ns > REPEATED_NS or done.answer.messages:
            return None
        return done.answer if _same(done.command, command) else None

    def _remember(self, command: Command, answer: CommandAnswer, now: HostNs) -> None:
        conversation = _conversation(command)
        self._done.pop(conversation, None)
        is_request = bool(answer.messages) or command.number == enums.MAV_CMD_SET_MESSAGE_INTERVAL
        if answer.result is CommandResult.ACCEPTED and not is_request:
            # What another sends again after this is a new wish: a STOP after the STOP before a selection above all.
            self._done.clear()
        if len(self._done) >= MAX_CONVERSATIONS:
            del self._done[next(iter(self._done))]
        self._done[conversation] = _Done(command, answer, now)

    def _on_ping(self, message: Message) -> list[Outgoing]:
        """Answer a PING request, whose target is 0/0; a PING with a target is an answer."""
        ping = message.fields
        if (ping.target_system, ping.target_component) != (0, 0):
            return []
        fields = {
            "time_usec": ping.time_usec,
            "seq": ping.seq,
            "target_system": message.system,
            "target_component": message.component,
        }
        component = next(iter(self._handlers))
        return [
            Outgoing(name="PING", fields=fields, to=Destination.REPLY, component=component, link=message.link),
        ]

    def _autopilot_version(self, _situation: Situation) -> Mapping[str, Any]:
        major, minor, patch = self._version
        unused = (0,) * 8
        return {
            "capabilities": CAPABILITIES,
            "flight_sw_version": (major & 0xFF) << 24 | (minor & 0xFF) << 16 | (patch & 0xFF) << 8,
            "middleware_sw_version": 0,
            "os_sw_version": 0,
            "board_version": 0,
            "flight_custom_version": unused,
            "middleware_custom_version": unused,
            "os_custom_version": unused,
            "vendor_id": 0,
            "product_id": 0,
            "uid": 0,
        }


def _command(message: Message, to_component: int, *, broadcast: bool) -> Command:
    fields = message.fields
    ends = ("x", "y", "z") if message.name == "COMMAND_INT" else ("param5", "param6", "param7")
    fifth, sixth, seventh = (float(getattr(fields, end)) for end in ends)
    return Command(
        number=fields.command,
        params=(fields.param1, fields.param2, fields.param3, fields.param4, fifth, sixth, seventh),
        system=message.system,
        component=message.component,
        link=message.link,
        to_component=to_component,
        broadcast=broadcast,
    )


def _conversation(command: Command) -> tuple[int, int, int]:
    """Return the sender and our component, by which answers are kept."""
    return (command.system, command.component, command.to_component)


def _requested_message(command: Command) -> int | None:
    """Return the requested message id, from REQUEST_MESSAGE or the older command for AUTOPILOT_VERSION alone."""
    first = command.params[0]
    if command.number == enums.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
        return AUTOPILOT_VERSION if first == 1.0 else None
    if command.number == enums.MAV_CMD_REQUEST_MESSAGE and isfinite(first):
        return int(first)
    return None


def _same(one: Command, other: Command) -> bool:
    """Return whether two commands are equal. NaN parameters ("use the default") are equal; the links may differ."""
    return (one.number, one.to_component) == (other.number, other.to_component) and all(
        a == b or (a != a and b != b) for a, b in zip(one.params, other.params, strict=True)
    )


def _acknowledgement(command: Command, result: CommandResult) -> Outgoing:
    fields = {
        "command": command.number,
        "result": int(result),
        "progress": 0,
        "result_param2": 0,
        "target_system": command.system,
        "target_component": command.component,
    }
    return Outgoing(
        name="COMMAND_ACK",
        fields=fields,
        to=Destination.REPLY,
        component=command.to_component,
        link=command.link,
    )

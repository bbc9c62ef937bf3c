"""Speaks with the autopilot about rates: one question at a time, repeated a few times, with its answer."""

from __future__ import annotations

from enum import Enum, auto
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.mavlink.client.ack_order import AckOrder
from fwav_companion.mavlink.client.rate_table import RateRow
from fwav_companion.mavlink.client.requests import command, request
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot

ACK_TIMEOUT_NS = 700 * NS_PER_MS
MAX_TRIES = 4
LEARN_TRIES = 3
"""Tries of GET_MESSAGE_INTERVAL: three timeouts are the two seconds after which the rate is measured instead."""
MAX_STREAM_RATE = 0xFFFF
SET, GET = enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_GET_MESSAGE_INTERVAL
DEFAULT_US = 0
"""param2 of SET_MESSAGE_INTERVAL for the autopilot's own rate (common.xml)."""


class QuestionKind(Enum):
    """What a question is about."""

    RATE = auto()
    """GET_MESSAGE_INTERVAL: the rate without our request."""
    DEFAULT = auto()
    """The same after a reset to the default: the rate looks like that of an earlier run of ours."""
    INTERVAL = auto()
    """SET_MESSAGE_INTERVAL to our rate."""
    WISH = auto()
    """SET_MESSAGE_INTERVAL to a station's rate that a reboot lost."""


class Question(msgspec.Struct):
    """The one request whose answer is awaited."""

    kind: QuestionKind
    msgid: int
    row: RateRow | None = None
    hz: float = 0.0
    """Rate of a WISH, hertz."""
    tries: int = 0
    deadline_ns: HostNs = HostNs(0)
    acknowledged: bool = False

    @property
    def most_tries(self) -> int:
        """Number of tries after which no answer is expected."""
        return LEARN_TRIES if self.kind in {QuestionKind.RATE, QuestionKind.DEFAULT} else MAX_TRIES


class RateDialogue:
    """Builds the requests to one autopilot, and finds the question that an acknowledgement answers."""

    def __init__(self, component: int) -> None:
        self._component = component
        self._acks: AckOrder[Question] = AckOrder(ACK_TIMEOUT_NS)
        self.question: Question | None = None
        """Question whose answer is awaited."""

    def begin(self) -> None:
        """Start over: no question is pending."""
        self.question = None
        self._acks.clear()

    def ask(self, autopilot: Autopilot, question: Question, now: HostNs) -> list[Outgoing]:
        """Return a question for the first time, or again; a station's or the autopilot's higher rate follows ours."""
        question.tries += 1
        question.deadline_ns = HostNs(now + ACK_TIMEOUT_NS)
        question.acknowledged = False
        self.question = question
        msgid, row = question.msgid, question.row
        if question.kind in {QuestionKind.RATE, QuestionKind.DEFAULT}:
            reset = self.set_rate(autopilot, msgid, DEFAULT_US, now) if question.kind is QuestionKind.DEFAULT else []
            self._acks.sent(GET, question, now)
            return [*reset, command(autopilot, self._component, GET, msgid)]
        interval_us = round(1e6 / question.hz) if row is None else row.interval_us
        return self.set_rate(autopilot, msgid, interval_us, now, question)

    def set_rate(
        self, autopilot: Autopilot, msgid: int, interval_us: int, now: HostNs, question: Question | None = None
    ) -> list[Outgoing]:
        """Return SET_MESSAGE_INTERVAL. Without a question its acknowledgement does not matter."""
        self._acks.sent(SET, question, now)
        confirmation = 0 if question is None else question.tries - 1
        return [command(autopilot, self._component, SET, msgid, interval_us, confirmation=confirmation)]

    def set_group(self, autopilot: Autopilot, number: int, rate_hz: float) -> Outgoing:
        """Return REQUEST_DATA_STREAM, which no acknowledgement follows."""
        rate = min(round(rate_hz) or 1, MAX_STREAM_RATE)
        fields = {"req_stream_id": number, "req_message_rate": rate, "start_stop": 1}
        return request(autopilot, self._component, "REQUEST_DATA_STREAM", fields)

    def acknowledged(self, autopilot: Autopilot, fields: Any, now: HostNs) -> Question | None:
        """Return the pending question that a COMMAND_ACK answers; older autopilots leave its target fields 0."""
        for_us = fields.target_system in {0, autopilot.system} and fields.target_component in {0, self._component}
        if not for_us or fields.command not in {SET, GET} or fields.result == enums.MAV_RESULT_IN_PROGRESS:
            return None
        question = self._acks.acknowledged(fields.command, now)
        return question if question is not None and question is self.question else None

    def stated(self, message: Message) -> Question | None:
        """Return the pending question that a MESSAGE_INTERVAL answers."""
        question = self.question
        if question is None or question.kind not in {QuestionKind.RATE, QuestionKind.DEFAULT}:
            return None
        return question if question.msgid == message.fields.message_id else None

"""Speaks with the autopilot about rates: one question at a time, repeated a few times, with its answer; and lists the
rates that are to be requested.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from enum import Enum, auto
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, HostNs
from fwav_companion.mavlink.client.rate_table import RateRow
from fwav_companion.mavlink.client.requests import command, request
from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.stream_groups import GROUPS, group_ids
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot

ACK_TIMEOUT_NS = 700 * NS_PER_MS
MAX_TRIES = 4
LEARN_TRIES = 3
"""Tries of GET_MESSAGE_INTERVAL: three timeouts are the two seconds after which the rate is measured instead."""
MAX_STREAM_RATE = 0xFFFF
MAX_AWAITED = 256
ROUNDING = 1.001
"""Ratio below which two rates are equal: intervals are whole microseconds on the wire, whole milliseconds in
autopilots."""
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


class Question(msgspec.Struct, eq=False):
    """The one request whose answer is awaited."""

    kind: QuestionKind
    msgid: int
    row: RateRow | None = None
    """Row of our message; None for a WISH."""
    wish_hz: float = 0.0
    """Rate of a WISH, hertz."""
    tries: int = 0
    deadline_ns: HostNs = HostNs(0)

    @property
    def is_about_before(self) -> bool:
        """Whether it asks what was there, and changes nothing of ours."""
        return self.kind in {QuestionKind.RATE, QuestionKind.DEFAULT}

    @property
    def most_tries(self) -> int:
        """Number of tries after which no answer is expected."""
        return LEARN_TRIES if self.is_about_before else MAX_TRIES


class AckOrder:
    """Matches acknowledgements to commands in order of sending: COMMAND_ACK carries only the kind of command, so it
    belongs to the oldest pending command of its kind.

    Two rules resynchronise it after a lost acknowledgement: an acknowledgement of a later command of another kind
    discards the commands sent before that one, and no command is pending longer than ``timeout_ns``.
    """

    __slots__ = ("_awaited", "_timeout_ns")

    def __init__(self, timeout_ns: int):
        self._timeout_ns = timeout_ns
        self._awaited: deque[tuple[int, object, int]] = deque(maxlen=MAX_AWAITED)

    def sent(self, command: int, subject: object, now: HostNs) -> None:
        """Note a command that is sent. ``subject`` is returned when it is acknowledged; None if the answer does not
        matter.
        """
        self._awaited.append((command, subject, now + self._timeout_ns))

    def acknowledged(self, command: int, now: HostNs) -> object:
        """Return the subject of the acknowledged command; None if there is none."""
        while self._awaited:
            awaited, subject, until_ns = self._awaited.popleft()
            if awaited == command and now < until_ns:
                return subject
        return None


class RateDialogue:
    """Builds the requests to one autopilot, and finds the question that an answer belongs to."""

    def __init__(self, autopilot: Autopilot, component: int) -> None:
        self._autopilot, self._component = autopilot, component
        self._acks = AckOrder(ACK_TIMEOUT_NS)
        self.question: Question | None = None
        """Question whose answer is awaited."""

    def ask(self, question: Question, now: HostNs) -> list[Outgoing]:
        """Return the requests of a question, for the first time or again."""
        question.tries += 1
        question.deadline_ns = HostNs(now + ACK_TIMEOUT_NS)
        self.question = question
        if question.is_about_before:
            reset = question.kind is QuestionKind.DEFAULT
            asked = [self.set_interval(question.msgid, DEFAULT_US, now)] if reset else []
            self._acks.sent(GET, question, now)
            return [*asked, command(self._autopilot, self._component, GET, question.msgid)]
        interval_us = round(1e6 / question.wish_hz) if question.row is None else question.row.interval_us
        return [self.set_interval(question.msgid, interval_us, now, question)]

    def set_interval(self, msgid: int, interval_us: int, now: HostNs, question: Question | None = None) -> Outgoing:
        """Return SET_MESSAGE_INTERVAL. Without a question its acknowledgement does not matter."""
        self._acks.sent(SET, question, now)
        confirmation = 0 if question is None else question.tries - 1
        return command(self._autopilot, self._component, SET, msgid, interval_us, confirmation=confirmation)

    def set_group(self, number: int, rate_hz: float) -> Outgoing:
        """Return REQUEST_DATA_STREAM, which no acknowledgement follows."""
        rate = min(round(rate_hz) or 1, MAX_STREAM_RATE)
        fields = {"req_stream_id": number, "req_message_rate": rate, "start_stop": 1}
        return request(self._autopilot, self._component, "REQUEST_DATA_STREAM", fields)

    def acknowledged(self, fields: Any, now: HostNs) -> Question | None:
        """Return the pending question that a COMMAND_ACK answers; older autopilots leave its target fields 0."""
        system, component = fields.target_system, fields.target_component
        for_us = system in {0, self._autopilot.system} and component in {0, self._component}
        if not for_us or fields.command not in {SET, GET} or fields.result == enums.MAV_RESULT_IN_PROGRESS:
            return None
        subject = self._acks.acknowledged(fields.command, now)
        return self.question if subject is not None and subject is self.question else None

    def stated(self, message: Message) -> Question | None:
        """Return the pending question that a MESSAGE_INTERVAL answers."""
        question = self.question
        if question is None or not question.is_about_before or question.msgid != message.fields.message_id:
            return None
        return question


def missing_rates(
    left_hz: Mapping[int, float],
    ours_hz: Mapping[int, float],
    demanded_hz: Mapping[int, float],
    *,
    by_group: bool = False,
) -> tuple[dict[int, float], list[tuple[int, float]]]:
    """Return the rates to request, hertz: those above the rates at which the messages of ``left_hz`` are left.

    First the groups, by MAV_DATA_STREAM (``by_group``): a group is requested as a whole where each of its messages is
    demanded at a higher rate. Then (message id, hertz) in order of sending: ours, and after it a station's higher one,
    which the autopilot may refuse. ``ours_hz``: rates of this service; ``demanded_hz``: the highest of all stations.
    """
    present_hz = dict(left_hz)
    groups: dict[int, float] = {}
    for number in GROUPS if by_group else ():
        members = group_ids(number)
        if members <= present_hz.keys():
            hz = min(demanded_hz.get(msgid, 0.0) for msgid in members)
            if hz > ROUNDING * max(present_hz[msgid] for msgid in members):
                groups[number] = hz
                present_hz |= dict.fromkeys(members, hz)
    messages: list[tuple[int, float]] = []
    for rates_hz in (ours_hz, demanded_hz):
        higher = {msgid: hz for msgid in present_hz if (hz := rates_hz.get(msgid, 0.0)) > ROUNDING * present_hz[msgid]}
        present_hz |= higher
        messages += higher.items()
    return groups, messages

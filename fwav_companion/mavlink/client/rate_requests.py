"""Sends rate requests one at a time: request, repeat, answer, and the older message if the command is unknown.

:class:`RateStream` decides when a message is requested and at what rate; this module sends the request.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.client.ack_order import AckOrder
from fwav_companion.mavlink.client.attitude_sharing import PLAIN, QUATERNION
from fwav_companion.mavlink.client.own_rates import OwnRates
from fwav_companion.mavlink.client.rate_merging import ROUNDING, FollowUp
from fwav_companion.mavlink.client.rate_stream import RateStream, StreamState
from fwav_companion.mavlink.client.requests import command, request
from fwav_companion.mavlink.client.subscriptions import DATA_STREAMS, MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.stream_groups import group_of
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot

ACK_TIMEOUT_NS = 700 * NS_PER_MS
MAX_TRIES = 4
GROUP_PAUSE_NS = NS_PER_S
"""Time in which one REQUEST_DATA_STREAM serves every message of its group that is due."""
MAX_STREAM_RATE = 0xFFFF
ATTITUDES = frozenset({PLAIN, QUATERNION})
INTERVAL_COMMANDS = frozenset({enums.MAV_CMD_SET_MESSAGE_INTERVAL, enums.MAV_CMD_GET_MESSAGE_INTERVAL})


class Answer(msgspec.Struct, frozen=True):
    """Result of an acknowledgement."""

    stream: RateStream
    """Stream that was requested."""
    command_unknown: bool
    """Whether the autopilot does not know SET_MESSAGE_INTERVAL: from now on only REQUEST_DATA_STREAM is sent."""


class _Question(msgspec.Struct):
    """Pending SET_MESSAGE_INTERVAL, whose answer decides on the next request."""

    stream: RateStream
    interval_us: int
    tries: int
    deadline_ns: HostNs


class RateRequests:
    """Sends to one autopilot the rate requests that its streams have due."""

    def __init__(self, component: int, own_rates: OwnRates):
        self._component = component
        self._own_rates = own_rates
        self._autopilot: Autopilot | None = None
        self._streams: Mapping[str, RateStream] = {}
        self._in_flight: _Question | None = None
        self._acks: AckOrder[_Question] = AckOrder(ACK_TIMEOUT_NS)
        self.demanded: Mapping[int, float] = {}
        """Highest rate that a station wants, hertz, by message id: requested after ours if it is higher."""
        self._lowered: set[str] = set()
        """Messages that the autopilot sends faster by itself than we request: they get that rate back."""
        self._command_unknown = False
        self._command_known = False
        self._groups_asked_ns: dict[int, HostNs] = {}

    @property
    def wake_at(self) -> HostNs | None:
        """Time of the next request; None if there is none."""
        if self._lowered:
            return HostNs(0)
        if self._in_flight is not None:
            return self._in_flight.deadline_ns
        due = (stream.next_ask_ns for stream in self._streams.values())
        return min((when for when in due if when is not None), default=None)

    def begin(self, autopilot: Autopilot, streams: Mapping[str, RateStream]) -> None:
        """Start over with an unknown autopilot. ``streams``: in the order of their requests."""
        self._autopilot, self._streams = autopilot, streams
        self._in_flight = None
        self._acks.clear()
        self._lowered.clear()
        self._own_rates.begin(autopilot.kind)
        self._command_unknown = self._command_known = False
        self._groups_asked_ns.clear()

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """Repeat the pending request if its answer is overdue, or send the next one."""
        if self._autopilot is None:
            return []
        lowered = [(MESSAGE_IDS[name], self._own_rates.hz(name)) for name in sorted(self._lowered)]
        self._lowered.clear()
        raised = self._restore(self._autopilot, lowered, now)
        if self._in_flight is not None:
            return raised + self._repeat(self._autopilot, self._in_flight, now)
        return raised + self._next(self._autopilot, now)

    def on_own_rate(self, name: str) -> None:
        """Note that the autopilot's own rate of this message is known: our request must not lower it."""
        stream = self._streams.get(name)
        if stream is not None and name not in ATTITUDES and self._own_rates.hz(name) > ROUNDING * stream.wanted_hz:
            self._lowered.add(name)

    def rate_kept_hz(self, stream: RateStream) -> float:
        """Return the rate that the autopilot must keep despite stations' requests: ours, or its own if higher.

        For attitude it is ours: plain ATTITUDE is requested slowly on purpose while the quaternion arrives. inf: the
        autopilot's default, whose interval is not reported.
        """
        ours_hz = 1e6 / stream.interval_us
        return ours_hz if stream.name in ATTITUDES else max(ours_hz, self._own_rates.hz(stream.name))

    def on_ack(self, ack: Message, now: HostNs) -> Answer | None:
        """Pass a COMMAND_ACK of the autopilot to its stream. Returns None if it settles no request."""
        fields = ack.fields
        if not self._is_for_us(fields) or fields.result == enums.MAV_RESULT_IN_PROGRESS:
            return None
        question = self._acks.acknowledged(fields.command, now) if fields.command in INTERVAL_COMMANDS else None
        if question is None or question is not self._in_flight:
            return None
        self._in_flight = None
        stream = question.stream
        if stream.state is StreamState.HELD_BACK:
            return None
        accepted = fields.result == enums.MAV_RESULT_ACCEPTED
        self._command_known |= accepted
        if fields.result == enums.MAV_RESULT_UNSUPPORTED and not self._command_known:
            self._command_unknown = True
            return Answer(stream, command_unknown=True)
        if fields.result == enums.MAV_RESULT_TEMPORARILY_REJECTED:
            stream.wait(now)
            return None
        stream.on_result(accepted, now)
        return Answer(stream, command_unknown=False)

    def _next(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        for stream in self._streams.values():
            if stream.next_ask_ns is not None and stream.next_ask_ns <= now:
                stream.asked(now)
                if self._command_unknown:
                    return self._ask_by_group(autopilot, stream, now)
                question = _Question(stream, stream.interval_us, 1, HostNs(now + ACK_TIMEOUT_NS))
                self._in_flight = question
                return self._put(autopilot, question, now)
        return []

    def _repeat(self, autopilot: Autopilot, question: _Question, now: HostNs) -> list[Outgoing]:
        if now < question.deadline_ns:
            return []
        if question.tries < MAX_TRIES:
            question.tries += 1
            question.deadline_ns = HostNs(now + ACK_TIMEOUT_NS)
            return self._put(autopilot, question, now)
        self._in_flight = None
        if question.stream.state is not StreamState.HELD_BACK:
            question.stream.state = StreamState.UNANSWERED
            question.stream.wait(now)
        return self._next(autopilot, now)

    def _ask_by_group(self, autopilot: Autopilot, stream: RateStream, now: HostNs) -> list[Outgoing]:
        """Request by group. No acknowledgement follows: the measured rate decides when to request again."""
        stream.on_result(accepted=True, now=now)
        number = DATA_STREAMS.get(stream.name, enums.MAV_DATA_STREAM_EXTRA3)
        asked_ns = self._groups_asked_ns.get(number)
        if asked_ns is not None and now < asked_ns + GROUP_PAUSE_NS:
            return self._next(autopilot, now)
        self._groups_asked_ns[number] = now
        members = [one for one in self._streams.values() if DATA_STREAMS.get(one.name, number) == number]
        rate_hz = max(one.wanted_hz for one in members if one.state is not StreamState.HELD_BACK)
        demanded_hz = max(self.demanded.get(MESSAGE_IDS[one.name], 0.0) for one in members)
        return [self._request_group(autopilot, number, max(rate_hz, demanded_hz))]

    def _put(self, autopilot: Autopilot, question: _Question, now: HostNs) -> list[Outgoing]:
        """Return the request, preceded by the query of the autopilot's own rate and followed by higher rates to be
        kept: the own rate, or a station's.
        """
        number, interval_us = MESSAGE_IDS[question.stream.name], question.interval_us
        asked = []
        for learning, param1, param2 in self._own_rates.questions(question.stream.name):
            asked.append(command(autopilot, self._component, number=learning, param1=param1, param2=param2))
            self._acks.sent(learning, None, now)
        set_interval = enums.MAV_CMD_SET_MESSAGE_INTERVAL
        confirmation = question.tries - 1
        asked.append(
            command(
                autopilot,
                self._component,
                number=set_interval,
                param1=number,
                param2=interval_us,
                confirmation=confirmation,
            )
        )
        self._acks.sent(set_interval, question, now)
        asked_hz = 1e6 / interval_us
        for hz in (self.rate_kept_hz(question.stream), self.demanded.get(number, 0.0)):
            if hz > ROUNDING * asked_hz:
                asked += self._restore(autopilot, [(number, hz)], now)
                asked_hz = hz
        return asked

    def follow(self, what: FollowUp, now: HostNs) -> list[Outgoing]:
        """Request at once the rates that a station's request has just lowered. The measured rates show the result."""
        if self._autopilot is None:
            return []
        autopilot = self._autopilot
        groups = [self._request_group(autopilot, number, hz) for number, hz in what.groups.items()]
        if not self._command_unknown:
            return groups + self._restore(autopilot, what.messages, now)
        lowered: dict[int, float] = {}
        for msgid, hz in what.messages:
            number = group_of(msgid)
            if number is not None:
                lowered[number] = max(hz, lowered.get(number, 0.0))
        return groups + [self._request_group(autopilot, number, hz) for number, hz in lowered.items()]

    def _restore(self, autopilot: Autopilot, rates: Sequence[tuple[int, float]], now: HostNs) -> list[Outgoing]:
        """Return SET_MESSAGE_INTERVAL for (message id, hertz), whose acknowledgements do not matter. For inf the
        interval is 0, the autopilot's default.
        """
        set_interval = enums.MAV_CMD_SET_MESSAGE_INTERVAL
        asked = []
        for number, hz in rates:
            asked.append(
                command(autopilot, self._component, number=set_interval, param1=number, param2=round(1e6 / hz))
            )
            self._acks.sent(set_interval, None, now)
        return asked

    def _request_group(self, autopilot: Autopilot, number: int, rate_hz: float) -> Outgoing:
        rate = min(round(rate_hz) or 1, MAX_STREAM_RATE)
        fields = {"req_stream_id": number, "req_message_rate": rate, "start_stop": 1}
        return request(autopilot, self._component, "REQUEST_DATA_STREAM", fields)

    def _is_for_us(self, ack: Any) -> bool:
        """Return whether the extension fields address us; older autopilots leave them 0."""
        system = self._autopilot.system if self._autopilot is not None else 0
        return ack.target_system in {0, system} and ack.target_component in {0, self._component}

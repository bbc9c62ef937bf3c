"""One question for a rate at a time: asked, repeated, answered, and put in the older way where the newer is unknown.

Which of the streams is due to be asked for, and at what rate, the streams know; this knows how to ask.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import msgspec

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.client.rate_stream import RateStream, StreamState
from fwav_companion.mavlink.client.requests import command, request
from fwav_companion.mavlink.client.subscriptions import DATA_STREAMS, MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.types.messages import Message, Outgoing
from fwav_companion.types.situation import Autopilot

ACK_TIMEOUT_NS = 700 * NS_PER_MS
MAX_TRIES = 4
GROUP_PAUSE_NS = NS_PER_S
"""One REQUEST_DATA_STREAM serves every message of its group that is due within so long."""
MAX_STREAM_RATE = 0xFFFF


class Answer(msgspec.Struct, frozen=True):
    """What an acknowledgement settled."""

    stream: RateStream
    """The one that was asked for."""
    command_unknown: bool
    """There is no SET_MESSAGE_INTERVAL over there: from now on REQUEST_DATA_STREAM is what is left."""


class _Question(msgspec.Struct):
    """The one SET_MESSAGE_INTERVAL in flight: an acknowledgement does not say which message it is about."""

    stream: RateStream
    interval_us: int
    tries: int
    deadline_ns: HostNs


class RateRequests:
    """Puts to one autopilot what its streams are due to ask."""

    def __init__(self, component: int):
        self._component = component
        self._autopilot: Autopilot | None = None
        self._streams: Mapping[str, RateStream] = {}
        self._in_flight: _Question | None = None
        self._command_unknown = False
        self._command_known = False
        self._groups_asked_ns: dict[int, HostNs] = {}

    @property
    def wake_at(self) -> HostNs | None:
        """When something is to be asked next."""
        if self._in_flight is not None:
            return self._in_flight.deadline_ns
        due = (stream.next_ask_ns for stream in self._streams.values())
        return min((when for when in due if when is not None), default=None)

    def begin(self, autopilot: Autopilot, streams: Mapping[str, RateStream]) -> None:
        """Nothing is known of this autopilot. ``streams``: in the order in which they are asked for."""
        self._autopilot, self._streams = autopilot, streams
        self._in_flight = None
        self._command_unknown = self._command_known = False
        self._groups_asked_ns.clear()

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """Repeat the question in flight if its answer is overdue, or put the next one."""
        if self._autopilot is None:
            return []
        if self._in_flight is not None:
            return self._repeat(self._autopilot, self._in_flight, now)
        return self._next(self._autopilot, now)

    def on_ack(self, ack: Message, now: HostNs) -> Answer | None:
        """Hand a COMMAND_ACK of the autopilot to the stream it is about; None where it settles nothing."""
        fields, question = ack.fields, self._in_flight
        if fields.command != enums.MAV_CMD_SET_MESSAGE_INTERVAL or question is None or not self._is_for_us(fields):
            return None
        if fields.result == enums.MAV_RESULT_IN_PROGRESS:
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
                return [self._set_message_interval(autopilot, question)]
        return []

    def _repeat(self, autopilot: Autopilot, question: _Question, now: HostNs) -> list[Outgoing]:
        if now < question.deadline_ns:
            return []
        if question.tries < MAX_TRIES:
            question.tries += 1
            question.deadline_ns = HostNs(now + ACK_TIMEOUT_NS)
            return [self._set_message_interval(autopilot, question)]
        self._in_flight = None
        if question.stream.state is not StreamState.HELD_BACK:
            question.stream.state = StreamState.UNANSWERED
            question.stream.wait(now)
        return self._next(autopilot, now)

    def _ask_by_group(self, autopilot: Autopilot, stream: RateStream, now: HostNs) -> list[Outgoing]:
        """No acknowledgement follows: the measuring decides when to ask again."""
        stream.on_result(accepted=True, now=now)
        number = DATA_STREAMS.get(stream.name, enums.MAV_DATA_STREAM_EXTRA3)
        asked_ns = self._groups_asked_ns.get(number)
        if asked_ns is not None and now < asked_ns + GROUP_PAUSE_NS:
            return self._next(autopilot, now)
        self._groups_asked_ns[number] = now
        members = [one for one in self._streams.values() if DATA_STREAMS.get(one.name, number) == number]
        rate_hz = max(one.wanted_hz for one in members if one.state is not StreamState.HELD_BACK)
        rate = min(round(rate_hz) or 1, MAX_STREAM_RATE)
        fields = {"req_stream_id": number, "req_message_rate": rate, "start_stop": 1}
        return [request(autopilot, self._component, "REQUEST_DATA_STREAM", fields)]

    def _set_message_interval(self, autopilot: Autopilot, question: _Question) -> Outgoing:
        return command(
            autopilot,
            self._component,
            enums.MAV_CMD_SET_MESSAGE_INTERVAL,
            MESSAGE_IDS[question.stream.name],
            question.interval_us,
            confirmation=question.tries - 1,
        )

    def _is_for_us(self, ack: Any) -> bool:
        """By the extension fields, which older autopilots leave 0."""
        system = self._autopilot.system if self._autopilot is not None else 0
        return ack.target_system in {0, system} and ack.target_component in {0, self._component}

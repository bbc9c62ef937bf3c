"""The loop that reconciles an autopilot's rates with the table: it learns what is there, and requests the difference.

It learns before it changes anything: it asks for each message's rate (GET_MESSAGE_INTERVAL) and counts arrivals for two
seconds. Then it requests the difference, one question at a time, each a few times at most. What a station's request has
lowered is requested again in the same write.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import inf

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.rate_dialogue import Question, QuestionKind, RateDialogue, missing_rates
from fwav_companion.mavlink.client.rate_table import ATTITUDE, NOT_KEPT, QUATERNION, REACHED, RateRow, RequestState
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.mavlink.wire.stream_groups import group_ids, group_of
from fwav_companion.types.messages import Message, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Autopilot, AutopilotKind

ENOUGH_NS = 2 * NS_PER_S
"""Least time of counting: as long as an answer to GET_MESSAGE_INTERVAL is awaited."""
GROUP_PAUSE_NS = NS_PER_S
"""Time in which one REQUEST_DATA_STREAM serves every message of its group that is due."""
SAME_RATE = 0.01
"""Relative difference up to which a stated rate may be what an earlier run of this service requested."""
MAX_SINGLE = 128
"""Messages remembered as requested by SET_MESSAGE_INTERVAL."""
Notify = Callable[[NoticeCode, Severity, str], None]


class StationRates(msgspec.Struct):
    """What stations on merging links request; it outlives a reboot of the autopilot."""

    demanded: Mapping[int, float] = {}
    """Highest requested rate, hertz, by message id."""
    single: set[int] = set()
    """Ids of the messages that were requested by SET_MESSAGE_INTERVAL."""


class RateReconciler:
    """Asks one autopilot for what the table lacks, from its adoption or reboot on."""

    def __init__(
        self,
        autopilot: Autopilot,
        rows: Iterable[RateRow],
        stations: StationRates,
        *,
        component: int,
        since_ns: HostNs,
        notify: Notify,
    ):
        """``since_ns``: beginning of the counts of the rows. ``notify``: takes what the log is to say."""
        self.autopilot = autopilot
        self.rows = {row.name: row for row in rows}
        """The table, by message name, the most important first."""
        self._stations = stations
        self._notify = notify
        self._dialogue = RateDialogue(autopilot, component)
        self._heeds_groups = autopilot.kind is not AutopilotKind.PX4  # which has an empty handler for them
        self._lost_groups: Mapping[int, float] = {}
        self._wishes: deque[Question] = deque()
        self._groups_asked_ns: dict[int, HostNs] = {}
        self._enough_ns = HostNs(since_ns + ENOUGH_NS)
        self._states_rates: bool | None = None
        """Whether the autopilot answers GET_MESSAGE_INTERVAL; None: not known yet."""
        self._has_answered = self._command_known = self.is_unsupported = self._by_group = False
        self.takes_requests = autopilot.system != 0
        """Whether requests can be addressed to the autopilot: system 0 would address every vehicle."""
        self.is_learning = self.takes_requests
        if not self.takes_requests:
            for row in self.rows.values():
                row.close(RequestState.UNSUPPORTED)

    def add(self, row: RateRow, comes_hz: float) -> None:
        """Add a message that is needed from now on, and arrives at ``comes_hz`` without a request of ours."""
        row.is_learned, row.before_hz = True, comes_hz
        if not self.takes_requests:
            row.close(RequestState.UNSUPPORTED)
        elif comes_hz >= REACHED * row.need_hz:
            row.close(RequestState.GRANTED)
        self.rows[row.name] = row

    @property
    def is_unanswered(self) -> bool:
        """Whether the questions about rates had no answer of any kind."""
        return self._states_rates is False and not self._has_answered

    @property
    def next_ask_ns(self) -> HostNs | None:
        """Time at which :meth:`reconcile` is due; None: not before the next message."""
        if self._dialogue.question is not None:
            return self._dialogue.question.deadline_ns
        if self.is_learning:
            return self._enough_ns if self._unlearned() is None else HostNs(0)
        if self._lost_groups or (self._wishes and not self.is_unsupported):
            return HostNs(0)
        return min((row.next_ask_ns for row in self.rows.values() if row.next_ask_ns is not None), default=None)

    # What is there: statements and arrivals before the first request.

    def on_interval(self, message: Message) -> None:
        """Process a MESSAGE_INTERVAL, if it answers a question of ours."""
        question = self._dialogue.stated(message)
        if question is None or question.row is None:
            return
        self._dialogue.question = None
        self._states_rates = self._has_answered = True
        row, interval_us = question.row, message.fields.interval_us
        # PX4 streams of unlimited rate have the interval -1 (mavlink_receiver.cpp, get_message_interval; a stopped
        # stream has 0 there); in common.xml and ArduPilot, -1 means disabled.
        unlimited = interval_us < 0 and self.autopilot.kind is AutopilotKind.PX4
        row.stated_hz = 1e6 / interval_us if interval_us > 0 else inf if unlimited else 0.0
        like_ours = abs(row.stated_hz - row.need_hz) <= SAME_RATE * row.need_hz
        row.is_learned = question.kind is QuestionKind.DEFAULT or not like_ours or self._is_never_sent_by_itself(row)

    def _unlearned(self) -> RateRow | None:
        """Return the next message whose rate the autopilot may still state."""
        if self._states_rates is False:
            return None
        return next((row for row in self.rows.values() if not row.is_learned), None)

    def _learn(self, now: HostNs) -> list[Outgoing]:
        row = self._unlearned()
        if row is not None:
            if row.stated_hz is None:
                return self._ask(Question(QuestionKind.RATE, row.msgid, row), now)
            row.meter.restart(now)
            return self._ask(Question(QuestionKind.DEFAULT, row.msgid, row), now)
        if now >= self._enough_ns:
            self.is_learning = False
            for row in self.rows.values():
                row.settle_before(self._stations.demanded.get(row.msgid, 0.0), now)
                if row.is_stated and self._is_never_sent_by_itself(row):
                    row.before_hz = 0.0
        return []

    def _is_never_sent_by_itself(self, row: RateRow) -> bool:
        """Return whether only a request can have started the message: ArduPilot sends only its groups by itself."""
        return self.autopilot.kind is AutopilotKind.ARDUPILOT and group_of(row.msgid) is None

    # The difference: one question at a time.

    def reconcile(self, now: HostNs) -> list[Outgoing]:
        """Return the request that is due: the pending question again, or the next one."""
        question = self._dialogue.question
        if question is not None:
            if now < question.deadline_ns:
                return []
            deaf = self._by_group and not self._has_answered
            if question.tries < (1 if deaf else question.most_tries):
                return self._ask(question, now)
            self._dialogue.question = None
            asked = self._on_silence(question, now)
            if asked:
                return asked
        if self.is_learning:
            asked = self._learn(now)
            if asked or self.is_learning:
                return asked
        return self._ask_next(now)

    def _ask_next(self, now: HostNs) -> list[Outgoing]:
        for row in self.rows.values():
            if row.next_ask_ns is None or row.next_ask_ns > now:
                continue
            if not self.is_unsupported:
                row.asked(now)
                return self._ask(Question(QuestionKind.INTERVAL, row.msgid, row), now)
            asked = self._ask_group_of(row, now)
            if asked:
                return asked
        if self._lost_groups:
            groups, self._lost_groups = self._lost_groups, {}
            left_hz = {msgid: hz for number, hz in groups.items() for msgid in group_ids(number)}
            return self._send(groups, missing_rates(left_hz, self._kept_hz(), self._stations.demanded)[1], now)
        if self._wishes and not self.is_unsupported:
            return self._ask(self._wishes.popleft(), now)
        return []

    def _ask(self, question: Question, now: HostNs) -> list[Outgoing]:
        asked, row = self._dialogue.ask(question, now), question.row
        if question.kind is QuestionKind.INTERVAL and row is not None:
            left_hz, kept_hz = {row.msgid: 1e6 / row.interval_us}, {row.msgid: row.kept_hz}
            asked += self._send({}, missing_rates(left_hz, kept_hz, self._stations.demanded)[1], now)
        return asked

    def _ask_group_of(self, row: RateRow, now: HostNs) -> list[Outgoing]:
        number = _group_to_ask(row)
        row.asked_by_group(now)
        asked_ns = self._groups_asked_ns.get(number)
        if asked_ns is not None and now < asked_ns + GROUP_PAUSE_NS:
            return []
        self._groups_asked_ns[number] = now
        members = [one for one in self.rows.values() if _group_to_ask(one) == number]
        kept_hz = [one.kept_hz for one in members if one.state is not RequestState.HELD_BACK]
        demanded_hz = [self._stations.demanded.get(one.msgid, 0.0) for one in members]
        return [self._dialogue.set_group(number, max(kept_hz + demanded_hz))]

    def _send(self, groups: Mapping[int, float], messages: Sequence[tuple[int, float]], now: HostNs) -> list[Outgoing]:
        """Return these requests; the measured rates show the result."""
        groups, followed = dict(groups), {msgid for msgid, _ in messages}
        for row in self.rows.values():
            row.is_asked |= row.msgid in followed
        if self._by_group:
            for msgid, hz in messages:
                number = group_of(msgid)
                if number is not None:
                    groups[number] = max(hz, groups.get(number, 0.0))
            messages = []
        return [
            *(self._dialogue.set_group(number, hz) for number, hz in groups.items()),
            *(self._dialogue.set_interval(msgid, round(1e6 / hz), now) for msgid, hz in messages),
        ]

    # Stations.

    def on_station_request(self, request: RateRequest, now: HostNs) -> list[Outgoing]:
        """Return the requests for the rates that a station's request has just lowered."""
        by_group = request.by_group and self._heeds_groups
        if not request.by_group:
            single = self._stations.single
            single.update(list(request.rates)[: MAX_SINGLE - len(single)])
        elif by_group:
            self._note_defaults(request.rates)
        kept_hz = {} if self.is_learning else self._kept_hz()
        if request.by_group and not by_group:  # it lowered nothing; the station's rates follow if they are higher
            left_hz = {msgid: kept_hz[msgid] for msgid in request.rates if msgid in kept_hz}
        else:
            left_hz = {msgid: hz or 0.0 for msgid, hz in request.rates.items()}
        groups, messages = missing_rates(left_hz, kept_hz, self._stations.demanded, by_group=by_group)
        return self._send(groups, messages, now)

    def wish_again(self) -> None:
        """Note the stations' rates to request again, because a reboot lost them: groups as one message each."""
        demanded = self._stations.demanded
        all_lost = dict.fromkeys(demanded, 0.0)
        self._lost_groups, messages = missing_rates(all_lost, {}, demanded, by_group=self._heeds_groups)
        single = self._stations.single - {row.msgid for row in self.rows.values()}
        self._wishes.extend(Question(QuestionKind.WISH, msgid, wish_hz=hz) for msgid, hz in messages if msgid in single)

    def _note_defaults(self, rates: Mapping[int, float | None]) -> None:
        """Follow what a request by group changes: ArduPilot's groups are its messages' defaults from then on.

        A higher rate counts as the station's alone, so that it is forgotten with the station.
        """
        for row in self.rows.values():
            if row.before_hz is not None and row.is_stated:
                row.before_hz = min(row.before_hz, rates.get(row.msgid, inf) or 0.0)

    def _kept_hz(self) -> dict[int, float]:
        return {row.msgid: row.kept_hz for row in self.rows.values() if row.state not in NOT_KEPT}

    # Answers, and their absence.

    def on_ack(self, message: Message, now: HostNs) -> None:
        """Process a COMMAND_ACK, if it answers the pending question."""
        question = self._dialogue.acknowledged(message.fields, now)
        if question is None:
            return
        result, row = message.fields.result, question.row
        accepted, unsupported = result == enums.MAV_RESULT_ACCEPTED, result == enums.MAV_RESULT_UNSUPPORTED
        if self._by_group and not self._has_answered and QUATERNION in self.rows:
            self.rows[QUATERNION].ask_soon(now)  # the autopilot hears us now, and did not when the groups were tried
        self._has_answered = True
        if question.is_about_before:
            if not accepted and row is not None:  # no statement follows; an accepted one is awaited
                self._dialogue.question, row.is_learned = None, True
                if unsupported and self._states_rates is None:
                    self._states_rates = False
            return
        self._dialogue.question = None
        self._command_known |= accepted
        self._by_group &= not accepted or self.is_unsupported
        if row is None or row.state is RequestState.HELD_BACK:
            return
        if unsupported and not self._command_known:
            self._fall_back(now)
        elif result == enums.MAV_RESULT_TEMPORARILY_REJECTED:
            row.wait(now)
        else:
            row.on_result(accepted, now)
            self._notify_outcome(row)

    def _on_silence(self, question: Question, now: HostNs) -> list[Outgoing]:
        row = question.row
        if row is None:
            return []
        if question.is_about_before:
            row.is_learned = True
            if self._states_rates is None:
                self._states_rates = False
        elif row.state is RequestState.HELD_BACK:
            return []
        elif self._has_answered:
            row.state = RequestState.UNANSWERED
            row.wait(now)
        else:
            # INAV ignores COMMAND_LONG, and some firmwares take REQUEST_DATA_STREAM alone: arrivals show the outcome.
            self._by_group = True
            if row.name != QUATERNION or ATTITUDE not in self.rows:
                return self._ask_group_of(row, now)
            row.close(RequestState.UNANSWERED)
        return []

    def _fall_back(self, now: HostNs) -> None:
        """Request by REQUEST_DATA_STREAM: the autopilot does not know the newer command."""
        text = "the autopilot does not know SET_MESSAGE_INTERVAL: asking by REQUEST_DATA_STREAM"
        self._notify(NoticeCode.INTERVALS_UNKNOWN, Severity.INFO, text)
        self.is_unsupported = self._by_group = True
        for row in self.rows.values():
            row.need(row.need_hz, now)
            row.is_asked = False  # what was sent had no effect
        if ATTITUDE in self.rows and QUATERNION in self.rows:  # a group contains plain ATTITUDE alone
            self.rows[QUATERNION].close(RequestState.HELD_BACK)

    def _notify_outcome(self, row: RateRow) -> None:
        if row.state is RequestState.REFUSED:
            text = f"the autopilot does not send {row.name}: refused at every rate"
            self._notify(NoticeCode.MESSAGE_REFUSED, Severity.INFO, text)
        elif row.state is RequestState.GRANTED and row.granted_hz < 0.99 * row.need_hz:
            self._notify(
                NoticeCode.RATE_REFUSED,
                Severity.WARNING,
                f"{row.name} at {row.need_hz:g} Hz is refused: the highest accepted rate is"
                f" {row.granted_hz:.1f} Hz (ArduPilot allows 0.8 SCHED_LOOP_RATE)",
            )


def _group_to_ask(row: RateRow) -> int:
    """Return the group to request for a message: attitude's for the quaternion, EXTRA3 for another without one."""
    number = group_of(MESSAGE_IDS[ATTITUDE] if row.name == QUATERNION else row.msgid)
    return enums.MAV_DATA_STREAM_EXTRA3 if number is None else number

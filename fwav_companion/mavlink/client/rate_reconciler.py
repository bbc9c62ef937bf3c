"""The loop that reconciles an autopilot's rates with the table: it learns what is there, and requests the difference.

It learns before it changes anything: it asks for each message's rate (GET_MESSAGE_INTERVAL) and counts arrivals for two
seconds. Then it requests the difference, one question at a time, each a few times at most.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from math import inf

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.arrivals_before import ArrivalsBefore
from fwav_companion.mavlink.client.rate_dialogue import Question, QuestionKind, RateDialogue
from fwav_companion.mavlink.client.rate_merging import ROUNDING, FollowUp, follow_up
from fwav_companion.mavlink.client.rate_table import ATTITUDE, NOT_KEPT, QUATERNION, RateRow, RequestState
from fwav_companion.mavlink.client.subscriptions import DATA_STREAMS
from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.rate_messages import RateRequest
from fwav_companion.mavlink.wire.stream_groups import group_of
from fwav_companion.types.messages import Message, NoticeCode, Outgoing, Severity
from fwav_companion.types.situation import Autopilot, AutopilotKind

GROUP_PAUSE_NS = NS_PER_S
"""Time in which one REQUEST_DATA_STREAM serves every message of its group that is due."""
SAME_RATE = 0.01
"""Relative difference up to which a stated rate may be what an earlier run of this service requested."""
MAX_SINGLE = 128
"""Messages remembered as requested by SET_MESSAGE_INTERVAL."""
Notify = Callable[[NoticeCode, Severity, str], None]


class RateReconciler:
    """Asks one autopilot for what the table lacks. ``notify``: takes what the log is to say."""

    def __init__(self, wanted: Mapping[str, float], component: int, notify: Notify):
        self._wanted = wanted
        self._notify = notify
        self.rows: dict[str, RateRow] = {}
        """The table, by message name, the most important first."""
        self.before = ArrivalsBefore()
        self.demanded: Mapping[int, float] = {}
        """Highest rate that a station on a merging link requests, hertz, by message id."""
        self._dialogue = RateDialogue(component)
        self._single: set[int] = set()
        self._wishes: deque[tuple[int | None, int, float]] = deque()
        """(group, message id, hertz): stations' rates that a reboot lost."""
        self.begin()

    def begin(self) -> None:
        """Start over with an autopilot of which nothing is known."""
        self._dialogue.begin()
        self._wishes.clear()
        self._groups_asked_ns: dict[int, HostNs] = {}
        self._learning: Question | None = None
        self.is_learning = True
        self._states_rates: bool | None = None
        """Whether the autopilot answers GET_MESSAGE_INTERVAL; None: not known yet."""
        self._has_answered = self._command_known = self.is_unsupported = self._by_group = False

    @property
    def is_unanswered(self) -> bool:
        """Whether the questions about rates had no answer of any kind."""
        return self._states_rates is False and not self._has_answered

    def wish_again(self, autopilot: Autopilot) -> None:
        """Note the stations' rates to request again, because a reboot lost them: groups as one message each."""
        heeds_groups = heeds_group_requests(autopilot)
        all_lost = RateRequest(
            system=0,
            component=0,
            link="",
            target_system=0,
            target_component=0,
            rates=dict.fromkeys(self.demanded, 0.0),
            by_group=heeds_groups,
        )
        groups = follow_up(all_lost, {}, self.demanded, heeds_groups=heeds_groups).groups
        self._wishes.extend((number, 0, hz) for number, hz in groups.items())
        single = self._single - {row.msgid for row in self.rows.values()}
        self._wishes.extend((None, msgid, hz) for msgid, hz in self.demanded.items() if msgid in single)

    def next_ask(self) -> HostNs | None:
        """Return when :meth:`reconcile` is due; None: not before the next message."""
        if self._dialogue.question is not None:
            return self._dialogue.question.deadline_ns
        if self.is_learning:
            unlearned = self._states_rates is not False and not all(row.is_learned for row in self.rows.values())
            return HostNs(0) if unlearned or self._learning is not None else self.before.enough_at
        if self._wishes and not self.is_unsupported:
            return HostNs(0)
        return min((row.next_ask_ns for row in self.rows.values() if row.next_ask_ns is not None), default=None)

    # What is there: statements and arrivals before the first request.

    def on_interval(self, autopilot: Autopilot, message: Message) -> None:
        """Process a MESSAGE_INTERVAL, if it answers a question of ours."""
        question = self._dialogue.stated(message)
        if question is None or question.row is None:
            return
        self._dialogue.question = None
        self._states_rates = self._has_answered = True
        row, interval_us = question.row, message.fields.interval_us
        # PX4 streams of unlimited rate have the interval -1 (mavlink_receiver.cpp, get_message_interval; a stopped
        # stream has 0 there); in common.xml and ArduPilot, -1 means disabled.
        unlimited = interval_us < 0 and autopilot.kind is AutopilotKind.PX4
        row.stated_hz = 1e6 / interval_us if interval_us > 0 else inf if unlimited else 0.0
        if question.kind is QuestionKind.RATE:
            like_ours = abs(row.stated_hz - row.need_hz) <= SAME_RATE * row.need_hz
            if like_ours and not _is_never_sent_by_itself(autopilot, row):
                self._learning = Question(QuestionKind.DEFAULT, row.msgid, row)
                return
        row.is_learned = True

    def _settle_before(self, autopilot: Autopilot, now: HostNs) -> None:
        """End the learning: what was there is known, and requests may change it."""
        self.is_learning = False
        for name, row in self.rows.items():
            row.settle_before(*self.before.taken(name, now))
            row.meter.forget(now)
            if row.is_stated and _is_never_sent_by_itself(autopilot, row):
                row.before_hz = 0.0

    def note_request(self, autopilot: Autopilot, request: RateRequest) -> None:
        """Follow what a station's request changes: ArduPilot's groups are its messages' defaults from then on.

        A higher rate counts as the station's alone, so that it is forgotten with the station.
        """
        if not request.by_group:
            self._single.update(list(request.rates)[: MAX_SINGLE - len(self._single)])
        elif heeds_group_requests(autopilot):
            for row in self.rows.values():
                hz = request.rates.get(row.msgid, inf)
                if row.before_hz is not None and row.is_stated:
                    row.before_hz = min(row.before_hz, hz or 0.0)

    # The difference: one question at a time.

    def reconcile(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        """Return the request that is due: the pending question again, or the next one."""
        question = self._dialogue.question
        if question is not None:
            if now < question.deadline_ns:
                return []
            deaf = not self._has_answered and self._by_group
            if question.tries < (1 if deaf else question.most_tries):
                return self._ask(autopilot, question, now)
            self._dialogue.question = None
            asked = self._on_silence(autopilot, question, now)
            if asked:
                return asked
        if self.is_learning:
            asked = self._learn(autopilot, now)
            if asked or self.is_learning:
                return asked
        return self._ask_next(autopilot, now)

    def _learn(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        if self._learning is not None:
            question, self._learning = self._learning, None
            if question.row is not None:
                self.before.reset(question.row.name, now)
            return self._ask(autopilot, question, now)
        if self._states_rates is not False:
            for row in self.rows.values():
                if not row.is_learned:
                    return self._ask(autopilot, Question(QuestionKind.RATE, row.msgid, row), now)
        if now >= self.before.enough_at:
            self._settle_before(autopilot, now)
        return []

    def _ask_next(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        for row in self.rows.values():
            if row.next_ask_ns is not None and row.next_ask_ns <= now:
                row.asked(now)
                if self.is_unsupported:
                    asked = self._ask_group_of(autopilot, row, now)
                    if asked:
                        return asked
                    continue
                return self._ask(autopilot, Question(QuestionKind.INTERVAL, row.msgid, row), now)
        if self._wishes and not self.is_unsupported:
            number, msgid, hz = self._wishes.popleft()
            if number is not None:
                return [
                    self._dialogue.set_group(autopilot, number, hz),
                    *self._behind_group(autopilot, number, hz, now),
                ]
            return self._ask(autopilot, Question(QuestionKind.WISH, msgid, hz=hz), now)
        return []

    def _ask(self, autopilot: Autopilot, question: Question, now: HostNs) -> list[Outgoing]:
        asked, row = self._dialogue.ask(autopilot, question, now), question.row
        if question.kind is QuestionKind.INTERVAL and row is not None:
            asked_hz = 1e6 / row.interval_us
            for hz in (row.kept_hz, self.demanded.get(row.msgid, 0.0)):
                if hz > ROUNDING * asked_hz:
                    asked += self._dialogue.set_rate(autopilot, row.msgid, round(1e6 / hz), now)
                    asked_hz = hz
        return asked

    def _behind_group(self, autopilot: Autopilot, number: int, hz: float, now: HostNs) -> list[Outgoing]:
        """Return our rates of a group's messages that its request lowers."""
        return [
            each
            for row in self.rows.values()
            if group_of(row.msgid) == number and row.state not in NOT_KEPT and row.kept_hz > ROUNDING * hz
            for each in self._dialogue.set_rate(autopilot, row.msgid, round(1e6 / row.kept_hz), now)
        ]

    def _ask_group_of(self, autopilot: Autopilot, row: RateRow, now: HostNs) -> list[Outgoing]:
        number = DATA_STREAMS.get(row.name, enums.MAV_DATA_STREAM_EXTRA3)
        row.asked_by_group(now)
        asked_ns = self._groups_asked_ns.get(number)
        if asked_ns is not None and now < asked_ns + GROUP_PAUSE_NS:
            return []
        self._groups_asked_ns[number] = now
        members = [one for one in self.rows.values() if DATA_STREAMS.get(one.name, number) == number]
        rate_hz = max(one.kept_hz for one in members if one.state is not RequestState.HELD_BACK)
        demanded_hz = max(self.demanded.get(one.msgid, 0.0) for one in members)
        return [self._dialogue.set_group(autopilot, number, max(rate_hz, demanded_hz))]

    def follow(self, autopilot: Autopilot, what: FollowUp, now: HostNs) -> list[Outgoing]:
        """Request at once the rates that a station's request has just lowered. The measured rates show the result."""
        groups = dict(what.groups)
        followed = {msgid for msgid, _ in what.messages}
        for row in self.rows.values():
            row.is_asked |= row.msgid in followed
        if not self._by_group:
            messages = [
                each
                for msgid, hz in what.messages
                for each in self._dialogue.set_rate(autopilot, msgid, round(1e6 / hz), now)
            ]
        else:
            messages = []
            for msgid, hz in what.messages:
                number = group_of(msgid)
                if number is not None:
                    groups[number] = max(hz, groups.get(number, 0.0))
        return [*(self._dialogue.set_group(autopilot, number, hz) for number, hz in groups.items()), *messages]

    # Answers, and their absence.

    def on_ack(self, autopilot: Autopilot, message: Message, now: HostNs) -> None:
        """Process a COMMAND_ACK, if it answers the pending question."""
        fields = message.fields
        question = self._dialogue.acknowledged(autopilot, fields, now)
        if question is None:
            return
        quaternion = self.rows.get(QUATERNION)
        if self._by_group and not self._has_answered and quaternion is not None:
            quaternion.ask_soon(now, 0)  # it is heard now, and was not when the groups were tried
        self._has_answered = True
        accepted = fields.result == enums.MAV_RESULT_ACCEPTED
        unsupported = fields.result == enums.MAV_RESULT_UNSUPPORTED
        row = question.row
        if question.kind in {QuestionKind.RATE, QuestionKind.DEFAULT}:
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
        elif fields.result == enums.MAV_RESULT_TEMPORARILY_REJECTED:
            row.wait(now)
        else:
            row.on_result(accepted, now)
            self._notify_outcome(row)

    def _on_silence(self, autopilot: Autopilot, question: Question, now: HostNs) -> list[Outgoing]:
        row = question.row
        if row is None:
            return []
        if question.kind in {QuestionKind.RATE, QuestionKind.DEFAULT}:
            row.is_learned = True
            if self._states_rates is None:
                self._states_rates = False
            return []
        if row.state is RequestState.HELD_BACK:
            return []
        if not self._has_answered:
            # INAV ignores COMMAND_LONG, and some firmwares take REQUEST_DATA_STREAM alone: arrivals show the outcome.
            self._by_group = True
            if row.name == QUATERNION and ATTITUDE in self.rows:
                row.close(RequestState.UNANSWERED)
                return []
            return self._ask_group_of(autopilot, row, now)
        row.state = RequestState.UNANSWERED
        row.wait(now)
        return []

    def _fall_back(self, now: HostNs) -> None:
        """Request by REQUEST_DATA_STREAM: the autopilot does not know the newer command."""
        text = "the autopilot does not know SET_MESSAGE_INTERVAL: asking by REQUEST_DATA_STREAM"
        self._notify(NoticeCode.INTERVALS_UNKNOWN, Severity.INFO, text)
        self.is_unsupported = self._by_group = True
        for row in self.rows.values():
            row.need(self._wanted[row.name], now)
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


def heeds_group_requests(autopilot: Autopilot) -> bool:
    """Return whether the autopilot acts on REQUEST_DATA_STREAM; PX4 has an empty handler for it."""
    return autopilot.kind is not AutopilotKind.PX4


def _is_never_sent_by_itself(autopilot: Autopilot, row: RateRow) -> bool:
    """Return whether only a request can have started the message: ArduPilot sends only its groups by itself."""
    return autopilot.kind is AutopilotKind.ARDUPILOT and group_of(row.msgid) is None

"""Reconciles the autopilot's message rates with the desired-state table (:mod:`~...client.rate_table`).

The loop learns what is there before it changes anything: it asks for each message's rate (GET_MESSAGE_INTERVAL) and
counts arrivals for two seconds. Then it requests the difference, one question at a time, and goes on measuring: an
acknowledgement is not proof (PX4 acknowledged 50 Hz and sent 18). A rate is requested again after a reboot, when it
falls, and when a station's request has lowered it; after a reboot, stations' own rates are requested again too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.client.arrivals_before import ArrivalsBefore
from fwav_companion.mavlink.client.one_shot_requests import OneShotRequests
from fwav_companion.mavlink.client.rate_competitors import RateCompetitors
from fwav_companion.mavlink.client.rate_dialogue import Asked, Question, RateDialogue
from fwav_companion.mavlink.client.rate_merging import ROUNDING, FollowUp, follow_up
from fwav_companion.mavlink.client.rate_table import (
    ATTITUDE,
    NOT_KEPT,
    QUATERNION,
    SILENT,
    RateRow,
    RequestState,
)
from fwav_companion.mavlink.client.subscriptions import DATA_STREAMS, MESSAGE_IDS, other_firmwares
from fwav_companion.mavlink.wire import enums
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest
from fwav_companion.mavlink.wire.stream_groups import group_of
from fwav_companion.types.messages import Message, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.network_status import StreamReport
from fwav_companion.types.situation import Autopilot, AutopilotKind

CHECK_NS = NS_PER_S
SILENT_NS = 600 * NS_PER_MS
"""Silence of the autopilot that distinguishes a lost link from lost rates. A fall is detected when 0.6 s of a window
are missing; a station's request leaves at least a few messages a second, so silence of this length means that the
link failed."""
LOST_NS = 2 * NS_PER_S
"""Silence of the autopilot after which the rates are measured anew: two missed heartbeats."""
PASSED_PAUSE_NS = NS_PER_S // 2
GROUP_PAUSE_NS = NS_PER_S
"""Time in which one REQUEST_DATA_STREAM serves every message of its group that is due."""
GATE_NS = 50 * NS_PER_MS
"""Interval at which a closed gate is tried again."""
BACKGROUND_ATTITUDE_HZ = 4.0
"""Rate of plain ATTITUDE while the quaternion arrives: enough for a ground station's horizon."""
SAME_RATE = 0.01
"""Relative difference up to which a stated rate may be what an earlier run of this service requested."""
MAX_NOTICES = 32
MAX_NAMED = 32
"""Stations whose first request is logged."""
MAX_SINGLE = 128
"""Messages remembered as requested by SET_MESSAGE_INTERVAL."""


class Rates:
    """The loop: pass in every message and each wake, send the returned messages."""

    def __init__(self, wanted: Mapping[str, float], *, attitude_message: str = "auto", component: int = 191):
        """Start without an autopilot. ``wanted``: hertz by message name, the most important first."""
        self._wanted = {name: hz for name, hz in wanted.items() if name in MESSAGE_IDS and isfinite(hz) and hz > 0.0}
        self._attitude_message = attitude_message
        self._autopilot: Autopilot | None = None
        self._rows: dict[str, RateRow] = {}
        self._now = self._heard_ns = self._check_ns = self._gate_ns = HostNs(0)
        self._before = ArrivalsBefore()
        self._dialogue = RateDialogue(component)
        self._one_shots = OneShotRequests(component)
        self._competitors = RateCompetitors()
        self._demanded: Mapping[int, float] = {}
        self._single: set[int] = set()
        self._wishes: deque[tuple[int | None, int, float]] = deque()
        """(group, message id, hertz): stations' rates that a reboot lost."""
        self._begin_dialogue()
        self._notices: deque[Notice] = deque(maxlen=MAX_NOTICES)
        self._named: set[str] = set()
        self.gate: Callable[[HostNs], bool] | None = None
        """Returns whether our requests may be sent now: closed while another exchange must have the link to itself.
        None: always open."""
        self.own_streams = OwnStreams(0, 1, {})
        """Messages whose rate is ours, with their rates without our requests."""
        self.wake_at: HostNs | None = None
        """Time at which :meth:`on_wake` is due; None while no autopilot is adopted."""

    @property
    def wanted_attitude_hz(self) -> float:
        """Configured rate of ATTITUDE, hertz."""
        return self._wanted.get(ATTITUDE, 0.0)

    @property
    def are_taken(self) -> bool:
        """Whether no request has failed yet, or one was granted."""
        rows = self._rows.values()
        granted = any(row.state is RequestState.GRANTED and row.is_asked for row in rows)
        return granted or not any(row.state in SILENT | {RequestState.REFUSED} for row in rows)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the requested parameters that the autopilot has reported."""
        return self._one_shots.parameters

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Reconcile this autopilot's rates from now on."""
        self._autopilot = autopilot
        names = [name for name in self._wanted if name not in other_firmwares(autopilot.kind)]
        self._rows = {name: RateRow(name, self._wanted[name]) for name in names}
        self._before.adopt(autopilot, now)
        self._begin(now)

    def ask_again(self, why: str, now: HostNs) -> None:
        """Start over after a reboot: the autopilot has forgotten every rate. Refused rates are tried again."""
        for row in self._rows.values():
            row.undone(why, now)
        self._before.restart(now)
        self._begin(now)
        lost = follow_up(
            RateRequest(
                system=0, component=0, link="", target_system=0, target_component=0,
                rates=dict.fromkeys(self._demanded, 0.0), by_group=self._heeds_groups,
            ),
            {}, self._demanded, heeds_groups=self._heeds_groups,
        )  # fmt: skip
        ours = {row.msgid for row in self._rows.values()}
        self._wishes.extend((number, 0, hz) for number, hz in lost.groups.items())
        single = self._single - ours
        self._wishes.extend((None, msgid, hz) for msgid, hz in self._demanded.items() if msgid in single)
        self._wake_when_due()

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count arrivals from our autopilot; process its acknowledgements, intervals and parameters."""
        autopilot = self._autopilot
        if autopilot is None:
            self._before.on_message(message, now)
            return
        if message.system != autopilot.system or message.component != autopilot.component:
            self._competitors.on_message(message, autopilot, now)
            return
        if now - self._heard_ns > LOST_NS:
            self._restart_meters(now)
        self._now = self._heard_ns = now
        name = message.name
        row = self._rows.get(name)
        if row is not None:
            row.meter.arrived()
            if self._is_learning:
                self._before.count(name)
        elif name == "COMMAND_ACK":
            self._on_ack(autopilot, message, now)
        elif name == "MESSAGE_INTERVAL":
            self._on_interval(autopilot, message)
        else:
            self._one_shots.on_message(message)
            return
        if row is None:
            self._wake_when_due()
        elif name in {"HOME_POSITION", "GPS_GLOBAL_ORIGIN"}:
            self._one_shots.on_message(message)

    def on_rate_request_passed(self, requester: str, now: HostNs) -> None:
        """Note that a station's rate request passed over a link that does not merge: request ours again at once.

        Further ones within half a second are answered after it: ground stations send half a dozen in a row.
        """
        if self._autopilot is None:
            return
        if self._competitors.saw(requester, now):
            text = f"{requester} asks the autopilot for other message rates over our link: asked again"
            self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)
        self._now = now
        for row in self._rows.values():
            if row.state is RequestState.GRANTED:
                row.undone(requester, now)
            if not self._is_learning:
                row.ask_soon(now, PASSED_PAUSE_NS)
        self._wake_when_due()

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """Set the highest rates, hertz by message id, that stations on merging links want: ours never lower them."""
        self._demanded = demanded

    def on_merged_requests(
        self, requests: Sequence[RateRequest], demanded: Mapping[int, float], now: HostNs
    ) -> list[Outgoing]:
        """Return the requests that follow stations' requests in the same write. ``demanded``: as in
        :meth:`stations_want`.
        """
        self.stations_want(demanded)
        autopilot = self._autopilot
        if autopilot is None or not self._takes_requests:
            return []
        followed = []
        for request in requests:
            if request.reaches(autopilot.system, autopilot.component):
                self._name(request)
                self._note_request(request)
                kept = {row.msgid: row.kept_hz for row in self._rows.values() if row.state not in NOT_KEPT}
                if self._is_learning:
                    kept = {}
                what = follow_up(request, kept, demanded, heeds_groups=self._heeds_groups)
                followed += self._follow(autopilot, what, now)
        self._share()
        return followed

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """Return the requests that are due."""
        autopilot = self._autopilot
        if autopilot is None:
            return []
        self._now = now
        if now >= self._check_ns:
            self._check_ns = HostNs(now + CHECK_NS)
            self._check(autopilot, now)
        asked: list[Outgoing] = []
        if self._takes_requests:
            if self.gate is None or self.gate(now):
                self._gate_ns = HostNs(0)
                asked = [*self._reconcile(autopilot, now), *self._one_shots.on_wake(now)]
            else:
                self._gate_ns = HostNs(now + GATE_NS)
        self._wake_when_due()
        self._share()
        return asked

    def notices(self) -> list[Notice]:
        """Return the log notices since the last call."""
        notices = list(self._notices)
        self._notices.clear()
        return notices

    def status(self) -> dict[str, StreamReport]:
        """Return the state of each requested message by its name."""
        return {name: row.status() for name, row in self._rows.items()}

    # What is there: statements and arrivals before the first request.

    def _on_interval(self, autopilot: Autopilot, message: Message) -> None:
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
        if question.asked is Asked.RATE:
            row.shown_hz = row.stated_hz
            like_ours = abs(row.shown_hz - row.need_hz) <= SAME_RATE * row.need_hz
            if like_ours and not self._is_never_sent_by_itself(row):
                self._learning = Question(Asked.DEFAULT, row.msgid, row)
                return
        row.is_learned = True

    def _is_never_sent_by_itself(self, row: RateRow) -> bool:
        """Return whether only a request can have started the message: ArduPilot sends its groups alone by itself."""
        return self._autopilot is not None and self._autopilot.kind is AutopilotKind.ARDUPILOT and (
            group_of(row.msgid) is None
        )

    def _settle_before(self, now: HostNs) -> None:
        """End the learning: what was there is known, and requests may change it."""
        self._is_learning = False
        counts, elapsed_ns = self._before.take(now)
        for name, row in self._rows.items():
            row.settle_before(counts.get(name, 0), elapsed_ns)
            row.meter.forget(now)
            if row.is_stated and self._is_never_sent_by_itself(row):
                row.before_hz = 0.0

    # The difference: one question at a time.

    def _reconcile(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
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
        if self._is_learning:
            asked = self._learn(autopilot, now)
            if asked or self._is_learning:
                return asked
        return self._ask_next(autopilot, now)

    def _learn(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        if self._learning is not None:
            question, self._learning = self._learning, None
            return self._ask(autopilot, question, now)
        if self._states_rates is not False:
            for row in self._rows.values():
                if not row.is_learned:
                    return self._ask(autopilot, Question(Asked.RATE, row.msgid, row), now)
        if now >= self._before.enough_at:
            self._settle_before(now)
        return []

    def _ask_next(self, autopilot: Autopilot, now: HostNs) -> list[Outgoing]:
        for row in self._rows.values():
            if row.next_ask_ns is not None and row.next_ask_ns <= now:
                row.asked(now)
                if self._is_unsupported:
                    asked = self._ask_group_of(autopilot, row, now)
                    if asked:
                        return asked
                    continue
                return self._ask(autopilot, Question(Asked.INTERVAL, row.msgid, row), now)
        if self._wishes and not self._is_unsupported:
            number, msgid, hz = self._wishes.popleft()
            if number is not None:
                return [self._dialogue.set_group(autopilot, number, hz), *self._behind_group(autopilot, number, hz, now)]
            return self._ask(autopilot, Question(Asked.WISH, msgid, hz=hz), now)
        return []

    def _ask(self, autopilot: Autopilot, question: Question, now: HostNs) -> list[Outgoing]:
        asked, row = self._dialogue.ask(autopilot, question, now), question.row
        if question.asked is Asked.INTERVAL and row is not None:
            asked_hz = 1e6 / row.interval_us
            for hz in (row.kept_hz, self._demanded.get(row.msgid, 0.0)):
                if hz > ROUNDING * asked_hz:
                    asked += self._dialogue.set_rate(autopilot, row.msgid, round(1e6 / hz), now)
                    asked_hz = hz
        return asked

    def _behind_group(self, autopilot: Autopilot, number: int, hz: float, now: HostNs) -> list[Outgoing]:
        """Return our rates of a group's messages that its request lowers."""
        return [
            each
            for row in self._rows.values()
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
        members = [one for one in self._rows.values() if DATA_STREAMS.get(one.name, number) == number]
        rate_hz = max(one.kept_hz for one in members if one.state is not RequestState.HELD_BACK)
        demanded_hz = max(self._demanded.get(one.msgid, 0.0) for one in members)
        return [self._dialogue.set_group(autopilot, number, max(rate_hz, demanded_hz))]

    def _follow(self, autopilot: Autopilot, what: FollowUp, now: HostNs) -> list[Outgoing]:
        """Request at once the rates that a station's request has just lowered. The measured rates show the result."""
        groups = dict(what.groups)
        followed = {msgid for msgid, _ in what.messages}
        for row in self._rows.values():
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

    def _on_ack(self, autopilot: Autopilot, message: Message, now: HostNs) -> None:
        fields = message.fields
        question = self._dialogue.acknowledged(autopilot, fields, now)
        if question is None:
            return
        self._has_answered = True
        accepted = fields.result == enums.MAV_RESULT_ACCEPTED
        unsupported = fields.result == enums.MAV_RESULT_UNSUPPORTED
        row = question.row
        if question.asked in {Asked.RATE, Asked.DEFAULT}:
            if not accepted and row is not None:  # no statement follows; an accepted one is awaited
                self._dialogue.question, row.is_learned = None, True
                if unsupported and self._states_rates is None:
                    self._states_rates = False
            return
        self._dialogue.question = None
        self._command_known |= accepted
        self._by_group &= not accepted or self._is_unsupported
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
        if question.asked in {Asked.RATE, Asked.DEFAULT}:
            row.is_learned = True
            if self._states_rates is None:
                self._states_rates = False
            return []
        if row.state is RequestState.HELD_BACK:
            return []
        if not self._has_answered:
            # INAV ignores COMMAND_LONG, and some firmwares take REQUEST_DATA_STREAM alone: arrivals show the outcome.
            self._by_group = True
            if row.name == QUATERNION and ATTITUDE in self._rows:
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
        self._is_unsupported = self._by_group = True
        for row in self._rows.values():
            row.need(self._wanted[row.name], now)
            row.is_asked = False  # what was sent had no effect
        if ATTITUDE in self._rows and QUATERNION in self._rows:  # a group contains plain ATTITUDE alone
            self._rows[QUATERNION].close(RequestState.HELD_BACK)

    # The state of the table.

    def _begin_dialogue(self) -> None:
        self._dialogue.begin()
        self._wishes.clear()
        self._groups_asked_ns: dict[int, HostNs] = {}
        self._learning: Question | None = None
        self._is_learning = True
        self._states_rates: bool | None = None
        """Whether the autopilot answers GET_MESSAGE_INTERVAL; None: not known yet."""
        self._has_answered = self._command_known = self._is_unsupported = self._by_group = False

    def _begin(self, now: HostNs) -> None:
        self._now = now
        self._begin_dialogue()
        for row in self._rows.values():
            row.forget_before()
            row.need(self._wanted[row.name], now)
            row.meter.forget(now)
        quaternion, plain = self._rows.get(QUATERNION), self._rows.get(ATTITUDE)
        if quaternion is not None and plain is not None:
            held_back = quaternion if self._attitude_message == ATTITUDE else plain
            held_back.close(RequestState.HELD_BACK)
        self._check_ns = HostNs(now + CHECK_NS)
        if self._autopilot is not None:
            if not self._takes_requests:
                for row in self._rows.values():
                    row.close(RequestState.UNSUPPORTED)
            self._one_shots.begin(self._autopilot, now)
            self._wake_when_due()
            self._share()

    @property
    def _takes_requests(self) -> bool:
        """Whether requests can be addressed to the autopilot: system 0 would address every vehicle."""
        return self._autopilot is not None and self._autopilot.system != 0

    @property
    def _heeds_groups(self) -> bool:
        return self._autopilot is not None and self._autopilot.kind is not AutopilotKind.PX4

    def _wake_when_due(self) -> None:
        """Set the next due time. It is kept and recomputed on changes only, because every arriving message reads
        it.
        """
        due = [self._check_ns]
        if self._takes_requests:
            asking = [when for when in (self._next_ask(), self._one_shots.wake_at) if when is not None]
            due += [max(when, self._gate_ns) for when in asking]
        self.wake_at = max(min(due), self._now)

    def _next_ask(self) -> HostNs | None:
        if self._dialogue.question is not None:
            return self._dialogue.question.deadline_ns
        if self._is_learning:
            unlearned = self._states_rates is not False and not all(row.is_learned for row in self._rows.values())
            return HostNs(0) if unlearned or self._learning is not None else self._before.enough_at
        if self._wishes and not self._is_unsupported:
            return HostNs(0)
        return min((row.next_ask_ns for row in self._rows.values() if row.next_ask_ns is not None), default=None)

    def _share(self) -> None:
        autopilot = self._autopilot
        if autopilot is None:
            return
        ours = [row for row in self._rows.values() if row.is_ours]
        self.own_streams = OwnStreams(
            autopilot.system,
            autopilot.component,
            {row.msgid: row.before_hz or 0.0 for row in ours},
            frozenset(row.msgid for row in ours if row.is_stated),
        )

    def _check(self, autopilot: Autopilot, now: HostNs) -> None:
        """Measure the rates, and act on those that fell."""
        silence = RequestState.UNSUPPORTED if self._is_unsupported else RequestState.UNANSWERED
        for row in self._rows.values():
            if row.meter.roll(now, row.granted_hz) and self._takes_requests and not self._is_learning:
                fell_from_hz = row.judge(now, silence)
                if fell_from_hz is not None and now - self._heard_ns <= SILENT_NS:
                    row.undone(self._competitors.to_blame(autopilot, now), now)
                    self._notify(
                        NoticeCode.RATE_FELL,
                        Severity.WARNING,
                        f"{row.name} fell from {fell_from_hz:.1f} to {row.meter.hz or 0.0:.1f} Hz"
                        f" (undone by: {row.undone_by}): asked again",
                    )
        self._share_attitude(now)

    def _restart_meters(self, now: HostNs) -> None:
        for row in self._rows.values():
            row.meter.restart(now)

    def _share_attitude(self, now: HostNs) -> None:
        """Request plain ATTITUDE slowly while the quaternion arrives, and at the full rate if it is not available."""
        quaternion, plain = self._rows.get(QUATERNION), self._rows.get(ATTITUDE)
        if quaternion is None or plain is None or self._attitude_message == ATTITUDE or not self._takes_requests:
            return
        failed = quaternion.state in SILENT | {RequestState.REFUSED, RequestState.HELD_BACK}
        failed |= quaternion.state is RequestState.GRANTED and quaternion.meter.hz == 0.0
        if (quaternion.meter.hz or 0.0) > 0.0:
            hz = min(BACKGROUND_ATTITUDE_HZ, self.wanted_attitude_hz)
        elif self._attitude_message == "auto" and failed:
            hz = self.wanted_attitude_hz
        else:
            return
        if plain.state is RequestState.HELD_BACK or plain.need_hz != hz:
            plain.need(hz, now)

    def _note_request(self, request: RateRequest) -> None:
        """Follow what a station's request changes: ArduPilot's groups are its messages' defaults from then on.

        A higher rate counts as the station's alone, so that it is forgotten with the station.
        """
        if not request.by_group:
            self._single.update(list(request.rates)[: MAX_SINGLE - len(self._single)])
        elif self._heeds_groups:
            for row in self._rows.values():
                hz = request.rates.get(row.msgid, inf)
                if row.before_hz is not None and row.is_stated:
                    row.before_hz = min(row.before_hz, hz or 0.0)

    def _name(self, request: RateRequest) -> None:
        if request.requester not in self._named and len(self._named) < MAX_NAMED:
            self._named.add(request.requester)
            text = f"{request.requester} asks the autopilot for message rates: merged with ours"
            self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)

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

    def _notify(self, code: NoticeCode, severity: Severity, text: str) -> None:
        self._notices.append(Notice(code, severity, text))

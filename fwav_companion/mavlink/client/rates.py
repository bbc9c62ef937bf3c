"""Keeps the autopilot's message rates at what this service and the stations desire: the front of the table of rates.

The reconciler requests what the table lacks. This module measures: an acknowledgement is not proof (PX4 acknowledged
50 Hz and sent 18). A rate is requested again after a reboot, when it falls, and when a station's request has lowered
it; after a reboot, the stations' own rates are requested again too.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import isfinite

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.client.one_shot_requests import SELDOM, OneShotRequests
from fwav_companion.mavlink.client.rate_reconciler import RateReconciler, StationRates
from fwav_companion.mavlink.client.rate_search import ArrivalsBefore, RateCompetitors
from fwav_companion.mavlink.client.rate_table import (
    ATTITUDE,
    FINAL_STATES,
    QUATERNION,
    SILENT,
    RateRow,
    RequestState,
    new_row,
)
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS, missing_messages, unneeded_messages
from fwav_companion.mavlink.wire.rate_messages import HORIZON_ATTITUDE_HZ, OwnStreams, RateRequest
from fwav_companion.types.messages import ATTITUDE_MESSAGES, Message, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.network_status import StreamReport
from fwav_companion.types.situation import Autopilot

CHECK_NS = NS_PER_S
SILENT_NS = 600 * NS_PER_MS
"""Silence of the autopilot that distinguishes a lost link from lost rates. A fall is detected when 0.6 s of a window
are missing; a station's request leaves at least a few messages a second, so silence of this length means that the
link failed."""
LOST_NS = 2 * NS_PER_S
"""Silence of the autopilot after which the rates are measured again: two missed heartbeats."""
PASSED_PAUSE_NS = NS_PER_S // 2
GATE_NS = 50 * NS_PER_MS
"""Interval at which a closed gate is tried again."""
MAX_NOTICES = MAX_NAMED = 32
"""Notices kept for the log, and stations whose first request is logged."""


class Rates:
    """The loop: pass in every message and each wake, send the returned messages."""

    def __init__(
        self,
        wanted: Mapping[str, float],
        *,
        attitude_message: str = "auto",
        component: int = 191,
        more_parameters: tuple[str, ...] = (),
        on_demand: Mapping[str, float] | None = None,
    ):
        """Start without an autopilot. ``wanted``: hertz by message name, the most important first.
        ``more_parameters``: read once from an ArduPilot, in addition to the usual ones. ``on_demand``: hertz of
        messages that :meth:`want` may ask for.
        """
        self._wanted = {name: hz for name, hz in wanted.items() if name in MESSAGE_IDS and isfinite(hz) and hz > 0.0}
        self._on_demand = dict(on_demand or {})
        self._attitude_message = attitude_message
        self._component = component
        self._loop: RateReconciler | None = None
        self._stations = StationRates()
        self._before = ArrivalsBefore()
        self._now = self._heard_ns = self._check_ns = self._gate_ns = HostNs(0)
        self._one_shots = OneShotRequests(component, more_parameters=more_parameters)
        self._competitors = RateCompetitors()
        self._notices: deque[Notice] = deque(maxlen=MAX_NOTICES)
        self._named: set[str] = set()
        self.gate: Callable[[HostNs], bool] | None = None
        """Returns whether requests for rates and parameters may be sent now: closed while another exchange must have
        the link to itself. The two for the home and the origin leave before it: without them the first position would
        be the origin. None: always open."""
        self.own_streams = OwnStreams(0, 1, {})
        """Messages whose rate is ours, with their rates without our requests."""
        self.wake_at: HostNs | None = None
        """Time at which :meth:`on_wake` is due; None while no autopilot is adopted."""

    @property
    def wanted_attitude_hz(self) -> float:
        """Configured rate of ATTITUDE, hertz."""
        return self._wanted.get(ATTITUDE, 0.0)

    @property
    def trouble(self) -> str:
        """What the autopilot does with our requests if none was granted and one failed; "" otherwise."""
        if self._loop is None:
            return ""
        rows = self._loop.rows.values()
        states = {row.state for row in rows}
        if any(row.state is RequestState.GRANTED and row.is_asked for row in rows):
            return ""
        if RequestState.UNSUPPORTED in states:
            return "takes no rate requests"
        if RequestState.UNANSWERED in states or self._loop.is_unanswered:
            return "answers no rate request"
        return "refuses rate requests" if RequestState.REFUSED in states else ""

    @property
    def attitude_pending(self) -> bool:
        """Whether our request for the attitude has no outcome yet, of an autopilot that has answered something."""
        if self._loop is None or self._loop.is_unanswered:
            return False
        rows = self._loop.rows
        return any(rows[name].state is RequestState.ASKING for name in ATTITUDE_MESSAGES & rows.keys())

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the requested parameters that the autopilot has reported."""
        return self._one_shots.parameters

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Reconcile this autopilot's rates from now on."""
        since_ns, counts = self._before.take(autopilot.system, autopilot.component, now)
        unneeded = unneeded_messages(autopilot.kind)
        hz = {name: hz for name, hz in self._wanted.items() if name not in unneeded}
        self._begin(autopilot, [new_row(name, hz[name], since_ns, counts[name]) for name in hz], since_ns, now)

    def want(self, name: str, comes_hz: float, now: HostNs) -> None:
        """Request one more message from now on, unless this firmware lacks it. ``comes_hz``: rate at which it arrives
        by itself: what stations on merging links go on getting.
        """
        loop = self._loop
        if loop is None or name in loop.rows or name in missing_messages(loop.autopilot.kind):
            return
        self._wanted.setdefault(name, self._on_demand[name])
        loop.add(new_row(name, self._wanted[name], now), comes_hz)
        self._wake_when_due()
        self._share(loop)

    def ask_again(self, why: str, now: HostNs) -> None:
        """Start over after a reboot: the autopilot has forgotten every rate. Refused rates are tried again."""
        if self._loop is None:
            return
        rows = [new_row(row.name, self._wanted[row.name], now) for row in self._loop.rows.values()]
        for row, before in zip(rows, self._loop.rows.values(), strict=True):
            row.contradicted = before.contradicted
            row.undone(why, now)
        self._begin(self._loop.autopilot, rows, now, now).wish_again()
        self._wake_when_due()

    def _begin(self, autopilot: Autopilot, rows: list[RateRow], since_ns: HostNs, now: HostNs) -> RateReconciler:
        self._now = now
        self._check_ns = HostNs(now + CHECK_NS)
        loop = self._loop = RateReconciler(
            autopilot, rows, self._stations, component=self._component, since_ns=since_ns, notify=self._notify
        )
        quaternion, plain = loop.rows.get(QUATERNION), loop.rows.get(ATTITUDE)
        if quaternion is not None and plain is not None and loop.takes_requests:
            held_back = quaternion if self._attitude_message == ATTITUDE else plain
            held_back.close(RequestState.HELD_BACK)
        self._one_shots.begin(autopilot, now)
        self._wake_when_due()
        self._share(loop)
        return loop

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count arrivals from our autopilot; process its acknowledgements, intervals and parameters."""
        loop = self._loop
        if loop is None:
            self._before.on_message(message, now)
            return
        if message.system != loop.autopilot.system or message.component != loop.autopilot.component:
            self._competitors.on_message(message, loop.autopilot, now)
            return
        if now - self._heard_ns > LOST_NS and not loop.is_learning:
            for each in loop.rows.values():
                each.meter.restart(now)
        self._now = self._heard_ns = now
        name = message.name
        row = loop.rows.get(name)
        if row is not None:
            row.meter.count += 1
            if name in SELDOM:
                self._one_shots.on_message(message)
        elif name == "COMMAND_ACK":
            loop.on_ack(message, now)
            self._wake_when_due()
        elif name == "MESSAGE_INTERVAL":
            loop.on_interval(message)
            self._wake_when_due()
        else:
            self._one_shots.on_message(message)

    def on_rate_request_passed(self, requester: str, now: HostNs) -> None:
        """Note that a station's rate request passed over a link that does not merge: request ours again at once.

        Further ones within half a second are answered after it: ground stations send half a dozen in a row.
        """
        loop = self._loop
        if loop is None:
            return
        if self._competitors.saw(requester, now):
            text = f"{requester} asks the autopilot for other message rates over our link: asked again"
            self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)
        self._now = now
        for row in loop.rows.values():
            if row.state is RequestState.GRANTED:
                row.undone(requester, now)
            if not loop.is_learning:
                row.ask_soon(now, PASSED_PAUSE_NS)
        self._wake_when_due()

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """Set the highest rates, hertz by message id, that stations on merging links want: ours never lower them."""
        self._stations.demanded = demanded

    def on_merged_requests(
        self, requests: Sequence[RateRequest], demanded: Mapping[int, float], now: HostNs
    ) -> list[Outgoing]:
        """Return the requests that follow stations' requests in the same write. ``demanded``: as in
        :meth:`stations_want`.
        """
        self.stations_want(demanded)
        loop = self._loop
        if loop is None or not loop.takes_requests:
            return []
        followed = []
        for request in requests:
            if request.reaches(loop.autopilot.system, loop.autopilot.component):
                self._competitors.saw(request.requester, now)
                if request.requester not in self._named and len(self._named) < MAX_NAMED:
                    self._named.add(request.requester)
                    text = f"{request.requester} asks the autopilot for message rates: merged with ours"
                    self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)
                followed += loop.on_station_request(request, now)
        self._share(loop)
        return followed

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """Return the requests that are due."""
        loop = self._loop
        if loop is None:
            return []
        self._now = now
        if now >= self._check_ns:
            self._check_ns = HostNs(now + CHECK_NS)
            if not loop.is_learning:
                self._check(loop, now)
        asked: list[Outgoing] = []
        if loop.takes_requests:
            is_open = self.gate is None or self.gate(now)
            self._gate_ns = HostNs(0 if is_open else now + GATE_NS)
            asked = loop.reconcile(now) if is_open else []
            asked += self._one_shots.on_wake(now, parameters=is_open)
        self._wake_when_due()
        self._share(loop)
        return asked

    def open_gate(self, now: HostNs) -> None:
        """Try the gate at once, because it was just opened."""
        if self._gate_ns > now:
            self._gate_ns = HostNs(0)
            self._wake_when_due()

    def notices(self) -> list[Notice]:
        """Return the log notices since the last call."""
        notices = list(self._notices)
        self._notices.clear()
        return notices

    def status(self) -> dict[str, StreamReport]:
        """Return the state of each requested message by its name."""
        return {} if self._loop is None else {name: row.status() for name, row in self._loop.rows.items()}

    def _wake_when_due(self) -> None:
        """Set the next due time, which every arriving message reads."""
        due = [self._check_ns]
        if self._loop is not None and self._loop.takes_requests:
            asking = [when for when in (self._loop.next_ask_ns, self._one_shots.wake_at) if when is not None]
            due += [max(when, self._gate_ns) for when in asking]
        self.wake_at = max(min(due), self._now)

    def _share(self, loop: RateReconciler) -> None:
        ours = [row for row in loop.rows.values() if row.is_ours]
        self.own_streams = OwnStreams(
            loop.autopilot.system,
            loop.autopilot.component,
            {row.msgid: row.before_hz or 0.0 for row in ours},
            frozenset(row.msgid for row in ours if row.is_stated),
        )

    def _check(self, loop: RateReconciler, now: HostNs) -> None:
        """Measure the rates, and act on those that fell."""
        silence = RequestState.UNSUPPORTED if loop.is_unsupported else RequestState.UNANSWERED
        for row in loop.rows.values():
            if not row.meter.roll(now, row.granted_hz) or not loop.takes_requests:
                continue
            fell_from_hz = row.judge(now, silence)
            if fell_from_hz is not None and now - self._heard_ns <= SILENT_NS:
                row.undone(self._competitors.to_blame(loop.autopilot, now), now)
                self._notify(
                    NoticeCode.RATE_FELL,
                    Severity.WARNING,
                    f"{row.name} fell from {fell_from_hz:.1f} to {row.meter.hz or 0.0:.1f} Hz"
                    f" (undone by: {row.undone_by}): asked again",
                )
        if loop.takes_requests:
            self._share_attitude(loop, now)

    def _share_attitude(self, loop: RateReconciler, now: HostNs) -> None:
        """Request plain ATTITUDE slowly while the quaternion arrives, and at the full rate if it is not available."""
        quaternion, plain = loop.rows.get(QUATERNION), loop.rows.get(ATTITUDE)
        if quaternion is None or plain is None or self._attitude_message == ATTITUDE:
            return
        failed = quaternion.state in SILENT | FINAL_STATES
        failed |= quaternion.state is RequestState.GRANTED and quaternion.meter.hz == 0.0
        if (quaternion.meter.hz or 0.0) > 0.0:
            hz = min(HORIZON_ATTITUDE_HZ, self.wanted_attitude_hz)
        elif self._attitude_message == "auto" and failed:
            hz = self.wanted_attitude_hz
        else:
            return
        if plain.state is RequestState.HELD_BACK or plain.need_hz != hz:
            plain.need(hz, now)

    def _notify(self, code: NoticeCode, severity: Severity, text: str) -> None:
        self._notices.append(Notice(code, severity, text))

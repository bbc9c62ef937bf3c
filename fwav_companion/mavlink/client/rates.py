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
from fwav_companion.mavlink.client.one_shot_requests import OneShotRequests
from fwav_companion.mavlink.client.rate_competitors import RateCompetitors
from fwav_companion.mavlink.client.rate_merging import follow_up
from fwav_companion.mavlink.client.rate_reconciler import RateReconciler, heeds_group_requests
from fwav_companion.mavlink.client.rate_table import ATTITUDE, NOT_KEPT, QUATERNION, SILENT, RateRow, RequestState
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS, other_firmwares
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest
from fwav_companion.types.messages import Message, Notice, NoticeCode, Outgoing, Severity
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
BACKGROUND_ATTITUDE_HZ = 4.0
"""Rate of plain ATTITUDE while the quaternion arrives: enough for a ground station's horizon."""
MAX_NOTICES = 32
MAX_NAMED = 32
"""Stations whose first request is logged."""


class Rates:
    """The loop: pass in every message and each wake, send the returned messages."""

    def __init__(
        self,
        wanted: Mapping[str, float],
        *,
        attitude_message: str = "auto",
        component: int = 191,
        follows: bool = False,
    ):
        """Start without an autopilot. ``wanted``: hertz by message name, the most important first. ``follows``: this
        service sends FOLLOW_TARGET.
        """
        self._wanted = {name: hz for name, hz in wanted.items() if name in MESSAGE_IDS and isfinite(hz) and hz > 0.0}
        self._attitude_message = attitude_message
        self._autopilot: Autopilot | None = None
        self._now = self._heard_ns = self._check_ns = self._gate_ns = HostNs(0)
        self._one_shots = OneShotRequests(component, follows=follows)
        self._competitors = RateCompetitors()
        self._notices: deque[Notice] = deque(maxlen=MAX_NOTICES)
        self._named: set[str] = set()
        self._loop = RateReconciler(self._wanted, component, self._notify)
        self.gate: Callable[[HostNs], bool] | None = None
        """Returns whether requests for rates and parameters may be sent now: closed while another exchange must have
        the link to itself. The two for the home and the origin pass, because the first position replaces them.
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
    def trouble(self) -> str:
        """What the autopilot does with our requests if none was granted and one failed; "" otherwise."""
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
    def parameters(self) -> dict[str, float]:
        """Values of the requested parameters that the autopilot has reported."""
        return self._one_shots.parameters

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Reconcile this autopilot's rates from now on."""
        self._autopilot = autopilot
        names = [name for name in self._wanted if name not in other_firmwares(autopilot.kind)]
        self._loop.rows = {name: RateRow(name, self._wanted[name]) for name in names}
        self._loop.before.adopt(autopilot, now)
        self._begin(now)

    def ask_again(self, why: str, now: HostNs) -> None:
        """Start over after a reboot: the autopilot has forgotten every rate. Refused rates are tried again."""
        for row in self._loop.rows.values():
            row.undone(why, now)
        self._loop.before.restart(now)
        self._begin(now)
        if self._autopilot is not None:
            self._loop.wish_again(self._autopilot)
            self._wake_when_due()

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count arrivals from our autopilot; process its acknowledgements, intervals and parameters."""
        autopilot = self._autopilot
        if autopilot is None:
            self._loop.before.on_message(message, now)
            return
        if message.system != autopilot.system or message.component != autopilot.component:
            self._competitors.on_message(message, autopilot, now)
            return
        if now - self._heard_ns > LOST_NS:
            self._restart_meters(now)
        self._now = self._heard_ns = now
        name = message.name
        row = self._loop.rows.get(name)
        if row is not None:
            row.meter.arrived()
            if self._loop.is_learning:
                self._loop.before.count(name)
        elif name == "COMMAND_ACK":
            self._loop.on_ack(autopilot, message, now)
        elif name == "MESSAGE_INTERVAL":
            self._loop.on_interval(autopilot, message)
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
        for row in self._loop.rows.values():
            if row.state is RequestState.GRANTED:
                row.undone(requester, now)
            if not self._loop.is_learning:
                row.ask_soon(now, PASSED_PAUSE_NS)
        self._wake_when_due()

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """Set the highest rates, hertz by message id, that stations on merging links want: ours never lower them."""
        self._loop.demanded = demanded

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
                self._competitors.saw(request.requester, now)
                self._loop.note_request(autopilot, request)
                kept = {} if self._loop.is_learning else self._kept_hz()
                what = follow_up(request, kept, demanded, heeds_groups=heeds_group_requests(autopilot))
                followed += self._loop.follow(autopilot, what, now)
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
            is_open = self.gate is None or self.gate(now)
            self._gate_ns = HostNs(0 if is_open else now + GATE_NS)
            asked = self._loop.reconcile(autopilot, now) if is_open else []
            asked += self._one_shots.on_wake(now, parameters=is_open)
        self._wake_when_due()
        self._share()
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
        return {name: row.status() for name, row in self._loop.rows.items()}

    # The state of the table.

    def _begin(self, now: HostNs) -> None:
        self._now = now
        self._loop.begin()
        for row in self._loop.rows.values():
            row.forget_before()
            row.need(self._wanted[row.name], now)
            row.meter.forget(now)
        quaternion, plain = self._loop.rows.get(QUATERNION), self._loop.rows.get(ATTITUDE)
        if quaternion is not None and plain is not None:
            held_back = quaternion if self._attitude_message == ATTITUDE else plain
            held_back.close(RequestState.HELD_BACK)
        self._check_ns = HostNs(now + CHECK_NS)
        if self._autopilot is not None:
            if not self._takes_requests:
                for row in self._loop.rows.values():
                    row.close(RequestState.UNSUPPORTED)
            self._one_shots.begin(self._autopilot, now)
            self._wake_when_due()
            self._share()

    @property
    def _takes_requests(self) -> bool:
        """Whether requests can be addressed to the autopilot: system 0 would address every vehicle."""
        return self._autopilot is not None and self._autopilot.system != 0

    def _kept_hz(self) -> dict[int, float]:
        return {row.msgid: row.kept_hz for row in self._loop.rows.values() if row.state not in NOT_KEPT}

    def _wake_when_due(self) -> None:
        """Set the next due time. It is kept and recomputed on changes only, because every arriving message reads
        it.
        """
        due = [self._check_ns]
        if self._takes_requests:
            asking = [when for when in (self._loop.next_ask(), self._one_shots.wake_at) if when is not None]
            due += [max(when, self._gate_ns) for when in asking]
        self.wake_at = max(min(due), self._now)

    def _share(self) -> None:
        autopilot = self._autopilot
        if autopilot is None:
            return
        ours = [row for row in self._loop.rows.values() if row.is_ours]
        self.own_streams = OwnStreams(
            autopilot.system,
            autopilot.component,
            {row.msgid: row.before_hz or 0.0 for row in ours},
            frozenset(row.msgid for row in ours if row.is_stated),
        )

    def _check(self, autopilot: Autopilot, now: HostNs) -> None:
        """Measure the rates, and act on those that fell."""
        silence = RequestState.UNSUPPORTED if self._loop.is_unsupported else RequestState.UNANSWERED
        for row in self._loop.rows.values():
            if row.meter.roll(now, row.granted_hz) and self._takes_requests and not self._loop.is_learning:
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
        for row in self._loop.rows.values():
            row.meter.restart(now)

    def _share_attitude(self, now: HostNs) -> None:
        """Request plain ATTITUDE slowly while the quaternion arrives, and at the full rate if it is not available."""
        quaternion, plain = self._loop.rows.get(QUATERNION), self._loop.rows.get(ATTITUDE)
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

    def _name(self, request: RateRequest) -> None:
        if request.requester not in self._named and len(self._named) < MAX_NAMED:
            self._named.add(request.requester)
            text = f"{request.requester} asks the autopilot for message rates: merged with ours"
            self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)

    def _notify(self, code: NoticeCode, severity: Severity, text: str) -> None:
        self._notices.append(Notice(code, severity, text))

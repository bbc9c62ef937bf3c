"""Requests message rates from the autopilot, measures them, and requests them again when they fall.

An acknowledgement is not proof (PX4 acknowledged 50 Hz and sent 18): the measured rate counts. A rate is requested
again after a reboot, when it falls, and at once when a station's rate request passed over our link. If the link of that
request merges requests, ours follows in the same write, and only if it is higher.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from math import isfinite

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.client.attitude_sharing import AttitudeSharing
from fwav_companion.mavlink.client.one_shot_requests import OneShotRequests
from fwav_companion.mavlink.client.own_rates import OwnRates
from fwav_companion.mavlink.client.rate_competitors import RateCompetitors
from fwav_companion.mavlink.client.rate_merging import follow_up
from fwav_companion.mavlink.client.rate_requests import RateRequests
from fwav_companion.mavlink.client.rate_stream import RateStream, StreamState
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS, other_firmwares
from fwav_companion.mavlink.wire.rate_messages import OwnStreams, RateRequest
from fwav_companion.types.messages import Message, Notice, NoticeCode, Outgoing, Severity
from fwav_companion.types.network_status import StreamReport
from fwav_companion.types.situation import Autopilot, AutopilotKind

CHECK_NS = NS_PER_S
SILENT_NS = 600 * NS_PER_MS
"""Silence of the autopilot that distinguishes a lost link from lost rates. A fall is detected when 0.6 s of a window
are missing; a station's request leaves at least a few messages a second, so silence of this length means that the
link failed."""
PASSED_PAUSE_NS = NS_PER_S // 2
MAX_NOTICES = 32
MAX_NAMED = 32
"""Stations whose first request is logged."""
NOT_ASKED = frozenset({StreamState.HELD_BACK, StreamState.DENIED})


class Rates:
    """Requests and supervises the wanted message rates: pass in every message and each wake, send the returned
    messages.
    """

    def __init__(
        self,
        wanted: Mapping[str, float],
        *,
        attitude_message: str = "auto",
        component: int = 191,
        merges_requests: bool = False,
    ):
        """Start without an autopilot. ``merges_requests``: a link merges stations' requests with ours, so the
        autopilot's own rates must be known.
        """
        self._wanted = {name: hz for name, hz in wanted.items() if name in MESSAGE_IDS and isfinite(hz) and hz > 0.0}
        self._attitudes = AttitudeSharing(attitude_message, self.wanted_attitude_hz)
        self._autopilot: Autopilot | None = None
        self._streams: dict[str, RateStream] = {}
        self._now = self._heard_ns = HostNs(0)
        self._check_ns = HostNs(0)
        self._own_rates = OwnRates(enabled=merges_requests)
        self._requests = RateRequests(component, self._own_rates)
        self._one_shots = OneShotRequests(component)
        self._competitors = RateCompetitors()
        self._notices: deque[Notice] = deque(maxlen=MAX_NOTICES)
        self._named: set[str] = set()
        self.own_streams = OwnStreams(0, 1, {})
        """Our requests to the adopted autopilot, and its own rates without them."""
        self.wake_at: HostNs | None = None
        """Time at which :meth:`on_wake` is due; None while no autopilot is adopted."""

    @property
    def wanted_attitude_hz(self) -> float:
        """Configured rate of ATTITUDE, hertz."""
        return self._wanted.get("ATTITUDE", 0.0)

    @property
    def parameters(self) -> dict[str, float]:
        """Values of the requested parameters that the autopilot has reported."""
        return self._one_shots.parameters

    def adopt(self, autopilot: Autopilot, now: HostNs) -> None:
        """Send requests to this autopilot from now on."""
        self._autopilot = autopilot
        names = [name for name in self._wanted if name not in other_firmwares(autopilot.kind)]
        self._streams = {name: RateStream(name, self._wanted[name]) for name in names}
        self._begin(now)

    def ask_again(self, why: str, now: HostNs) -> None:
        """Start over after a reboot or a lost link: the autopilot has forgotten every rate. Refused rates are tried
        again.
        """
        for stream in self._streams.values():
            stream.undone(why, now)
        self._begin(now)

    def on_message(self, message: Message, now: HostNs) -> None:
        """Count arrivals from our autopilot; process its acknowledgements, intervals and parameters."""
        if not self._is_from_autopilot(message):
            if self._autopilot is not None:
                self._competitors.on_message(message, self._autopilot, now)
            return
        self._now = self._heard_ns = now
        stream = self._streams.get(message.name)
        if stream is not None:
            stream.meter.arrived()
        if message.name == "COMMAND_ACK":
            self._on_ack(message, now)
            self.wake_at = self._next_due()
            self._share()
        elif message.name == "MESSAGE_INTERVAL":
            name = self._own_rates.on_interval(message)
            if name:
                self._requests.on_own_rate(name)
                self.wake_at = self._next_due()
                self._share()
        else:
            self._one_shots.on_message(message)

    def on_rate_request_passed(self, requester: str, now: HostNs) -> None:
        """Note that a station's REQUEST_DATA_STREAM or SET_MESSAGE_INTERVAL passed over our link: request again at
        once.

        Further ones within half a second are answered after it: ground stations send half a dozen in a row.
        """
        if self._autopilot is None:
            return
        if self._competitors.saw(requester, now):
            text = f"{requester} asks the autopilot for other message rates over our link: asked again"
            self._notify(NoticeCode.RATES_TAKEN, Severity.INFO, text)
        self._now = now
        for stream in self._streams.values():
            if stream.state is StreamState.GRANTED:
                stream.undone(requester, now)
            stream.ask_soon(now, PASSED_PAUSE_NS)
        self.wake_at = self._next_due()

    def stations_want(self, demanded: Mapping[int, float]) -> None:
        """Set the highest rates, hertz by message id, that stations on merging links want: ours never lower them."""
        self._requests.demanded = demanded

    def on_merged_requests(
        self, requests: Sequence[RateRequest], demanded: Mapping[int, float], now: HostNs
    ) -> list[Outgoing]:
        """Return the requests that follow stations' requests in the same write. ``demanded``: as in
        :meth:`stations_want`.
        """
        self.stations_want(demanded)
        autopilot = self._autopilot
        if autopilot is None:
            return []
        followed = []
        for request in requests:
            if request.reaches(autopilot.system, autopilot.component):
                self._name(request)
                heeds_groups = autopilot.kind is not AutopilotKind.PX4
                if request.by_group and heeds_groups:
                    self._own_rates.on_group(request.rates)
                what = follow_up(request, self._kept_hz(), demanded, heeds_groups=heeds_groups)
                followed += self._requests.follow(what, now)
        self._share()
        return followed

    def _kept_hz(self) -> dict[int, float]:
        asked = [(name, stream) for name, stream in self._streams.items() if stream.state not in NOT_ASKED]
        return {MESSAGE_IDS[name]: self._requests.rate_kept_hz(stream) for name, stream in asked}

    def on_wake(self, now: HostNs) -> list[Outgoing]:
        """Return the requests that are due."""
        if self._autopilot is None:
            return []
        self._now = now
        if now >= self._check_ns:
            self._check_ns = HostNs(now + CHECK_NS)
            self._check(now)
        asked = [*self._requests.on_wake(now), *self._one_shots.on_wake(now)]
        self.wake_at = self._next_due()
        self._share()
        return asked

    def notices(self) -> list[Notice]:
        """Return the log notices since the last call."""
        notices = list(self._notices)
        self._notices.clear()
        return notices

    def status(self) -> dict[str, StreamReport]:
        """Return the state of each requested message by its name."""
        return {name: stream.status() for name, stream in self._streams.items()}

    def _share(self) -> None:
        if self._autopilot is not None:
            by_itself_hz = {
                MESSAGE_IDS[name]: self._own_rates.hz(name)
                for name, stream in self._streams.items()
                if stream.state not in NOT_ASKED
            }
            self.own_streams = OwnStreams(self._autopilot.system, self._autopilot.component, by_itself_hz)

    def _name(self, request: RateRequest) -> None:
        if request.requester not in self._named and len(self._named) < MAX_NAMED:
            self._named.add(request.requester)
            self._notify(
                NoticeCode.RATES_TAKEN,
                Severity.INFO,
                f"{request.requester} asks the autopilot for message rates: merged with ours",
            )

    def _begin(self, now: HostNs) -> None:
        self._now = now
        for stream in self._streams.values():
            stream.want(self._wanted[stream.name], now)
            stream.meter.forget(now)
        self._attitudes.begin(self._streams)
        self._check_ns = HostNs(now + CHECK_NS)
        if self._autopilot is not None:
            self._requests.begin(self._autopilot, self._streams)
            self._one_shots.begin(self._autopilot, now)
            self.wake_at = self._next_due()
            self._share()

    def _next_due(self) -> HostNs:
        """Return the next due time. It is kept and recomputed on changes only, because every arriving message reads
        it.
        """
        due = (self._check_ns, self._one_shots.wake_at, self._requests.wake_at)
        return max(min(when for when in due if when is not None), self._now)

    def _check(self, now: HostNs) -> None:
        """Measure the rates, and act on those that fell."""
        for stream in self._streams.values():
            if stream.meter.roll(now, stream.granted_hz):
                fell_from_hz = stream.judge(now)
                if fell_from_hz is not None:
                    self._blame(stream, fell_from_hz, now)
        self._attitudes.share(self._streams, now)

    def _blame(self, stream: RateStream, fell_from_hz: float, now: HostNs) -> None:
        if now - self._heard_ns > SILENT_NS:
            return
        stream.undone(self._competitors.to_blame(self._autopilot, now), now)
        self._notify(
            NoticeCode.RATE_FELL,
            Severity.WARNING,
            f"{stream.name} fell from {fell_from_hz:.1f} to {stream.meter.hz or 0.0:.1f} Hz"
            f" (undone by: {stream.undone_by}): asked again",
        )

    def _on_ack(self, message: Message, now: HostNs) -> None:
        answer = self._requests.on_ack(message, now)
        if answer is None:
            return
        if answer.command_unknown:
            self._fall_back(now)
        else:
            self._notify_outcome(answer.stream)

    def _notify_outcome(self, stream: RateStream) -> None:
        if stream.state is StreamState.DENIED:
            text = f"the autopilot does not send {stream.name}: refused at every rate"
            self._notify(NoticeCode.MESSAGE_REFUSED, Severity.INFO, text)
        elif stream.state is StreamState.GRANTED and stream.granted_hz < 0.99 * stream.wanted_hz:
            self._notify(
                NoticeCode.RATE_REFUSED,
                Severity.WARNING,
                f"{stream.name} at {stream.wanted_hz:g} Hz is refused: the highest accepted rate is"
                f" {stream.granted_hz:.1f} Hz (ArduPilot allows 0.8 SCHED_LOOP_RATE)",
            )

    def _fall_back(self, now: HostNs) -> None:
        """Request by REQUEST_DATA_STREAM: the autopilot does not know the newer command."""
        text = "the autopilot does not know SET_MESSAGE_INTERVAL: asking by REQUEST_DATA_STREAM"
        self._notify(NoticeCode.INTERVALS_UNKNOWN, Severity.INFO, text)
        for stream in self._streams.values():
            stream.want(self._wanted[stream.name], now)
        self._attitudes.fall_back(self._streams)

    def _is_from_autopilot(self, message: Message) -> bool:
        autopilot = self._autopilot
        return autopilot is not None and message.system == autopilot.system and message.component == autopilot.component

    def _notify(self, code: NoticeCode, severity: Severity, text: str) -> None:
        self._notices.append(Notice(code, severity, text))

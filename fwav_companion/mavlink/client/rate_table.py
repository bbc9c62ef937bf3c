"""The rows of the desired-state table: one for each message of the autopilot that this service needs.

The desired rate of a message is the highest of what we need, what a station requests, and what was there before our
first request. What was there is the rate that the autopilot states (MESSAGE_INTERVAL), unless the arrivals contradict
it: a statement may be wrong, a measured rate is not.
"""

from __future__ import annotations

from enum import StrEnum
from math import inf

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.rate_search import ArrivalMeter, RateSearch
from fwav_companion.mavlink.client.subscriptions import MESSAGE_IDS
from fwav_companion.types.messages import ATTITUDE_MESSAGES
from fwav_companion.types.network_status import StreamReport

FIRST_PAUSE_NS = 4 * NS_PER_S
LONGEST_PAUSE_NS = 60 * NS_PER_S
"""Longest pause between requests for a rate that does not arrive: the pause doubles each time."""
UNDONE_KEPT_NS = 60 * NS_PER_S
"""Time for which the cause of a lost rate is kept: ground stations repeat their requests within 30 s."""
REACHED = 0.85
"""Share of the agreed rate from which it counts as reached: an autopilot's scheduler rounds."""
FALLEN = 0.7
"""Share of the earlier measured rate below which a rate has fallen: a radio that loses a fifth changes no rate."""
RISEN = 1.15
"""Ratio of two rates from which the higher one is another rate, by the same rounding."""
SHOWN = 0.5
"""Share of the requested rate from which arrivals show that an unacknowledged request had an effect."""
ATTITUDE, QUATERNION = "ATTITUDE", "ATTITUDE_QUATERNION"


class RequestState(StrEnum):
    """What the autopilot did about our request for one message."""

    HELD_BACK = "held_back"
    """Not requested: another message serves, or is tried first."""
    ASKING = "asking"
    GRANTED = "granted"
    """Acknowledged, or shown by the arrivals, or sent by the autopilot without a request."""
    REFUSED = "denied"
    """Refused at every rate; not requested again before a reboot."""
    UNANSWERED = "unanswered"
    """Neither acknowledged nor shown by the arrivals."""
    UNSUPPORTED = "unsupported"
    """The autopilot does not take requests for rates."""


FINAL_STATES = frozenset({RequestState.HELD_BACK, RequestState.REFUSED})
"""States in which nothing is requested before a reboot, unless another message fails."""
NOT_KEPT = FINAL_STATES | {RequestState.UNSUPPORTED}
"""States without a rate of ours that a station's request could lower."""
SILENT = frozenset({RequestState.UNANSWERED, RequestState.UNSUPPORTED})


class RateRow(msgspec.Struct, eq=False):
    """State of one message since the adoption, or since the last reboot."""

    name: str
    need_hz: float
    """Rate that this service needs, hertz."""
    search: RateSearch
    meter: ArrivalMeter
    undone_by: str | None = None
    """Last cause of a lost rate: a station's ids, or a reboot; None after UNDONE_KEPT_NS without another."""
    undone_ns: HostNs = HostNs(0)
    contradicted: int = 0
    """Number of statements of the autopilot that the measured rate contradicted."""

    # What was there before our first request.

    is_learned: bool = False
    """Whether the autopilot's statement is there, or is not awaited any more."""
    stated_hz: float | None = None
    """Stated rate, hertz, which the arrivals must agree with; inf: with every new value. Where an earlier run of ours
    left its rate, the default to which it was reset."""
    before_hz: float | None = None
    """Rate before our first request, hertz; None: not known yet."""
    is_stated: bool = False
    """Whether :attr:`before_hz` is the autopilot's statement."""

    # Our requests.

    state: RequestState = RequestState.ASKING
    next_ask_ns: HostNs | None = None
    """Time of the next request; None: none is due."""
    is_asked: bool = False
    """Whether a request of ours was sent: the rate may be ours."""
    is_shown_only: bool = False
    """Whether no acknowledgement follows the request: arrivals alone show its outcome."""
    asked_ns: HostNs | None = None
    plateau_hz: float | None = None
    """Highest rate measured since the last request."""
    pause_ns: int = FIRST_PAUSE_NS

    @property
    def msgid(self) -> int:
        """Message id."""
        return MESSAGE_IDS[self.name]

    @property
    def granted_hz(self) -> float:
        """Highest accepted rate, hertz; before the first acceptance, the needed rate."""
        return 1e6 / (self.search.accepted_us or 1e6 / self.need_hz)

    @property
    def interval_us(self) -> int:
        """Interval to request now, microseconds: the next step of the search, or the granted one again."""
        return self.search.asking_us or self.search.accepted_us or round(1e6 / self.need_hz)

    @property
    def kept_hz(self) -> float:
        """Rate that the autopilot must keep despite stations' requests: ours, or what was there if that is higher."""
        return max(1e6 / self.interval_us, self.before_hz or 0.0 if self.keeps_before else 0.0)

    @property
    def keeps_before(self) -> bool:
        """Whether the rate that was there must not be lowered. A stated rate of attitudes may be: plain ATTITUDE is
        requested slowly on purpose while the quaternion arrives.
        """
        return self.name not in ATTITUDE_MESSAGES or not self.is_stated

    @property
    def is_ours(self) -> bool:
        """Whether the message may come at a rate that only we requested: stations then get it at :attr:`before_hz`.

        A stated rate of attitudes counts too: what no station requests goes at most at a display's rate.
        """
        if self.before_hz is None or self.state in SILENT or self.state is RequestState.REFUSED:
            return False
        return self.is_asked or (self.is_stated and self.name in ATTITUDE_MESSAGES)

    def settle_before(self, demanded_hz: float, now: HostNs) -> None:
        """Determine the rate before our first request from the statement and from the arrivals, and whether it is
        enough for us and for the stations.

        Of a periodic stream between (count - 1) and (count + 1) intervals lie in a time: the highest rate that explains
        the arrivals is kept, so that the stream is not thinned.
        """
        count, per_s = self.meter.count, NS_PER_S / self.meter.elapsed_ns(now)
        least_hz, most_hz, stated_hz = (count - 1) * per_s, (count + 1) * per_s, self.stated_hz
        self.is_stated = stated_hz is not None
        if stated_hz is not None and stated_hz != inf:
            self.is_stated = least_hz <= RISEN * stated_hz and FALLEN * stated_hz <= most_hz
            self.contradicted += not self.is_stated
        self.before_hz = stated_hz if self.is_stated else (most_hz if count else 0.0)
        comes_hz = stated_hz if self.is_stated else count * per_s
        enough = comes_hz is not None and comes_hz >= REACHED * max(self.need_hz, demanded_hz)
        if enough and self.keeps_before and self.state is RequestState.ASKING:
            self.close(RequestState.GRANTED)
        self.meter = ArrivalMeter(now)

    def need(self, need_hz: float, now: HostNs) -> None:
        """Start over at this rate: no granted rate is known."""
        self.need_hz, self.search = need_hz, RateSearch(need_hz)
        self.state, self.next_ask_ns, self.is_shown_only = RequestState.ASKING, now, False
        self.plateau_hz, self.pause_ns = None, FIRST_PAUSE_NS

    def undone(self, by: str, now: HostNs) -> None:
        """Note the cause of a lost rate."""
        self.undone_by, self.undone_ns = by, now

    def close(self, state: RequestState) -> None:
        """Send no further request."""
        self.state, self.next_ask_ns = state, None

    def asked(self, now: HostNs) -> None:
        """Note that the request is sent."""
        self.asked_ns, self.next_ask_ns, self.is_asked = now, None, True

    def asked_by_group(self, now: HostNs) -> None:
        """Note that the message's group is requested, which no acknowledgement follows."""
        self.asked(now)
        self.is_shown_only = True
        self.meter.restart(now)

    def ask_soon(self, now: HostNs, pause_ns: int = 0) -> None:
        """Request again, but not within ``pause_ns`` of the last request."""
        if self.state in FINAL_STATES:
            return
        earliest_ns = now if self.asked_ns is None else max(now, self.asked_ns + pause_ns)
        self.next_ask_ns = HostNs(min(earliest_ns, self.next_ask_ns if self.next_ask_ns is not None else earliest_ns))

    def wait(self, now: HostNs) -> None:
        """Request again after a pause that grows each time."""
        self.next_ask_ns = HostNs(now + self.pause_ns)
        self.pause_ns = min(2 * self.pause_ns, LONGEST_PAUSE_NS)

    def on_result(self, accepted: bool, now: HostNs) -> None:
        """Process the answer to the pending request; the next step of the search is due at once."""
        self.is_shown_only = False
        (self.search.on_accepted if accepted else self.search.on_refused)()
        if self.search.denied:
            self.close(RequestState.REFUSED)
            return
        searching = self.search.asking_us is not None
        self.state = RequestState.ASKING if searching else RequestState.GRANTED
        self.next_ask_ns = now if searching else None
        self.meter.restart(now)

    def judge(self, now: HostNs, silence: RequestState) -> float | None:
        """Compare the window that just ended with the agreed rate. Returns the earlier rate if the rate fell.

        ``silence``: state of a request that nothing answers.
        """
        if now - self.undone_ns >= UNDONE_KEPT_NS:
            self.undone_by = None
        hz, before_hz = self.meter.hz, self.plateau_hz
        if hz is None or not (self.state is RequestState.GRANTED or self.state in SILENT or self.is_shown_only):
            return None
        if self.state is RequestState.HELD_BACK:
            return None
        if before_hz is not None and hz < min(FALLEN * before_hz, REACHED * self.granted_hz):
            # A rate above the granted one is due to a station's request, and ends with it.
            self.plateau_hz = None
            self.ask_soon(now, FIRST_PAUSE_NS)
            return before_hz
        self.plateau_hz = max(hz, before_hz or 0.0) or None
        if hz >= REACHED * self.granted_hz:
            self.close(RequestState.GRANTED)  # whether the autopilot acknowledged it or not
            self.pause_ns = FIRST_PAUSE_NS
            return None
        if self.is_shown_only:
            risen = hz > (RISEN * self.before_hz if self.before_hz else SHOWN * self.granted_hz)
            self.state = RequestState.GRANTED if risen else silence
        if self.next_ask_ns is None:
            self.wait(now)
        return None

    def status(self) -> StreamReport:
        """Return the state for the status file."""
        closed = self.state in FINAL_STATES or not self.is_asked
        before_hz = self.before_hz
        return StreamReport(
            wanted_hz=self.need_hz,
            asked_hz=None if closed else round(self.granted_hz, 2),
            measured_hz=None if self.meter.hz is None else round(self.meter.hz, 2),
            before_hz=None if before_hz is None or before_hz == inf else round(before_hz, 2),
            before_by=None if before_hz is None else "stated" if self.is_stated else "measured",
            contradicted=self.contradicted,
            state=str(self.state),
            undone_by=self.undone_by,
        )


def new_row(name: str, need_hz: float, since_ns: HostNs, count: int = 0) -> RateRow:
    """Return a row that is due. ``count``: arrivals since then."""
    return RateRow(name, need_hz, RateSearch(need_hz), ArrivalMeter(since_ns, count), next_ask_ns=since_ns)

"""Holds the state of one message wanted at a rate: the progress of its request, its measured rate, and the retry
pause.
"""

from __future__ import annotations

from enum import StrEnum

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.mavlink.client.rate_search import ArrivalMeter, RateSearch
from fwav_companion.types.network_status import StreamReport

FIRST_PAUSE_NS = 4 * NS_PER_S
LONGEST_PAUSE_NS = 60 * NS_PER_S
"""Longest pause between requests for a rate that does not arrive: the pause doubles each time."""
UNDONE_KEPT_NS = 60 * NS_PER_S
"""Time for which the cause of a lost rate is kept: ground stations repeat their requests within 30 s."""
REACHED = 0.85
FALLEN = 0.7
"""Share of the earlier measured rate below which a rate has fallen."""


class StreamState(StrEnum):
    """Progress of a rate request."""

    HELD_BACK = "held_back"
    """Not requested: another message serves, or is tried first."""
    ASKING = "asking"
    GRANTED = "granted"
    DENIED = "denied"
    """Refused at every rate; not requested again before a reboot."""
    UNANSWERED = "unanswered"


class RateStream:
    """State of one wanted message. :mod:`~fwav_companion.mavlink.client.rate_requests` sends its requests."""

    __slots__ = (
        "_asked_ns",
        "_pause_ns",
        "_plateau_hz",
        "_undone_ns",
        "meter",
        "name",
        "next_ask_ns",
        "search",
        "state",
        "undone_by",
        "wanted_hz",
    )

    def __init__(self, name: str, wanted_hz: float):
        self.name = name
        self.meter = ArrivalMeter()
        self.undone_by: str | None = None
        """Last cause of a lost rate: a station's ids, or a reboot; None after UNDONE_KEPT_NS without another."""
        self._undone_ns = HostNs(0)
        self._asked_ns: HostNs | None = None
        self.want(wanted_hz, HostNs(0))

    def want(self, wanted_hz: float, now: HostNs) -> None:
        """Start over at this rate: no granted rate is known."""
        self.wanted_hz = wanted_hz
        self.search = RateSearch(wanted_hz)
        self.state = StreamState.ASKING
        self.next_ask_ns: HostNs | None = now
        self._plateau_hz: float | None = None
        self._pause_ns = FIRST_PAUSE_NS

    def undone(self, by: str, now: HostNs) -> None:
        """Note the cause of a lost rate."""
        self.undone_by, self._undone_ns = by, now

    def hold_back(self) -> None:
        """Stop requesting the message."""
        self.state, self.next_ask_ns = StreamState.HELD_BACK, None

    @property
    def granted_hz(self) -> float:
        """Highest accepted rate, hertz; before the first acceptance, the wanted rate."""
        return 1e6 / (self.search.accepted_us or 1e6 / self.wanted_hz)

    @property
    def interval_us(self) -> int:
        """Interval to request now, microseconds: the next step of the search, or the granted one again."""
        return self.search.asking_us or self.search.accepted_us or round(1e6 / self.wanted_hz)

    @property
    def is_searching(self) -> bool:
        """Whether the search has a next step."""
        return self.search.asking_us is not None

    def asked(self, now: HostNs) -> None:
        """Note that the request is sent."""
        self._asked_ns, self.next_ask_ns = now, None

    def ask_soon(self, now: HostNs, pause_ns: int) -> None:
        """Request again, but not within ``pause_ns`` of the last request."""
        if self.state in {StreamState.HELD_BACK, StreamState.DENIED}:
            return
        earliest_ns = now if self._asked_ns is None else max(now, self._asked_ns + pause_ns)
        self.next_ask_ns = HostNs(min(earliest_ns, self.next_ask_ns if self.next_ask_ns is not None else earliest_ns))

    def wait(self, now: HostNs) -> None:
        """Request again after a pause that grows each time."""
        self.next_ask_ns = HostNs(now + self._pause_ns)
        self._pause_ns = min(2 * self._pause_ns, LONGEST_PAUSE_NS)

    def on_result(self, accepted: bool, now: HostNs) -> None:
        """Take the answer to the pending request; the next step of the search is due at once."""
        if self.is_searching:
            if accepted:
                self.search.on_accepted()
            else:
                self.search.on_refused()
        if self.search.denied:
            self.state, self.next_ask_ns = StreamState.DENIED, None
            return
        self.state = StreamState.ASKING if self.is_searching else StreamState.GRANTED
        self.next_ask_ns = now if self.is_searching else None
        self.meter.restart(now)

    def judge(self, now: HostNs) -> float | None:
        """Compare the window that just ended with the granted rate. Returns the earlier rate if the rate fell."""
        if now - self._undone_ns >= UNDONE_KEPT_NS:
            self.undone_by = None
        hz, before_hz = self.meter.hz, self._plateau_hz
        if hz is None or self.state not in {StreamState.GRANTED, StreamState.UNANSWERED}:
            return None
        if before_hz is not None and hz < min(FALLEN * before_hz, REACHED * self.granted_hz):
            # A rate above the granted one is due to a station's request, and ends with it.
            self._plateau_hz = None
            self.ask_soon(now, FIRST_PAUSE_NS)
            return before_hz
        self._plateau_hz = max(hz, before_hz or 0.0) or None
        if hz >= REACHED * self.granted_hz:
            self.state = StreamState.GRANTED  # whether the autopilot acknowledged it or not
            self._pause_ns, self.next_ask_ns = FIRST_PAUSE_NS, None
        elif self.next_ask_ns is None:
            self.wait(now)
        return None

    def status(self) -> StreamReport:
        """Return the state for the status file."""
        held_back = self.state in {StreamState.HELD_BACK, StreamState.DENIED}
        return StreamReport(
            wanted_hz=self.wanted_hz,
            asked_hz=None if held_back else round(self.granted_hz, 2),
            measured_hz=None if self.meter.hz is None else round(self.meter.hz, 2),
            state=str(self.state),
            undone_by=self.undone_by,
        )

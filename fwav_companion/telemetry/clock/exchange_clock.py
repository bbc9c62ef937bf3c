"""Estimates offset and rate from TIMESYNC exchanges: lock, gate, suspects, and new segments.

An exchange that disagrees is a suspect: noise once, a step when three agree (the popcorn filter of NTP, RFC 5905).
Until this is decided the claim contains both hypotheses. The line is fitted in ``exchange_window``.
"""

from __future__ import annotations

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.clock.clock_line import ClockLine
from fwav_companion.telemetry.clock.exchange_fit import Exchange, in_agreement, in_line
from fwav_companion.telemetry.clock.exchange_window import IN_AGREEMENT, ExchangeWindow
from fwav_companion.types import ClockExchange

IN_LINE = 5
"""Number of exchanges on one line that lock a clock whose rate is not a crystal's, where no earlier rate was known:
a line through two of three exchanges with random errors of 100 ms meets the third one in 4 % of the cases."""
MOST_UNLOCKED, MOST_SUSPECTS = 12, 6
SLOWEST_RATE, FASTEST_RATE = 0.1, 10.0
"""Range of rates: a simulator runs at a tenth of real time on a slow computer, at ten times where configured so."""
FASTEST, SLOWEST = 1.0 - FASTEST_RATE, 1.0 - SLOWEST_RATE
MOST_RATE_STEP = 0.6
"""Largest change of the rate that three exchanges show; a larger one needs IN_LINE of them."""
RECENT_S = 10.0
"""Time for which a suspect counts as evidence of another line."""
AGREEING = 2
"""Number of exchanges within the gate that narrow the band, from which they are no lone errors."""


class ExchangeClock:
    """Clock estimate of one link from its exchanges; :attr:`line` is None until three of them agree."""

    __slots__ = (
        "_recent",
        "_ref_host_ns",
        "_ref_offset_ns",
        "_suspects",
        "_window",
        "accepted",
        "line",
        "newest_ns",
        "segment",
        "suspect_s",
    )

    def __init__(self) -> None:
        self._window: ExchangeWindow | None = None
        self._suspects: list[Exchange] = []
        self._recent: list[Exchange] = []
        """Exchanges of the last RECENT_S that contradict the line: suspects, and those that narrow the band."""
        self._ref_host_ns: HostNs | None = None
        self._ref_offset_ns = 0
        self.line: ClockLine | None = None
        self.newest_ns: HostNs | None = None
        """Middle of the newest exchange that was used."""
        self.segment = 0
        """Number of steps so far: it grows with each new segment."""
        self.accepted = 0
        """Number of exchanges that agreed with the segment."""
        self.suspect_s = 0.0
        """What the newest suspect contradicts, seconds; 0 without one."""

    def insert(self, answered: ClockExchange) -> bool:
        """Take one exchange. Returns whether the line changed."""
        entry = self._entry(answered)
        if entry is None:
            return False
        window = self._window
        if window is None:
            return self._insert_unlocked(entry)
        if entry.t <= window.newest.t:  # it overtook another
            return False
        residual = abs(entry.offset - window.predicted(entry.t))
        if residual <= window.gate(entry):
            return self._accept(window, entry)
        self._suspects = [*self._suspects[1 - MOST_SUSPECTS :], entry]
        self.suspect_s = residual
        self._remember(entry)
        return self._begin_segment(window) or self._begin_line(window)

    @property
    def changed(self) -> bool:
        """Whether the rate differs from a crystal's, or was just seen to change."""
        return self._window is not None and self._window.changed

    @property
    def segment_ns(self) -> HostNs:
        """First exchange of the segment."""
        return self._host_ns(self._locked.segment_t)

    @property
    def best_trip_s(self) -> float | None:
        """Least round trip of the exchanges in use, seconds."""
        return None if self._window is None else self._window.least_trip

    @property
    def in_doubt(self) -> bool:
        """Whether the line may be another than the one in use."""
        return self._window is None or self._window.in_doubt or bool(self._suspects)

    @property
    def wants_more(self) -> bool:
        """Whether more exchanges a second would help."""
        return self.in_doubt or self._locked.is_wide

    def bound_s(self, now: HostNs) -> float:
        """Bound of the offset's error without suspects, seconds."""
        assert self._ref_host_ns is not None  # noqa: S101  (there was an exchange)
        return self._locked.bound((now - self._ref_host_ns) * 1e-9)

    @property
    def _locked(self) -> ExchangeWindow:
        assert self._window is not None  # noqa: S101  (callers asked)
        return self._window

    def _host_ns(self, t: float) -> HostNs:
        assert self._ref_host_ns is not None  # noqa: S101  (there was an exchange)
        return HostNs(self._ref_host_ns + round(t * NS_PER_S))

    def _entry(self, answered: ClockExchange) -> Exchange | None:
        sent_ns, received_ns = answered.sent_ns, answered.received_ns
        if received_ns < sent_ns:
            return None
        middle_ns = HostNs((sent_ns + received_ns) // 2)
        # The stamp of a dated-back reception is the beginning of the request on the line.
        offset_ns = middle_ns - answered.autopilot_ns - answered.request_ns
        if self._ref_host_ns is None:
            self._ref_host_ns, self._ref_offset_ns = middle_ns, offset_ns
        return Exchange(
            (middle_ns - self._ref_host_ns) * 1e-9,
            (offset_ns - self._ref_offset_ns) * 1e-9,
            (received_ns - sent_ns) * 1e-9,
            answered.beside_ns * 1e-9,
        )

    def _insert_unlocked(self, entry: Exchange) -> bool:
        self._suspects = [*self._suspects[1 - MOST_UNLOCKED :], entry]
        chosen = in_agreement(self._suspects)
        if len(chosen) >= IN_AGREEMENT:
            return self._start(chosen, changed=False)
        chosen = in_line(self._suspects[-MOST_SUSPECTS:], FASTEST, SLOWEST)
        return len(chosen) >= IN_LINE and self._start(chosen, changed=True)

    def _accept(self, window: ExchangeWindow, entry: Exchange) -> bool:
        """Use an exchange within the gate, unless it alone narrows the band beyond chance."""
        exchanges = [*window.kept, entry]
        narrowed_s = window.narrowed_by(entry)
        if narrowed_s > 0.0:
            self._remember(entry)
            if len(self._recent) < AGREEING:
                self.suspect_s = narrowed_s
                return False
            exchanges = self._with_recent(window.kept)
        self.accepted += 1
        self._suspects, self.suspect_s = [], 0.0
        window.accept(exchanges)
        return self._use(window)

    def _begin_segment(self, window: ExchangeWindow) -> bool:
        """Start a new segment where three suspects agree with one another, the newest included."""
        recent, skew = self._suspects[-IN_AGREEMENT - 1 :], window.fit[1]
        if len(recent) < IN_AGREEMENT:
            return False
        chosen = in_line(recent, skew - MOST_RATE_STEP, min(SLOWEST, skew + MOST_RATE_STEP))
        if len(chosen) < IN_AGREEMENT or chosen[-1] is not recent[-1]:
            chosen = in_line(self._suspects, FASTEST, SLOWEST)
            if len(chosen) < IN_LINE or chosen[-1] is not recent[-1]:
                return False
        self.segment += 1
        return self._start(chosen, changed=True)

    def _begin_line(self, window: ExchangeWindow) -> bool:
        """Drop what is older than the contradicting exchanges, if those are on one line, with all since the first."""
        since = self._with_recent([entry for entry in window.kept if entry.t >= self._recent[0].t])
        if len(self._recent) < IN_AGREEMENT or not window.begin_line(since):
            return False
        self._suspects, self._recent, self.suspect_s = [], [], 0.0
        return self._use(window)

    def _start(self, chosen: list[Exchange], *, changed: bool) -> bool:
        self._suspects, self._recent, self.suspect_s = [], [], 0.0
        self.accepted, self._window = len(chosen), ExchangeWindow(chosen, changed=changed)
        return self._use(self._window)

    def _remember(self, entry: Exchange) -> None:
        self._recent = [each for each in self._recent if each.t > entry.t - RECENT_S] + [entry]

    def _with_recent(self, exchanges: list[Exchange]) -> list[Exchange]:
        """These and the contradicting ones, in order of time."""
        known = {entry.t for entry in exchanges}
        return sorted([*exchanges, *(entry for entry in self._recent if entry.t not in known)], key=lambda e: e.t)

    def _use(self, window: ExchangeWindow) -> bool:
        """Use the line of this window."""
        fit = window.fit
        self.newest_ns = self._host_ns(window.newest.t)
        self.line = ClockLine(
            ref_host_ns=self.newest_ns,
            offset_ns=self._ref_offset_ns + round(fit[0] * NS_PER_S),
            skew=fit[1],
            var_offset=fit[2],
            cov_offset_skew=fit[3],
            var_skew=fit[4],
            wander=window.wander,
            var_bias=(0.5 * window.least_delays) ** 2 / 3.0,  # uniform in half of the least round trip either way
        )
        return True

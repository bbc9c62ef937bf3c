"""Clock estimate of one link: exchanges where they are answered, else arrivals alone, in one sequence of segments."""

from __future__ import annotations

from math import inf, sqrt

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.arrival_watch import ArrivalWatch
from fwav_companion.telemetry.clock.arrivals import LEAST_DELAY_SIGMA_S, ArrivalEnvelope
from fwav_companion.telemetry.clock.clock_line import ClockLine
from fwav_companion.telemetry.clock.exchange_clock import ExchangeClock
from fwav_companion.types import ClockExchange

SEGMENTS = 8
"""Most earlier segments kept: frames are paired within seconds, a clock that steps each second stays known."""
OUTLIVED_NS = 2 * NS_PER_S
"""Age of the last exchange from which arrivals are used where they contradict it: twenty requests were unanswered."""
AWAITED_NS = NS_PER_S
"""Time after the first request for which three exchanges are awaited: arrivals know the clock less well."""
BEYOND_DOUBT = 3.0
"""Least bound of an estimate from arrivals, in sigmas: arrivals give no hard bound."""


class Segment(msgspec.Struct, frozen=True, gc=False):
    """A line that held until a step or another rate."""

    line: ClockLine
    until_ns: HostNs
    """Host instant from which the next line holds."""
    agreed_ns: HostNs
    sure_ns: HostNs
    """Last instant at which this line, and first at which the next one was seen to hold."""
    step_s: float
    """Step of the offset to the next line, seconds; positive: the autopilot's clock fell behind."""
    skew: float
    """Skew of the next line."""


class LinkClock:
    """Estimate of the clock behind one link, now and at recent instants."""

    __slots__ = ("_answered", "_arrivals", "_asked_ns", "_exchanges", "_rate", "_watch", "line", "segments")

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._exchanges = ExchangeClock()
        self._arrivals = ArrivalEnvelope(rate)
        self._watch = ArrivalWatch()
        self.segments: list[Segment] = []
        """Earlier segments that are still known, the oldest first."""
        self.line: ClockLine | None = None
        """The line in use; None before there is an estimate. Kept, because each frame asks for it six times."""
        self._answered = False
        self._asked_ns: HostNs | None = None

    def on_request(self, now: HostNs) -> None:
        """Note that a request was sent: arrivals alone are not used for a second, because its answer is better."""
        if self._asked_ns is None:
            self._asked_ns = now
            self._choose_line()

    @property
    def exchanges(self) -> ExchangeClock:
        """The estimate from exchanges."""
        return self._exchanges

    def on_exchange(self, exchange: ClockExchange) -> Segment | None:
        """Take an answered request. Returns the segment that it ended, if it did."""
        ended = self._insert(exchange)
        self._choose_line()
        return ended

    def _insert(self, exchange: ClockExchange) -> Segment | None:
        exchanges = self._exchanges
        before, segment, accepted = exchanges.line, exchanges.segment, exchanges.accepted
        self._answered = True
        if not exchanges.insert(exchange):
            return None
        if before is None or exchanges.segment == segment:
            if self._watch.departure_s > 0.0 and exchanges.accepted > accepted:
                self._watch.forgive()
            return None
        line = exchanges.line
        assert line is not None  # noqa: S101  (the segment has one)
        ended = self._ended(before, line)
        self.segments = [*self.segments[1 - SEGMENTS :], ended]
        self._watch.restart()
        return ended

    def on_arrival(self, stamp_ns: BootNs, arrival_ns: HostNs) -> bool:
        """Take an arrival. Returns whether it began to contradict the estimate from exchanges."""
        line = self._exchanges.line
        if line is None or not self._answered:
            self._arrivals.watch(stamp_ns, arrival_ns)
            self._arrivals.insert(stamp_ns, arrival_ns)
        contradicts = self._watch.insert(stamp_ns, arrival_ns, line)
        if line is None or self.line is not line or self._watch.departure_s > 0.0:
            self._choose_line()
        return contradicts

    def skip(self) -> None:
        """Forget the arrivals: the stamps continue far ahead of their expected values."""
        self._arrivals = ArrivalEnvelope(self._rate)
        self._watch.restart()
        self._choose_line()

    @property
    def in_doubt(self) -> bool:
        """Whether the line may be another than the one in use."""
        return self._exchanges.in_doubt or self._watch.departure_s > 0.0

    @property
    def wants_more(self) -> bool:
        """Whether more exchanges a second would help."""
        return self.in_doubt or self._exchanges.wants_more

    @property
    def by_exchanges(self) -> bool:
        """Whether the line in use is that of exchanges."""
        return self._exchanges.line is not None and self.line is self._exchanges.line

    def line_at(self, host_ns: HostNs) -> ClockLine | None:
        """The line that held at this host instant."""
        for segment in self.segments:
            if host_ns < segment.until_ns:
                return segment.line
        return self.line

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | None:
        """Host instant of an autopilot instant; None before there is an estimate."""
        for segment in self.segments:
            host_ns = segment.line.host_from_boot(boot_ns)
            if host_ns < segment.until_ns:
                return host_ns
        line = self.line
        return None if line is None else line.host_from_boot(boot_ns)

    def sigma_s(self, host_ns: HostNs) -> float:
        """One sigma of the offset at this host instant, seconds: infinite before there is an estimate."""
        line = self.line_at(host_ns) if self.segments else self.line
        if line is None:
            return inf
        variance = line.scatter(host_ns) + line.var_bias
        if self.segments:
            for segment in self.segments:
                if segment.agreed_ns < host_ns < segment.sure_ns:
                    variance += segment.step_s**2
            if host_ns < self.segments[-1].until_ns:
                return sqrt(variance)
        if line is not self._exchanges.line:
            return sqrt(variance + self._arrivals.late_s**2)
        exchanges, watch = self._exchanges, self._watch
        quiet_s = watch.quiet_s(host_ns, exchanges.newest_ns)
        return sqrt(variance + max(exchanges.suspect_s, watch.departure_s, quiet_s) ** 2)

    def bound_s(self, now: HostNs) -> float:
        """Bound of the offset's error, seconds; of an earlier segment its claim alone is left."""
        line = self.line_at(now)
        if line is None:
            return inf
        if line is not self.line:
            return BEYOND_DOUBT * self.sigma_s(now)
        if line is self._exchanges.line:
            return self._exchanges.bound_s(now) + self._doubt_s(now) - self._exchanges.suspect_s
        return max(self._arrivals.bound_s(now, line.offset_ns_at(now)), BEYOND_DOUBT * self.sigma_s(now))

    def _choose_line(self) -> None:
        """Use the line of exchanges, that of arrivals which outlived it, or that of arrivals alone."""
        exchanges = self._exchanges.line
        if exchanges is not None:
            self.line = self._outlived(exchanges) or exchanges
        else:
            self.line = None if self._awaits_exchanges else self._arrivals.line

    @property
    def _awaits_exchanges(self) -> bool:
        asked_ns, heard_ns = self._asked_ns, self._watch.heard_ns
        return asked_ns is not None and (heard_ns is None or heard_ns - asked_ns < AWAITED_NS)

    def _doubt_s(self, host_ns: HostNs) -> float:
        """The largest of what a suspect, the newest arrivals and a silence contradict, seconds."""
        exchanges, watch = self._exchanges, self._watch
        return max(exchanges.suspect_s, watch.departure_s, watch.quiet_s(host_ns, exchanges.newest_ns))

    def _outlived(self, line: ClockLine) -> ClockLine | None:
        """The line of arrivals, where exchanges stopped and arrivals contradict the last ones; else None."""
        watch, newest_ns = self._watch, self._exchanges.newest_ns
        if watch.departure_s == 0.0 or watch.heard_ns is None or newest_ns is None:
            return None
        if watch.heard_ns - newest_ns < OUTLIVED_NS:
            return None
        if self._answered:
            self._answered = False
            delay_ns = 0 if watch.least_ns is None else watch.least_ns
            self._arrivals = ArrivalEnvelope(self._rate)
            self._arrivals.least_delay_s = delay_ns * 1e-9
            self._arrivals.least_delay_sigma_s = min(LEAST_DELAY_SIGMA_S, 1e-3 + sqrt(line.var_bias))
        return self._arrivals.line

    def _ended(self, before: ClockLine, after: ClockLine) -> Segment:
        """The segment until the change: where the lines meet, between the last agreement and the first exchange."""
        sure_ns = self._exchanges.segment_ns
        agreed_ns = min(max(before.ref_host_ns, self._watch.agreed_ns or HostNs(0)), sure_ns)
        skew, until_ns = after.skew - before.skew, agreed_ns
        if skew != 0.0:
            meet_ns = sure_ns - (after.offset_ns_at(sure_ns) - before.offset_ns_at(sure_ns)) / skew
            until_ns = HostNs(round(meet_ns)) if agreed_ns < meet_ns < sure_ns else agreed_ns
        step_s = (after.offset_ns_at(until_ns) - before.offset_ns_at(until_ns)) * 1e-9
        return Segment(before, until_ns, agreed_ns, sure_ns, step_s, after.skew)

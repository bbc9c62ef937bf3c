"""Conversion between autopilot time and host time: ``host = boot + host_from_autopilot``.

Each link to the autopilot has an estimate: exchanges where they are answered, else arrivals alone, in one sequence of
segments. The one of least sigma is used.
"""

from __future__ import annotations

from math import inf, sqrt

import msgspec

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.arrivals import ArrivalEnvelope, ArrivalWatch
from fwav_companion.telemetry.clock.clock_line import LEAST_REPORTED_RATE, ClockLine
from fwav_companion.telemetry.clock.clock_news import ClockNews, ClockReports
from fwav_companion.telemetry.clock.exchange_clock import ExchangeClock
from fwav_companion.types import ClockEstimate, ClockExchange, ClockStatus, Reason, Unpaired

SETTLED_SIGMA_S = 2e-3
"""One sigma without the asymmetry of the delays up to which the clock counts as settled, s."""
MOST_LINKS = 8
SEGMENTS = 8
"""Most earlier segments kept: frames are paired within seconds, a clock that steps each second stays known."""
OUTLIVED_NS = 2 * NS_PER_S
"""Age of the last exchange from which arrivals are used where they contradict it: twenty requests were unanswered."""
AWAITED_NS = NS_PER_S
"""Time after the first request for which three exchanges are awaited: arrivals know the clock less well."""
BEYOND_DOUBT = 3.0
"""Least bound of an estimate without exchanges, in sigmas: arrivals give no hard bound."""

UNKNOWN = Unpaired(Reason.NO_CLOCK)


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


class LinkClock:
    """Estimate of the clock behind one link, now and at recent instants."""

    __slots__ = ("_answered", "_arrivals", "_asked_ns", "_rate", "_watch", "exchanges", "line", "segments")

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._arrivals = ArrivalEnvelope(rate)
        self._watch = ArrivalWatch()
        self._answered = False
        """Whether an exchange came since arrivals replaced exchanges."""
        self._asked_ns: HostNs | None = None
        self.exchanges = ExchangeClock()
        """The estimate from exchanges."""
        self.segments: list[Segment] = []
        """Earlier segments that are still known, the oldest first."""
        self.line: ClockLine | None = None
        """The line in use; None before there is an estimate. Kept, because each frame asks for it six times."""

    def on_request(self, now: HostNs) -> None:
        """Note that a request was sent: arrivals alone are not used for a second, because its answer is better."""
        if self._asked_ns is None:
            self._asked_ns = now
            self._choose_line()

    def on_exchange(self, exchange: ClockExchange) -> ClockLine | None:
        """Take an answered request. Returns the line that it ended, if it did."""
        exchanges, watch = self.exchanges, self._watch
        before, segment, ended = exchanges.line, exchanges.segment, None
        self._answered = True
        if exchanges.insert(exchange):
            if before is not None and exchanges.segment != segment:
                self.segments = [*self.segments[1 - SEGMENTS :], self._ended(before)]
                ended = before
            if ended is not None or watch.departure_s > 0.0:  # another line, or a queue that has grown
                watch.restart()
        self._choose_line()
        return ended

    def on_arrival(self, stamp_ns: BootNs, arrival_ns: HostNs) -> bool:
        """Take an arrival. Returns whether it began to contradict the estimate from exchanges."""
        line = self.exchanges.line
        if line is None or not self._answered:
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
        return self.exchanges.in_doubt or self._watch.departure_s > 0.0

    @property
    def wants_more(self) -> bool:
        """Whether more exchanges a second would help."""
        return self.exchanges.wants_more or self._watch.departure_s > 0.0

    @property
    def by_exchanges(self) -> bool:
        """Whether the line in use is that of exchanges."""
        return self.line is not None and self.line is self.exchanges.line

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
        return None if self.line is None else self.line.host_from_boot(boot_ns)

    def sigma_s(self, host_ns: HostNs) -> float:
        """One sigma of the offset at this host instant, seconds: infinite before there is an estimate."""
        line = self.line_at(host_ns) if self.segments else self.line
        if line is None:
            return inf
        variance = line.scatter(host_ns) + line.var_bias
        for segment in self.segments:
            if segment.agreed_ns < host_ns < segment.sure_ns:
                variance += segment.step_s**2
        if line is self.line:
            variance += self._doubt_s(host_ns) ** 2
        return sqrt(variance)

    def bound_s(self, now: HostNs) -> float:
        """Bound of the offset's error, seconds; of an earlier segment its claim alone is left."""
        line = self.line_at(now)
        if line is not None and line is self.exchanges.line:
            return self.exchanges.bound_s(now) + self._doubt_s(now)
        least = BEYOND_DOUBT * self.sigma_s(now)
        if line is None or line is not self.line:
            return least
        return max(self._arrivals.bound_s(now, line.offset_ns_at(now)), least)

    def _doubt_s(self, host_ns: HostNs) -> float:
        """The largest of what a suspect, the newest arrivals and a silence contradict of the line in use, seconds."""
        exchanges, watch = self.exchanges, self._watch
        if self.line is not exchanges.line:
            return self._arrivals.late_s
        return max(exchanges.suspect_s, watch.departure_s, watch.quiet_s(host_ns, exchanges.newest_ns))

    def _choose_line(self) -> None:
        """Use the line of exchanges, that of arrivals which outlived it, or that of arrivals alone."""
        line, heard_ns = self.exchanges.line, self._watch.heard_ns
        if line is None:
            awaited = self._asked_ns is not None and (heard_ns is None or heard_ns - self._asked_ns < AWAITED_NS)
            self.line = None if awaited else self._arrivals.line
        elif self._watch.departure_s > 0.0 and heard_ns is not None and heard_ns - line.ref_host_ns >= OUTLIVED_NS:
            if self._answered:
                self._answered = False
                self._arrivals = ArrivalEnvelope(self._rate)
                self._arrivals.expect_delay(self._watch.least_ns * 1e-9, sqrt(line.var_bias))
            self.line = self._arrivals.line or line
        else:
            self.line = line

    def _ended(self, before: ClockLine) -> Segment:
        """The segment until the change: where the lines meet, between the last agreement and the first exchange."""
        after, sure_ns = self.exchanges.line, self.exchanges.segment_ns
        assert after is not None  # noqa: S101  (the new segment has one)
        agreed_ns = min(max(before.ref_host_ns, self._watch.agreed_ns or HostNs(0)), sure_ns)
        skew, until_ns = after.skew - before.skew, agreed_ns
        if skew != 0.0:
            meet_ns = sure_ns - (after.offset_ns_at(sure_ns) - before.offset_ns_at(sure_ns)) / skew
            until_ns = HostNs(round(meet_ns)) if agreed_ns < meet_ns < sure_ns else agreed_ns
        step_s = (after.offset_ns_at(until_ns) - before.offset_ns_at(until_ns)) * 1e-9
        return Segment(before, until_ns, agreed_ns, sure_ns, step_s)


class Clock:
    """Clock estimate of the autopilot over each of its links; the one of least sigma is used."""

    __slots__ = ("_links", "_rate", "_reports", "_used")

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock from all arrivals of a recording, where it is not a crystal's."""
        self._rate = rate
        self.reset()

    def reset(self) -> None:
        """Forget everything: the autopilot's clock began again."""
        self._used = LinkClock(self._rate)
        self._links: dict[str, LinkClock] = {}
        self._reports = ClockReports()

    def on_request(self, now: HostNs) -> None:
        """Note that a request was sent: arrivals alone are not used while its answer is awaited, a second at most."""
        self._used.on_request(now)

    def on_exchange(self, exchange: ClockExchange) -> ClockNews | None:
        """Take an answered request. Returns a slip of the autopilot's clock, or its rate, when it is found."""
        link = self._link(exchange.link)
        news = self._reports.on_exchange(link.exchanges, link.on_exchange(exchange), exchange.received_ns)
        if len(self._links) > 1:
            self._used = min(self._links.values(), key=lambda one: one.sigma_s(exchange.received_ns))
        return news if link is self._used else None

    def on_arrival(self, stamp_ns: BootNs, arrival_ns: HostNs, link: str = "") -> bool:
        """Take the truncated stamp and the arrival of a message. Returns whether it began to contradict exchanges."""
        return (self._links.get(link) or self._link(link)).on_arrival(stamp_ns, arrival_ns)

    def skip(self) -> None:
        """Forget the arrivals: the stamps continue far ahead of their expected values."""
        for link in self._links.values():
            link.skip()

    @property
    def agreed(self) -> bool:
        """Whether three exchanges agreed on a link."""
        return any(link.exchanges.line is not None for link in self._links.values())

    @property
    def in_doubt(self) -> bool:
        """Whether the line may be another than the one in use."""
        return self._used.in_doubt

    @property
    def wants_more(self) -> bool:
        """Whether more exchanges a second would help."""
        return self._used.wants_more

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """Host instant of an autopilot instant; NO_CLOCK while nothing is known."""
        used = self._used
        if not used.segments:
            return UNKNOWN if used.line is None else used.line.host_from_boot(boot_ns)
        host_ns = used.host_from_boot(boot_ns)
        return UNKNOWN if host_ns is None else host_ns

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """Autopilot instant of a host instant; NO_CLOCK while nothing is known."""
        used = self._used
        line = used.line_at(host_ns) if used.segments else used.line
        return UNKNOWN if line is None else BootNs(host_ns - line.offset_ns_at(host_ns))

    def sigma_s_at(self, host_ns: HostNs) -> float:
        """One sigma of the offset at this host instant, seconds; infinite while nothing is known."""
        return self._used.sigma_s(host_ns)

    def rate_at(self, host_ns: HostNs) -> float:
        """Autopilot seconds per host second at this instant; 1 for a clock that is a crystal's."""
        used = self._used
        line = used.line_at(host_ns) if used.segments else used.line
        if line is None or abs(line.skew) <= LEAST_REPORTED_RATE or not line.differs:
            return 1.0
        return 1.0 - line.skew

    def estimate(self, now: HostNs) -> ClockEstimate:
        """Clock estimate at this host instant; status UNKNOWN has infinite sigma and bound."""
        used = self._used
        line = used.line_at(now)
        return ClockEstimate(
            at_ns=now,
            host_from_autopilot_ns=0 if line is None else line.offset_ns_at(now),
            skew=0.0 if line is None else line.skew,
            sigma_s=used.sigma_s(now),
            bound_s=used.bound_s(now),
            round_trip_s=used.exchanges.best_trip_s if used.by_exchanges else None,
            status=self._status(line, now),
            asymmetry_s=0.0 if line is None else sqrt(line.var_bias),
            rate_differs=line is not None and line.differs,
        )

    def _status(self, line: ClockLine | None, now: HostNs) -> ClockStatus:
        used = self._used
        if line is None:
            return ClockStatus.UNKNOWN
        if not used.by_exchanges:
            return ClockStatus.ARRIVALS
        if used.exchanges.changed:
            return ClockStatus.FOLLOWED
        settled = not used.in_doubt and sqrt(line.scatter(now)) <= SETTLED_SIGMA_S
        return ClockStatus.SETTLED if settled else ClockStatus.SETTLING

    def _link(self, name: str) -> LinkClock:
        """Estimate of a link, begun where it is new; the first link's is the one in use."""
        link = self._links.get(name)
        if link is None:
            if len(self._links) >= MOST_LINKS:
                return self._used
            link = self._links[name] = LinkClock(self._rate) if self._links else self._used
        return link

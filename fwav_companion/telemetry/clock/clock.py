"""Conversion between autopilot time and host time: ``host = boot + host_from_autopilot``."""

from __future__ import annotations

from math import inf, sqrt

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.clock_line import ClockLine
from fwav_companion.telemetry.clock.clock_news import LEAST_REPORTED_RATE, ClockNews, ClockReports, is_notable
from fwav_companion.telemetry.clock.link_clock import LinkClock
from fwav_companion.types import ClockEstimate, ClockExchange, ClockStatus, Reason, Unpaired

SETTLED_SIGMA_S = 2e-3
"""One sigma without the asymmetry of the delays up to which the clock counts as settled, s."""
MOST_LINKS = 8

UNKNOWN = Unpaired(Reason.NO_CLOCK)


class Clock:
    """Clock estimate of the autopilot over each of its links; the one of least sigma is used."""

    __slots__ = ("_links", "_rate", "_reports", "_used")

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock from all arrivals of a recording, where it is not a crystal's."""
        self._rate = rate
        self._used = LinkClock(rate)
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

    def reset(self) -> None:
        """Forget everything: the autopilot's clock began again."""
        self._used, self._links, self._reports = LinkClock(self._rate), {}, ClockReports()

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
        if line is None or abs(line.skew) <= LEAST_REPORTED_RATE or not is_notable(line):
            return 1.0
        return 1.0 - line.skew

    def estimate(self, now: HostNs) -> ClockEstimate:
        """Clock estimate at this host instant; status UNKNOWN has infinite sigma and bound."""
        used = self._used
        line = used.line_at(now)
        if line is None:
            return _unknown(now)
        exchanges = used.exchanges if used.by_exchanges else None
        sigma_s = used.sigma_s(now)
        return ClockEstimate(
            at_ns=now,
            host_from_autopilot_ns=line.offset_ns_at(now),
            skew=line.skew,
            sigma_s=sigma_s,
            bound_s=used.bound_s(now),
            round_trip_s=None if exchanges is None else exchanges.best_trip_s,
            status=self._status(line, now),
            asymmetry_s=sqrt(line.var_bias),
            rate_differs=is_notable(line),
        )

    def _status(self, line: ClockLine, now: HostNs) -> ClockStatus:
        used = self._used
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


def _unknown(now: HostNs) -> ClockEstimate:
    return ClockEstimate(
        at_ns=now,
        host_from_autopilot_ns=0,
        skew=0.0,
        sigma_s=inf,
        bound_s=inf,
        round_trip_s=None,
        status=ClockStatus.UNKNOWN,
    )

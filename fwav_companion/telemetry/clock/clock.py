"""Conversion between autopilot time and host time: ``host = boot + host_from_autopilot``."""

from __future__ import annotations

from math import hypot, inf

from fwav_companion.geometry.stamps import NS_PER_S, BootNs, HostNs
from fwav_companion.telemetry.clock.arrivals import ArrivalEnvelope
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine
from fwav_companion.telemetry.clock.clock_news import ClockNews, ClockReports
from fwav_companion.telemetry.clock.exchanges import ExchangeFit
from fwav_companion.telemetry.clock.followed import FollowedClock
from fwav_companion.telemetry.clock.hard_bound import Exchange, exchange_from
from fwav_companion.types import ClockEstimate, ClockExchange, ClockStatus, Reason, Unpaired

EXCHANGES_FOR_TRUST = 3
"""Least number of exchanges for an estimate from them: with fewer, the envelope of arrivals is better."""
EXCHANGES_WHEN_SETTLED = 20
SETTLED_SIGMA_S = 2e-3
EXCHANGES_OUTLIVED_S = 120.0
"""Age of the last exchange from which arrivals are better, s: at 600 ppm the bound has then grown by 72 ms."""
FOLLOWED_OUTLIVED_NS = 10 * NS_PER_S
"""Age of a followed clock's last exchange from which arrivals are used: at 1 % its offset has then moved by 100 ms, and
arrivals are as good."""
EXCHANGES_BEFORE = 64
"""Number of exchanges before a contradiction from which the follower starts."""

BEYOND_DOUBT = 3.0
"""Least bound of an estimate from arrivals, in sigmas: arrivals give no hard bound, and the sigma covers a least delay
that wanders."""

UNKNOWN = Unpaired(Reason.NO_CLOCK)


class Clock:
    """Clock estimate from TIMESYNC exchanges where requests are answered, else from arrivals alone.

    While exchanges agree to 600 ppm, as two crystals do, a line through two minutes of them is the estimate. A clock
    that leaves this range is followed exchange by exchange until it has stayed within the range for 20 s.
    """

    __slots__ = ("_arrivals", "_basis", "_exchanges", "_followed", "_rate", "_reports")

    def __init__(self, rate: float = 1.0) -> None:
        """``rate``: rate of the autopilot's clock from all arrivals of a recording, where it is not a crystal's."""
        self._rate = rate
        self._exchanges = ExchangeFit()
        self._arrivals = ArrivalEnvelope(rate)
        self._followed: FollowedClock | None = None
        self._reports = ClockReports()
        self._basis: FollowedClock | ClockLine | None = None
        """Estimate in use until the next exchange or arrival; None until the next query chooses it."""

    def on_exchange(self, exchange: ClockExchange) -> ClockNews | None:
        """Take an answered request. Returns a slip of the autopilot's clock, or its rate, when it is found."""
        entry = exchange_from(exchange)
        if entry is None:
            return None
        self._basis = None
        if self._followed is None:
            if self._exchanges.insert(entry):
                self._follow()
            return None
        self._followed.insert(entry)
        calm = self._followed.calm()
        if calm is not None:
            self._unfollow(calm)
            return self._reports.on_calm()
        return self._reports.on_followed(self._followed)

    def on_arrival(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Take the truncated stamp and the arrival of a message."""
        self._basis = None
        self._arrivals.insert(stamp_ns, arrival_ns)

    def skip(self) -> None:
        """Forget the arrivals: the stamps continue far ahead of their expected values."""
        self._arrivals, self._basis = ArrivalEnvelope(self._rate), None

    def reset(self) -> None:
        """Forget everything: the autopilot's clock began again."""
        self._exchanges = ExchangeFit()
        self._arrivals = ArrivalEnvelope(self._rate)
        self._followed = self._basis = None
        self._reports = ClockReports()

    @property
    def in_doubt(self) -> bool:
        """Whether more exchanges would help: they are few since the start or a change of skew, they contradict one
        another, or the clock is followed.
        """
        if self._followed is not None or self._exchanges.contradicting:
            return True
        return self._exchanges.count < EXCHANGES_WHEN_SETTLED or self._exchanges.in_doubt

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """Host instant of an autopilot instant; NO_CLOCK while nothing is known."""
        basis = self._basis or self._chosen()
        return UNKNOWN if basis is None else basis.host_from_boot(boot_ns)

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """Autopilot instant of a host instant; NO_CLOCK while nothing is known."""
        basis = self._basis or self._chosen()
        if basis is None:
            return UNKNOWN
        offset_ns = basis.offset_ns_at(host_ns) if isinstance(basis, ClockLine) else basis.offset_at(host_ns)[0]
        return BootNs(host_ns - offset_ns)

    def sigma_s_at(self, host_ns: HostNs) -> float:
        """One sigma of the offset at this host instant, seconds; infinite while nothing is known."""
        basis = self._basis or self._chosen()
        if basis is None:
            return inf
        return self._line_sigma_s(basis, host_ns) if isinstance(basis, ClockLine) else basis.offset_at(host_ns)[2]

    def rate_at(self, host_ns: HostNs) -> float:
        """Autopilot seconds per host second at this instant; 1 for a clock that is a crystal's."""
        basis = self._basis or self._chosen()
        if isinstance(basis, FollowedClock):
            return 1.0 - basis.offset_at(host_ns)[1]
        return 1.0 if basis is None or abs(basis.skew) <= MOST_SKEW else 1.0 - basis.skew

    def estimate(self, now: HostNs) -> ClockEstimate:
        """Clock estimate at this host instant; status UNKNOWN has infinite sigma and bound."""
        followed = self._answering
        if followed is not None:
            return self._followed_estimate(followed, now)
        line = self._line()
        return _unknown(now) if line is None else self._line_estimate(line, now)

    def _line_estimate(self, line: ClockLine, now: HostNs) -> ClockEstimate:
        offset_ns, sigma_s = line.offset_ns_at(now), self._line_sigma_s(line, now)
        if line is self._arrivals.line:
            return ClockEstimate(
                at_ns=now,
                host_from_autopilot_ns=offset_ns,
                skew=line.skew,
                sigma_s=sigma_s,
                bound_s=max(self._arrivals.bound_s(now, offset_ns), BEYOND_DOUBT * sigma_s),
                round_trip_s=None,
                status=ClockStatus.ARRIVALS,
            )
        settled = not self.in_doubt and sigma_s <= SETTLED_SIGMA_S
        return ClockEstimate(
            at_ns=now,
            host_from_autopilot_ns=offset_ns,
            skew=line.skew,
            sigma_s=sigma_s,
            bound_s=self._exchanges.bound_s(now, offset_ns),
            round_trip_s=self._exchanges.best_round_trip_s,
            status=ClockStatus.SETTLED if settled else ClockStatus.SETTLING,
        )

    def _followed_estimate(self, followed: FollowedClock, now: HostNs) -> ClockEstimate:
        offset_ns, skew, sigma_s = followed.offset_at(now)
        return ClockEstimate(
            at_ns=now,
            host_from_autopilot_ns=offset_ns,
            skew=skew,
            sigma_s=sigma_s,
            bound_s=followed.bound_s(now, offset_ns),
            round_trip_s=followed.best_round_trip_s,
            status=ClockStatus.FOLLOWED,
        )

    def _chosen(self) -> FollowedClock | ClockLine | None:
        """Estimate to use now; None while nothing is known."""
        self._basis = self._answering or self._line()
        return self._basis

    @property
    def _answering(self) -> FollowedClock | None:
        """The follower, unless its exchanges are so old that arrivals are as good; None without one."""
        arrivals, followed = self._arrivals.line, self._followed
        if followed is None or arrivals is None:
            return followed
        silent_ns = arrivals.ref_host_ns - followed.newest.host_ns
        return followed if silent_ns <= FOLLOWED_OUTLIVED_NS else None

    def _follow(self) -> None:
        before = self._exchanges.newest(EXCHANGES_BEFORE)
        self._followed = FollowedClock(before, self._exchanges.contradicting)
        self._reports.on_left(self._followed)

    def _unfollow(self, calm: list[Exchange]) -> None:
        self._followed, self._exchanges = None, ExchangeFit()
        for entry in calm:
            self._exchanges.insert(entry)

    def _line_sigma_s(self, line: ClockLine, host_ns: HostNs) -> float:
        """One sigma of the line's offset, the contradiction by the newest arrivals or exchanges included, seconds."""
        if line is self._arrivals.line:
            return hypot(line.sigma_s(host_ns), self._arrivals.late_s)
        if not self._exchanges.contradicting:
            return line.sigma_s(host_ns)
        return hypot(line.sigma_s(host_ns), self._exchanges.contradiction_s(line.offset_ns_at(host_ns)))

    def _line(self) -> ClockLine | None:
        exchanges, arrivals = self._exchanges.line, self._arrivals.line
        if exchanges is None or arrivals is None:
            return exchanges or arrivals
        if self._exchanges.count < EXCHANGES_FOR_TRUST:
            return arrivals
        silent_s = (arrivals.ref_host_ns - exchanges.ref_host_ns) * 1e-9
        return arrivals if silent_s > EXCHANGES_OUTLIVED_S else exchanges


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

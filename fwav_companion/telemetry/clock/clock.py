"""Autopilot time and host time in terms of one another: ``host = boot + host_from_autopilot``."""

from __future__ import annotations

from math import inf

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.telemetry.clock.arrivals import ArrivalEnvelope
from fwav_companion.telemetry.clock.clock_line import ClockLine
from fwav_companion.telemetry.clock.exchanges import ExchangeFit
from fwav_companion.types import ClockEstimate, ClockExchange, ClockStatus, Reason, Unpaired

EXCHANGES_FOR_TRUST = 3
"""With fewer exchanges the envelope of arrivals is better."""
EXCHANGES_WHEN_SETTLED = 20
SETTLED_SIGMA_S = 2e-3
EXCHANGES_OUTLIVED_S = 120.0
"""At 600 ppm the bound has then grown by 72 ms, and arrivals are better."""

BEYOND_DOUBT = 3.0
"""Sigmas: arrivals give no hard bound, and the sigma covers a least delay that wanders."""

UNKNOWN = Unpaired(Reason.NO_CLOCK)


class Clock:
    """Clock estimate by TIMESYNC exchanges where they are answered, else by arrivals alone."""

    __slots__ = ("_arrivals", "_exchanges")

    def __init__(self) -> None:
        self._exchanges = ExchangeFit()
        self._arrivals = ArrivalEnvelope()

    def on_exchange(self, exchange: ClockExchange) -> bool:
        """Take an answered request. Returns True where the autopilot's clock has begun again, and this estimate with
        it.
        """
        began_anew = self._exchanges.insert(exchange)
        if began_anew:
            self._arrivals = ArrivalEnvelope()
        return began_anew

    def on_arrival(self, stamp_ns: BootNs, arrival_ns: HostNs) -> None:
        """Take the truncated stamp and the arrival of a message."""
        self._arrivals.insert(stamp_ns, arrival_ns)

    def reset(self) -> None:
        """Forget everything: the autopilot's clock began again."""
        self._exchanges = ExchangeFit()
        self._arrivals = ArrivalEnvelope()

    @property
    def in_doubt(self) -> bool:
        """Whether more exchanges would help: they are few since the start or a change of skew, or contradict one
        another.
        """
        return self._exchanges.count < EXCHANGES_WHEN_SETTLED or self._exchanges.in_doubt

    def host_from_boot(self, boot_ns: BootNs) -> HostNs | Unpaired:
        """Host instant of an autopilot instant; NO_CLOCK while nothing is known."""
        line = self._line()
        return UNKNOWN if line is None else line.host_from_boot(boot_ns)

    def boot_from_host(self, host_ns: HostNs) -> BootNs | Unpaired:
        """Autopilot instant of a host instant; NO_CLOCK while nothing is known."""
        line = self._line()
        return UNKNOWN if line is None else BootNs(host_ns - line.offset_ns_at(host_ns))

    def estimate(self, now: HostNs) -> ClockEstimate:
        """Clock estimate at this host instant; status UNKNOWN has infinite sigma and bound."""
        line = self._line()
        if line is None:
            return ClockEstimate(
                at_ns=now,
                host_from_autopilot_ns=0,
                skew=0.0,
                sigma_s=inf,
                bound_s=inf,
                round_trip_s=None,
                status=ClockStatus.UNKNOWN,
            )
        offset_ns = line.offset_ns_at(now)
        if line is self._arrivals.line:
            sigma_s = line.sigma_s(now)
            bound_s = max(self._arrivals.bound_s(now, offset_ns), BEYOND_DOUBT * sigma_s)
            return ClockEstimate(
                at_ns=now,
                host_from_autopilot_ns=offset_ns,
                skew=line.skew,
                sigma_s=sigma_s,
                bound_s=bound_s,
                round_trip_s=None,
                status=ClockStatus.ARRIVALS,
            )
        sigma_s = line.sigma_s(now)
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

    def _line(self) -> ClockLine | None:
        exchanges, arrivals = self._exchanges.line, self._arrivals.line
        if exchanges is None or arrivals is None:
            return exchanges or arrivals
        if self._exchanges.count < EXCHANGES_FOR_TRUST:
            return arrivals
        silent_s = (arrivals.ref_host_ns - exchanges.ref_host_ns) * 1e-9
        return arrivals if silent_s > EXCHANGES_OUTLIVED_S else exchanges

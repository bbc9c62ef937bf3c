"""The exchanges of one segment and the line through them: what is kept, how it is fitted, when it bends.

From eight exchanges on the line is the middle of the widest band between their bounds (``envelopes``); before, and for
the errors of single exchanges, it is the fit weighted by round trips (``exchange_fit``). Seconds from a common
reference.
"""

from __future__ import annotations

from math import hypot, sqrt

from fwav_companion.telemetry.clock.clock_line import MOST_SKEW
from fwav_companion.telemetry.clock.envelopes import Band, Envelopes, widest_band
from fwav_companion.telemetry.clock.exchange_fit import FLOOR_S, Exchange, Line, fit_line

IN_AGREEMENT = 3
"""Number of exchanges that agree by chance in few cases: fewer are no evidence of a line."""
MOST_KEPT, LEAST_KEPT = 64, 6
WINDOW_S = 60.0
RATE_SIGMA, CHANGED_RATE_SIGMA = 100e-6, 0.5
"""Scale of the rate before it is measured: of two crystals, and of a clock that was seen to change its rate."""
WANDER, CHANGED_WANDER = 2e-6, 1e-2
"""One sigma of the change of the rate since the newest exchange: temperature; a simulator under a varying load."""
GATE_SIGMAS, GATE_S = 4.0, 1.5e-3
CALM_S = 3.0
"""Time after a change from which the clock may be a crystal's again, s."""
REACH, CHANGED_REACH = 2e-3, 0.7
"""Largest difference of a new rate from the last one: of crystals, a host's slew included, and of other clocks."""
NEWEST = (3, 4, 6, 8, 12, 16, 24, 32)
"""Numbers of newest exchanges that are tried as the only ones on a new line."""
CHANGED = 10.0
"""Log-likelihood that two lines gain on one from which the older exchanges are dropped: 20 000 to one, because every
exchange tests it again."""
TRIED = 0.5
"""Log-likelihood that one exchange costs from which new lines are tried at all."""
LONE = 40.0
"""Log-likelihood that one exchange costs from which it is a suspect, though its residual is within the gate."""
LEAST_WIDTH = 0.3
"""Width of a band of suspects, in least round trips, from which they are on one line."""
LEAST_FOR_BAND = 8
"""Number of exchanges from which their bounds show how dense they lie; before, the fit weighted by trips counts."""
CERTAIN_SIGMAS = 5.0
"""Sigmas by which the rate of a few exchanges must lie beyond a crystal's."""
ENOUGH, MOST_ASKED = 20, 200
"""Number of exchanges in a fit from which one a second is enough, where they know the offset to NARROW_S; and in any
case: a jitter of 60 ms is never known as well."""
NARROW_S = 0.7e-3
"""One sigma of the offset, s: behind a jitter of 10 ms each way, one exchange a second finds a rate of 600 ppm in 20 s,
with errors of 2 ms on the way."""
LEAST_APART_S = 0.08
"""Least time between two exchanges whose round trips limit the rate error."""
NO_LINE: Line = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""What is known before the first fit: no rate was shown."""


class ExchangeWindow:
    """At least three exchanges that agree, and the line through them."""

    __slots__ = ("_accepted", "_band", "_fit_t", "_weighted", "changed", "fit", "is_bent", "kept", "segment_t")

    def __init__(self, exchanges: list[Exchange], *, changed: bool) -> None:
        """``changed``: whether the rate may differ from a crystal's."""
        self.kept = exchanges
        self.changed = changed
        """Whether the rate differs from a crystal's, or was just seen to change."""
        self.segment_t = exchanges[0].t
        """Beginning of the segment, or of the last change of its rate."""
        self.is_bent = False
        """Whether the line had to forget older exchanges at the newest one."""
        self._accepted = len(exchanges)
        self._band: Band | None = None
        self._fit_t = exchanges[-1].t
        """Instant to which the fit refers."""
        self.fit = self._weighted = NO_LINE
        self._refit(None)

    @property
    def newest(self) -> Exchange:
        """The newest exchange, to whose instant :attr:`fit` refers."""
        return self.kept[-1]

    @property
    def in_doubt(self) -> bool:
        """Whether the line is young, or had to change."""
        return self.changed or self.is_bent or len(self.kept) < ENOUGH

    @property
    def is_wide(self) -> bool:
        """Whether more exchanges a second would make the offset better known."""
        return self._accepted < MOST_ASKED and self.fit[2] > NARROW_S**2

    @property
    def least_trip(self) -> float:
        """Least round trip of the exchanges in use."""
        return min([entry.trip for entry in self.kept])

    @property
    def least_delays(self) -> float:
        """Least delays of both directions together: no exchange need have been fast both ways."""
        return self.least_trip if self._band is None else max(0.0, self._band.width)

    @property
    def wander(self) -> float:
        """One sigma of the change of the rate since the newest exchange."""
        return CHANGED_WANDER if self.changed else WANDER

    def accept(self, exchanges: list[Exchange]) -> None:
        """Fit these exchanges, the newest last."""
        self.kept = exchanges
        self._accepted += 1
        if self.changed:
            self._settle()
        self._refit(self.fit)

    def begin_line(self, since: list[Exchange]) -> bool:
        """Drop all but these exchanges, if they are on one line. Returns whether they are."""
        if self.changed:
            return False
        least = min(entry.trip for entry in (*self.kept, *since))
        if widest_band(since, self.fit[1], MOST_SKEW, self.fit[1], REACH).width <= LEAST_WIDTH * least:
            return False
        self.kept = since
        self._bound()
        self._band, self.fit = None, NO_LINE
        self._refit(None)
        self.is_bent = True
        return True

    def predicted(self, t: float) -> float:
        """Offset of the line at an instant."""
        return self.fit[0] + self.fit[1] * (t - self._fit_t)

    def gate(self, entry: Exchange) -> float:
        """Largest residual of an exchange that agrees with the line."""
        # The scatter of the weighted fit, which knows the errors of single exchanges; the band is surer than those.
        _, _, c00, c01, c11, jitter = self._weighted
        dt = entry.t - self._fit_t
        scatter = max(0.0, c00 + dt * (2.0 * c01 + dt * (c11 + self.wander**2)))
        sigma = sqrt(scatter + FLOOR_S**2 + jitter**2)
        return GATE_SIGMAS * sigma + GATE_S + 0.5 * abs(entry.trip - self.least_trip) + entry.beside

    def narrowed_by(self, entry: Exchange) -> float:
        """By how much this exchange narrows the band beyond chance; 0 where it does not."""
        band = self._band
        if band is None or self.changed or not band.is_entered_by(entry, entry.t - self._fit_t):
            return 0.0
        narrower = self._widest([*self.kept, entry])
        return band.width - narrower.width if narrower.worse_by(band.width) > LONE else 0.0

    def bound(self, t: float) -> float:
        """Bound of the line's error: the tightest of the exchanges' intervals, each widened by its age."""
        skew, pace = (self.fit[1], self._largest_rate_error()) if self.changed else (0.0, MOST_SKEW)
        offset = self.predicted(t)
        rooms = [
            abs(offset - entry.offset - skew * (t - entry.t)) + 0.5 * entry.trip + pace * abs(t - entry.t)
            for entry in self.kept
        ]
        return min(rooms)

    def _settle(self) -> None:
        """Treat the clock as a crystal's again once its rate has been within the range of one for CALM_S."""
        calm = self.newest.t - self.segment_t >= CALM_S
        if calm and abs(self.fit[1]) < MOST_SKEW + sqrt(self.fit[4]) < 2.0 * MOST_SKEW:
            self.changed = False

    def _refit(self, last: Line | None) -> None:
        """Fit the line; ``last``: the line before the newest exchange, which shows the jitter."""
        self._bound()
        self.is_bent = False
        fit = self._fitted(last)
        if not self.changed and len(self.kept) <= ENOUGH and self._has_changed_rate():
            fit = self._fitted(None)
        self.fit, self._weighted, self._fit_t = fit, fit, self.newest.t
        if len(self.kept) < LEAST_FOR_BAND:
            return
        envelopes = self._envelopes(self.kept)
        band = self._widest_between(envelopes)
        if self._band is not None and band.worse_by(self._band.width) > TRIED:
            band = self._without_older(band)
            envelopes = self._envelopes(self.kept)
        self._band = band
        if len(self.kept) >= LEAST_FOR_BAND:  # fewer do not show how dense their bounds lie
            covariance = envelopes.covariance(band)
            self.fit = (band.offset, band.skew, *covariance, self._weighted[5])

    def _envelopes(self, exchanges: list[Exchange]) -> Envelopes:
        """The bounds of these exchanges under the rate's prior."""
        return Envelopes(exchanges, *self._rate_prior())

    def _widest_between(self, envelopes: Envelopes) -> Band:
        return envelopes.widest(self.fit[1], CHANGED_REACH if self.changed else REACH)

    def _widest(self, exchanges: list[Exchange]) -> Band:
        return self._widest_between(self._envelopes(exchanges))

    def _without_older(self, band: Band) -> Band:
        """The band without the exchanges before a change of the rate, where two lines are likelier than one."""
        step, reach = (CHANGED_RATE_SIGMA, CHANGED_REACH) if self.changed else (MOST_SKEW, REACH)
        while len(self.kept) > LEAST_KEPT:
            most = self.least_trip  # no band is wider
            gains = {}
            for k in NEWEST:
                if k > len(self.kept) - IN_AGREEMENT:
                    break
                older = min(most, self._widest(self.kept[:-k]).width)
                newer = min(most, widest_band(self.kept[-k:], band.skew, step, band.skew, reach).width)
                gains[k] = ((len(self.kept) - k) * (older - band.width) + k * (newer - band.width)) / band.tail
            best = max(gains, key=lambda k: gains[k], default=0)
            if not best or gains[best] < CHANGED:
                break
            self.is_bent = True
            del self.kept[:-best]
            self.fit = self._weighted = self._fitted(None)
            band = self._widest(self.kept)
        return band

    def _rate_prior(self) -> tuple[float, float]:
        """Mean and scale of the skew."""
        if self.changed:
            return _chord(self.kept), CHANGED_RATE_SIGMA
        # Many exchanges that show a rate widen the prior, which would hold a crystal at its edge back for ever.
        return 0.0, hypot(RATE_SIGMA, self.fit[1] if len(self.kept) > ENOUGH else 0.0)

    def _fitted(self, last: Line | None) -> Line:
        skew, sigma = self._rate_prior()
        return fit_line(self.kept, sigma, skew, last)

    def _has_changed_rate(self) -> bool:
        """Find whether the exchanges show a rate beyond a crystal's, and remember it."""
        if len(self.kept) >= LEAST_KEPT:
            free = fit_line(self.kept, CHANGED_RATE_SIGMA, _chord(self.kept), None)
            self.changed = abs(free[1]) - MOST_SKEW > CERTAIN_SIGMAS * sqrt(free[4])
            if self.changed:
                self.segment_t = self.newest.t
        return self.changed

    def _bound(self) -> None:
        """Drop what is older than the window; beyond MOST_KEPT, that of the older half whose bounds are the widest."""
        kept = self.kept
        oldest = kept[-1].t - WINDOW_S
        while len(kept) > LEAST_KEPT and kept[0].t < oldest:
            del kept[0]
        if len(kept) > MOST_KEPT:
            del kept[max(range(len(kept) // 2), key=lambda k: self._room(kept[k]))]

    def _room(self, entry: Exchange) -> float:
        """Distance of the nearer of an exchange's two bounds from the line."""
        return 0.5 * entry.trip - abs(entry.offset - self.predicted(entry.t))

    def _largest_rate_error(self) -> float:
        """Largest difference from the line's skew that two consecutive exchanges allow, s/s."""
        largest, earlier = MOST_SKEW, self.kept[0]
        for entry in self.kept[1:]:
            between = entry.t - earlier.t
            if between >= LEAST_APART_S:
                moved = abs(entry.offset - earlier.offset - self.fit[1] * between)
                largest = max(largest, (moved + 0.5 * (entry.trip + earlier.trip)) / between)
                earlier = entry
        return largest


def _chord(exchanges: list[Exchange]) -> float:
    """Skew between the first and the last exchange."""
    return (exchanges[-1].offset - exchanges[0].offset) / (exchanges[-1].t - exchanges[0].t)

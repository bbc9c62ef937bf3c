"""Estimates offset and rate from TIMESYNC exchanges: lock, fit over a bounded window, gate, and new segments.

An exchange that disagrees is a suspect: noise once, a step when three agree (the popcorn filter of NTP, RFC 5905).
Until this is decided the claim contains both hypotheses.
"""

from __future__ import annotations

from math import hypot, sqrt

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine
from fwav_companion.telemetry.clock.envelopes import Band, Envelopes, widest_band
from fwav_companion.telemetry.clock.exchange_fit import (
    FLOOR_S,
    Exchange,
    Line,
    fit_line,
    in_agreement,
    in_line,
)
from fwav_companion.types import ClockExchange

IN_AGREEMENT = 3
IN_LINE = 5
"""Number of exchanges on one line that lock a clock whose rate is not a crystal's, where no earlier rate was known:
a line through two of three exchanges with random errors of 100 ms meets the third one in 4 % of the cases."""
MOST_UNLOCKED = 12
MOST_KEPT = 64
WINDOW_S = 60.0
RATE_SIGMA, CHANGED_RATE_SIGMA = 100e-6, 0.5
"""One sigma of the rate before it is measured: of two crystals, and of a clock that was seen to change its rate."""
WANDER, CHANGED_WANDER = 2e-6, 1e-2
"""One sigma of the change of the rate since the newest exchange: temperature; a simulator under a varying load."""
SLOWEST_RATE, FASTEST_RATE = 0.1, 10.0
"""Range of rates: a simulator runs at a tenth of real time on a slow computer, at ten times where configured so."""
FASTEST, SLOWEST = 1.0 - FASTEST_RATE, 1.0 - SLOWEST_RATE
MOST_RATE_STEP = 0.6
"""Largest change of the rate that three exchanges show; a larger one needs IN_LINE of them."""
GATE_SIGMAS, GATE_S = 4.0, 1.5e-3
MOST_SUSPECTS = 6
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
RECENT_S = 10.0
"""Time for which a suspect counts as evidence of another line."""
AGREEING = 2
"""Number of exchanges within the gate that narrow the band, from which they are no lone errors."""
LEAST_WIDTH = 0.3
"""Width of a band of suspects, in least round trips, from which they are on one line."""
LEAST_KEPT = 6
LEAST_FOR_BAND = 8
"""Number of exchanges from which their bounds show how dense they lie; before, the fit weighted by trips counts."""
CERTAIN_SIGMAS = 5.0
"""Sigmas by which the rate of a few exchanges must lie beyond a crystal's."""
ENOUGH = 20
"""Number of exchanges in a fit from which one a second is enough."""
LEAST_APART_S = 0.08
"""Least time between two exchanges whose round trips limit the rate error."""


class ExchangeClock:
    """Clock estimate of one link from its exchanges; :attr:`line` is None until three of them agree."""

    __slots__ = (
        "_band",
        "_fit",
        "_fit_t",
        "_is_bent",
        "_kept",
        "_recent",
        "_ref_host_ns",
        "_ref_offset_ns",
        "_suspects",
        "_weighted",
        "accepted",
        "best_trip_s",
        "changed",
        "line",
        "newest_ns",
        "segment",
        "segment_t",
        "suspect_s",
    )

    def __init__(self) -> None:
        self._kept: list[Exchange] = []
        self._suspects: list[Exchange] = []
        self._recent: list[Exchange] = []
        """Exchanges of the last RECENT_S that contradict the line: suspects, and those that narrow the band."""
        self._band: Band | None = None
        self._fit: Line | None = None
        self._weighted: Line = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        """The fit weighted by round trips."""
        self._fit_t = 0.0
        """Time of the newest exchange of the fit."""
        self._ref_host_ns: HostNs | None = None
        self._ref_offset_ns = 0
        self._is_bent = False
        """Whether the line had to forget older exchanges at the newest one."""
        self.line: ClockLine | None = None
        self.segment = 0
        """Number of steps so far: it grows with each new segment."""
        self.segment_t = 0.0
        """Beginning of the segment, seconds since the first exchange."""
        self.accepted = 0
        """Number of exchanges that agreed with the segment."""
        self.changed = False
        """Whether the rate differs from a crystal's, or was just seen to change."""
        self.suspect_s = 0.0
        """What the newest suspect contradicts, seconds; 0 without one."""
        self.newest_ns: HostNs | None = None
        """Middle of the newest exchange that was used."""
        self.best_trip_s: float | None = None
        """Least round trip of the exchanges in use, seconds."""

    def insert(self, answered: ClockExchange) -> bool:
        """Take one exchange. Returns whether the line changed."""
        entry = self._entry(answered)
        if entry is None:
            return False
        if self.line is None:
            return self._insert_unlocked(entry)
        if self._kept and entry.t <= self._kept[-1].t:  # it overtook another
            return False
        residual = entry.offset - self._predicted(entry.t)
        if abs(residual) <= self._gate(entry):
            narrowed_s = self._narrowed_by(entry)
            if narrowed_s > 0.0:
                self._remember(entry)
                if len(self._recent) < AGREEING:
                    self.suspect_s = narrowed_s
                    return False
                self._kept = self._with_recent(self._kept)
            else:
                self._kept.append(entry)
            self.accepted += 1
            self._suspects.clear()
            self.suspect_s = 0.0
            if self.changed:
                self._settle(entry)
            self._refit()
            return True
        self._suspects = [*self._suspects[1 - MOST_SUSPECTS :], entry]
        self.suspect_s = abs(residual)
        self._remember(entry)
        return self._begin_segment() or self._begin_line()

    @property
    def segment_ns(self) -> HostNs:
        """First exchange of the segment."""
        assert self._ref_host_ns is not None  # noqa: S101  (there was an exchange)
        return HostNs(self._ref_host_ns + round(self.segment_t * NS_PER_S))

    @property
    def in_doubt(self) -> bool:
        """Whether more exchanges would help."""
        doubted = self.changed or self._is_bent or bool(self._suspects)
        return self.line is None or doubted or len(self._kept) < ENOUGH

    def sigma_s(self, host_ns: HostNs) -> float:
        """One sigma of the offset, seconds, suspects included."""
        line = self.line
        assert line is not None  # noqa: S101  (callers asked)
        return sqrt(line.scatter(host_ns) + line.var_bias + self.suspect_s**2)

    def bound_s(self, now: HostNs) -> float:
        """Bound of the offset's error, seconds: the tightest of the exchanges' intervals, each widened by its age."""
        line = self.line
        assert line is not None  # noqa: S101  (callers asked)
        assert self._ref_host_ns is not None  # noqa: S101  (there was an exchange)
        t = (now - self._ref_host_ns) * 1e-9
        offset = (line.offset_ns_at(now) - self._ref_offset_ns) * 1e-9
        skew, pace = (line.skew, self._largest_rate_error(line.skew)) if self.changed else (0.0, MOST_SKEW)
        rooms = [
            abs(offset - entry.offset - skew * (t - entry.t)) + 0.5 * entry.trip + pace * abs(t - entry.t)
            for entry in self._kept
        ]
        return min(rooms) + self.suspect_s

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
            self._start(chosen, changed=False)
            return True
        chosen = in_line(self._suspects[-MOST_SUSPECTS:], FASTEST, SLOWEST)
        if len(chosen) < IN_LINE:
            return False
        self._start(chosen, changed=True)
        return True

    def _begin_segment(self) -> bool:
        """Start a new segment where three suspects agree with one another, the newest included."""
        recent, fit = self._suspects[-IN_AGREEMENT - 1 :], self._fit
        assert fit is not None  # noqa: S101  (locked)
        newest = recent[-1]
        if len(recent) >= IN_AGREEMENT:
            chosen = in_line(recent, fit[1] - MOST_RATE_STEP, min(SLOWEST, fit[1] + MOST_RATE_STEP))
            if len(chosen) < IN_AGREEMENT or chosen[-1] is not newest:
                chosen = in_line(self._suspects, FASTEST, SLOWEST)
                if len(chosen) < IN_LINE or chosen[-1] is not newest:
                    return False
            self.segment += 1
            self._start(chosen, changed=True)
            return True
        return False

    def _begin_line(self) -> bool:
        """Drop what is older than the contradicting exchanges, if those are on one line, with all since the first."""
        fit = self._fit
        assert fit is not None  # noqa: S101  (locked)
        since = self._with_recent([entry for entry in self._kept if entry.t >= self._recent[0].t])
        if self.changed or len(self._recent) < IN_AGREEMENT:
            return False
        least = min(entry.trip for entry in (*self._kept, *since))
        if widest_band(since, fit[1], MOST_SKEW, fit[1], REACH).width <= LEAST_WIDTH * least:
            return False
        self._kept, self._suspects, self._recent, self.suspect_s = since, [], [], 0.0
        self._fit = self._band = None
        self._refit()
        self._is_bent = True
        return True

    def _remember(self, entry: Exchange) -> None:
        self._recent = [each for each in self._recent if each.t > entry.t - RECENT_S] + [entry]

    def _with_recent(self, exchanges: list[Exchange]) -> list[Exchange]:
        """These and the contradicting ones, in order of time."""
        known = {entry.t for entry in exchanges}
        return sorted([*exchanges, *(entry for entry in self._recent if entry.t not in known)], key=lambda e: e.t)

    def _narrowed_by(self, entry: Exchange) -> float:
        """By how much this exchange narrows the band beyond chance, seconds; 0 where it does not."""
        band = self._band
        if band is None or self.changed:
            return 0.0
        narrower = self._widest([*self._kept, entry])
        return band.width - narrower.width if narrower.worse_by(band.width) > LONE else 0.0

    def _widest(self, exchanges: list[Exchange]) -> Band:
        """The band of these exchanges under the rate's prior."""
        fit, (skew, sigma) = self._fit, self._rate_prior()
        near = skew if fit is None else fit[1]
        return widest_band(exchanges, skew, sigma, near, CHANGED_REACH if self.changed else REACH)

    def _start(self, chosen: list[Exchange], *, changed: bool) -> None:
        self._kept, self._suspects, self._recent, self.suspect_s = chosen, [], [], 0.0
        self._band = None
        self._fit, self.changed, self.segment_t, self.accepted = None, changed, chosen[0].t, len(chosen)
        self._refit()

    def _settle(self, entry: Exchange) -> None:
        """Treat the clock as a crystal's again once its rate has been within the range of one for CALM_S."""
        fit = self._fit
        assert fit is not None  # noqa: S101  (locked)
        if entry.t - self.segment_t >= CALM_S and abs(fit[1]) < MOST_SKEW + sqrt(fit[4]) < 2.0 * MOST_SKEW:
            self.changed = False

    def _refit(self) -> None:
        self._bound_window()
        fit, self._is_bent = self._fitted(self._fit), False
        if not self.changed and len(self._kept) <= ENOUGH and self._has_changed_rate():
            fit = self._fitted(None)
        self._fit = self._weighted = fit
        if len(self._kept) >= LEAST_FOR_BAND:
            band = self._widest(self._kept)
            if self._band is not None and band.worse_by(self._band.width) > TRIED:
                band = self._without_older(band)
            self._band = band
            if len(self._kept) >= LEAST_FOR_BAND:
                covariance = Envelopes(self._kept, *self._rate_prior()).covariance(band)
                fit = (band.offset, band.skew, *covariance, fit[5])
            else:  # too few to show how dense their bounds lie
                fit = self._weighted
            self._fit = fit
        end = self._kept[-1]
        self._fit_t = end.t
        self.best_trip_s = min([entry.trip for entry in self._kept])
        assert self._ref_host_ns is not None  # noqa: S101  (there was an exchange)
        self.newest_ns = HostNs(self._ref_host_ns + round(end.t * NS_PER_S))
        self.line = ClockLine(
            ref_host_ns=self.newest_ns,
            offset_ns=self._ref_offset_ns + round(fit[0] * NS_PER_S),
            skew=fit[1],
            var_offset=fit[2],
            cov_offset_skew=fit[3],
            var_skew=fit[4],
            wander=CHANGED_WANDER if self.changed else WANDER,
            var_bias=(0.5 * self.best_trip_s) ** 2 / 3.0,  # uniform in half of the least round trip either way
        )

    def _without_older(self, band: Band) -> Band:
        """The band without the exchanges before a change of the rate, where two lines are likelier than one."""
        step, reach = (CHANGED_RATE_SIGMA, CHANGED_REACH) if self.changed else (MOST_SKEW, REACH)
        while len(self._kept) > LEAST_KEPT:
            most = min(entry.trip for entry in self._kept)  # no band is wider
            gains = {}
            for k in NEWEST:
                if k > len(self._kept) - IN_AGREEMENT:
                    break
                older = min(most, self._widest(self._kept[:-k]).width)
                newer = min(most, widest_band(self._kept[-k:], band.skew, step, band.skew, reach).width)
                gains[k] = ((len(self._kept) - k) * (older - band.width) + k * (newer - band.width)) / band.tail
            best = max(gains, key=lambda k: gains[k], default=0)
            if not best or gains[best] < CHANGED:
                break
            self._is_bent = True
            del self._kept[:-best]
            self._fit = self._weighted = self._fitted(None)
            band = self._widest(self._kept)
        return band

    def _rate_prior(self) -> tuple[float, float]:
        """Mean and one sigma of the skew."""
        if self.changed:
            return _chord(self._kept), CHANGED_RATE_SIGMA
        # Many exchanges that show a rate widen the prior, which would hold a crystal at its edge back for ever.
        shown = self._fit[1] if self._fit is not None and len(self._kept) > ENOUGH else 0.0
        return 0.0, hypot(RATE_SIGMA, shown)

    def _fitted(self, last: Line | None) -> Line:
        skew, sigma = self._rate_prior()
        return fit_line(self._kept, sigma, skew, last)

    def _has_changed_rate(self) -> bool:
        """Find whether the exchanges show a rate beyond a crystal's, and remember it."""
        if not self.changed and len(self._kept) >= LEAST_KEPT:
            free = fit_line(self._kept, CHANGED_RATE_SIGMA, _chord(self._kept), None)
            self.changed = abs(free[1]) - MOST_SKEW > CERTAIN_SIGMAS * sqrt(free[4])
            if self.changed:
                self.segment_t = self._kept[-1].t
        return self.changed

    def _bound_window(self) -> None:
        """Drop what is older than the window; beyond MOST_KEPT, that of the older half whose bounds are the widest."""
        kept = self._kept
        oldest = kept[-1].t - WINDOW_S
        while len(kept) > LEAST_KEPT and kept[0].t < oldest:
            del kept[0]
        if len(kept) > MOST_KEPT:
            del kept[max(range(len(kept) // 2), key=lambda k: self._room(kept[k]))]

    def _room(self, entry: Exchange) -> float:
        """Distance of the nearer of an exchange's two bounds from the line, seconds."""
        return 0.5 * entry.trip - abs(entry.offset - self._predicted(entry.t))

    def _predicted(self, t: float) -> float:
        fit = self._fit
        assert fit is not None  # noqa: S101  (locked)
        return fit[0] + fit[1] * (t - self._fit_t)

    def _gate(self, entry: Exchange) -> float:
        line, fit = self.line, self._fit
        assert line is not None  # noqa: S101  (locked)
        assert fit is not None  # noqa: S101  (locked)
        assert self.best_trip_s is not None  # noqa: S101  (locked)
        assert self._ref_host_ns is not None  # noqa: S101  (locked)
        at_ns = HostNs(self._ref_host_ns + round(entry.t * NS_PER_S))
        # The scatter of the weighted fit, which knows the errors of single exchanges; the band is surer than those.
        sigma = sqrt(self._scatter((at_ns - line.ref_host_ns) * 1e-9) + FLOOR_S**2 + fit[5] ** 2)
        return GATE_SIGMAS * sigma + GATE_S + 0.5 * abs(entry.trip - self.best_trip_s) + entry.beside

    def _scatter(self, dt: float) -> float:
        """Variance of the weighted fit's offset ``dt`` seconds after its newest exchange, s^2."""
        _, _, c00, c01, c11, _ = self._weighted
        wander = CHANGED_WANDER if self.changed else WANDER
        return max(0.0, c00 + dt * (2.0 * c01 + dt * (c11 + wander * wander)))

    def _largest_rate_error(self, skew: float) -> float:
        """Largest difference from this skew that two consecutive exchanges allow, s/s."""
        largest, earlier = MOST_SKEW, self._kept[0]
        for entry in self._kept[1:]:
            between = entry.t - earlier.t
            if between >= LEAST_APART_S:
                moved = abs(entry.offset - earlier.offset - skew * between)
                largest = max(largest, (moved + 0.5 * (entry.trip + earlier.trip)) / between)
                earlier = entry
        return largest


def _chord(exchanges: list[Exchange]) -> float:
    """Skew between the first and the last exchange."""
    return (exchanges[-1].offset - exchanges[0].offset) / (exchanges[-1].t - exchanges[0].t)

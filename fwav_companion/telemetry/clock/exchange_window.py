"""The exchanges of one segment and the line between their bounds: what is kept, what contradicts it, when it bends.

Seconds from a common reference. Two rules decide: an exchange that enters the band deeper than a new fastest one would
is a suspect, and where two lines are much likelier than one, the suspects included, the older exchanges are dropped.
"""

from __future__ import annotations

from math import log1p, sqrt

from fwav_companion.telemetry.clock.agreement import Exchange
from fwav_companion.telemetry.clock.band import Band, Envelopes
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW

IN_AGREEMENT = 3
"""Number of exchanges that agree by chance in few cases: fewer are no evidence of a line."""
MOST_KEPT, LEAST_KEPT = 64, 6
WINDOW_S = 60.0
RATE_SIGMA, CHANGED_RATE_SIGMA = 100e-6, 0.5
"""Scale of the rate before it is measured: of two crystals, and of a clock that was seen to change its rate."""
WANDER, CHANGED_WANDER = 2e-6, 1e-2
"""One sigma of the change of the rate since the newest exchange: temperature; a simulator under a varying load."""
RECORD, GATE_SIGMAS, GATE_S = 20.0, 4.0, 0.1e-3
"""Largest depth of an exchange that agrees: in mean distances of the bounds at the band's edge (one new fastest delay
in 100 000 enters deeper), in sigmas of the line, and what hosts and stamps add, s."""
CALM_S = 3.0
"""Time after a change from which the clock may be a crystal's again, s."""
REACH, CHANGED_REACH = 2e-3, 0.7
"""Largest rate of crystals, a host's slew included, and largest difference of another clock's from the chord's."""
NEWEST = (3, 4, 6, 8, 12, 16, 24, 32)
"""Numbers of newest exchanges that are tried as the only ones on a new line."""
CHANGED = 8.0
"""Log-likelihood that two lines gain on one from which the older exchanges are dropped: 20 000 to one, because every
exchange tests it again."""
SHOWN = 6.0
"""Number of distances of bounds by which their density is known: what it makes unlikely is less so (Student)."""
ERRS = 7.0
"""Log-likelihood that an exchange costs that errs by itself: one in 150."""
TRIED = 0.5
"""Log-likelihood, in bounds, that one exchange costs from which new lines are tried at all."""
ENOUGH, MOST_ASKED = 20, 200
"""Number of exchanges in a fit from which one a second is enough, where they know the offset to NARROW_S; and in any
case: a jitter of 60 ms is never known as well."""
NARROW_S = 0.7e-3
"""One sigma of the offset, s: behind a jitter of 10 ms each way, one exchange a second finds a rate of 600 ppm in 20 s,
with errors of 2 ms on the way."""
LEAST_APART_S = 0.08
"""Least time between two exchanges whose round trips limit the rate error."""


class ExchangeWindow:
    """At least three exchanges that agree, and the widest band between their bounds."""

    __slots__ = ("_accepted", "_rate_sigma", "band", "changed", "kept", "segment_t")

    def __init__(self, exchanges: list[Exchange], *, changed: bool) -> None:
        """``changed``: whether the rate may differ from a crystal's."""
        self.kept = exchanges
        self.changed = changed
        """Whether the rate differs from a crystal's, or was just seen to change."""
        self.segment_t = exchanges[0].t
        """Beginning of the segment, or of the last change of its rate."""
        self._accepted = len(exchanges)
        self._rate_sigma = RATE_SIGMA
        self.band = self._widest()
        self._open()

    @property
    def newest(self) -> Exchange:
        """The newest exchange."""
        return self.kept[-1]

    @property
    def in_doubt(self) -> bool:
        """Whether the line is young, or had to change."""
        return self.changed or len(self.kept) < ENOUGH

    @property
    def is_wide(self) -> bool:
        """Whether more exchanges a second would make the offset better known."""
        return self._accepted < MOST_ASKED and self.band.var_offset > NARROW_S**2

    @property
    def least_trip(self) -> float:
        """Least round trip of the exchanges in use."""
        return min([entry.trip for entry in self.kept])

    @property
    def wander(self) -> float:
        """One sigma of the change of the rate since the newest exchange."""
        return CHANGED_WANDER if self.changed else WANDER

    def contradiction(self, entry: Exchange) -> float:
        """Distance of an exchange from the line, seconds, where it enters the band deeper than chance; else 0."""
        band, depth = self.band, self.band.entered_by(entry)
        dt = entry.t - band.t
        grown = dt * (2.0 * band.cov_offset_skew + dt * (band.var_skew + self.wander**2))
        sigma = sqrt(max(0.0, band.var_offset + grown))
        disagrees = depth > RECORD * band.apart + GATE_SIGMAS * sigma + GATE_S
        return abs(entry.offset - band.predicted(entry.t)) if disagrees else 0.0

    def accept(self, entry: Exchange, suspects: list[Exchange]) -> bool:
        """Use an exchange that agrees. Returns whether it showed, with the suspects, that the rate has changed."""
        before = self.band
        self.kept.append(entry)
        self._accepted += 1
        self._bound()
        if self.changed:
            self._settle()
        self.band = self._widest()
        bends = before.width - self.band.width > TRIED * before.apart and self.bend(suspects, before)
        self._open()
        return bends

    def bend(self, suspects: list[Exchange], before: Band) -> bool:
        """Drop what is older than a change of the rate, if two lines are likelier than one line and suspects that err.

        ``before``: the band that shows how dense the bounds lie. Returns whether exchanges were dropped.
        """
        if self.changed:  # suspects in a row begin a segment
            suspects = []
        every = sorted([*self.kept, *suspects], key=lambda entry: entry.t)
        step, reach = (CHANGED_RATE_SIGMA, CHANGED_REACH) if self.changed else (MOST_SKEW, REACH)
        band, most, gains = self.band, self.least_trip, {}  # no band is wider than the least trip
        for k in NEWEST:
            newer = every[-k:]
            older = [entry for entry in self.kept if entry.t < newer[0].t]
            if len(older) < IN_AGREEMENT:
                break
            width, apart = Envelopes(newer, band.skew, step).opening(band.skew, reach)
            if width > 0.0:
                errs = sum(entry.t >= newer[0].t for entry in suspects)
                gains[k] = ERRS * errs + _likelier((min(most, width) - band.width) / max(apart, before.tail / k))
                width, _ = self._envelopes(older).opening(*self._range(older))
                apart = max(before.apart * len(self.kept), before.tail) / len(older)
                gains[k] += _likelier((min(most, width) - band.width) / apart)
        best = max(gains, key=lambda k: gains[k], default=0)
        if not best or gains[best] < CHANGED:
            return False
        self.kept = every[-best:]
        self._rate_sigma = MOST_SKEW
        self._bound()
        self.band = self._widest()
        return True

    def bound(self, t: float) -> float:
        """Bound of the line's error: the tightest of the exchanges' intervals, each widened by its age."""
        skew, pace = (self.band.skew, self._largest_rate_error()) if self.changed else (0.0, MOST_SKEW)
        offset = self.band.predicted(t)
        rooms = [
            abs(offset - entry.offset - skew * (t - entry.t)) + 0.5 * entry.trip + pace * abs(t - entry.t)
            for entry in self.kept
        ]
        return min(rooms)

    def _open(self) -> None:
        """Let the rate be any where no band of a crystal's line is open, as no two delays are together shorter than 0;
        where no band at all is, drop the oldest.
        """
        if not self.changed and self.band.width <= 0.0:
            self.changed, self.segment_t = True, self.newest.t
            self.band = self._widest()
        while self.band.width <= 0.0 and len(self.kept) > IN_AGREEMENT:
            del self.kept[0]
            self.band = self._widest()

    def _settle(self) -> None:
        """Treat the clock as a crystal's again once its rate has been within the range of one for CALM_S."""
        calm = self.newest.t - self.segment_t >= CALM_S
        if calm and abs(self.band.skew) < MOST_SKEW + sqrt(self.band.var_skew) < 2.0 * MOST_SKEW:
            self.changed = False

    def _widest(self) -> Band:
        return self._envelopes(self.kept).widest(*self._range(self.kept))

    def _envelopes(self, exchanges: list[Exchange]) -> Envelopes:
        """The bounds of these exchanges under the rate's prior."""
        if self.changed:
            return Envelopes(exchanges, _chord(exchanges), CHANGED_RATE_SIGMA)
        # Many exchanges that show a rate widen the prior, which would hold a crystal at its edge back for ever.
        shown = abs(self.band.skew) if len(exchanges) > ENOUGH else 0.0
        return Envelopes(exchanges, 0.0, max(self._rate_sigma, shown))

    def _range(self, exchanges: list[Exchange]) -> tuple[float, float]:
        """Middle and half of the range of skews."""
        return (_chord(exchanges), CHANGED_REACH) if self.changed else (0.0, REACH)

    def _bound(self) -> None:
        """Drop what is older than the window; beyond MOST_KEPT, that of the older half whose bounds are the widest."""
        kept = self.kept
        oldest = kept[-1].t - WINDOW_S
        while len(kept) > LEAST_KEPT and kept[0].t < oldest:
            del kept[0]
        if len(kept) > MOST_KEPT:
            del kept[min(range(len(kept) // 2), key=lambda k: self.band.entered_by(kept[k]))]

    def _largest_rate_error(self) -> float:
        """Largest difference from the line's skew that two consecutive exchanges allow, s/s."""
        largest, earlier = MOST_SKEW, self.kept[0]
        for entry in self.kept[1:]:
            between = entry.t - earlier.t
            if between >= LEAST_APART_S:
                moved = abs(entry.offset - earlier.offset - self.band.skew * between)
                largest = max(largest, (moved + 0.5 * (entry.trip + earlier.trip)) / between)
                earlier = entry
        return largest


def _likelier(wider: float) -> float:
    """Log-likelihood that a band gains that is wider by so many distances of its bounds."""
    return min(wider, SHOWN * log1p(max(0.0, wider) / SHOWN))


def _chord(exchanges: list[Exchange]) -> float:
    """Skew between the first and the last exchange."""
    return (exchanges[-1].offset - exchanges[0].offset) / (exchanges[-1].t - exchanges[0].t)

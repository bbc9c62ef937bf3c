"""Clock estimate from TIMESYNC: a line through the exchanges, each weighted by its round trip, inside a hard bound.

An exchange places the autopilot's instant between sending and receiving: the offset is the middle, wrong by half the
difference of the two delays. Where delays are a constant plus a long tail, that error shrinks with the round trip's
excess over the least one. Where they scatter evenly, the error does not depend on the excess. The residuals show which
of the two holds (:mod:`round_trip_weights`). The weights act as the gate: a slow exchange has a small weight, and no
exchange is discarded for a fixed number of milliseconds. Where the fastest messages alone are more precise
(:mod:`envelopes`), those are used.
"""

from __future__ import annotations

from typing import NamedTuple

from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.telemetry.clock.clock_line import MOST_SKEW, ClockLine
from fwav_companion.telemetry.clock.envelopes import fit_between
from fwav_companion.telemetry.clock.hard_bound import ROUNDING_NS, Exchange, HardBound
from fwav_companion.telemetry.clock.round_trip_weights import Fit, RoundTripWeights

WINDOW_NS = 120 * NS_PER_S
MOST_KEPT = 400
"""Most exchanges in the window: ten a second for the first half minute, then one a second through the window."""
EXCHANGES_TO_WEIGH = 12
"""Number of exchanges from which the residuals show how errors depend on the round trip; before, an error is uniform in
its bound."""
EXCHANGES_TO_WEIGH_AGAIN = 12
"""Number of further exchanges for the same after a change of the skew."""
FITTED_EACH = 20
FIT_EVERY_NS = 900_000_000
"""Time between two fits of the line: a line is good for far longer, so fitting it more often would be wasted work."""
LIKELIER_BY, LIKELIER_BY_EACH = 5.0, 0.05
"""Log-likelihood, in total and for every exchange, by which the fit between the envelopes must exceed the weighted
one. An exponential tail gains 0.18 an exchange; a rounder one (the sum of two such) loses 0.08."""
WILD_NS = NS_PER_S
"""Distance of a single contradiction beyond which it may be another node's answer, as for a clock that is followed."""
CONTRADICTIONS_FOR_A_STEP = 3
"""Number of contradictions in a row that show a clock that slips or has another rate. One may be another node's
answer."""
LONGEST_TAIL = 64
ASTRAY_SIGMAS = 4.5
"""Mean residual of the newest exchanges, in its sigmas, beyond which the skew has changed. It is tested for every tail
length at every exchange, but these tests hardly differ."""

TAILS = (12, 24, 48, 96)
"""Numbers of newest exchanges that are compared with all exchanges."""
SURE_TAIL, SURE_SIGMAS = 24, 8.0
"""Number of newest exchanges from which a disagreement beyond these sigmas is a change of the skew. Lines between
envelopes err like a Laplacian: eight of its sigmas are as rare as four and a half of a Gaussian."""
DOUBT_AFTER_NS = 5 * NS_PER_S
"""Time of doubt after a change of the skew: a clock discipline that began to slew may change again."""
BY_CHANCE_SIGMAS = 4.0
"""Disagreement, in sigmas, beyond which the excess is added to the variance, until it is significant or gone."""

FEW, FEW_ASTRAY_SIGMAS = 4, 6.0
"""Least number of exchanges for a change of the skew, and their sigmas while there are few: they must lie off by more
than delays can explain. An exchange errs by at most half its round trip, which is two of its own sigmas."""


class Description(NamedTuple):
    """Fits to some exchanges, in seconds; times and offsets are relative to the newest exchange."""

    times: list[float]
    offsets: list[float]
    excesses: list[float]
    """Excesses of the round trips over the least."""
    weighted: Fit
    fit: Fit
    """The likelier of the weighted fit and the fit between the envelopes."""
    between: bool
    """Whether ``fit`` is the fit between the envelopes."""
    room_s: float
    """Room between the envelopes, seconds."""


class ExchangeFit:
    """Weighted line through the last two minutes of exchanges, and the interval that none of them contradicts."""

    __slots__ = (
        "_best_ns",
        "_bound",
        "_by_envelopes",
        "_changed_ns",
        "_fitted_ns",
        "_weigh_from",
        "_weights",
        "_window",
        "contradicting",
        "in_doubt",
        "line",
    )

    def __init__(self) -> None:
        self.line: ClockLine | None = None
        self._changed_ns: HostNs | None = None
        self._weigh_from = EXCHANGES_TO_WEIGH
        self._by_envelopes = False
        """Whether the envelopes have proved better than weights on this link. This property of a link is constant."""
        self.in_doubt = False
        """Whether the skew has just changed, or the newest exchanges disagree with those before by more than chance."""
        self._window: list[Exchange] = []
        self._best_ns: int | None = None
        self.contradicting: list[Exchange] = []
        """The newest exchanges, if they contradict those before."""
        self._bound = HardBound()
        self._fitted_ns = HostNs(0)
        self._weights = RoundTripWeights()

    @property
    def count(self) -> int:
        """Number of exchanges in the window."""
        return len(self._window)

    @property
    def best_round_trip_s(self) -> float | None:
        """Least round trip in the window, seconds."""
        if self._best_ns is None and self._window:
            self._best_ns = min([e.round_trip_ns for e in self._window])
        return None if self._best_ns is None else self._best_ns * 1e-9

    def insert(self, entry: Exchange) -> bool:
        """Take one exchange. Returns whether the last few in a row contradict all before them."""
        if self._bound.contradicts(entry):
            self.contradicting.append(entry)
            return len(self.contradicting) >= CONTRADICTIONS_FOR_A_STEP
        self.contradicting.clear()
        self._take(entry)
        return False

    def contradiction_s(self, offset_ns: int) -> float:
        """Largest distance of this offset from the exchanges that contradict those before it, seconds; 0 without any.

        A single one far away may be another clock's answer; a second contradiction makes both count.
        """
        distances_ns = [abs(entry.offset_ns - offset_ns) for entry in self.contradicting]
        if len(distances_ns) == 1 and distances_ns[0] > WILD_NS:
            return 0.0
        return max(distances_ns, default=0) * 1e-9

    def newest(self, count: int) -> list[Exchange]:
        """The newest exchanges of the window, oldest first."""
        return self._window[-count:]

    def bound_s(self, now: HostNs, offset_ns: int) -> float:
        """Bound of the error of ``offset_ns`` at ``now``, seconds: drift is at most 600 ppm."""
        low_ns, high_ns = self._bound.interval(now)
        by_drift_s = max(high_ns - offset_ns, offset_ns - low_ns) * 1e-9
        contradiction_s = self.contradiction_s(offset_ns)
        if contradiction_s == 0.0:
            return by_drift_s
        half_trip_s = 0.5e-9 * max(entry.round_trip_ns for entry in self.contradicting) + 1e-9 * ROUNDING_NS
        return max(by_drift_s, contradiction_s + half_trip_s)

    def _take(self, entry: Exchange) -> None:
        self._bound.take(entry)
        self._window.append(entry)
        if self._best_ns is not None:
            self._best_ns = min(self._best_ns, entry.round_trip_ns)
        oldest_ns = entry.host_ns - WINDOW_NS
        while self._window[0].host_ns < oldest_ns or len(self._window) > MOST_KEPT:
            if self._window[0].round_trip_ns == self._best_ns:
                self._best_ns = None
            del self._window[0]
        if len(self._window) <= FITTED_EACH or entry.host_ns - self._fitted_ns >= FIT_EVERY_NS:
            self.line = self._fit()

    def _fit(self) -> ClockLine:
        """Line over the window, as far back as the newest exchanges agree with it."""
        self._fitted_ns = self._window[-1].host_ns
        whole = self._described(self._window, weigh=len(self._window) >= self._weigh_from)
        times, offsets, excesses = whole.times, whole.offsets, whole.excesses
        tail = self._astray(times, offsets, excesses=excesses, level=whole.weighted[0], skew=whole.weighted[1])
        if tail:
            return self._fit_newest(tail)
        if whole.room_s < -ROUNDING_NS * 1e-9 and len(times) >= 2 * EXCHANGES_TO_WEIGH:
            return self._fit_newest(len(times) - len(times) // 2)
        level, skew, p00, p01, p11 = whole.fit
        self._by_envelopes |= whole.between
        squared_angle = 0.0
        for length in TAILS:
            if 2 * length > len(times):
                break
            newest = self._described(self._window[-length:], between=self._by_envelopes)
            difference2, chance2 = (newest.fit[0] - level) ** 2, newest.fit[2] + p00
            if length >= SURE_TAIL and difference2 > SURE_SIGMAS**2 * chance2:
                return self._fit_newest(length)
            squared_angle = max(squared_angle, difference2 - BY_CHANCE_SIGMAS**2 * chance2)
        changed = self._changed_ns is not None and self._fitted_ns - self._changed_ns < DOUBT_AFTER_NS
        self.in_doubt = changed or squared_angle > 0.0
        ref = self._window[-1]
        low_ns, high_ns = self._bound.interval(ref.host_ns)
        offset_ns = max(low_ns, min(high_ns, ref.offset_ns + round(level * 1e9)))
        return ClockLine(
            ref_host_ns=ref.host_ns,
            offset_ns=offset_ns,
            skew=max(-MOST_SKEW, min(MOST_SKEW, skew)),
            var_offset=p00 + squared_angle,
            cov_offset_skew=p01,
            var_skew=p11,
        )

    def _fit_newest(self, length: int) -> ClockLine:
        """Line through the newest exchanges, after a change of the skew; earlier exchanges are deleted.

        The model of delays stays: residuals that contain the rest of a bend would suggest that errors do not depend on
        the round trip, and so hide the bend.
        """
        self._changed_ns = self._fitted_ns
        if len(self._window) >= EXCHANGES_TO_WEIGH:
            self._weigh_from = length + EXCHANGES_TO_WEIGH_AGAIN
        del self._window[:-length]
        self._best_ns = None
        return self._fit()

    def _described(self, window: list[Exchange], *, weigh: bool = False, between: bool | None = None) -> Description:
        """Line through these exchanges, between the envelopes or by weights, whichever is likelier.

        ``weigh``: learn from these exchanges how errors depend on the round trip. ``between``: which of the two fits,
        where that is already decided.
        """
        ref = self._window[-1]
        times = [(e.host_ns - ref.host_ns) * 1e-9 for e in window]
        offsets = [(e.offset_ns - ref.offset_ns) * 1e-9 for e in window]
        trips = [e.round_trip_ns * 1e-9 for e in window]
        if weigh:
            self._weights.learn_least(trips)
        excesses = self._weights.excesses(trips)
        if weigh:
            self._weights.learn(times, offsets, excesses)
        weighted = self._weights.line(times, offsets, excesses)
        room_s, fit = 0.0, weighted
        if weigh or between:
            e = fit_between(times, offsets, trips, MOST_SKEW)
            room_s = e.room_s
            if between is None:
                likelier = self._weights.log_likelihood(weighted, times, offsets, excesses) + self._margin
                between = e.log_likelihood > likelier
            if between:
                fit = (e.level, e.skew, e.var_level, e.cov_level_skew, e.var_skew)
        return Description(
            times=times,
            offsets=offsets,
            excesses=excesses,
            weighted=weighted,
            fit=fit,
            between=bool(between),
            room_s=room_s,
        )

    @property
    def _margin(self) -> float:
        return LIKELIER_BY + LIKELIER_BY_EACH * len(self._window)

    def _astray(
        self, times: list[float], offsets: list[float], excesses: list[float], level: float, skew: float
    ) -> int:
        """Number of newest exchanges whose mean lies off the line by more than chance; 0 where there are none.

        If not 0, the skew has changed: a host's clock discipline slews by hundreds of ppm from one second to the next.
        """
        weight = moment = 0.0
        for back in range(1, min(LONGEST_TAIL, len(times) // 2) + 1):
            w = self._weights.of(excesses[-back])
            weight += w
            moment += w * (offsets[-back] - level - skew * times[-back])
            evident = ASTRAY_SIGMAS if back >= EXCHANGES_TO_WEIGH else FEW_ASTRAY_SIGMAS
            if back >= FEW and moment * moment > evident**2 * weight:
                return back
        return 0

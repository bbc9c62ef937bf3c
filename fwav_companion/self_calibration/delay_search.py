"""The search for the camera's delay: a bank of joint estimates, one a delay, and a trial of what they end at.

A flapping wing is not linear in the delay, so the bank only tells where to look: of two delays a beat apart it may
prefer the one that happens to lie nearer to one of its own. So each end is fitted again about itself, over everything
that was kept, until hypotheses are compared and not linearizations. A delay is found when none that can be told from
it is nearly as likely, the prior counted in.

Immutable: each step returns the next state.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import copysign, inf, sqrt
from typing import TypeAlias

import msgspec

from fwav_companion.self_calibration.assessment import CalibrationStatus
from fwav_companion.self_calibration.calibration_context import DELAY_STEP_S, CalibrationContext
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT, PixelMeasurement, SharedParameter

LEAST = 40
MOST = 240
"""Glimpses: four beats at 30 frames/s, before anything is decided, and when to give up."""
FLAT = 10.0
"""Of log-likelihood between the best and the worst of a bank; below it nothing shakes, and any delay fits."""
EARLY_MARGIN = 10.0
"""Of log-likelihood with the prior, over the next delay, to be done before MOST: 20 000 to one, for it is asked again
with every glimpse."""
MARGIN = 4.5
"""The same at the end: what a prior alone says of a delay three sigma away."""
LUCK_SIGMAS = 3.0
"""Of two delays at which the vehicle moves alike one fits better by luck: so much of a difference says nothing."""
SHARP_S = 0.0013
"""One sigma of a delay. Flapping of 5 degrees at 5 Hz shows 0.4 ms after LEAST glimpses and 0.2 ms after
MOST; the noise of told attitudes (0.1 deg at 50 Hz), which looks like shaking but is none, 2 ms."""
WIDE_S = 3.0 * DELAY_STEP_S
"""Where so little shakes, ends nearer than this are one wide peak: what moves slowly does not repeat itself."""
APART_S = 0.5 * DELAY_STEP_S
APART_SIGMAS = 3.0
"""Two ends nearer than this, or than so many of their sigmas together, are one."""
MOST_TRIALS = 12
HOPELESS = 100.0
"""Of log-likelihood behind the best after the first round: linearization costs less than half of it by then."""
ROUNDS = 2
"""Over everything kept: the first ends within 3 ms, half a degree of a beat at 15 Hz, the second within the noise."""
STEPS = 40
"""Glimpses a frame that all trials take together: as many as the bank does."""
LEAST_STEP = 3
"""By each trial, so that it overtakes what goes on coming."""


class FoundDelay(msgspec.Struct, frozen=True):
    """A delay, with what else fits it: where to linearize."""

    around: tuple[float, ...]


class NoDelay(msgspec.Struct, frozen=True):
    """No delay, and why: AMBIGUOUS, UNEXPLAINED, or WAITING, where too little shakes."""

    status: CalibrationStatus
    rivals: tuple[float, ...] = ()
    """Of AMBIGUOUS: delays that explain what was seen about as well as one another, the likeliest first."""


Result: TypeAlias = FoundDelay | NoDelay
UNEXPLAINED = NoDelay(CalibrationStatus.UNEXPLAINED)


class DelaySearch(msgspec.Struct, frozen=True):
    """A search on its way."""

    shop: CalibrationContext
    bank: tuple[FilterPass, ...]
    trials: tuple[FilterPass, ...] = ()
    round: int = 0
    cursor: int = 0
    """How many of the kept glimpses the trials have taken in this round."""

    def fed(self, glimpse: PixelMeasurement) -> DelaySearch:
        """With one more glimpse in the bank. Trials take theirs from what is kept."""
        return msgspec.structs.replace(self, bank=tuple(fit.fed(glimpse) for fit in self.bank))

    def advanced(self, kept: Sequence[PixelMeasurement]) -> DelaySearch:
        """A frame further."""
        if not self.trials:
            return self._trying(self.bank, 0.0, inf) if _taken(self.bank) >= LEAST and not self._flat else self
        share = kept[self.cursor : self.cursor + max(LEAST_STEP, STEPS // len(self.trials))]
        trials = tuple(_fed(fit, share) for fit in self.trials)
        search = msgspec.structs.replace(self, trials=trials, cursor=self.cursor + len(share))
        return (
            search._trying(trials, APART_SIGMAS, HOPELESS)
            if self.round < ROUNDS and search.cursor >= len(kept)
            else search
        )

    def result(self, kept: Sequence[PixelMeasurement]) -> Result | None:
        """None: the search goes on."""
        if not self.trials:
            flat = any(fit.fits for fit in self.bank) and self._flat
            return (FoundDelay(self.shop.means) if flat else UNEXPLAINED) if _taken(self.bank) >= MOST else None
        if self.round < ROUNDS or self.cursor < len(kept):
            return None
        over = _taken(self.trials) >= MOST
        margin = MARGIN if over else EARLY_MARGIN
        ends = self._distinct(self.trials, APART_SIGMAS)
        best = max(
            ends, key=lambda end: min((self._lead(end, other) for other in ends if other is not end), default=0.0)
        )
        sharp = _sigma(best) < SHARP_S
        apart_s = 0.0 if sharp else WIDE_S
        rivals = [end for end in ends if self._lead(best, end) < margin and abs(_delay(end) - _delay(best)) > apart_s]
        if best.fits and not rivals:
            return FoundDelay(best.joint.mean[:COMMON_COUNT])
        if not over:
            return None
        if best.fits and sharp:
            return NoDelay(CalibrationStatus.AMBIGUOUS, tuple(_delay(end) for end in (best, *rivals)))
        return NoDelay(CalibrationStatus.WAITING) if best.fits else UNEXPLAINED

    def without(self, tracks: Collection[int], kept: Sequence[PixelMeasurement]) -> DelaySearch:
        """With targets forgotten; ``kept`` are the glimpses with theirs."""
        return msgspec.structs.replace(
            self,
            bank=tuple(_without(fit, tracks) for fit in self.bank),
            trials=tuple(_without(fit, tracks) for fit in self.trials),
            cursor=sum(glimpse.track not in tracks for glimpse in kept[: self.cursor]),
        )

    @property
    def _flat(self) -> bool:
        scores = [fit.score for fit in self.bank]
        return max(scores) - min(scores) < FLAT

    def _trying(self, fits: Sequence[FilterPass], apart_sigmas: float, behind: float) -> DelaySearch:
        """The next round, about the ends of these that are no more than so far behind the best."""
        best, *others = self._distinct(fits, apart_sigmas)[:MOST_TRIALS]
        ends = [best, *(fit for fit in others if self._likelihood(fit) > self._likelihood(best) - behind)]
        return DelaySearch(self.shop, (), tuple(self.shop.trial(fit.joint) for fit in ends), self.round + 1)

    def _distinct(self, fits: Sequence[FilterPass], apart_sigmas: float) -> list[FilterPass]:
        """The likeliest first, of those that are one the likelier."""
        kept: list[FilterPass] = []
        for fit in sorted(fits, key=self._likelihood, reverse=True):
            apart = (max(APART_S, apart_sigmas * (_sigma(fit) + _sigma(other))) for other in kept)
            if all(abs(_delay(fit) - _delay(other)) > least for other, least in zip(kept, apart, strict=True)):
                kept.append(fit)
        return kept

    def _lead(self, fit: FilterPass, other: FilterPass) -> float:
        """How much likelier than the other, a logarithm: what was seen, beyond luck, and the prior."""
        seen = fit.score - other.score
        told = max(0.0, abs(seen) - LUCK_SIGMAS * sqrt(max(fit.luck, other.luck)))
        return copysign(told, seen) + self._prior(fit) - self._prior(other)

    def _likelihood(self, fit: FilterPass) -> float:
        return fit.score + self._prior(fit)

    def _prior(self, fit: FilterPass) -> float:
        off = (_delay(fit) - self.shop.means[SharedParameter.DELAY]) / self.shop.sigmas[SharedParameter.DELAY]
        return -0.5 * off * off


def delay_search(shop: CalibrationContext) -> DelaySearch:
    """Before the first glimpse."""
    return DelaySearch(shop, shop.bank())


def _taken(fits: Sequence[FilterPass]) -> int:
    return max(fit.used + fit.refused for fit in fits)


def _fed(fit: FilterPass, glimpses: Sequence[PixelMeasurement]) -> FilterPass:
    for glimpse in glimpses:
        fit = fit.fed(glimpse)
    return fit


def _without(fit: FilterPass, tracks: Collection[int]) -> FilterPass:
    for track in sorted(tracks):
        fit = fit.without(track)
    return fit


def _delay(fit: FilterPass) -> float:
    return fit.joint.mean[SharedParameter.DELAY]


def _sigma(fit: FilterPass) -> float:
    return sqrt(max(0.0, fit.joint.cov[SharedParameter.DELAY][SharedParameter.DELAY]))

"""The search for the camera's delay: a static bank of hypotheses (Magill 1965), and trials about their estimates.

The motion of a flapping wing is not linear in the delay, so the bank only shows where to look: of two delays a beat
apart it may prefer the one that happens to lie nearer to a delay of the bank. So trials repeat the fit over all kept
measurements, each linearized about the delay that a hypothesis ended at, until scores compare hypotheses and not
linearizations. Trials of the last round associate the measurements of targets near to one another again, each about its
own delay, because a wrong delay displaces measurements by more than such targets are apart. A delay is found when no
other distinguishable delay is nearly as likely, the prior included.

Immutable: each step returns the next state.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import inf
from typing import TypeAlias

import msgspec
import numpy as np

from fwav_companion.self_calibration.arrays import Array, Mask
from fwav_companion.self_calibration.calibration_context import DELAY_STEP_S, CalibrationContext
from fwav_companion.self_calibration.calibration_report import CalibrationStatus, SharedParameter
from fwav_companion.self_calibration.filter_pass import FilterPass
from fwav_companion.self_calibration.measurement_batch import MeasurementBatch
from fwav_companion.self_calibration.reassociation import Trial, near_places

LEAST = 40
MOST = 240
"""Frames before any decision (four wing beats at 30 frames/s), and frames at which the search ends."""
LEAST_SIGHTS = 16
"""Measurements on photographs before a decision: 32 numbers for the 11 shared parameters, which have priors, and for
two of each target. Each photograph has its own samples of telemetry; frames at 30/s share three of them."""
FLAT = 10.0
"""Log-likelihood ratio of the best hypothesis of a bank to the worst, below which nothing shakes and any delay fits."""
EARLY_MARGIN = 10.0
"""Log-likelihood ratio to the next delay, with the prior, that decides before MOST frames: 20 000 to one, because every
frame tests it again."""
MARGIN = 4.5
"""Log-likelihood ratio to the next delay that decides at MOST frames: that of the prior alone, three sigma away."""
CHANCE_SIGMAS = 3.0
"""Sigmas of a difference of two scores that are disregarded: of two delays at which the vehicle moves alike, one fits
better by chance."""
SHARP_S = 0.0013
"""One sigma of a delay, s, below which shaking shows it. Flapping of 5 degrees at 5 Hz gives 0.4 ms after LEAST frames
and 0.2 ms after MOST; the noise of reported attitudes (0.1 deg at 50 Hz), which looks like shaking, gives 2 ms."""
WIDE_S = 3.0 * DELAY_STEP_S
"""Distance of delays, s, below which they belong to one wide peak where little shakes: slow motion does not repeat
itself."""
APART_S = 0.5 * DELAY_STEP_S
APART_SIGMAS = 3.0
"""Distance below which the delays of two hypotheses count as one: in seconds, and in the sum of their sigmas."""
VALLEY = 1.0
"""Rise of the log-likelihood that exceeds the noise of a linearization."""
MOST_TRIALS = 12
HOPELESS = 100.0
"""Log-likelihood ratio to the best after the first round, beyond which a delay is dropped: linearization errors cost
less than half of it by then."""
ROUNDS = 2
"""Rounds of trials over all kept measurements. The first ends within 3 ms of the delay, half a degree of a beat at
15 Hz, the second within the noise."""
PHOTOGRAPH_ROUNDS = 4
"""Rounds of trials over photographs. Their few sights move a trial less each round: after two, delays 0.06 s apart,
which are one peak, stayed apart in 4 of 96 drawn flights, after four in one."""


class FoundDelay(msgspec.Struct, frozen=True):
    """Result of a successful search: the delay with the other parameters that fit it, as a linearization point."""

    point: Array
    """(11 or more), shared parameters first."""
    places: dict[int, Array] = {}
    """Apparent places (2) of the targets, by track."""


class NoDelay(msgspec.Struct, frozen=True):
    """Result of a search without a delay, and the reason: AMBIGUOUS, UNEXPLAINED, or WAITING if too little shakes."""

    status: CalibrationStatus
    alternatives: tuple[float, ...] = ()
    """Delays that explain the measurements alike (AMBIGUOUS), the most likely first, s."""


Result: TypeAlias = FoundDelay | NoDelay
UNEXPLAINED = NoDelay(CalibrationStatus.UNEXPLAINED)


class DelaySearch(msgspec.Struct, frozen=True):
    """A delay search in progress."""

    context: CalibrationContext
    hypotheses: FilterPass
    """The bank in round 0, trials in later rounds."""
    round: int = 0
    cursor: int = 0
    """Number of kept batches that the trials of this round have used."""
    photographs: bool = False
    """Whether the frames of the bank were photographs."""
    trials: tuple[Trial, ...] = ()
    """Trials of the last round where targets are near to one another, with and without an association of their own."""

    @property
    def progress(self) -> tuple[int, int]:
        """Frames that the bank has used, and the number needed to begin; on photographs, measurements instead."""
        bank = self._passes[0]
        return (bank.sights, LEAST_SIGHTS) if bank.photographs else (bank.frames, LEAST)

    @property
    def begun(self) -> bool:
        """Whether the bank has used enough frames to begin the trials."""
        sights, needed = self.progress
        return self.round > 0 or sights >= needed

    def fed(self, batch: MeasurementBatch) -> DelaySearch:
        """The search after one more batch. Only the bank uses it; trials use the kept batches (``advanced``)."""
        if self.round:
            return self
        return msgspec.structs.replace(self, hypotheses=self.hypotheses.fed(batch))

    def advanced(
        self, kept: Sequence[MeasurementBatch], steps: int, kinds: Mapping[int, str] | None = None
    ) -> DelaySearch:
        """The search after one step of the trials, over the next ``steps`` kept batches. ``kinds``: label by track."""
        if not self.round:
            return self._next_round(0.0, inf) if self.begun and not self._flat else self
        hypotheses, trials = self.hypotheses, self.trials
        for batch in kept[self.cursor : self.cursor + steps]:
            if trials:
                trials = tuple([trial.fed(batch, kinds or {}) for trial in trials])
            else:
                hypotheses = hypotheses.fed(batch)
        cursor = min(self.cursor + steps, len(kept))
        search = msgspec.structs.replace(self, hypotheses=hypotheses, trials=trials, cursor=cursor)
        if search._is_last_round or cursor < len(kept):
            return search
        following = search._next_round(APART_SIGMAS, HOPELESS)
        return following._apart(float(kept[-1].drop_m.max()), kinds or {}) if following._is_last_round else following

    def complete(self, kept: Sequence[MeasurementBatch]) -> bool:
        """Whether the trials of the last round have used all kept batches."""
        return self._is_last_round and self.cursor >= len(kept)

    def result(self, kept: Sequence[MeasurementBatch]) -> Result | None:
        """Result of the search; None while it goes on."""
        over = self._passes[0].frames >= MOST
        if not self.round:
            flat = bool(self._fits.any()) and self._flat
            return (FoundDelay(self.context.means) if flat else UNEXPLAINED) if over else None
        if not self.complete(kept):
            return None
        margin = MARGIN if over else EARLY_MARGIN
        ends = self._distinct(APART_SIGMAS)
        best = max(ends, key=lambda i: min((self._lead(i, j) for j in ends if j != i), default=0.0))
        fits, sharp = bool(self._fits[best]), self._sigmas[best] < SHARP_S
        apart_s = 0.0 if sharp else WIDE_S
        delays = self._delays
        rivals = [i for i in ends if self._lead(best, i) < margin and abs(delays[i] - delays[best]) > apart_s]
        if self.photographs and not sharp:
            rivals = [i for i in rivals if self._valley(best, i, ends)]
        if fits and not rivals:
            joint, i = (self.trials[best].estimate.joint, 0) if self.trials else (self.hypotheses.joint, best)
            return FoundDelay(joint.mean[i], {track: place[i] for track, place in joint.targets.items()})
        if not over:
            return None
        if fits and sharp:
            return NoDelay(CalibrationStatus.AMBIGUOUS, tuple(float(delays[i]) for i in (best, *rivals)))
        return NoDelay(CalibrationStatus.WAITING) if fits else UNEXPLAINED

    def without(self, tracks: Collection[int], kept: Sequence[MeasurementBatch]) -> DelaySearch:
        """The search without some targets. ``kept``: the kept batches, still with those targets."""
        hypotheses = self.hypotheses.without(tracks)
        left = sum(any(track not in tracks for track in batch.tracks) for batch in kept[: self.cursor])
        trials = tuple([trial.without(tracks) for trial in self.trials])
        return msgspec.structs.replace(self, hypotheses=hypotheses, trials=trials, cursor=left)

    @property
    def _is_last_round(self) -> bool:
        return self.round == (PHOTOGRAPH_ROUNDS if self.photographs else ROUNDS)

    @property
    def _passes(self) -> tuple[FilterPass, ...]:
        """The passes of all hypotheses, in order."""
        return tuple([trial.estimate for trial in self.trials]) or (self.hypotheses,)

    @property
    def _score(self) -> Array:
        return np.concatenate([each.score for each in self._passes])

    @property
    def _fits(self) -> Mask:
        return np.concatenate([each.fits for each in self._passes])

    @property
    def _flat(self) -> bool:
        return float(np.ptp(self._score)) < FLAT

    @property
    def _delays(self) -> Array:
        return np.concatenate([each.joint.mean[:, SharedParameter.DELAY] for each in self._passes])

    @property
    def _sigmas(self) -> Array:
        delay = SharedParameter.DELAY
        variances = np.concatenate([each.joint.cov[:, delay, delay] for each in self._passes])
        return np.asarray(np.sqrt(np.maximum(variances, 0.0)))

    def _apart(self, height_m: float, kinds: Mapping[int, str]) -> DelaySearch:
        """The search with another trial of each hypothesis under which targets are near to one another.

        It associates the measurements again. The first trial keeps the tracker's association, because the places of a
        first fit may mix two targets.
        """
        hints = self.hypotheses.hints
        near = [
            near_places({track: hint[i] for track, hint in hints.items()}, kinds, height_m)
            for i in range(len(self.hypotheses.score))
        ]
        if not any(near):
            return self
        alone = [self.hypotheses.take([i]) for i in range(len(near))]
        trials = [Trial(each, places) for each, places in zip(alone, near, strict=True) if places]
        return msgspec.structs.replace(self, trials=(*(Trial(each, {}) for each in alone), *trials))

    @property
    def _log_priors(self) -> Array:
        off = (self._delays - self.context.delay_s) / self.context.sigmas[SharedParameter.DELAY]
        return np.asarray(-0.5 * off * off)

    def _next_round(self, apart_sigmas: float, behind: float) -> DelaySearch:
        """The search in its next round: trials about each distinct delay that is not hopelessly behind the best."""
        ends, likelihood = self._distinct(apart_sigmas)[:MOST_TRIALS], self._score + self._log_priors
        tried = [i for i in ends if i == ends[0] or likelihood[i] > likelihood[ends[0]] - behind]
        trials = self.context.trials(self.hypotheses.joint.take(tried))
        photographs = self.photographs if self.round else self.hypotheses.photographs
        return DelaySearch(self.context, trials, self.round + 1, photographs=photographs)

    def _distinct(self, apart_sigmas: float) -> list[int]:
        """Indices of the hypotheses that ended at distinct delays, the most likely first."""
        delays, sigmas, kept = self._delays, self._sigmas, list[int]()
        for i in np.argsort(-(self._score + self._log_priors), kind="stable").tolist():
            near = (max(APART_S, apart_sigmas * (sigmas[i] + sigmas[j])) for j in kept)
            if all(abs(delays[i] - delays[j]) > least for j, least in zip(kept, near, strict=True)):
                kept.append(i)
        return kept

    def _valley(self, best: int, i: int, ends: Sequence[int]) -> bool:
        """Whether the likelihood falls and rises again between two delays, so that they are not one wide peak."""
        delays, likelihood = self._delays, self._score + self._log_priors
        low, high = sorted((float(delays[best]), float(delays[i])))
        between = [float(likelihood[k]) for k in ends if low < delays[k] < high]
        return bool(between) and min(between) < float(likelihood[i]) - VALLEY

    def _lead(self, i: int, j: int) -> float:
        """Log-likelihood ratio of one hypothesis to another: of the measurements, beyond chance, and of the prior."""
        score, log_prior = self._score, self._log_priors
        variance = np.concatenate([each.score_variance for each in self._passes])
        seen = float(score[i] - score[j])
        beyond = max(0.0, abs(seen) - CHANCE_SIGMAS * max(variance[i], variance[j]) ** 0.5)
        return float(np.copysign(beyond, seen) + log_prior[i] - log_prior[j])


def delay_search(context: CalibrationContext) -> DelaySearch:
    """A delay search before the first frame."""
    return DelaySearch(context, context.bank())

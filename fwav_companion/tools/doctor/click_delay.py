"""The delay of an operator's video, measured by clicks in time with a blinking object. PURE.

An object that the detector finds appears and disappears in an even rhythm before the camera: a lamp for ``color``, a
tag on a telephone's screen. The operator sees it later, and clicks each time that it appears. People tap in time with
an even rhythm: the mean of many taps is some hundredths of a second early, but a reaction to a single flash is 0.2 s
late (Repp 2005, Sensorimotor synchronization: a review of the tapping literature). So the delay is the phase of the
clicks in the rhythm. It is known up to a whole period.
"""

from __future__ import annotations

from cmath import exp, phase
from collections import defaultdict
from collections.abc import Iterable, Sequence
from itertools import pairwise
from math import log, pi, sqrt
from statistics import median
from typing import Final

import msgspec

ABSENT_S: Final = 0.15
"""Shortest absence before an appearance: a detector misses a frame now and then."""
FEWEST_BLINKS: Final = 4
FEWEST_CLICKS: Final = 6
SHORTEST_S, LONGEST_S = 0.6, 4.0
"""Range of usable rhythm periods, seconds: people cannot click faster, and at a slower rhythm they wait and react."""
UNEVEN: Final = 0.15
"""Largest median deviation of the periods of an even rhythm, as a share of the period."""
MOST_SCATTER_S: Final = 0.15
"""Largest standard deviation of clicks in time with the rhythm: [publish] video_delay_s tolerates 0.15 s."""
TAPPING_SIGMA_S: Final = 0.03
"""One sigma of people's mean tapping error, early or late."""
TOGETHER_S: Final = 0.25
"""Clicks closer in time than this count as one: a repeated command."""


class ClickDelay(msgspec.Struct, frozen=True):
    """The delay that the clicks show."""

    video_delay_s: float
    sigma_s: float
    """One sigma of the delay, including people's mean tapping error."""
    clicks: int
    period_s: float
    """Period of the blinking: the delay may be longer by whole periods."""


class NoClickDelay(msgspec.Struct, frozen=True):
    """Why no delay can be given."""

    why: str


class Blinking:
    """Which labels each frame shows, and when each appears."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._last_s = 0.0
        self._seen_s: dict[str, float] = {}
        self._onsets: defaultdict[str, list[float]] = defaultdict(list)

    def add(self, at_s: float, labels: Iterable[str]) -> None:
        """Add a frame by its capture time; frames out of order are left out."""
        if self._first_s is not None and at_s <= self._last_s:
            return
        for label in set(labels):
            seen_s = self._seen_s.get(label, self._first_s)
            if seen_s is not None and self._last_s - seen_s >= ABSENT_S:
                self._onsets[label].append(0.5 * (self._last_s + at_s))
            self._seen_s[label] = at_s
        self._first_s = at_s if self._first_s is None else self._first_s
        self._last_s = at_s

    @property
    def onsets(self) -> Sequence[float]:
        """Instants at which the label that blinks most appeared."""
        return max(self._onsets.values(), key=len, default=[])


def distinct(clicks: Sequence[float]) -> list[float]:
    """The clicks without repetitions."""
    kept: list[float] = []
    for click in sorted(clicks):
        if not kept or click - kept[-1] > TOGETHER_S:
            kept.append(click)
    return kept


def click_delay(onsets: Sequence[float], clicks: Sequence[float]) -> ClickDelay | NoClickDelay:
    """The delay by the clicks' phase in the rhythm of the blinking; instants on one clock, seconds."""
    period_s = rhythm_s(onsets)
    if isinstance(period_s, NoClickDelay):
        return period_s
    delays = [click - _onset_before(onsets, click, period_s) for click in distinct(clicks) if click > onsets[0]]
    if len(delays) < FEWEST_CLICKS:
        return NoClickDelay(f"{len(delays)} clicks; needed: {FEWEST_CLICKS}, each when it appears")
    mean = sum(exp(2j * pi * delay / period_s) for delay in delays) / len(delays)
    # Circular mean and standard deviation: Mardia & Jupp, Directional Statistics, 2000, ch. 2.
    scatter_s = period_s / (2.0 * pi) * sqrt(max(0.0, -2.0 * log(max(abs(mean), 1e-9))))
    if scatter_s > MOST_SCATTER_S:
        return NoClickDelay(f"the clicks scatter by {scatter_s:.2f} s; click in time with the blinking, as to music")
    delay_s = (phase(mean) / (2.0 * pi) * period_s) % period_s
    sigma_s = sqrt(TAPPING_SIGMA_S**2 + scatter_s**2 / len(delays))
    return ClickDelay(delay_s, sigma_s, len(delays), period_s)


def rhythm_s(onsets: Sequence[float]) -> float | NoClickDelay:
    """The period of the blinking, seconds."""
    if len(onsets) < FEWEST_BLINKS:
        return NoClickDelay(f"nothing that the detector finds has appeared {FEWEST_BLINKS} times; let a target blink")
    periods = [after - before for before, after in pairwise(onsets)]
    period_s = median(periods)
    if not SHORTEST_S <= period_s <= LONGEST_S:
        return NoClickDelay(f"it blinks every {period_s:.2f} s; needed: {SHORTEST_S:g} to {LONGEST_S:g} s")
    if median(abs(each - period_s) for each in periods) > UNEVEN * period_s:
        return NoClickDelay("it blinks unevenly; needed: an even rhythm, as of a blinking lamp")
    return period_s


def _onset_before(onsets: Sequence[float], click: float, period_s: float) -> float:
    """The last appearance before a click; the rhythm replaces an appearance that was not seen."""
    last = max(onset for onset in onsets if onset < click)
    return last + (click - last) // period_s * period_s

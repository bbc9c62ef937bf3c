"""The answer of a study from its records alone: errors, claims, calibration, limits and what to change. PURE."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from math import log, sqrt
from statistics import fmean, median
from typing import Final

import msgspec

from fwav_companion.tools.study.causes import NOISES
from fwav_companion.tools.study.distributions import (
    ErrorQuantiles,
    IntervalEstimate,
    binned,
    error_quantiles,
    paired_median,
    quantile_interval,
    share_of,
)
from fwav_companion.tools.study.flight_draw import CONFIGURED, PAPER_FILTER, TWICE, WITHOUT
from fwav_companion.tools.study.flight_ranking import ranked_causes
from fwav_companion.tools.study.flight_record import POINTS, FlightRecord
from fwav_companion.tools.study.keys import Value, Variation
from fwav_companion.tools.study.study_plan import StudyPlan

LEVELS: Final = (0.5, 0.9, 0.95, 0.999)
"""Probabilities of the claims that are tested."""


class ClaimTest(msgspec.Struct, frozen=True):
    """Test of the claims at one probability: how many true positions lie within the claimed ellipses."""

    level: float
    inside: int
    n: int
    share: IntervalEstimate

    @property
    def verdict(self) -> str:
        """Holds, or too narrow or too wide if the interval excludes the probability."""
        if self.share.low <= self.level <= self.share.high:
            return "holds"
        return "too narrow" if self.share.high < self.level else "too wide"


class ArmAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The answer of the flights of one arm."""

    flights: int
    answered: int
    errors: ErrorQuantiles | None
    claimed95_m: float | None
    """Median claimed radius at the end."""
    claims: tuple[ClaimTest, ...]
    no_answer: tuple[tuple[str, int], ...]
    """Reasons and their counts, the most frequent first."""


class CalibrationEnd(msgspec.Struct, frozen=True):
    """The flights that ended with one status of self-calibration."""

    status: str
    flights: int
    lacks: str
    """The condition that most of these flights lacked, by their last calibration line."""


class CalibrationAnswer(msgspec.Struct, frozen=True):
    """How often and how soon self-calibration was calibrated."""

    share: IntervalEstimate
    """Share of flights that were calibrated at the end or before."""
    seconds: IntervalEstimate | None
    """Median time until ``calibrated``, over these flights."""
    ends: tuple[CalibrationEnd, ...]
    """Statuses at the end, the most frequent first."""


class InstantAnswer(msgspec.Struct, frozen=True):
    """Errors at one instant of the flights."""

    at_s: float
    answered: float
    """Share of flights with an answer by then."""
    half_m: float
    nine_tenths_m: float
    most_m: float
    claimed95_m: float


class CauseAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """The error due to a cause, by the filter's own bias terms and, if flights without it were flown, by comparison.

    A noise has no bias term: its sigma is 0.
    """

    name: str
    sigma_m: float
    """Horizontal error due to the cause, one sigma, root mean square over flights."""
    pairs: int = 0
    with_m: float | None = None
    """Median error of the paired flights with the cause."""
    without_m: float | None = None
    change_m: IntervalEstimate | None = None
    """Median of the paired differences, without minus with."""


class CurvePoint(msgspec.Struct, frozen=True):
    """Errors of the flights whose varied value is near one value."""

    value: Value
    flights: int
    answered: int
    half: IntervalEstimate | None
    nine_tenths: IntervalEstimate | None


class VariationAnswer(msgspec.Struct, frozen=True):
    """The curve of one varied key."""

    variation: Variation
    points: tuple[CurvePoint, ...]


class StudyAnswer(msgspec.Struct, frozen=True, kw_only=True):
    """All conclusions of a study."""

    configured: ArmAnswer
    twice: ArmAnswer | None
    paper_filter: ArmAnswer | None
    """The same flights with the paper's low-pass, in the paper's case."""
    over_time: tuple[InstantAnswer, ...]
    calibration: CalibrationAnswer | None
    causes: tuple[CauseAnswer, ...]
    """Causes, the largest first."""
    curves: tuple[VariationAnswer, ...]
    wrong: tuple[FlightRecord, ...]
    """Flights as configured whose claim is wrong beyond 99.9 %."""

    @property
    def confirmed(self) -> list[CauseAnswer]:
        """The causes without which flights were repeated, the largest improvement first."""
        return sorted((each for each in self.causes if each.change_m is not None), key=_change)


def answer_of(plan: StudyPlan, records: Sequence[FlightRecord]) -> StudyAnswer:
    """The conclusions from the records of a study."""
    own = [record for record in records if record.arm == CONFIGURED]
    twice, paper_filter = ([record for record in records if record.arm == arm] for arm in (TWICE, PAPER_FILTER))
    noises = [(name, 0.0) for name in NOISES if any(record.arm == f"{WITHOUT}{name}" for record in records)]
    return StudyAnswer(
        configured=_arm(own),
        twice=_arm(twice) if twice else None,
        paper_filter=_arm(paper_filter) if paper_filter else None,
        over_time=_over_time(plan, own),
        calibration=_calibration(own),
        causes=tuple(_cause(name, variance, records) for name, variance in (*ranked_causes(own), *noises)),
        curves=tuple(_curve(variation, own) for variation in plan.variations),
        wrong=tuple(record for record in own if record.is_wrong),
    )


def _arm(records: Sequence[FlightRecord]) -> ArmAnswer:
    answered = [record for record in records if record.is_answered]
    reasons = Counter(record.no_answer for record in records if not record.is_answered)
    claims = [record.claimed95_m for record in answered if record.claimed95_m is not None]
    return ArmAnswer(
        flights=len(records),
        answered=len(answered),
        errors=error_quantiles(_errors(answered)),
        claimed95_m=median(claims) if claims else None,
        claims=tuple(_claim(level, answered) for level in LEVELS),
        no_answer=tuple(sorted(reasons.items(), key=lambda item: (-item[1], item[0]))),
    )


def _errors(records: Sequence[FlightRecord]) -> list[float]:
    return [record.error_m for record in records if record.error_m is not None]


def _claim(level: float, answered: Sequence[FlightRecord]) -> ClaimTest:
    """Test of the claims at a probability p: inside its ellipse, the normalised square is below -2 ln(1 - p), 2 dof."""
    squares = [record.normalised2 for record in answered if record.normalised2 is not None]
    inside = sum(square <= -2.0 * log(1.0 - level) for square in squares)
    return ClaimTest(level, inside, len(squares), share_of(inside, len(squares)))


def _over_time(plan: StudyPlan, records: Sequence[FlightRecord]) -> tuple[InstantAnswer, ...]:
    found = []
    for k in range(POINTS):
        present = [
            (record.errors_m[k], record.claims95_m[k])
            for record in records
            if record.errors_m and record.errors_m[k] is not None
        ]
        if not present:
            continue
        errors = sorted(error for error, _ in present if error is not None)
        found.append(
            InstantAnswer(
                at_s=(k + 1) * plan.seconds / POINTS,
                answered=len(present) / len(records),
                half_m=_quantile(errors, 0.5),
                nine_tenths_m=_quantile(errors, 0.9),
                most_m=_quantile(errors, 0.95),
                claimed95_m=median(claim for _, claim in present if claim is not None),
            )
        )
    return tuple(found)


def _quantile(ordered: Sequence[float], share: float) -> float:
    """The quantile, by linear interpolation between the values as in numpy."""
    place = share * (len(ordered) - 1)
    below = int(place)
    above = min(below + 1, len(ordered) - 1)
    return ordered[below] + (place - below) * (ordered[above] - ordered[below])


def _calibration(records: Sequence[FlightRecord]) -> CalibrationAnswer | None:
    flown = [record for record in records if record.calibration]
    if not flown:
        return None
    times = [record.calibrated_s for record in flown if record.calibrated_s is not None]
    statuses = Counter(record.calibration for record in flown)
    return CalibrationAnswer(
        share_of(len(times), len(flown)),
        quantile_interval(times, 0.5) if times else None,
        tuple(
            CalibrationEnd(status, count, _most_lacked(status, flown))
            for status, count in sorted(statuses.items(), key=lambda item: (-item[1], item[0]))
        ),
    )


def _most_lacked(status: str, flown: Sequence[FlightRecord]) -> str:
    """The reason that most flights with this status ended with; of equally frequent ones the first by name."""
    reasons = Counter(record.calibration_lacks for record in flown if record.calibration == status)
    return min(reasons, key=lambda reason: (-reasons[reason], reason))


def _cause(name: str, variance: float, records: Sequence[FlightRecord]) -> CauseAnswer:
    without = {r.index: r.error_m for r in records if r.arm == f"{WITHOUT}{name}" and r.error_m is not None}
    own = {r.index: r.error_m for r in records if r.arm == CONFIGURED and r.error_m is not None}
    both = sorted(without.keys() & own.keys())
    if not both:
        return CauseAnswer(name=name, sigma_m=sqrt(variance))
    before, after = [own[i] for i in both], [without[i] for i in both]
    return CauseAnswer(
        name=name,
        sigma_m=sqrt(variance),
        pairs=len(both),
        with_m=median(before),
        without_m=median(after),
        change_m=paired_median(before, after),
    )


def _change(cause: CauseAnswer) -> float:
    return 0.0 if cause.change_m is None else cause.change_m.value


def _curve(variation: Variation, records: Sequence[FlightRecord]) -> VariationAnswer:
    values = [record.varied[variation.key] for record in records]
    if variation.is_range:
        numbers = [float(value) for value in values]
        groups: list[tuple[Value, list[int]]] = [
            (fmean(numbers[i] for i in part), part) for part in binned(numbers) if part
        ]
    else:
        groups = [(each, [i for i, value in enumerate(values) if value == each]) for each in variation.choices]
    return VariationAnswer(variation, tuple(_point(value, [records[i] for i in part]) for value, part in groups))


def _point(value: Value, records: Sequence[FlightRecord]) -> CurvePoint:
    errors = _errors(records)
    return CurvePoint(
        value,
        len(records),
        len(errors),
        quantile_interval(errors, 0.5) if errors else None,
        quantile_interval(errors, 0.9) if errors else None,
    )

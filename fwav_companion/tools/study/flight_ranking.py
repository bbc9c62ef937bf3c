"""What to change first: causes ranked by the filter's own bias terms, and the arms that confirm the first two. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import fmean
from typing import Final

from fwav_companion.tools.study.causes import NOISES
from fwav_companion.tools.study.flight_draw import CONFIGURED, PAPER_FILTER, TWICE, WITHOUT
from fwav_companion.tools.study.flight_record import CAUSE_NAMES, FlightRecord
from fwav_companion.tools.study.study_plan import StudyPlan

PAIRED: Final = 40
"""Flights of each further arm: the first ones of the study, with the same draws but for one cause."""
CONFIRMED_CAUSES: Final = 2
LEAST_CAUSE_M: Final = 0.001
"""Error below which a cause is not ranked, one sigma, metres: rounding makes a sigma of zero as large."""


def further_flights(flights: int) -> int:
    """Flights of each further arm."""
    return min(PAIRED, flights)


def ranked_causes(records: Sequence[FlightRecord]) -> list[tuple[str, float]]:
    """Causes with the mean horizontal variance that each adds at the end, m^2; the largest first."""
    limits = [record.limits_m for record in records if record.arm == CONFIGURED and record.limits_m]
    if not limits:
        return []
    means = {name: fmean(each.get(name, 0.0) ** 2 for each in limits) for name in CAUSE_NAMES}
    return sorted(
        ((name, mean) for name, mean in means.items() if mean > LEAST_CAUSE_M**2), key=lambda item: (-item[1], item[0])
    )


def configured_tasks(flights: int) -> list[tuple[int, str]]:
    """The flights of a study as configured, and those with twice the sigmas, which need no ranking."""
    return [*((i, CONFIGURED) for i in range(flights)), *((i, TWICE) for i in range(further_flights(flights)))]


def confirming_arms(plan: StudyPlan, records: Sequence[FlightRecord]) -> list[str]:
    """The arms without the error of the first causes. Only the first flights rank the causes, also if more are added.

    The paper's case has no lasting error: its arms are those without one of its noises, and the one with its filter.
    """
    if plan.preset == "paper":
        return [PAPER_FILTER, *(f"{WITHOUT}{name}" for name in NOISES)]
    first = [record for record in records if record.index < further_flights(plan.flights)]
    return [f"{WITHOUT}{name}" for name, _ in ranked_causes(first)[:CONFIRMED_CAUSES]]


def confirming_flights(plan: StudyPlan) -> int:
    """Number of flights in these arms, before any is flown."""
    arms = len(confirming_arms(plan, [])) if plan.preset else CONFIRMED_CAUSES
    return arms * further_flights(plan.flights)


def confirming_tasks(plan: StudyPlan, records: Sequence[FlightRecord]) -> list[tuple[int, str]]:
    """The flights of these arms."""
    return [(i, arm) for arm in confirming_arms(plan, records) for i in range(further_flights(plan.flights))]

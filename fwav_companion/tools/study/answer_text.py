"""The answer of a study in words and as a table. PURE."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import msgspec

from fwav_companion.tools.report.wording import REASONS, length, spaced
from fwav_companion.tools.study.causes import CAUSES
from fwav_companion.tools.study.conclusions import ArmAnswer, CauseAnswer, ClaimTest, StudyAnswer
from fwav_companion.tools.study.distributions import IntervalEstimate
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.study_plan import StudyPlan

PATTERN_WORDS: Final = {
    "eight": "figure eights over the target",
    "hover": "hovers in view of the target",
    "orbit": "orbits about the target",
    "survey": "survey racetracks across the target",
    "straight": "straight passes over the target",
}
NO_ANSWER: Final = {
    "never_in_view": "The target was in fewer than three pictures.",
    "not_confirmed": "Detections were too few, or did not agree.",
}
SMALL_M: Final = 0.03
"""Causes below this are in no table, metres."""
WIDTH: Final = 44


def sentence(plan: StudyPlan, answer: StudyAnswer) -> str:
    """The answer in three or four sentences."""
    own = answer.configured
    if own.errors is None:
        reason = _reason(own.no_answer[0][0]) if own.no_answer else ""
        return f"None of the {own.flights} flights found the target. Most frequent reason: {reason}"
    ends = (
        f"Half of the flights end within {length(own.errors.half.value)} of the target, and 95 % within "
        f"{length(own.errors.most.value)} ({own.answered} of {own.flights} {PATTERN_WORDS[plan.pattern]}, "
        f"{plan.seconds:g} s each)."
    )
    parts = (ends, _claims_sentence(own.claims), _limit_sentence(answer.confirmed))
    return " ".join(part for part in parts if part)


def lines(answer: StudyAnswer) -> Iterator[str]:
    """The table, and what follows from it."""
    own, twice = answer.configured, answer.twice
    yield f"{'':{WIDTH}}{'as configured':>24}" + (f"{'every sigma twice':>24}" if twice else "")
    for name, values in rows(own, twice):
        yield f"{name:{WIDTH}}" + "".join(f"{value:>24}" for value in values)
    if answer.calibration is not None and answer.calibration.statuses:
        yield f"self-calibration: {calibration_words(answer)}"
    for reason, count in own.no_answer:
        yield f"no answer: {count} flights, {spaced(reason)}: {_reason(reason)}"
    yield from _cause_lines(answer)
    yield from _curve_lines(answer)


def rows(own: ArmAnswer, twice: ArmAnswer | None) -> Iterator[tuple[str, list[str]]]:
    """Name and values, one for each arm."""
    arms = [own] if twice is None else [own, twice]
    yield "flights with an answer", [f"{arm.answered} of {arm.flights}" for arm in arms]
    for name, field in (("half of the errors below", "half"), ("90 % below", "nine_tenths"), ("95 % below", "most")):
        yield name, ["-" if arm.errors is None else interval(getattr(arm.errors, field)) for arm in arms]
    yield "claimed radius (95 %), median", ["-" if arm.claimed95_m is None else length(arm.claimed95_m) for arm in arms]
    for k, claim in enumerate(own.claims):
        name = f"inside the claimed {claim.level * 100.0:g} % ellipse"
        yield name, [share(arm.claims[k]) for arm in arms]


def interval(value: IntervalEstimate) -> str:
    """A length with its 95 % interval."""
    return f"{length(value.value)} ({length(value.low)} to {length(value.high)})"


def share(claim: ClaimTest) -> str:
    """A share with its 95 % interval."""
    low, high = 100.0 * claim.share.low, 100.0 * claim.share.high
    return "-" if claim.n == 0 else f"{100.0 * claim.share.value:.0f} % ({low:.0f} to {high:.0f} %)"


def calibration_words(answer: StudyAnswer) -> str:
    """How soon the camera was calibrated, and how flights ended."""
    calibration = answer.calibration
    if calibration is None:
        return "off"
    share_words = f"{100.0 * calibration.share.value:.0f} % of flights calibrated the camera"
    if calibration.seconds is not None:
        share_words += f", half of them within {calibration.seconds.value:.0f} s"
    ends = ", ".join(f"{status} {count}" for status, count in calibration.statuses)
    return f"{share_words}; at the end: {ends}"


def as_object(plan: StudyPlan, answer: StudyAnswer, report: str, wrong: Sequence[str]) -> dict[str, Any]:
    """The object for --json."""
    found: dict[str, Any] = msgspec.to_builtins(answer)
    found["wrong"] = [{"index": record.index, "replay": line} for record, line in zip(answer.wrong, wrong, strict=True)]
    return {"sentence": sentence(plan, answer), **found, "report": report}


def wrong_lines(wrong: Sequence[FlightRecord], commands: Sequence[str]) -> Iterator[str]:
    """The flights whose claims are wrong, with the lines that fly them alone."""
    if wrong:
        verb = "flight claims" if len(wrong) == 1 else "flights claim"
        yield f"{len(wrong)} {verb} an ellipse that is wrong beyond 99.9 %; each flies alone by:"
    for record, command in zip(wrong, commands, strict=True):
        yield f"  {command}   # {length(record.error_m or 0.0)} off, claimed {length(record.claimed95_m or 0.0)} (95 %)"


def cause_name(name: str) -> str:
    """The cause in words."""
    return CAUSES[name].name


def change_words(cause: CauseAnswer) -> str:
    """What flights without the cause gained, with its interval."""
    if cause.change_m is None or cause.with_m is None or cause.without_m is None:
        return ""
    ends = (moved(cause.change_m.low), moved(cause.change_m.high))
    by = f"{moved(cause.change_m.value)}, between {ends[0]} and {ends[1]}, {cause.pairs} pairs"
    return f"median {length(cause.with_m)} to {length(cause.without_m)} ({by})"


def moved(change_m: float) -> str:
    """A change of the error in words."""
    return f"{length(abs(change_m))} {'nearer' if change_m < 0.0 else 'farther'}"


def _claims_sentence(claims: Sequence[ClaimTest]) -> str:
    claim = next(each for each in claims if each.level == 0.95)
    if claim.n == 0:
        return ""
    words = {
        "holds": "The claims hold",
        "too narrow": "The claims are too narrow",
        "too wide": "The claims are wider than necessary",
    }[claim.verdict]
    return f"{words}: the claimed 95 % ellipses contain the target in {share(claim)} of these flights."


def _limit_sentence(confirmed: Sequence[CauseAnswer]) -> str:
    if not confirmed:
        return ""
    first = confirmed[0]
    if first.change_m is None or first.without_m is None or first.with_m is None:
        return ""
    if first.change_m.high < 0.0:
        return (
            f"What limits it is {cause_name(first.name)}: flown again without its error, half of the flights end "
            f"within {length(first.without_m)} instead of {length(first.with_m)}."
        )
    return (
        f"No single cause limits it: flown again without the error of {cause_name(first.name)}, half of the flights "
        f"end within {length(first.without_m)} instead of {length(first.with_m)}, which may be chance."
    )


def _cause_lines(answer: StudyAnswer) -> Iterator[str]:
    shown = [each for each in answer.causes if each.sigma_m >= SMALL_M or each.change_m is not None]
    if shown:
        yield "what limits the end of a flight, by the filter's own terms (one sigma):"
    for cause in shown:
        again = f"; without it: {change_words(cause)}" if cause.change_m is not None else ""
        yield f"  {cause_name(cause.name):{WIDTH - 2}}{length(cause.sigma_m):>9}{again}"
    if answer.confirmed and (answer.confirmed[0].change_m or IntervalEstimate(0.0, 0.0, 0.0)).high < 0.0:
        yield f"change first: {CAUSES[answer.confirmed[0].name].remedy}"


def _curve_lines(answer: StudyAnswer) -> Iterator[str]:
    for curve in answer.curves:
        yield f"{curve.variation.key}: half of the errors below, by its value"
        for point in curve.points:
            value = f"{point.value:.4g}" if isinstance(point.value, float) else point.value
            errors = "no answer" if point.half is None else interval(point.half)
            yield f"  {value:>{WIDTH - 2}}  {errors}  ({point.answered} of {point.flights} flights)"


def _reason(name: str) -> str:
    return NO_ANSWER.get(name) or REASONS.get(name, f"{spaced(name)}.")

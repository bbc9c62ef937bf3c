"""The answer of a study in words and as a table. PURE."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import msgspec

from fwav_companion.tools.reason_table import words_of
from fwav_companion.tools.report.calibration_section import STATUSES
from fwav_companion.tools.report.wording import length, spaced
from fwav_companion.tools.study.causes import error_cause
from fwav_companion.tools.study.conclusions import ArmAnswer, CauseAnswer, ClaimTest, StudyAnswer
from fwav_companion.tools.study.distributions import IntervalEstimate
from fwav_companion.tools.study.flight_draw import BIRD_PITCH_DEG
from fwav_companion.tools.study.flight_record import FlightRecord
from fwav_companion.tools.study.paper_preset import NOTES
from fwav_companion.tools.study.study_plan import StudyPlan

PATTERN_WORDS: Final = {
    "eight": "figure eights over the target",
    "hover": "hovers in view of the target",
    "orbit": "orbits about the target",
    "survey": "survey racetracks across the target",
    "straight": "straight passes over the target",
}
NO_ANSWER: Final = {
    "never_in_view": "The target was in fewer than three pictures: fly closer, higher or longer, or tilt the camera.",
    "not_confirmed": "It was detected too rarely, or detections did not agree: fly longer in view of the target.",
}
COPTER: Final = "For a copter: --set flight.flap_deg=0 flight.pitch_deg=0"
SMALL_M: Final = 0.03
"""Least error of a cause that the tables show, metres."""
WORTH_SHARE: Final = 0.1
"""Least improvement for which a cause is worth changing, as a share of the error with it: less is not noticed."""
WIDTH: Final = 40
COLUMN: Final = 28
"""Width of a column of values: that of "12.34 m (10.00 to 14.00 m)"."""


def sentence(plan: StudyPlan, answer: StudyAnswer) -> str:
    """The answer in three or four sentences."""
    own = answer.configured
    if own.errors is None:
        reason = no_answer_words(own.no_answer[0][0]) if own.no_answer else ""
        return f"None of the {own.flights} flights found the target. Most frequent reason: {reason}"
    ends = (
        f"Half of the flights end within {length(own.errors.half.value)} of the target, and 95 % within "
        f"{length(own.errors.most.value)} ({own.answered} of {own.flights} {flights_words(plan)})."
    )
    parts = (ends, _claims_sentence(own.claims), _limit_sentence(answer))
    return " ".join(part for part in parts if part)


def copter_hint(plan: StudyPlan, answer: StudyAnswer) -> str:
    """How to fly a copter; "" where the flights did not flap, or a user chose how they do."""
    chosen = {key for key, _ in plan.settings} | {each.key for each in plan.variations}
    if plan.preset or chosen & {"flight.flap_deg", "flight.pitch_deg"} or not answer.configured.flights:
        return ""
    return f"The body flaps, at {BIRD_PITCH_DEG:g} degrees of mean pitch where the mount allows it. {COPTER}"


def flights_words(plan: StudyPlan) -> str:
    """The flights of a study in words."""
    if plan.preset == "paper":
        return "hovers at 10 m with 90 pictures each: the paper's case"
    return f"{PATTERN_WORDS[plan.pattern]}, {plan.seconds:g} s each"


def lines(plan: StudyPlan, answer: StudyAnswer) -> Iterator[str]:
    """The table and its conclusions."""
    for name, values in (("", [name for name, _ in columns(answer)]), *rows(answer)):
        yield f"{name:{WIDTH}}" + "".join(f"{value:>{COLUMN}}" for value in values)
    for reason, count in answer.configured.no_answer:
        yield f"no answer: {count} flights, {spaced(reason)}: {no_answer_words(reason)}"
    yield from _calibration_lines(plan, answer)
    yield from _cause_lines(answer)
    yield from _curve_lines(answer)
    yield from NOTES if plan.preset == "paper" else ()
    hint = copter_hint(plan, answer)
    if hint:
        yield hint


def columns(answer: StudyAnswer) -> list[tuple[str, ArmAnswer]]:
    """Name and answer of each arm that is compared as a whole."""
    arms = (
        ("as configured", answer.configured),
        ("the paper's low-pass", answer.paper_filter),
        ("every true sigma twice", answer.twice),
    )
    return [(name, arm) for name, arm in arms if arm is not None]


def rows(answer: StudyAnswer) -> Iterator[tuple[str, list[str]]]:
    """Name and values, one for each of :func:`columns`."""
    arms = [arm for _, arm in columns(answer)]
    yield "flights with an answer", [f"{arm.answered} of {arm.flights}" for arm in arms]
    for name, field in (("half of the errors below", "half"), ("90 % below", "nine_tenths"), ("95 % below", "most")):
        yield name, ["-" if arm.errors is None else interval(getattr(arm.errors, field)) for arm in arms]
    yield "claimed radius (95 %), median", ["-" if arm.claimed95_m is None else length(arm.claimed95_m) for arm in arms]
    for k, claim in enumerate(answer.configured.claims):
        name = f"inside the claimed {claim.level * 100.0:g} % ellipse"
        yield name, [share(arm.claims[k]) for arm in arms]


def interval(value: IntervalEstimate) -> str:
    """A length with its 95 % interval, in one unit."""
    unit, times, digits = ("m", 1.0, 2) if value.value >= 0.0995 else ("cm", 100.0, 1)
    middle, low, high = (f"{times * each:.{digits}f}" for each in (value.value, value.low, value.high))
    return f"{middle} {unit} ({low} to {high} {unit})"


def share(claim: ClaimTest) -> str:
    """A share with its 95 % interval."""
    return "-" if claim.n == 0 else share_words(claim.share)


def calibration_words(plan: StudyPlan, answer: StudyAnswer) -> str:
    """Whether self-calibration is on, and how soon the camera was calibrated."""
    calibration = answer.calibration
    if calibration is None:
        return "Self-calibration is off."
    on = "Self-calibration is on."
    if plan.switches_calibration_on:
        on = (
            f"The study has self-calibration on, {plan.config_name} has it off: set [tracking] self_calibration = true "
            "to fly so, or study it off by --set tracking.self_calibration=false."
        )
    found = f"{share_words(calibration.share)} of the flights calibrated the camera"
    if calibration.seconds is not None:
        found += f", half of these within {calibration.seconds.value:.0f} s"
    return f"{on} {found}."


def share_words(value: IntervalEstimate) -> str:
    """A share with its 95 % interval."""
    return f"{100.0 * value.value:.0f} % ({100.0 * value.low:.0f} to {100.0 * value.high:.0f} %)"


def calibration_rows(answer: StudyAnswer) -> Iterator[tuple[str, str, str]]:
    """Status at the end, number of flights, and meaning with the condition that most of these flights lacked."""
    for end in answer.calibration.ends if answer.calibration is not None else ():
        lacks = f" Most of these flights end with: {end.lacks}." if end.lacks else ""
        yield end.status, f"{end.flights}", f"{STATUSES.get(end.status, '')}{lacks}"


def as_object(plan: StudyPlan, answer: StudyAnswer, report: str, wrong: Sequence[str]) -> dict[str, Any]:
    """The object for --json."""
    found: dict[str, Any] = msgspec.to_builtins(answer)
    found["wrong"] = [{"index": record.index, "replay": line} for record, line in zip(answer.wrong, wrong, strict=True)]
    return {"sentence": sentence(plan, answer), **found, "report": report}


def wrong_lines(wrong: Sequence[FlightRecord], commands: Sequence[str]) -> Iterator[str]:
    """The flights whose claims are wrong, with the command lines that repeat each of them alone."""
    if wrong:
        verb = "flight claims" if len(wrong) == 1 else "flights claim"
        yield f"{len(wrong)} {verb} an ellipse that is wrong beyond 99.9 %; each flies alone by:"
    for record, command in zip(wrong, commands, strict=True):
        yield f"  {command}   # {length(record.error_m or 0.0)} off, claimed {length(record.claimed95_m or 0.0)} (95 %)"


def cause_name(name: str) -> str:
    """The cause in words."""
    return error_cause(name).name


def change_words(cause: CauseAnswer) -> str:
    """Change of the error without the cause, with its interval; empty if no flight without it was flown."""
    if cause.change_m is None or cause.with_m is None or cause.without_m is None:
        return ""
    ends = f"half of {cause.pairs} flights end within {length(cause.without_m)} instead of {length(cause.with_m)}"
    return f"{ends}; {_paired_words(cause.change_m)}"


def _paired_words(change_m: IntervalEstimate) -> str:
    """The median of the paired changes, with its interval."""
    low, high = change_m.low, change_m.high
    if low < 0.0 < high or low == high == 0.0:
        return f"no change shown: the same flight ends between {moved(low)} and {moved(high)} (median)"
    near, far = sorted((abs(low), abs(high)))
    return f"the same flight ends {moved(change_m.value)} (median, {length(near)} to {length(far)})"


def is_worth_changing(cause: CauseAnswer) -> bool:
    """Whether the same flights end nearer without this error, beyond chance and by WORTH_SHARE of their error."""
    if cause.change_m is None or cause.with_m is None:
        return False
    return cause.change_m.high < 0.0 and -cause.change_m.value >= WORTH_SHARE * cause.with_m


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


def _limit_sentence(answer: StudyAnswer) -> str:
    if not answer.causes:
        return "No lasting error limits it: what is left is noise, which more pictures average out."
    if not answer.confirmed:
        return ""
    worth = next(filter(is_worth_changing, answer.confirmed), None)
    first = worth or answer.confirmed[0]
    if first.change_m is None or first.without_m is None or first.with_m is None:
        return ""
    if worth is not None:
        return (
            f"What limits it is {cause_name(first.name)}: flown again without its error, half of the flights end "
            f"within {length(first.without_m)} instead of {length(first.with_m)}."
        )
    return (
        f"No single cause limits it: flown again without the error of {cause_name(first.name)}, half of the flights "
        f"end within {length(first.without_m)} instead of {length(first.with_m)}."
    )


def _calibration_lines(plan: StudyPlan, answer: StudyAnswer) -> Iterator[str]:
    yield calibration_words(plan, answer)
    for status, flights, words in calibration_rows(answer):
        yield f"  {status:<14}{flights:>6}  {words}"


def _cause_lines(answer: StudyAnswer) -> Iterator[str]:
    shown = [each for each in answer.causes if each.sigma_m >= SMALL_M or (each.sigma_m and each.change_m is not None)]
    if shown:
        yield "what limits the end of a flight, by the filter's own terms (one sigma):"
    for cause in shown:
        yield f"  {cause_name(cause.name):{WIDTH - 2}}{length(cause.sigma_m):>9}"
    if answer.confirmed:
        yield "the same flights again without one of these errors, in truth and prior:"
    for cause in answer.confirmed:
        yield f"  {cause_name(cause.name)}: {change_words(cause)}"
    worth = next(filter(is_worth_changing, answer.confirmed), None)
    if worth is not None:
        yield f"change first: {error_cause(worth.name).remedy}"


def _curve_lines(answer: StudyAnswer) -> Iterator[str]:
    for curve in answer.curves:
        yield f"{curve.variation.key}: half of the errors below, by its value"
        for point in curve.points:
            value = f"{point.value:.4g}" if isinstance(point.value, float) else point.value
            errors = "no answer" if point.half is None else interval(point.half)
            yield f"  {value:>{WIDTH - 2}}  {errors}  ({point.answered} of {point.flights} flights)"


def no_answer_words(name: str) -> str:
    """A reason why a flight has no answer, as a sentence."""
    return NO_ANSWER.get(name) or words_of(name) or f"{spaced(name)}."

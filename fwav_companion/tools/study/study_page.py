"""The report of a study: a self-contained page for a design review. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from fwav_companion import __version__
from fwav_companion.config import UncertaintyConfig
from fwav_companion.tools.report.page_elements import document, figure, key, row, section, table
from fwav_companion.tools.report.wording import length, spaced
from fwav_companion.tools.study.answer_text import (
    calibration_rows,
    calibration_words,
    cause_name,
    change_words,
    columns,
    copter_hint,
    flights_words,
    interval,
    is_worth_changing,
    no_answer_words,
    rows,
    sentence,
)
from fwav_companion.tools.study.causes import error_cause
from fwav_companion.tools.study.conclusions import CauseAnswer, StudyAnswer, VariationAnswer
from fwav_companion.tools.study.flight_draw import (
    CONFIGURED,
    FALSE_DETECTIONS,
    TWICE,
    USUAL_POSITION_M,
    WANDER_TIMES_S,
)
from fwav_companion.tools.study.flight_record import FLOWN, FlightRecord
from fwav_companion.tools.study.keys import Value
from fwav_companion.tools.study.paper_preset import NOTES
from fwav_companion.tools.study.record_file import Environment
from fwav_companion.tools.study.study_charts import (
    claims_chart,
    curve_chart,
    distribution_chart,
    over_time_chart,
)
from fwav_companion.tools.study.study_plan import StudyPlan

FLOWN_WORDS = {
    "height_m": "height above the ground, m",
    "radius_m": "radius of the pattern, m",
    "speed_m_s": "speed, m/s",
    "pitch_deg": "mean pitch of the body, degrees",
    "flap_hz": "wing beat, Hz",
    "flap_deg": "amplitude of the flapping, degrees",
    "wind_m_s": "wind, m/s",
    "miss_rate": "share of missed detections",
}
SHOWN_M = 0.005
"""Least error with a bar, metres."""


def study_page(
    plan: StudyPlan,
    records: Sequence[FlightRecord],
    answer: StudyAnswer,
    environment: Environment,
    *,
    notes: Sequence[str] = (),
    commands: Sequence[str] = (),
) -> str:
    """The HTML file. ``commands``: lines that fly the flights with wrong claims alone."""
    return document(
        "How accurate will it be",
        [
            _summary(plan, answer, notes),
            _first_section(answer),
            _error_section(plan, records, answer),
            *(_curve_section(curve) for curve in answer.curves),
            _claim_section(answer),
            _calibration_section(plan, answer),
            _no_answer_section(answer),
            _wrong_section(answer, commands),
            _method_section(plan, records, environment),
        ],
    )


def _summary(plan: StudyPlan, answer: StudyAnswer, notes: Sequence[str]) -> str:
    own = answer.configured
    words = f'<p class="lead also">{escape(sentence(plan, answer))}</p>'
    words += "".join(f'<p class="lead off">{escape(note)}</p>' for note in notes)
    hint = copter_hint(plan, answer)
    words += f"<p>{escape(hint)}</p>" if hint else ""
    cards = [(f"{own.answered} / {own.flights}", "flights with an answer")]
    if own.errors is not None:
        cards += [
            (length(own.errors.half.value), "error, half of the flights"),
            (length(own.errors.most.value), "error, 95 % of the flights"),
        ]
    claim = own.claims[2]
    if claim.n:
        cards.append((f"{100.0 * claim.share.value:.0f} %", "inside their claimed 95 % ellipse"))
    if answer.calibration is not None:
        cards.append((f"{100.0 * answer.calibration.share.value:.0f} %", "calibrated their camera"))
    items = "".join(f"<div><b>{escape(value)}</b><span>{escape(name)}</span></div>" for value, name in cards)
    kicker = f"fwav-companion study \u00b7 {plan.config_name}"
    return (
        f'<header><p class="kicker">{escape(kicker)}</p><h1>How accurate will it be</h1>{words}</header>'
        f'<section class="cards">{items}</section>'
    )


def _first_section(answer: StudyAnswer) -> str:
    """What to change first: the ranking with bars, and the paired reruns."""
    if not answer.causes:
        return ""
    largest = answer.causes[0].sigma_m
    bars = "".join(_bar(cause, largest) for cause in answer.causes if cause.sigma_m >= SHOWN_M)
    caption = (
        "One sigma on the ground at the end of a flight, by cause: what the target's claim would lose if that error "
        "were exactly known. By the filter's own bias terms, over all flights."
    )
    ranking = figure("The error budget at the end", bars, caption) if bars else ""
    again = f"<figure><h3>Flown again without it</h3>{_reruns(answer)}</figure>" if answer.confirmed else ""
    form = "two broad" if ranking and again else "one"
    return section("What to change first", "", f'<div class="{form}">{ranking}{again}</div>')


def _reruns(answer: StudyAnswer) -> str:
    """A paragraph for each cause without which flights were repeated."""
    words = (
        "The same flights were flown again with the same random numbers, but without that one error, in truth and in "
        "the prior."
    )
    causes = "".join(
        f"<p><b>{escape(cause_name(each.name))}</b><br>{escape(_sentence(change_words(each)))}"
        + (f"<br>To get there: {escape(error_cause(each.name).remedy)}." if is_worth_changing(each) else "")
        + "</p>"
        for each in answer.confirmed
    )
    return f"<p>{words}</p>{causes}"


def _sentence(words: str) -> str:
    return f"{words[:1].upper()}{words[1:]}."


def _bar(cause: CauseAnswer, largest: float) -> str:
    width = f"{100.0 * cause.sigma_m / largest:.1f}%"
    return (
        f'<div class="bar-row"><span>{escape(cause_name(cause.name))}</span>'
        f'<span class="track"><i style="width:{width}"></i></span><b>{length(cause.sigma_m)}</b></div>'
    )


def _error_section(plan: StudyPlan, records: Sequence[FlightRecord], answer: StudyAnswer) -> str:
    errors = _errors(records, CONFIGURED)
    if not errors:
        return ""
    entries = [
        ("ours", "line", "half of the flights are below"),
        ("plain", "line", "90 %"),
        ("paper", "line", "95 %"),
        ("bound", "line", "claimed radius (95 %), median"),
    ]
    over_time = figure("Over the flight", over_time_chart(answer.over_time, plan.seconds), key=key(entries))
    kinds = [("ours", "line", "as configured"), ("paper", "line", "every true sigma twice its prior")]
    drawn = distribution_chart(errors, _errors(records, TWICE))
    at_end = figure("At the end", drawn, key=key(kinds if answer.twice is not None else kinds[:1]))
    heads = ["", *(name for name, _ in columns(answer))]
    body = [row([name, *values]) for name, values in rows(answer)]
    words = "In brackets: 95 % intervals of these figures themselves, since the flights are a sample."
    if answer.twice is not None:
        words += " The last column is what a configuration costs that claims half of the true errors."
    grid = f'<div class="two">{over_time}{at_end}</div>{table(heads, body)}'
    return section("Error of the target", words, grid)


def _errors(records: Sequence[FlightRecord], arm: str) -> list[float]:
    return [record.error_m for record in records if record.arm == arm and record.error_m is not None]


def _curve_section(curve: VariationAnswer) -> str:
    drawn = curve_chart(curve)
    entries = [
        ("ours", "line", "half of the errors are below"),
        ("claim", "area", "95 % bootstrap band of that"),
        ("relative", "dot", "90 % are below"),
    ]
    body = [
        row([
            f"{_value(point.value)} ({point.answered} of {point.flights})",
            "-" if point.half is None else interval(point.half),
            "-" if point.nine_tenths is None else interval(point.nine_tenths),
        ])
        for point in curve.points
    ]  # fmt: skip
    numbers = table(["value (flights with an answer)", "half below", "90 % below"], body)
    shown = figure(f"Error over {curve.variation.key}", drawn, key=key(entries)) if drawn else ""
    return section(f"With other values of {curve.variation.key}", "", f'<div class="two">{shown}{numbers}</div>')


def _value(value: Value) -> str:
    return f"{value:.3g}" if isinstance(value, float) else value


def _claim_section(answer: StudyAnswer) -> str:
    own, twice = answer.configured, answer.twice
    entries = [("estimate", "dot", "as configured, with its 95 % interval")]
    if twice is not None:
        entries.append(("east", "dot", "every true sigma twice its prior"))
    drawn = figure("Claimed and observed", claims_chart(own, twice), key=key(entries))
    body = [
        row(
            [
                f"{100.0 * claim.level:g} %",
                f"{claim.inside} of {claim.n}",
                f"{100.0 * claim.share.low:.0f} to {100.0 * claim.share.high:.0f} %",
                claim.verdict,
            ],
            "good" if claim.verdict == "holds" else "off",
        )
        for claim in own.claims
        if claim.n
    ]
    numbers = table(["claimed ellipse", "contains the target", "95 % interval of that share", "verdict"], body)
    inside = f'<div class="two">{drawn}<div>{numbers}</div></div>'
    return section("Can the claims be trusted", "", inside)


def _calibration_section(plan: StudyPlan, answer: StudyAnswer) -> str:
    body = [row(each) for each in calibration_rows(answer)]
    ends = f'<div class="reasons">{table(["at the end", "flights", ""], body)}</div>' if body else ""
    return section("Self-calibration of the camera", calibration_words(plan, answer), ends)


def _no_answer_section(answer: StudyAnswer) -> str:
    if not answer.configured.no_answer:
        return ""
    body = [row([spaced(reason), f"{count}", no_answer_words(reason)]) for reason, count in answer.configured.no_answer]
    inside = f'<div class="reasons">{table(["reason", "flights", ""], body)}</div>'
    return section("Flights without an answer", "", inside)


def _wrong_section(answer: StudyAnswer, commands: Sequence[str]) -> str:
    if not answer.wrong:
        return ""
    body = [
        row([f"{record.index}", length(record.error_m or 0.0), length(record.claimed95_m or 0.0), command])
        for record, command in zip(answer.wrong, commands, strict=True)
    ]
    expected = 0.001 * answer.configured.answered
    words = (
        f"{len(answer.wrong)} of {answer.configured.answered} claims are wrong beyond 99.9 %; by chance {expected:.2g} "
        "are expected. Each line flies one of them alone and keeps its recording."
    )
    return section("Claims that are wrong", words, table(["flight", "error", "claimed (95 %)", "command"], body))


def _method_section(plan: StudyPlan, records: Sequence[FlightRecord], environment: Environment) -> str:
    own = [record for record in records if record.arm == CONFIGURED]
    spans = [
        row([FLOWN_WORDS[name], _span([record.flown[name] for record in own])])
        for name in FLOWN  # records of a file have another order than those just flown
        if own and name in own[0].flown
    ]
    settings = [row([key_, value]) for key_, value in plan.settings]
    lens = "" if plan.lens.exact else " The lens counts by its radially symmetric part."
    words = (
        f"{_sentence(flights_words(plan))[:-1]}, drawn from the priors of "
        f"{plan.config_name} with seed {plan.seed}, flown by the mock autopilot and camera, and replayed through the "
        f"same pipeline as a real flight.{lens} Simulated errors are those that the configuration states, missed "
        f"detections, and {_false_words(plan)}; no others."
    )
    tables = f'<div class="two"><div>{table(["flight", "drawn"], spans)}</div><div>{_priors(plan)}</div></div>'
    tables += table(["set", ""], settings) if settings else ""
    wheels = ", ".join(f"{name} {version}" for name, version in environment.wheels.items())
    processors = ", ".join(environment.processors)
    foot = f"<footer><p>fwav-companion {__version__}; {escape(wheels)}; {escape(processors)}.</p></footer>"
    notes = "".join(f"<p>{escape(note)}</p>" for note in (NOTES if plan.preset == "paper" else ()))
    return section("How this was computed", words, notes + tables) + foot


def _false_words(plan: StudyPlan) -> str:
    return "no false one" if plan.preset else f"a false one in every {1.0 / FALSE_DETECTIONS:.0f}th picture"


def _priors(plan: StudyPlan) -> str:
    """The sigmas by which flights are drawn, and the claimed sigmas if they differ."""
    drawn, claimed = plan.truth().uncertainty, plan.parsed(plan.claim_settings()).uncertainty
    names = drawn.__struct_fields__
    differs = any(getattr(drawn, name) != getattr(claimed, name) for name in names)
    body = [row([name, _prior(drawn, name), *([_prior(claimed, name)] if differs else [])]) for name in names]
    return table(["[uncertainty]", "drawn", *(["claimed"] if differs else [])], body)


def _prior(sigmas: UncertaintyConfig, name: str) -> str:
    """The value of a key of [uncertainty]; for ``auto``, the drawn value."""
    value = getattr(sigmas, name)
    if value != "auto":
        return f"{value:g}"
    low, high = WANDER_TIMES_S
    means = {"position_bias_m": f" ({USUAL_POSITION_M:g})", "position_bias_time_s": f" ({low:g} to {high:g})"}
    return f"auto{means.get(name, '')}"


def _span(values: Sequence[float]) -> str:
    low, high = min(values), max(values)
    return f"{low:.4g}" if high - low < 1e-9 else f"{low:.2g} to {high:.2g}"

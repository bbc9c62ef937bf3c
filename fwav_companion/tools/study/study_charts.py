"""Drawings of a study: error over time, distribution, claims, and the curve of a varied key. PURE."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from fwav_companion.tools.report.drawing import (
    CHART,
    WIDE_CHART,
    LinearAxes,
    LogAxes,
    Point,
    circle,
    drawing,
    line,
    polygon,
    polyline,
    text,
)
from fwav_companion.tools.study.conclusions import ArmAnswer, ClaimTest, InstantAnswer, VariationAnswer
from fwav_companion.tools.study.distributions import IntervalEstimate

LEAST_M: Final = 0.001
"""Least error of a logarithmic axis, metres."""
LEAST_RATIO: Final = 5.0
"""Least ratio of the ends of a logarithmic axis."""


def over_time_chart(instants: Sequence[InstantAnswer], seconds: float) -> str:
    """Median, 90 % and 95 % of the errors and the median claim over the flight."""
    tops = [each.most_m for each in instants] + [each.claimed95_m for each in instants]
    axes = LogAxes((0.0, seconds), _log_range([each.half_m for each in instants], tops), WIDE_CHART)
    parts = axes.elements("seconds of the flight", "error, metres, logarithmic")
    band = [axes.at(each.at_s, each.most_m) for each in instants]
    band += [axes.at(each.at_s, each.half_m) for each in reversed(instants)]
    parts.append(polygon(band, "claim"))
    for name, kind in (("claimed95_m", "bound"), ("most_m", "variant variant-paper"),
                       ("nine_tenths_m", "variant variant-plain"), ("half_m", "ours")):  # fmt: skip
        parts.append(polyline([axes.at(each.at_s, getattr(each, name)) for each in instants], kind))
    return drawing(*axes.size, parts, "Error over the flight: half, 90 % and 95 % of flights, and the median claim")


def distribution_chart(errors: Sequence[float], twice: Sequence[float]) -> str:
    """Cumulative distribution of the errors at the end, and that of flights with twice the sigmas."""
    both = [*errors, *twice]
    axes = LinearAxes((0.0, _top(sorted(both)[round(0.98 * (len(both) - 1))])), (0.0, 100.0), WIDE_CHART)
    parts = axes.elements("error at the end, metres", "share of flights with an answer, %")
    for values, kind in ((twice, "variant variant-paper"), (errors, "ours")):
        parts.append(polyline(_steps(axes, sorted(values)), kind))
    return drawing(*axes.size, parts, "Share of flights whose error is smaller")


def claims_chart(own: ArmAnswer, twice: ArmAnswer | None) -> str:
    """Observed against claimed probability, with 95 % intervals; on the diagonal claims are right."""
    axes = LinearAxes((40.0, 104.0), (0.0, 104.0), CHART)
    parts = axes.elements("claimed, %", "observed, %")
    parts.append(line(axes.at(40.0, 40.0), axes.at(100.0, 100.0), "bound"))
    for arm, kind, shift in ((twice, "east", 0.8), (own, "estimate", -0.8)):
        for claim in () if arm is None else arm.claims:
            parts += _bar(axes, 100.0 * claim.level + shift, claim, kind)
    return drawing(*axes.size, parts, "Share of truths inside the claimed ellipses")


def curve_chart(curve: VariationAnswer) -> str:
    """Errors over the varied value: half with its bootstrap band, and 90 %."""
    points = [point for point in curve.points if point.half is not None and point.nine_tenths is not None]
    if not points:
        return ""
    xs = [_place(curve, k, point.value) for k, point in enumerate(curve.points) if point in points]
    span = _span(curve, xs)
    halves = [point.half for point in points if point.half is not None]
    tails = [point.nine_tenths for point in points if point.nine_tenths is not None]
    axes = LogAxes(span, _log_range([each.low for each in halves], [each.value for each in tails]), WIDE_CHART)
    parts = axes.elements(
        "" if curve.variation.choices else curve.variation.key, "error at the end, metres, logarithmic"
    )
    if curve.variation.is_range:
        upper = [axes.at(x, each.high) for x, each in zip(xs, halves, strict=True)]
        lower = [axes.at(x, each.low) for x, each in zip(xs, halves, strict=True)]
        parts.append(polygon([*upper, *reversed(lower)], "claim"))
        parts.append(polyline([axes.at(x, each.value) for x, each in zip(xs, tails, strict=True)], "claim-edge"))
        parts.append(polyline([axes.at(x, each.value) for x, each in zip(xs, halves, strict=True)], "ours"))
    for x, half, tail in zip(xs, halves, tails, strict=True):
        parts += _whisker(axes, x, half)
        parts.append(circle(axes.at(x, tail.value), 3.0, "relative"))
    if curve.variation.choices:
        parts += [text((axes.at(x, 1.0)[0], axes.size[1] - 2.0), f"{point.value}", "name", "middle")
                  for x, point in zip(xs, points, strict=True)]  # fmt: skip
    return drawing(*axes.size, parts, f"Error over {curve.variation.key}")


def _bar(axes: LinearAxes, x: float, claim: ClaimTest, kind: str) -> list[str]:
    if claim.n == 0:
        return []
    share = claim.share
    return [
        line(axes.at(x, 100.0 * share.low), axes.at(x, 100.0 * share.high), "bar"),
        circle(axes.at(x, 100.0 * share.value), 4.0, kind, f"{claim.inside} of {claim.n}"),
    ]


def _whisker(axes: LinearAxes, x: float, value: IntervalEstimate) -> list[str]:
    return [
        line(axes.at(x, value.low), axes.at(x, value.high), "bar"),
        circle(axes.at(x, value.value), 4.0, "estimate"),
    ]


def _place(curve: VariationAnswer, k: int, value: object) -> float:
    return float(value) if curve.variation.is_range and isinstance(value, float) else float(k)


def _span(curve: VariationAnswer, xs: Sequence[float]) -> tuple[float, float]:
    if curve.variation.is_range:
        return (curve.variation.low, curve.variation.high)
    return (min(xs) - 0.5, max(xs) + 0.5)


def _steps(axes: LinearAxes, ordered: Sequence[float]) -> list[Point]:
    """The empirical distribution as a line of steps, up to the end of the axis."""
    points = [axes.at(0.0, 0.0)]
    for k, value in enumerate(ordered):
        if value > axes.x[1]:
            break
        points += [axes.at(value, 100.0 * k / len(ordered)), axes.at(value, 100.0 * (k + 1) / len(ordered))]
    return points if ordered else []


def _log_range(lows: Sequence[float], highs: Sequence[float]) -> tuple[float, float]:
    """Ends of a logarithmic axis, at least :data:`LEAST_RATIO` apart."""
    low, high = max(LEAST_M, 0.7 * min(lows)), 1.3 * max(highs)
    return (min(low, high / LEAST_RATIO), high)


def _top(value: float) -> float:
    return max(0.01, 1.05 * value)

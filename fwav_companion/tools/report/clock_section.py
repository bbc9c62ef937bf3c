"""Sections about time: uncertainty of the clock offset, gaps between attitudes, offset and round trip. Pure."""

from __future__ import annotations

from collections.abc import Sequence
from math import hypot
from statistics import median

from fwav_companion.geometry.ellipses import NORMAL_95
from fwav_companion.recording.line_types import ClockEstimateLine, Line, header_of
from fwav_companion.tools.report.drawing import LinearAxes, drawing, polygon, polyline, thinned
from fwav_companion.tools.report.flight_data import ClockSample, FlightData
from fwav_companion.tools.report.page_elements import figure, key, section
from fwav_companion.types import ClockStatus

MOST_POINTS = 600
BINS = 20
"""Bars of the histogram."""
LARGEST_DRIFT = 600e-6
"""Largest rate error of a clock without a jump, seconds per second: the rate that the hard bound allows for."""
SMALLEST_SIGMA_S = 1e-7
"""Smallest uncertainty in a weight, seconds: below the resolution of the recorded times."""
FIT_S = 5.0
"""Shortest time of a settled clock for a statement about its drift, seconds."""
OFFSET, ROUND_TRIP = "The offset between the two clocks", "The shortest round trip"


def timing_section(flight: FlightData) -> str:
    """Accuracy of the clock offset, and time from each sighting to the nearest attitude; empty without either."""
    figures = []
    if len(flight.clock) > 1:
        last = flight.clock[-1]
        caption = (
            f"This board stamps pictures, the autopilot stamps attitudes. At the end the offset between the two clocks "
            f"was known to {last.error95_s * 1e3:.2g} ms (95 %); its hard bound was {last.bound_s * 1e3:.2g} ms."
        )
        entries = key([("ours", "line", "95 %"), ("bound", "line", "hard bound")])
        figures.append(figure("The two clocks", _uncertainty_chart(flight.clock, flight.seconds), caption, key=entries))
    if flight.gaps_s:
        caption = (
            "Each sighting uses the attitude at the time when its image row was exposed, interpolated between "
            f"messages. Half of the sightings are within {median(flight.gaps_s) * 1e3:.1f} ms of a message. At 5 wing "
            "beats a second, 10 ms can be two degrees."
        )
        figures.append(figure("Time to the nearest attitude", _gaps_chart(flight.gaps_s), caption))
    if not figures:
        return ""
    return section("Time of each sighting", "", f'<div class="two">{"".join(figures)}</div>')


def _uncertainty_chart(samples: Sequence[ClockSample], seconds: float) -> str:
    top_ms = max([1.0, *(1.15e3 * sample.bound_s for sample in samples[1:])])
    axes = LinearAxes((0.0, max(seconds, 1.0)), (0.0, top_ms))
    bound = [axes.at(sample.at_s, sample.bound_s * 1e3) for sample in samples]
    error95 = [axes.at(sample.at_s, sample.error95_s * 1e3) for sample in samples]
    parts = [*axes.elements("seconds", "milliseconds"), polyline(bound, "bound"), polyline(error95, "ours")]
    return drawing(*axes.size, parts, "Uncertainty of the clock offset over time")


def _gaps_chart(gaps_s: Sequence[float]) -> str:
    """Histogram of the time from each used detection to the nearest attitude."""
    top_ms = max(5.0, max(gaps_s) * 1e3)
    counts = [0] * BINS
    for gap_s in gaps_s:
        counts[min(BINS - 1, int(gap_s * 1e3 / top_ms * BINS))] += 1
    axes = LinearAxes((0.0, top_ms), (0.0, max(counts) * 1.1))
    parts = axes.elements("milliseconds to the nearest attitude", "detections")
    for index, count in enumerate(counts):
        left, right = index * top_ms / BINS, (index + 1) * top_ms / BINS
        a, b, base = axes.at(left, count), axes.at(right, count), axes.at(left, 0.0)[1]
        parts.append(polygon([(a[0] + 1, base), (a[0] + 1, a[1]), (b[0] - 1, b[1]), (b[0] - 1, base)], "bar-fill"))
    return drawing(*axes.size, parts, "Detections by time to the nearest attitude")


def clock_offset_section(lines: Sequence[Line], start: float) -> str:
    """Clock offset and shortest round trip over time; empty with less than two lines of a settled clock."""
    clock = settled_clock([line for line in lines if isinstance(line, ClockEstimateLine)])
    if len(clock) < 2:
        return ""
    header = header_of(lines)
    offset_s = 0.0 if header is None else header.unix_offset_s
    times = [line.time_monotonic + offset_s - start for line in clock]
    moved_ms = [1e3 * (line.host_from_autopilot_s - clock[-1].host_from_autopilot_s) for line in clock]
    errors_ms = [1e3 * NORMAL_95 * line.sigma_s for line in clock]
    figures = figure(
        OFFSET,
        _offset_chart(times, list(zip(moved_ms, errors_ms, strict=True))),
        f"Relative to its value at the end, while the clock was settled. {_drift_words(clock)}".strip(),
        key=key([("ours", "line", "offset"), ("bound", "line", "95 % interval")]),
    )
    figures += _round_trip_figure(times, clock)
    return section("The two clocks in detail", "", f'<div class="two">{figures}</div>')


def settled_clock(clock: Sequence[ClockEstimateLine]) -> list[ClockEstimateLine]:
    """The settled clock lines since the last jump of the offset: before it another offset held (autopilot restart)."""
    found: list[ClockEstimateLine] = []
    for line in clock:
        if line.status != ClockStatus.SETTLED:
            continue
        if found and _has_jumped(found[-1], line):
            found = []
        found.append(line)
    return found


def _has_jumped(before: ClockEstimateLine, line: ClockEstimateLine) -> bool:
    """Whether the offset moved further than both hard bounds and the largest drift allow."""
    step_s = abs(line.host_from_autopilot_s - before.host_from_autopilot_s)
    passed_s = line.time_monotonic - before.time_monotonic
    return bool(step_s > before.bound_s + line.bound_s + LARGEST_DRIFT * passed_s)


def clock_drift(clock: Sequence[ClockEstimateLine]) -> tuple[float, float]:
    """Drift of the offset, and half the width of its 95 % interval, seconds per second.

    Drift: line fit weighted by 1 / sigma^2 (Mills). Estimates of a clock filter are correlated, so the interval is that
    of two estimates only, the last one and the best partner: the least sqrt(sigma_i^2 + sigma_last^2) / (t_last - t_i).
    """
    weights = [1.0 / max(line.sigma_s, SMALLEST_SIGMA_S) ** 2 for line in clock]
    times = [line.time_monotonic - clock[0].time_monotonic for line in clock]
    offsets = [line.host_from_autopilot_s - clock[0].host_from_autopilot_s for line in clock]
    total = sum(weights)
    mean_time = sum(w * t for w, t in zip(weights, times, strict=True)) / total
    mean_offset = sum(w * y for w, y in zip(weights, offsets, strict=True)) / total
    spread = sum(w * (t - mean_time) ** 2 for w, t in zip(weights, times, strict=True))
    slope = sum(w * (t - mean_time) * (y - mean_offset) for w, t, y in zip(weights, times, offsets, strict=True))
    sigmas = [hypot(line.sigma_s, clock[-1].sigma_s) for line in clock[:-1]]
    width = min(sigma / (times[-1] - t) for sigma, t in zip(sigmas, times, strict=False))
    return slope / spread, NORMAL_95 * width


def _drift_words(clock: Sequence[ClockEstimateLine]) -> str:
    """A falling offset (host minus autopilot) means that the autopilot's clock gains. Empty below FIT_S seconds."""
    if clock[-1].time_monotonic - clock[0].time_monotonic < FIT_S:
        return ""
    drift, width = (1e6 * value for value in clock_drift(clock))
    digits = 1 if width < 1.0 else 0
    verb = "gains" if drift < 0.0 else "loses"
    rate = f"{abs(drift):.{digits}f} ± {width:.{digits}f} µs per second"
    return f"The autopilot's clock {verb} {rate} (95 %, line fit)."


def _offset_chart(times: Sequence[float], values: Sequence[tuple[float, float]]) -> str:
    """The offset between the ends of its 95 % interval; ``values``: (offset, half width) in milliseconds."""
    low = min(value - width for value, width in values)
    high = max(value + width for value, width in values)
    margin = 0.05 * max(high - low, 1e-3)
    axes = LinearAxes((times[0], max(times[-1], times[0] + 1.0)), (low - margin, high + margin))
    parts = axes.elements("seconds", "milliseconds")
    for factor, kind in ((-1.0, "bound"), (1.0, "bound"), (0.0, "ours")):
        path = [(t, value + factor * width) for t, (value, width) in zip(times, values, strict=True)]
        parts.append(polyline((axes.at(*point) for point in thinned(path, MOST_POINTS)), kind))
    return drawing(*axes.size, parts, OFFSET)


def _round_trip_figure(times: Sequence[float], clock: Sequence[ClockEstimateLine]) -> str:
    trips = [
        (t, 1e3 * line.round_trip_s) for t, line in zip(times, clock, strict=True) if line.round_trip_s is not None
    ]
    if len(trips) < 2:
        return ""
    top_ms = max(0.1, 1.2 * max(trip for _, trip in trips))
    axes = LinearAxes((trips[0][0], max(trips[-1][0], trips[0][0] + 1.0)), (0.0, top_ms))
    parts = [*axes.elements("seconds", "milliseconds"), polyline((axes.at(*point) for point in trips), "ours")]
    caption = "The shortest recent round trip to the autopilot: half of it bounds the error of the offset."
    return figure(ROUND_TRIP, drawing(*axes.size, parts, ROUND_TRIP), caption)

"""Behind a report: innovations, and the clock's offset and round trip. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.recording.lines import Line, line_unix_s
from fwav_companion.tools.report.axes import Frame
from fwav_companion.tools.report.charts import MOST_POINTS
from fwav_companion.tools.report.groups import BELIEVED
from fwav_companion.tools.report.markup import figure, key, section
from fwav_companion.tools.report.svg import Point, circle, drawing, line, polyline, thinned

EXPECTED, BEYOND_95 = 2.0, 5.991
"""Of a normalised square in two dimensions: its mean, and what one in twenty exceeds."""
MOST_SHOWN = 4.0 * BEYOND_95
NEARLY_ALL = 0.97
"""Of the innovations that the scale has room for."""
AXES = (("fix", "dot", "north"), ("east", "dot", "east"))
INNOVATION = (
    "Each sighting from where its target was believed before it: noise scatters about zero, a trend is an error."
)
AS_THEY_CAME = "Each sighting is drawn as it came, before anything that was learned of the camera: here it shows why."


class Innovation(msgspec.Struct, frozen=True):
    """One sighting against where its target was believed just before."""

    at_s: float
    north_m: float
    east_m: float
    squared: float
    """Normalised by all that was not known of either."""


def depths(lines: Sequence[Line]) -> list[str]:
    """Sections for :func:`~fwav_companion.tools.report.page`; those without anything to show are empty."""
    begun = _begun(lines)
    return [_innovations(lines, begun), _clock(lines, begun)]


def _begun(lines: Sequence[Line]) -> float:
    """Unix time of the first thing that was told."""
    offset_s = lines[0]["unix_offset_s"] if lines and lines[0]["type"] == "header" else 0.0
    told = (line_unix_s(line, offset_s) for line in lines if line["type"] in ("target", "clock", "calibration"))
    times = [at_s for at_s in told if at_s is not None]
    return min(times, default=0.0)


def innovations(lines: Sequence[Line], begun: float) -> list[Innovation]:
    """Of every believed track; none where the recording was replayed without them."""
    believed = (line for line in lines if line["type"] == "target" and line["state"] in BELIEVED)
    return [
        Innovation(line["time_unix"] - begun, told["north"], told["east"], told["distance2"])
        for line in believed
        if (told := line.get("innovation")) is not None
    ]


def _innovations(lines: Sequence[Line], begun: float) -> str:
    found = innovations(lines, begun)
    if not found:
        return ""
    seconds = max(each.at_s for each in found)
    squares = [each.squared for each in found]
    mean = sum(squares) / len(squares)
    beyond = 100.0 * sum(square > BEYOND_95 for square in squares) / len(squares)
    caption = (
        f"Over everything that was not known of the sighting or of its target: their mean is {mean:.2f}, where "
        f"{EXPECTED:g} is expected; {beyond:.0f} % lie above {BEYOND_95:g}, where 5 % should. More: errors are larger "
        "than [uncertainty] says. Less: it says too much, or this flight was luckier than most."
    )
    points = [(each.at_s, each.squared) for each in found]
    told = key([("fix", "dot", "one sighting"), ("ours", "line", f"mean that is expected, {EXPECTED:g}"),
                ("bound", "line", f"one in twenty lies above, {BEYOND_95:g}")])  # fmt: skip
    figures = figure("Innovations", _innovation_chart(found, seconds), INNOVATION, key=key(AXES))
    figures += figure("Their normalised squares", _square_chart(points, seconds), caption, key=told)
    words = AS_THEY_CAME if any(line["type"] == "calibration" for line in lines) else ""
    return section("Do the sightings agree with one another?", words, f'<div class="two">{figures}</div>')


def _innovation_chart(found: Sequence[Innovation], seconds: float) -> str:
    largest = sorted(max(abs(each.north_m), abs(each.east_m)) for each in found)
    top_m = max(0.1, 1.2 * largest[int(NEARLY_ALL * (len(largest) - 1))])
    frame = Frame((0.0, max(1.0, seconds)), (-top_m, top_m))
    parts = frame.axes("seconds", "metres")
    for kind, points in (
        ("east", [(each.at_s, each.east_m) for each in found]),
        ("fix", [(each.at_s, each.north_m) for each in found]),
    ):
        parts += [circle(frame.at(*point), 1.7, kind) for point in thinned(points, MOST_POINTS)]
    return _drawing(frame, parts, "Innovations")


def _square_chart(points: Sequence[Point], seconds: float) -> str:
    frame = Frame((0.0, max(1.0, seconds)), (0.0, MOST_SHOWN))
    parts = frame.axes("seconds", "normalised square")
    parts += [circle(frame.at(*point), 1.7, "fix") for point in thinned(points, MOST_POINTS)]
    for level, kind in ((EXPECTED, "ours"), (BEYOND_95, "bound")):
        parts.append(line(frame.at(0.0, level), frame.at(max(1.0, seconds), level), kind))
    return _drawing(frame, parts, "Normalised squares of the innovations")


def _band(times: Sequence[float], points: Sequence[tuple[float, float]], unit: str, name: str) -> str:
    """A value as a line between its one-sigma lines."""
    low = min(value - sigma for value, sigma in points)
    high = max(value + sigma for value, sigma in points)
    margin = 0.05 * max(high - low, 1e-3)
    frame = Frame((times[0], max(times[-1], times[0] + 1.0)), (low - margin, high + margin))
    parts = frame.axes("seconds", unit)
    for share, kind in ((-1.0, "bound"), (1.0, "bound"), (0.0, "ours")):
        course = [(t, value + share * sigma) for t, (value, sigma) in zip(times, points, strict=True)]
        parts.append(polyline((frame.at(*point) for point in thinned(course, MOST_POINTS)), kind))
    return _drawing(frame, parts, name)


def _drawing(frame: Frame, parts: Sequence[str], name: str) -> str:
    return drawing(*frame.size, parts, name)


def _clock(lines: Sequence[Line], begun: float) -> str:
    told = [line for line in lines if line["type"] == "clock"]
    if len(told) < 2:
        return ""
    offset_s = lines[0].get("unix_offset_s", 0.0)
    times = [each["time_monotonic"] + offset_s - begun for each in told]
    moved_ms = [1e3 * (each["host_from_autopilot_s"] - told[-1]["host_from_autopilot_s"]) for each in told]
    sigmas_ms = [1e3 * each["sigma_s"] for each in told]
    drift = 1e3 * (moved_ms[-1] - moved_ms[0]) / max(1e-3, times[-1] - times[0])
    name = "The offset between the two clocks"
    figures = figure(
        name,
        _band(times, list(zip(moved_ms, sigmas_ms, strict=True)), "milliseconds", name),
        f"Against its value at the end. Over the flight the clocks drift by {drift:+.1f} µs a second.",
        key=key([("ours", "line", "offset"), ("bound", "line", "± one sigma")]),
    )
    trips = [
        (t, 1e3 * each["round_trip_s"])
        for t, each in zip(times, told, strict=True)
        if each.get("round_trip_s") is not None
    ]
    if len(trips) > 1:
        frame = Frame(
            (trips[0][0], max(trips[-1][0], trips[0][0] + 1.0)), (0.0, max(0.1, 1.2 * max(trip for _, trip in trips)))
        )
        parts = [*frame.axes("seconds", "milliseconds"), polyline((frame.at(*point) for point in trips), "ours")]
        caption = (
            "The shortest way to the autopilot and back lately: half of it is the most that the offset can be off."
        )
        figures += figure("The best round trip", _drawing(frame, parts, "The best round trip"), caption)
    return section("The two clocks, closer", "", f'<div class="two">{figures}</div>')

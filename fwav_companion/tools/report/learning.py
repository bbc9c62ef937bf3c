"""What self-calibration learned of the camera while it flew: delay and mount, finding their values. Pure."""

from __future__ import annotations

from collections.abc import Sequence

import msgspec

from fwav_companion.tools.report.axes import TINY, Frame
from fwav_companion.tools.report.markup import figure, key, section
from fwav_companion.tools.report.story import CalibrationPoint, Planted, Story
from fwav_companion.tools.report.svg import Point, drawing, line, polygon, polyline, thinned

MOST_POINTS = 300
MARGIN = 0.18
"""Of the height of a chart, above and below what moves in it."""
STATUSES = {
    "waiting": "Too little was seen to move anything: delay and mount stand where the configuration has them.",
    "ambiguous": "Several delays explain what was seen alike, as a steady beat repeats itself: nothing was moved.",
    "unexplained": "No delay within its prior explains what was seen: nothing was moved.",
    "time": "The shaking showed the delay. The mount, which this flight's headings and ranges do not show, stays.",
    "calibrated": "Delay and mount were both found while it flew.",
}
WHAT_IS_THE_MOUNT = (
    "The mount is told by the angles about the body's axes by which it is turned. A constant error of the autopilot's "
    "roll, pitch or heading looks just like that, and is in it."
)
UNITS = {" ms": "milliseconds", "°": "degrees"}
AXES = ("x (roll)", "y (pitch)", "z (yaw)")


class Learned(msgspec.Struct, frozen=True):
    """One quantity over time."""

    name: str
    unit: str
    points: list[tuple[float, float, float]]
    """(seconds, value, one sigma)."""
    true: float | None

    @property
    def told(self) -> str:
        """Where it ended."""
        _, value, sigma = self.points[-1]
        truth = "" if self.true is None else f" In truth {self.true:.2f}{self.unit}."
        return f"At the end {value:.2f}{self.unit} ± {sigma:.2f}{self.unit} (one sigma).{truth}"


def learning(story: Story) -> str:
    """A section; empty where nothing calibrated itself."""
    if len(story.learned) < 2:
        return ""
    by = f" This is what {story.learned_by} found: the answers above were made without." if story.learned_by else ""
    entries = [("calibrated", "line", "believed"), ("claim", "area", "± one sigma")]
    if story.planted is not None:
        entries.append(("planted", "line", "the truth, told to nobody"))
    wrong = f"Nothing was estimated: {story.mistake}. " if story.mistake else ""
    words = f"{wrong}{STATUSES.get(story.learned[-1].status, '')}{by} {WHAT_IS_THE_MOUNT}"
    drawn = "".join(figure(each.name, chart_of(each), each.told) for each in quantities(story.learned, story.planted))
    return section("What it learned of its own camera", words, f'{key(entries)}<div class="grid four">{drawn}</div>')


def quantities(points: Sequence[CalibrationPoint], planted: Planted | None) -> list[Learned]:
    """The delay, and the mount about each of the body's axes."""
    delay = [(each.at_s, 1e3 * each.time_offset_s, 1e3 * each.time_offset_sigma_s) for each in points]
    found = [Learned("Camera delay", " ms", delay, None if planted is None else 1e3 * planted.time_offset_s)]
    for axis, name in enumerate(AXES):
        angle = [(each.at_s, each.mount_deg[axis], each.mount_sigma_deg[axis]) for each in points]
        true = None if planted is None else planted.mount_deg[axis]
        found.append(Learned(f"Mount about {name}", "°", angle, true))
    return found


def chart_of(learned: Learned) -> str:
    """The value in its band, and the truth where it is known."""
    points = learned.points
    frame = Frame((points[0][0], max(points[-1][0], points[0][0] + 1.0)), _reach(learned), TINY)
    upper = _thinned([(t, value + sigma) for t, value, sigma in points])
    lower = _thinned([(t, value - sigma) for t, value, sigma in points])
    parts = [polygon([frame.at(*point) for point in (*upper, *reversed(lower))], "claim")]
    parts += frame.axes("seconds", UNITS[learned.unit])
    if learned.true is not None:
        parts.append(line(frame.at(frame.x[0], learned.true), frame.at(frame.x[1], learned.true), "planted"))
    parts.append(
        polyline((frame.at(*point) for point in _thinned([(t, v) for t, v, _ in points])), "way way-calibrated")
    )
    return drawing(*frame.size, parts, f"{learned.name} over time")


def _thinned(points: Sequence[Point]) -> Sequence[Point]:
    return thinned(points, MOST_POINTS)


def _reach(learned: Learned) -> Point:
    """All values, the truth, and the last band; earlier bands may be wider than the chart."""
    _, last, sigma = learned.points[-1]
    seen = [value for _, value, _ in learned.points] + [last - 2.0 * sigma, last + 2.0 * sigma]
    if learned.true is not None:
        seen.append(learned.true)
    margin = MARGIN * max(max(seen) - min(seen), 1e-3)
    return min(seen) - margin, max(seen) + margin

"""SVG elements and chart axes. Colours are CSS classes, so the page's light or dark style decides them. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import ceil, floor, log10

Point = tuple[float, float]

CHART: Point = (360.0, 210.0)
"""Width and height of a chart in a grid of charts, in SVG units."""
SMALL_CHART: Point = (260.0, 180.0)
"""Width and height of a chart in a row of four, in SVG units."""
WIDE_CHART: Point = (560.0, 340.0)
"""Width and height of a chart that fills more than half a row, in SVG units."""
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 20.0, 30.0
"""Margins of a chart, in SVG units."""
LEFT_WITH_UNITS = 56.0
"""Left margin where tick labels carry a unit, as in "10 cm", in SVG units."""
SHORT_LOG_RANGE = 50.0
"""Ratio of a logarithmic axis's ends below which ticks at 2 and 5 are labelled too."""


def number(value: float) -> str:
    """A coordinate as text, rounded to 0.01 SVG units, which is finer than a pixel."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def polyline(points: Iterable[Point], kind: str) -> str:
    """An open line through the points; empty text without points."""
    path = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return f'<polyline class="{kind}" points="{path}"/>' if path else ""


def polygon(points: Iterable[Point], kind: str) -> str:
    """A filled polygon; empty text without points."""
    path = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return f'<polygon class="{kind}" points="{path}"/>' if path else ""


def circle(at: Point, radius: float, kind: str, tooltip: str = "") -> str:
    """A circle; the browser shows ``tooltip`` under the mouse."""
    title = f"<title>{escape(tooltip)}</title>" if tooltip else ""
    return f'<circle class="{kind}" cx="{number(at[0])}" cy="{number(at[1])}" r="{number(radius)}">{title}</circle>'


def line(a: Point, b: Point, kind: str) -> str:
    """A straight line."""
    return f'<line class="{kind}" x1="{number(a[0])}" y1="{number(a[1])}" x2="{number(b[0])}" y2="{number(b[1])}"/>'


def text(at: Point, words: str, kind: str = "", anchor: str = "start") -> str:
    """A text element; the words are escaped."""
    place = f'x="{number(at[0])}" y="{number(at[1])}"'
    return f'<text class="{kind}" {place} text-anchor="{anchor}">{escape(words)}</text>'


def cross(at: Point, reach: float, kind: str) -> str:
    """A cross with arms of length ``reach``."""
    x, y = at
    return line((x - reach, y), (x + reach, y), kind) + line((x, y - reach), (x, y + reach), kind)


def drawing(width: float, height: float, parts: Iterable[str], label: str) -> str:
    """The SVG element, as wide as its column; ``label`` is read out by screen readers."""
    name = escape(label, quote=True)
    return f'<svg viewBox="0 0 {number(width)} {number(height)}" role="img" aria-label="{name}">{"".join(parts)}</svg>'


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from low to high, about ``most`` of them."""
    if not high > low:
        return [low]
    rough = (high - low) / max(1, most)
    power = 10.0 ** floor(log10(rough))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= rough * 0.999)
    return [step * index for index in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def tick_number(value: float) -> str:
    """The text of a tick without a unit."""
    return f"{value:g}" if abs(value) < 1e4 else f"{value:.0f}"


def tick_length(metres: float) -> str:
    """The text of a tick with its unit: 0.01 is "1 cm"."""
    if metres >= 1.0:
        return f"{metres:.3g} m"
    return f"{100.0 * metres:.3g} cm" if metres >= 0.01 else f"{1000.0 * metres:.3g} mm"


def thinned(points: Sequence[Point], most: int) -> Sequence[Point]:
    """At most ``most`` of the points, evenly chosen, with both ends: the page stays small."""
    if len(points) <= most:
        return points
    step = (len(points) - 1) / (most - 1)
    return [points[round(index * step)] for index in range(most)]


class LinearAxes:
    """Axes of a chart, linear in x and y: data coordinates to SVG coordinates, grid and tick labels."""

    left = LEFT

    def __init__(self, x: tuple[float, float], y: tuple[float, float], size: Point = CHART) -> None:
        """``x``, ``y``: the ends of each axis in data units."""
        self.x, self.y, self.size = x, y, size

    def at(self, x: float, y: float) -> Point:
        """The SVG coordinates of a data point; y is clipped to the axis."""
        (x0, x1), (width, height) = self.x, self.size
        across = self.left + (x - x0) / (x1 - x0) * (width - self.left - RIGHT)
        up = height - BOTTOM - min(1.0, max(0.0, self._fraction(y))) * (height - TOP - BOTTOM)
        return across, up

    def elements(self, x_name: str, y_name: str) -> list[str]:
        """Grid lines, tick labels and axis names."""
        parts = []
        for value, label in self._y_ticks():
            left, right = self.at(self.x[0], value), self.at(self.x[1], value)
            parts.append(line(left, right, "grid"))
            if label:
                parts.append(text((self.left - 6, left[1] + 4), label, "tick", "end"))
        bottom = self.size[1] - BOTTOM
        for value in ticks(*self.x, 6 if self.size[0] > SMALL_CHART[0] else 4):
            x = self.at(value, self.y[0])[0]
            parts += [
                line((x, bottom), (x, bottom + 4), "axis"),
                text((x, bottom + 16), tick_number(value), "tick", "middle"),
            ]
        parts.append(line((self.left, bottom), (self.size[0] - RIGHT, bottom), "axis"))
        parts.append(text((self.size[0] - RIGHT, self.size[1] - 2), x_name, "name", "end"))
        parts.append(text((self.left, TOP - 9), y_name, "name"))
        return parts

    def _fraction(self, y: float) -> float:
        """Height of y on the axis, 0 at the bottom and 1 at the top."""
        return (y - self.y[0]) / (self.y[1] - self.y[0])

    def _y_ticks(self) -> list[tuple[float, str]]:
        """Values of the horizontal grid lines with their labels; an empty label draws the line alone."""
        return [(value, tick_number(value)) for value in ticks(*self.y, 4)]


class LogAxes(LinearAxes):
    """Axes of a chart whose y is logarithmic, in metres: a centimetre and several metres are both readable."""

    left = LEFT_WITH_UNITS

    def _fraction(self, y: float) -> float:
        low, high = self.y
        return log10(max(y, low) / low) / log10(high / low)

    def _y_ticks(self) -> list[tuple[float, str]]:
        low, high = self.y
        short = high / low < SHORT_LOG_RANGE
        found = []
        for power in range(floor(log10(low)), ceil(log10(high)) + 1):
            for factor in (1.0, 2.0, 5.0):
                value = factor * 10.0**power
                if low * 0.999 <= value <= high * 1.001:
                    found.append((value, tick_length(value) if short or factor == 1.0 else ""))
        return found

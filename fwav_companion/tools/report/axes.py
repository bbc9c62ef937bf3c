"""A chart's axes: data to pixels, a grid, numbers and their units. Pure."""

from __future__ import annotations

from math import ceil, floor, log10

from fwav_companion.tools.report.svg import Point, line, text, ticks, told_number

CHART_WIDTH, CHART_HEIGHT = 360.0, 210.0
SMALL: Point = (CHART_WIDTH, CHART_HEIGHT)
"""Several stand side by side."""
TINY: Point = (260.0, 180.0)
"""Four in a row."""
WIDE: Point = (560.0, 340.0)
"""One that carries the story."""
LEFT, RIGHT, TOP, BOTTOM = 40.0, 8.0, 20.0, 30.0
LEFT_OF_WORDS = 56.0
"""The same where ticks carry their unit: "10 cm"."""
FEW = 50.0
"""From end to end of a logarithmic axis: within this, 2 and 5 are written too."""


class Frame:
    """Linear both ways."""

    left = LEFT

    def __init__(self, x: tuple[float, float], y: tuple[float, float], size: Point = SMALL) -> None:
        self.x, self.y, self.size = x, y, size

    def at(self, x: float, y: float) -> Point:
        """In the drawing; what is beyond the top or the bottom stays at it."""
        (x0, x1), (width, height) = self.x, self.size
        across = self.left + (x - x0) / (x1 - x0) * (width - self.left - RIGHT)
        up = height - BOTTOM - min(1.0, max(0.0, self._share(y))) * (height - TOP - BOTTOM)
        return across, up

    def axes(self, x_name: str, y_name: str) -> list[str]:
        """Grid, numbers, names."""
        parts = []
        for value, told in self._rungs():
            left, right = self.at(self.x[0], value), self.at(self.x[1], value)
            parts.append(line(left, right, "grid"))
            if told:
                parts.append(text((self.left - 6, left[1] + 4), told, "tick", "end"))
        bottom = self.size[1] - BOTTOM
        for value in ticks(*self.x, 6 if self.size[0] > TINY[0] else 4):
            x = self.at(value, self.y[0])[0]
            parts += [
                line((x, bottom), (x, bottom + 4), "axis"),
                text((x, bottom + 16), told_number(value), "tick", "middle"),
            ]
        parts.append(line((self.left, bottom), (self.size[0] - RIGHT, bottom), "axis"))
        parts.append(text((self.size[0] - RIGHT, self.size[1] - 2), x_name, "name", "end"))
        parts.append(text((self.left, TOP - 9), y_name, "name"))
        return parts

    def _share(self, y: float) -> float:
        """How far up, from 0 to 1."""
        return (y - self.y[0]) / (self.y[1] - self.y[0])

    def _rungs(self) -> list[tuple[float, str]]:
        """Where the grid's lines lie, and what is written beside them."""
        return [(value, told_number(value)) for value in ticks(*self.y, 4)]


class LogFrame(Frame):
    """Upwards in decades of metres: a centimetre and a few metres are both seen."""

    left = LEFT_OF_WORDS

    def _share(self, y: float) -> float:
        low, high = self.y
        return log10(max(y, low) / low) / log10(high / low)

    def _rungs(self) -> list[tuple[float, str]]:
        low, high = self.y
        few = high / low < FEW
        rungs = []
        for power in range(floor(log10(low)), ceil(log10(high)) + 1):
            for factor in (1.0, 2.0, 5.0):
                value = factor * 10.0**power
                if low * 0.999 <= value <= high * 1.001:
                    rungs.append((value, told_length(value) if few or factor == 1.0 else ""))
        return rungs


def told_length(metres: float) -> str:
    """Of a tick: 0.01 is "1 cm"."""
    if metres >= 1.0:
        return f"{metres:.3g} m"
    return f"{100.0 * metres:.3g} cm" if metres >= 0.01 else f"{1000.0 * metres:.3g} mm"

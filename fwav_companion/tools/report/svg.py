"""Drawing: SVG by hand. Colours are classes, so that the page's style, light or dark, decides them. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from math import ceil, floor, log10

Point = tuple[float, float]


def number(value: float) -> str:
    """A coordinate: a hundredth of a pixel is finer than any screen."""
    return f"{value:.2f}".rstrip("0").rstrip(".")


def polyline(points: Iterable[Point], kind: str) -> str:
    """An open line."""
    told = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return f'<polyline class="{kind}" points="{told}"/>' if told else ""


def polygon(points: Iterable[Point], kind: str) -> str:
    """A filled form."""
    told = " ".join(f"{number(x)},{number(y)}" for x, y in points)
    return f'<polygon class="{kind}" points="{told}"/>' if told else ""


def circle(at: Point, radius: float, kind: str, told: str = "") -> str:
    """A dot; ``told`` appears where a mouse rests on it."""
    title = f"<title>{escape(told)}</title>" if told else ""
    return f'<circle class="{kind}" cx="{number(at[0])}" cy="{number(at[1])}" r="{number(radius)}">{title}</circle>'


def line(a: Point, b: Point, kind: str) -> str:
    """A straight line."""
    return f'<line class="{kind}" x1="{number(a[0])}" y1="{number(a[1])}" x2="{number(b[0])}" y2="{number(b[1])}"/>'


def text(at: Point, told: str, kind: str = "", anchor: str = "start") -> str:
    """Words."""
    place = f'x="{number(at[0])}" y="{number(at[1])}"'
    return f'<text class="{kind}" {place} text-anchor="{anchor}">{escape(told)}</text>'


def cross(at: Point, reach: float, kind: str) -> str:
    """Where something truly is."""
    x, y = at
    return line((x - reach, y), (x + reach, y), kind) + line((x, y - reach), (x, y + reach), kind)


def drawing(width: float, height: float, parts: Iterable[str], label: str) -> str:
    """The whole, as wide as its place allows; ``label`` is for who cannot see it."""
    inside = "".join(parts)
    told = escape(label, quote=True)
    return f'<svg viewBox="0 0 {number(width)} {number(height)}" role="img" aria-label="{told}">{inside}</svg>'


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from low to high."""
    if not high > low:
        return [low]
    rough = (high - low) / max(1, most)
    power = 10.0 ** floor(log10(rough))
    step = next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= rough * 0.999)
    return [step * index for index in range(ceil(low / step - 1e-9), floor(high / step + 1e-9) + 1)]


def told_number(value: float) -> str:
    """For a tick."""
    return f"{value:g}" if abs(value) < 1e4 else f"{value:.0f}"


def thinned(points: Sequence[Point], most: int) -> Sequence[Point]:
    """So few that the page stays small; the ends are kept."""
    if len(points) <= most:
        return points
    step = (len(points) - 1) / (most - 1)
    return [points[round(index * step)] for index in range(most)]

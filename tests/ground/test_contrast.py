"""Contrast of the page's colours by WCAG 2.2 (1.4.3 for text, 1.4.11 for marks), computed from its style sheet."""

from __future__ import annotations

import re

import pytest

pytest.importorskip("aiohttp")

from fwav_companion.ground.server import PAGE

SUNLIGHT, TEXT, MARK = 7.0, 4.5, 3.0
"""AAA for what is read most, AA for any text, AA for graphics."""
PAIRS = [
    *((name, ground, SUNLIGHT) for name in ("text", "quiet") for ground in ("panel", "back")),
    *((name, "panel", TEXT) for name in ("target", "coasting", "old", "good", "bad")),
    *((name, "press", TEXT) for name in ("text", "quiet", "target", "coasting", "old", "good", "bad")),
    ("warn-text", "warn-back", SUNLIGHT),
    *((name, "map", TEXT) for name in ("text", "quiet")),
    *((name, "map", MARK) for name in ("target", "coasting", "old", *(f"v{number}" for number in range(8)))),
]


def colours(theme: str) -> dict[str, str]:
    """The variables of a theme."""
    text = PAGE.joinpath("style.css").read_text(encoding="utf-8")
    selector = ":root {" if theme == "light" else ':root[data-theme="dark"] {'
    return dict(re.findall(r"--([\w-]+): (#[0-9a-f]{6});", text.partition(selector)[2].partition("}")[0]))


def luminance(colour: str) -> float:
    channels = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    r, g, b = (each / 12.92 if each <= 0.04045 else ((each + 0.055) / 1.055) ** 2.4 for each in channels)
    return 0.2126 * r + 0.7152 * g + 0.0722 * b


def contrast(a: str, b: str) -> float:
    light, dark = sorted((luminance(a), luminance(b)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_contrast_of_known_pairs_is_that_of_the_standard():
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)  # the known grey that just fails


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_every_pair_of_a_theme_can_be_read_in_sunlight(theme):
    known = colours(theme)
    low = {(name, ground): round(contrast(known[name], known[ground]), 2) for name, ground, least in PAIRS
           if contrast(known[name], known[ground]) < least}  # fmt: skip
    assert low == {}


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_vehicles_colours_differ(theme):
    known = colours(theme)
    assert len({known[f"v{number}"] for number in range(8)}) == 8

"""The whole page: closed in itself, whatever a recording says is text, and every number in a drawing is one."""

import re

import pytest
from report_lines import Markup, approach, calibration, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import CALIBRATED, PictureShown, Planted, Replayed, page, tell
from fwav_companion.tools.report.comparison import comparison
from fwav_companion.tools.report.depths import depths
from fwav_companion.tools.report.story import CAUSES

EVIL = "</title></svg><script src=//x>&\"'"
ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
DRAWN = ("points", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "width", "height", "viewBox")


def flight(label="mark", status="time", reason="no_clock"):
    """A bit of everything that a recording can hold."""
    fix = {"north": 100.2, "east": -50.1, "cov": []}
    for second in range(20):
        yield target(float(second), 100.0 + 0.1 * second, -50.0, label=label, fix=fix, lat=48.0, lon=11.0) | {
            "innovation": {"north": 0.2, "east": -0.1, "distance2": 0.1 * second}
        }
        yield {"type": "sighting", "frame": second * 10, "reason": None, "gap_s": 0.002 * second, "time_boot": second,
               "budget": dict.fromkeys(CAUSES, 0.1), "camera_ned": [0.0, second, -10.0]}  # fmt: skip
        yield {"type": "clock", "time_monotonic": float(second), "host_from_autopilot_s": 1e-6 * second,
               "sigma_s": 1e-4, "bound_s": 1e-3, "round_trip_s": 2e-3, "status": "good"}  # fmt: skip
        yield calibration(float(second), 0.001 * second, 0.002, [0.1, 0.2, 0.3], 0.1) | {"status": status}
    yield summary(dropped={reason: 3})


def story_of(lines, **other):
    truth = [TruthPoint(line["label"], None, (100.0, -50.0, 0.0), None) for line in lines if line["type"] == "target"]
    return tell(lines, title="T", way=CALIBRATED, truth=truth[:1], **other)


def numbers_of(html: str) -> list[str]:
    return [
        told for _, each in Markup(html).elements for name in DRAWN for told in re.split("[ ,]", each.get(name, ""))
    ]


def test_everything_is_in_one_file():
    lines = [header(origin=ORIGIN), *flight()]
    html = page(story_of(lines), depths(lines))
    assert not re.search(r"""(src|href)\s*=|url\(|@import|https?:""", html)
    assert html.count("<svg") == 1 + 1 + 4 + 2 + 2 + 2  # map, error, learned, timing, innovations, clock
    for heading in ("Where everything is", "Why not better?", "What it learned", "Innovations", "The best round trip"):
        assert heading in Markup(html).text


def test_whatever_a_recording_says_is_text():
    lines = [header(origin=ORIGIN, version=EVIL), *flight(label=EVIL, status=EVIL, reason=EVIL)]
    seen = PictureShown(b"", (640, 480), 1, [{"u": 1.0, "v": 2.0, "label": EVIL, "box": [0, 0, 9, 9]}])
    others = [Replayed(EVIL, "own", approach([1.0], label=EVIL))]
    story = story_of(
        lines, others=others, hidden={EVIL: EVIL}, notes=[EVIL], picture=seen, planted=Planted(0.0, [0, 0, 0])
    )
    for html in (page(story, depths(lines)), comparison(EVIL, (EVIL, EVIL), (story, story), [EVIL])):
        assert "<script" not in html
        assert "</title></svg>" not in html
        assert EVIL in Markup(html).text


@pytest.mark.parametrize("sigma_m", [0.0, 1e-9, 1.0, 1e6])
@pytest.mark.parametrize("count", [1, 2, 40])
def test_every_number_in_a_drawing_is_one(sigma_m, count):
    lines = [header(origin=ORIGIN), *approach([0.0] * count, sigma_m), summary()]
    others = [Replayed("another", "paper", approach([1e-7] * count, sigma_m))]
    html = page(story_of(lines, others=others), depths(lines))
    for told in numbers_of(html):
        assert told in ("", "100%") or abs(float(told)) < 1e5


def test_a_light_page_and_a_dark_one_name_every_colour():
    html = page(story_of([header(), *flight()]))
    style = html.partition("<style>")[2].partition("</style>")[0]
    light, dark = style.split("prefers-color-scheme:dark")
    for name in set(re.findall(r"var\((--\w+)\)", style)):
        assert f"{name}:" in light
        assert f"{name}:" in dark.partition("}}")[0]


def test_innovations_are_drawn_north_and_east():
    told = [{"north": 0.5 if second % 2 else -0.5, "east": -0.25, "distance2": 1.0} for second in range(60)]
    lines = [target(float(second), 100.0, -50.0) | {"innovation": each} for second, each in enumerate(told)]
    lines = [header(), *lines, summary()]
    drawn = Markup(depths(lines)[0])
    north, east = ([float(each["cy"]) for each in drawn.of(kind)] for kind in ("fix", "east"))
    north = north[:60]  # the rest are their squares
    assert len(north) == len(east) == 60
    middle = (max(north) + min(north)) / 2
    assert {round(y - middle, 1) for y in east} == {round((max(north) - middle) / 2, 1)}

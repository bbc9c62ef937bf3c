"""The whole page: self-contained, every statement with 95 %, and text from a recording is never markup."""

import re

import pytest
from report_lines import Markup, approach, calibration, clock, header, sighting, summary, target

from fwav_companion.recording.line_types import TargetLine
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import (
    CALIBRATED,
    PAPER,
    CameraPicture,
    PlantedErrors,
    ReplayedLines,
    comparison,
    diagnostics,
    flight_data,
    page,
)
from fwav_companion.tools.report.comparison import ConfigDifference
from fwav_companion.tools.report.page_elements import STYLE
from fwav_companion.tools.report.sighting_statistics import CAUSES

EVIL = "</title></svg><script src=//x>&\"'"
ORIGIN = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
DRAWN = ("points", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "r", "width", "height", "viewBox")


def lines_of(label="mark", status="time", reason="no_clock", **head):
    """A recording that contains every kind of line."""
    fix = {"north": 100.2, "east": -50.1}
    yield header(origin=ORIGIN, **head)
    for second in range(20):
        at_s = float(second)
        innovation = {"north": 0.2, "east": -0.1, "distance2": 0.1 * second}
        place = {"lat": 48.0, "lon": 11.0, "fix": fix, "innovation": innovation}
        yield target(at_s, 100.0 + 0.1 * second, -50.0, label=label, **place)
        yield sighting(at_s, dict.fromkeys(CAUSES, 0.1), gap_s=0.002 * second, camera_ned=[0.0, at_s, -10.0])
        yield clock(at_s, 600.0 + 1e-6 * second, 1e-4)
        yield calibration(at_s, 0.001 * second, 0.002, [0.1, 0.2, 0.3], 0.1, status=status)
    yield summary(dropped={reason: 3})


def flight_of(lines, **other):
    truth = [TruthPoint(line.label, None, (100.0, -50.0, 0.0), None) for line in lines if isinstance(line, TargetLine)]
    return flight_data(lines, title="T", variant=CALIBRATED, truth=truth[:1], **other)


def numbers_of(html: str) -> list[str]:
    found = Markup(html).elements
    return [number for _, each in found for name in DRAWN for number in re.split("[ ,]", each.get(name, ""))]


def test_everything_is_in_one_file():
    lines = [*lines_of()]
    html = page(flight_of(lines), diagnostics(lines))
    assert not re.search(r"""(src|href)\s*=|url\(|@import|https?:""", html)
    assert html.count("<svg") == 1 + 1 + 4 + 2 + 2 + 2  # map, error, calibration, timing, innovations, clock
    text = Markup(html).text
    for heading in ("Map", "What limits the accuracy", "Self-calibration", "Innovations", "The shortest round trip"):
        assert heading in text


def test_every_uncertainty_is_one_of_95_percent_and_says_so():
    lines = [*lines_of()]
    seen = CameraPicture(b"", (640, 480), 1, [{"u": 1.0, "v": 2.0, "label": "mark", "sigma": 0.5}])
    others = [ReplayedLines(PAPER.name, "paper", approach([1.0]))]
    flight = flight_of(lines, others=others, picture=seen, planted=PlantedErrors(0.0, [0.0, 0.0, 0.0]))
    html = page(flight, diagnostics(lines)).replace(STYLE, "")
    text = Markup(html).text
    assert "sigma" not in text.lower()
    shares = {share for each in Markup(html).texts for share in re.findall(r"(\d+) %", each)}
    assert shares == {"95", "5", "0"}  # 5 % of the innovations are expected beyond, 0 % were
    assert "at (1.0, 2.0) px, ± 1.0 px (95 %)" in text
    assert text.count("(95 %)") >= 8


def test_frames_and_detections_are_counted_apart():
    lines = [header(), *approach([1.0]), *[sighting()] * 161]
    counts = summary(frames=342, detections=161, fixes=161, dropped={"no_clock": 19})
    text = Markup(page(flight_of([*lines, counts]))).text
    expected = "Frames: 342 read, 19 refused. Detections: 161 made, 161 placed on the ground, 0 not placed."
    assert expected in text
    assert "framesno clock19" in text


def test_detections_of_a_refused_frame_and_refused_detections_are_distinguished():
    """Refused: a frame of three detections, two frames of one each; and two detections above the horizon."""
    refused = [sighting(reason=reason) for reason in ("no_clock",) * 3 + ("too_late", "above_horizon") * 2]
    counts = summary(frames=9, detections=14, fixes=7, dropped={"no_clock": 1, "too_late": 2, "above_horizon": 2})
    text = Markup(page(flight_of([header(), *approach([1.0]), *[sighting()] * 7, *refused, counts]))).text
    assert "Frames: 9 read, 3 refused. Detections: 14 made, 7 placed on the ground, 7 not placed." in text
    assert "framesno clock1" in text
    assert "framestoo late2" in text
    assert "detectionsabove horizon2" in text


@pytest.mark.parametrize(("with_sightings", "kind"), [(2, "detections"), (0, "frames"), (5, "frames")])
def test_a_reason_of_both_is_one_of_detections_where_each_has_its_line(with_sightings, kind):
    lines = [header(), *approach([1.0]), sighting(), *[sighting(reason="not_finite")] * with_sightings]
    text = Markup(page(flight_of([*lines, summary(dropped={"not_finite": 2})]))).text
    assert f"{kind}not finite2" in text


def test_whatever_a_recording_says_is_text():
    lines = [*lines_of(label=EVIL, status=EVIL, reason=EVIL, version=EVIL)]
    seen = CameraPicture(b"", (640, 480), 1, [{"u": 1.0, "v": 2.0, "label": EVIL, "box": [0, 0, 9, 9]}])
    others = [ReplayedLines(EVIL, "own", approach([1.0], label=EVIL))]
    flight = flight_of(
        lines, others=others, hidden={EVIL: EVIL}, notes=[EVIL], picture=seen, planted=PlantedErrors(0.0, [0, 0, 0])
    )
    different = ConfigDifference(EVIL, EVIL, EVIL)
    for html in (page(flight, diagnostics(lines)), comparison((EVIL, EVIL), (flight, flight), [different], [EVIL])):
        assert "<script" not in html
        assert "</title></svg>" not in html
        assert EVIL in Markup(html).text


@pytest.mark.parametrize("sigma_m", [0.0, 1e-9, 1.0, 1e6])
@pytest.mark.parametrize("count", [1, 2, 40])
def test_every_number_in_a_drawing_is_one(sigma_m, count):
    lines = [header(origin=ORIGIN), *approach([0.0] * count, sigma_m), summary()]
    others = [ReplayedLines("another", "paper", approach([1e-7] * count, sigma_m))]
    html = page(flight_of(lines, others=others), diagnostics(lines))
    for number in numbers_of(html):
        assert number in ("", "100%") or abs(float(number)) < 1e5


def test_a_light_page_and_a_dark_one_name_every_colour():
    html = page(flight_of([*lines_of()]))
    style = html.partition("<style>")[2].partition("</style>")[0]
    light, dark = style.split("prefers-color-scheme:dark")
    for name in set(re.findall(r"var\((--\w+)\)", style)):
        assert f"{name}:" in light
        assert f"{name}:" in dark.partition("}}")[0]


def test_innovations_are_drawn_north_and_east():
    drawn_m = [{"north": 0.5 if second % 2 else -0.5, "east": -0.25, "distance2": 1.0} for second in range(60)]
    lines = [target(float(second), 100.0, -50.0, innovation=each) for second, each in enumerate(drawn_m)]
    lines = [header(), *lines, summary()]
    drawn = Markup(diagnostics(lines)[0])
    north, east = ([float(each["cy"]) for each in drawn.of(kind)] for kind in ("fix", "east"))
    north = north[:60]  # the rest are their squares
    assert len(north) == len(east) == 60
    middle = (max(north) + min(north)) / 2
    assert {round(y - middle, 1) for y in east} == {round((max(north) - middle) / 2, 1)}


@pytest.mark.parametrize(
    ("sigma_m", "source", "said"),
    [
        (0.0, "home_position", "shifted by +3.2 m, by home position."),
        (3.2, "arming", "shifted by +3.2 m, by arming; a sigma of 3.2 m is in every claim"),
    ],
)
def test_a_shift_of_the_elevation_model_is_named(sigma_m, source, said):
    shift = {"shift_m": 3.2, "sigma_m": sigma_m, "source": source}
    lines = [header(origin=ORIGIN), *approach([0.1, 0.2]), summary(terrain=shift)]
    assert said in page(flight_data(lines, title="a"), diagnostics(lines))

"""The page of a rendered flight: complete, self-contained, and never broken by text of a recording."""

import re
from html.parser import HTMLParser

import msgspec
import pytest

from fwav_companion.recording.labels import display_name
from fwav_companion.recording.line_types import OriginObject, TargetLine
from fwav_companion.recording.summary_types import SummaryLine
from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.demo.demo_report import true_path
from fwav_companion.tools.report import (
    CALIBRATED,
    PAPER,
    CameraPicture,
    ReplayedLines,
    SecondFlight,
    SecondResult,
    TrueVehiclePath,
    flight_data,
    page,
)

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Balance(HTMLParser):
    """Fails on a tag that is closed but not open."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag, attrs):
        self.seen.add(tag)
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def checked(html: str) -> str:
    balance = Balance()
    balance.feed(html)
    assert balance.open == []
    assert not re.search(r"""(src|href)\s*=\s*["'](?!data:)""", html)
    assert "url(" not in html
    assert "@import" not in html
    assert "<script" not in html
    assert "nan" not in re.findall(r'points="([^"]*)"', html)
    return html


@pytest.fixture(scope="module")
def drawn(flight):
    companion, mock = flight
    truth = [TruthPoint(target.label, None, target.at(0.0), None) for target in mock.scene]
    picture = CameraPicture(b"\xff\xd8", (640, 480), 50, [{"u": 10.0, "v": 20.0, "label": "tag36h11:7", "sigma": 0.5}])
    return flight_data(
        companion.lines, title="A flight", truth=truth, picture=picture,
        true_path=TrueVehiclePath([0.0, 99.0], [(0.0, 0.0, -9.0), (50.0, -20.0, -9.0)]),
        hidden={"compass off by": "+1°"}, notes=["again"],
    )  # fmt: skip


def test_the_page_is_whole_and_needs_nothing_from_elsewhere(drawn):
    html = checked(page(drawn))
    for words in ("A flight", "tag 7", "tag 11", "compass off by", "GNSS", "Error over", "data:image/jpeg"):
        assert words in html
    charts = sum(bool(each.points) for each in drawn.targets)
    assert charts >= 2
    assert html.count("<svg") == charts + 4  # and the map, the picture, the clock, the gaps


def test_another_flight_has_a_chapter_of_its_own(drawn):
    result = SecondResult("It ended <well>.", ("0.6 cm", "its <error>"))
    html = checked(page(drawn, second=SecondFlight(["<section><h2>Another flight</h2></section>"], result)))
    assert "<b>0.6 cm</b><span>its &lt;error&gt;</span>" in html
    assert html.index("It ended &lt;well&gt;.") < html.index("View from above") < html.index("Another flight")
    assert html.index("Another flight") < html.index("Error over time")


def test_in_three_variants_each_target_has_one_chart_more(drawn, flight):
    companion, mock = flight
    truth = [TruthPoint(target.label, None, target.at(0.0), None) for target in mock.scene]
    others = [ReplayedLines(each.name, each.kind, companion.lines) for each in (PAPER, CALIBRATED)]
    html = checked(page(flight_data(companion.lines, title="Three", truth=truth, others=others)))
    found = sum(each.found for each in drawn.targets)
    assert html.count('class="variant variant-paper"') >= found
    assert html.count("Distance from the truth: tag ") == found


def test_the_errors_are_against_the_truth(drawn, flight):
    companion, mock = flight
    series = {each.name: each for each in drawn.targets}
    assert len(series) == 5
    assert sum(bool(each.points) for each in drawn.targets) >= 2
    for target in mock.scene:
        one = series[display_name(target.label)]
        assert one.true_ned == pytest.approx(target.at(0.0)[:2])
        for line, point in zip(companion.targets(target.label)[-1:], one.points[-1:], strict=True):
            true = target.at(0.0)
            expected = ((line.north - true[0]) ** 2 + (line.east - true[1]) ** 2) ** 0.5
            assert point.error_m == pytest.approx(expected)


def test_without_a_truth_a_picture_or_a_world_there_is_still_a_page(flight):
    companion, _ = flight
    html = checked(page(flight_data(companion.lines, title="As flown")))
    assert "error on the map" not in html
    relative = [msgspec.structs.replace(companion.lines[0], origin=None), *companion.lines[1:]]
    checked(page(flight_data(relative, title="Relative")))


def test_a_flight_that_saw_nothing_has_a_page(flight):
    header = flight[0].lines[0]
    summary = SummaryLine(frames=0, detections=0, fixes=0, dropped={})
    html = checked(page(flight_data([header, summary], title="Nothing")))
    assert "Frames: 0 read, 0 refused." in html


def test_text_of_a_recording_is_never_markup(flight):
    evil = '"><script>alert(1)</script>'
    lines = [
        msgspec.structs.replace(line, label=evil) if isinstance(line, TargetLine) else line for line in flight[0].lines
    ]
    picture = CameraPicture(b"", (640, 480), 1, [{"u": 1.0, "v": 2.0, "label": evil, "box": [0, 0, 9, 9]}])
    checked(page(flight_data(lines, title=evil, picture=picture, hidden={evil: evil}, notes=[evil])))


def test_the_true_path_is_about_the_recordings_origin_whatever_the_mocks():
    """A service on a busy machine hears its first position late, over another place: 111.2 m further north here."""
    mocks = {"lat": 48.0, "lon": 11.0, "alt_amsl": 500.0}
    truth = [
        {"type": "header", "origin": mocks},
        {"type": "vehicle", "boot_ns": 2_000_000_000, "position": [150.0, 20.0, -9.0]},
    ]
    path = true_path(truth, OriginObject(48.001, 11.0, 503.0))
    assert path.times_boot_s == [2.0]
    assert path.positions_ned[0] == pytest.approx((150.0 - 111.2, 20.0, -6.0), abs=0.05)
    assert true_path(truth, OriginObject(**mocks)).positions_ned[0] == pytest.approx((150.0, 20.0, -9.0))
    assert true_path(truth, None).positions_ned[0] == (150.0, 20.0, -9.0)

"""Two replays side by side: a headline that names the difference, and one row for the same target."""

import re
from html import unescape

import pytest
from report_lines import Markup, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import ReplayedLines, comparison, flight_data
from fwav_companion.tools.report.comparison import ConfigDifference, pairs

PLACES = {"a": 0.0, "b": 10.0, "c": 20.0}
NAMES = ("A.jsonl", "B.jsonl")
FILTER = ConfigDifference("tracking.filter", '"kalman"', '"lowpass"')
MOTION = ConfigDifference("tracking.motion", '"static"', '"moving"')


def lines_of(tracks, off_m, **other):
    """One confirmed target for each (track, place)."""
    targets = [target(0.0, PLACES[place] + off_m, 0.0, track=track) for track, place in tracks]
    return [header(**other), *targets, summary()]


def flights_of(ours, theirs, truth=()):
    first = flight_data(ours, title="", truth=truth, others=[ReplayedLines("B", "own", theirs)])
    return first, flight_data(theirs, title="", truth=truth, others=[ReplayedLines("A", "own", ours)])


def headline(html):
    (found,) = re.findall("<h1>(.*?)</h1>", unescape(html))
    assert f"<title>{found}</title>" in unescape(html)
    return found


def test_numbers_of_tracks_do_not_matter():
    flights = flights_of(lines_of([(1, "a"), (2, "b"), (3, "c")], 0.1), lines_of([(1, "c"), (2, "a"), (3, "b")], 0.5))
    for _, ours, theirs in pairs(flights):
        assert theirs.last.north - ours.last.north == pytest.approx(0.4)


def test_both_maps_show_the_same_ground():
    """The scale bar is equally long on both maps, though one shows more."""
    flights = flights_of(lines_of([(1, "a")], 0.1), lines_of([(8, "a"), (9, "c")], 0.5))
    html = comparison(NAMES, flights, [])
    bars = re.findall(r'<line class="bar" x1="([\d.]+)"', html)
    assert len(bars) == 6
    assert bars[:3] == bars[3:]
    assert "1 target from" in html
    assert "2 targets from" in html


def test_what_only_one_of_them_found_has_a_row_too():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (*PLACES.values(), 70.0)]
    flights = flights_of(lines_of([(1, "a"), (2, "b")], 0.1), lines_of([(8, "b"), (9, "c")], 0.5), truth)
    html = comparison(NAMES, flights, [])
    rows = re.findall(r"<tr><td>(mark[^<]*)</td>(.*?)</tr>", unescape(html))
    assert len(rows) == 4
    both = [cells for name, cells in rows if "not found" not in cells]
    assert len(both) == 1
    assert "<td>0.40 m</td>" in both[0]
    in_none = [name for name, cells in rows if cells.count("not found") == 2]
    assert in_none == ["mark"]
    assert "Their configurations are the same" in Markup(html).text


@pytest.mark.parametrize(
    ("differences", "expected"),
    [
        ([FILTER], "tracking.filter: kalman compared with lowpass"),
        ([FILTER, MOTION], "2 settings differ: tracking.filter, tracking.motion"),
        ([FILTER, MOTION] * 3, "6 settings differ: tracking.filter, tracking.motion, tracking.filter and 3 more"),
    ],
)
def test_the_headline_names_the_settings_that_differ(differences, expected):
    flights = flights_of(lines_of([(1, "a")], 0.1), lines_of([(1, "a")], 0.5))
    assert headline(comparison(NAMES, flights, differences)) == expected


def test_the_headline_names_another_difference_where_the_settings_are_equal():
    ours = lines_of([(1, "a")], 0.1)
    same = comparison(NAMES, flights_of(ours, ours), [])
    assert headline(same) == "No difference"
    assert "Final estimates are equal;" in Markup(same).text
    moved = lines_of([(1, "a")], 0.5)
    expected = "Same recording, same configuration, different results"
    assert headline(comparison(NAMES, flights_of(ours, moved), [])) == expected
    newer = lines_of([(1, "a")], 0.5, version="0.2")
    assert headline(comparison(NAMES, flights_of(ours, newer), [])) == "Version 0.0 compared with version 0.2"
    longer = [*ours[:-1], summary(frames=11)]
    assert headline(comparison(NAMES, flights_of(ours, longer), [])) == "Two recordings with the same configuration"


def test_the_effect_and_the_values_of_the_only_setting_are_named():
    truth = [TruthPoint("mark", None, (PLACES["a"], 0.0, 0.0), None)]
    flights = flights_of(lines_of([(1, "a")], 0.1), lines_of([(1, "a")], 0.5), truth)
    text = Markup(comparison(NAMES, flights, [FILTER])).text
    assert "Final estimates are 40 cm apart; claimed radius (95 %): A 2.45 m, B 2.45 m." in text
    assert "True error: A 10 cm, B 50 cm." in text
    assert "A (kalman) claimed 95 %A (kalman) true errorB (lowpass) claimed 95 %B (lowpass) true error" in text


def test_without_a_truth_there_is_no_column_of_errors():
    flights = flights_of(lines_of([(1, "a")], 0.1), lines_of([(1, "a")], 0.5))
    html = comparison(NAMES, flights, [FILTER])
    assert "true error" not in html.lower()
    (cells,) = re.findall(r"<tr><td>mark</td>(.*?)</tr>", html)
    assert cells.count("<td>") == 3  # both claims and the distance

"""Two replays beside one another: the same target is one row, whatever each calls its track."""

import re
from html import unescape

import pytest
from report_lines import Markup, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import Replayed, tell
from fwav_companion.tools.report.comparison import comparison, pairs

PLACES = {"a": 0.0, "b": 10.0, "c": 20.0}


def lines_of(tracks, off_m):
    """One confirmed target for each (track, place)."""
    return [header(), *(target(0.0, PLACES[place] + off_m, 0.0, track=track) for track, place in tracks), summary()]


def told(ours, theirs, truth=()):
    first = tell(ours, title="", truth=truth, others=[Replayed("B", "own", theirs)])
    return first, tell(theirs, title="", truth=truth, others=[Replayed("A", "own", ours)])


def test_numbers_of_tracks_do_not_matter():
    stories = told(lines_of([(1, "a"), (2, "b"), (3, "c")], 0.1), lines_of([(1, "c"), (2, "a"), (3, "b")], 0.5))
    for _, ours, theirs in pairs(stories):
        assert theirs.last.north - ours.last.north == pytest.approx(0.4)


def test_both_maps_show_the_same_ground():
    """One bar of so many metres is as long on both, though one saw more."""
    stories = told(lines_of([(1, "a")], 0.1), lines_of([(8, "a"), (9, "c")], 0.5))
    html = comparison("T", ("A.jsonl", "B.jsonl"), stories, [])
    bars = re.findall(r'<line class="bar" x1="([\d.]+)"', html)
    assert len(bars) == 6
    assert bars[:3] == bars[3:]
    assert "1 target from" in html
    assert "2 targets from" in html


def test_what_only_one_of_them_found_has_a_row_too():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (*PLACES.values(), 70.0)]
    stories = told(lines_of([(1, "a"), (2, "b")], 0.1), lines_of([(8, "b"), (9, "c")], 0.5), truth)
    html = comparison("T", ("A.jsonl", "B.jsonl"), stories, [])
    rows = re.findall(r"<tr><td>(mark[^<]*)</td>(.*?)</tr>", unescape(html))
    assert len(rows) == 4
    both = [cells for name, cells in rows if "not found" not in cells]
    assert len(both) == 1
    assert "<td>0.40 m</td>" in both[0]
    nobody = [name for name, cells in rows if cells.count("not found") == 2]
    assert nobody == ["mark"]
    assert "Their configurations are the same" in Markup(html).text

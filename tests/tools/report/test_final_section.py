"""Targets by the whole flight beside their live estimates."""

from types import SimpleNamespace

import msgspec
import pytest
from report_lines import summary, target

from fwav_companion.recording.lines import final_places
from fwav_companion.tools.report.final_section import final_section, final_targets
from fwav_companion.types.tracks import FinalPlace

COV = ((0.04, 0.0, 0.0), (0.0, 0.04, 0.0), (0.0, 0.0, 0.09))


def end_of(track, north, state="confirmed"):
    return target(0.0, north, 2.0, track=track, state=state, label="tag", down=-1.0, cov=COV)


def series(north, true_ned):
    return SimpleNamespace(name="tag", last=SimpleNamespace(north=north, east=2.0), true_ned=true_ned)


def summary_of(*lines):
    places = {
        3: FinalPlace(1.1, 2.0, ((0.01, 0.0), (0.0, 0.01)), 40),
        9: FinalPlace(0.0, 0.0, ((1.0, 0.0), (0.0, 1.0)), 2),
    }
    ends = {line.track: line for line in lines}
    return summary(final=msgspec.to_builtins(final_places(places, ends, None)))


def test_final_has_label_and_height_of_the_last_line_and_its_own_place():
    (final,) = summary_of(end_of(3, 1.5)).final
    assert (final.track, final.label, final.down, final.sightings) == (3, "tag", -1.0, 40)
    assert (final.north, final.east, final.lat) == (1.1, 2.0, None)
    assert final.cov == ((0.01, 0.0, 0.0), (0.0, 0.01, 0.0), (0.0, 0.0, 0.09))


def test_section_shows_live_and_final_with_their_errors():
    end = end_of(3, 1.5)
    found = final_targets([end_of(3, 9.0), end, end_of(3, 5.0, "dropped"), summary_of(end)], [series(1.5, (1.0, 2.0))])
    (shown,) = found
    assert shown.live[:2] == (1.5, 2.0)
    assert shown.final[:2] == (1.1, 2.0)
    assert shown.live[2] == pytest.approx(2.0 * shown.final[2])
    text = final_section(found)
    assert "live error" in text
    assert "0.50 m" in text
    assert "0.10 m" in text


def test_section_without_truth_has_no_errors_and_none_without_targets():
    end = end_of(3, 1.5)
    assert "error" not in final_section(final_targets([end, summary_of(end)], []))
    assert final_section(final_targets([end, summary()], [])) == ""
    assert final_targets([], []) == []

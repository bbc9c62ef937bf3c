"""Grouping of lines by target, their errors, and the lines of another filter for the same target."""

import pytest
from report_lines import BEGUN, approach, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import ReplayedLines, flight_data

TRUTH = [TruthPoint("mark", None, (100.0, -50.0, 0.0), None)]


def series_of(lines, truth=(), others=()):
    return flight_data([header(), *lines, summary()], title="", truth=truth, others=others).targets


def test_errors_and_claims_are_those_of_the_lines():
    (one,) = series_of(approach([3.0, 2.0, 0.25], sigma_m=0.5), TRUTH)
    assert [each.error_m for each in one.points] == pytest.approx([3.0, 2.0, 0.25])
    assert [each.at_s for each in one.points] == pytest.approx([0.0, 1.0, 2.0])
    assert one.last.radius95_m == pytest.approx(0.5 * 5.991464547**0.5)
    assert one.true_ned == (100.0, -50.0)


def test_three_targets_of_one_label_are_three():
    lines = [
        target(at_s, 10.0 * track, 0.0, label="person", track=track) for at_s in (0.0, 1.0) for track in (3, 12, 7)
    ]
    truth = [TruthPoint("person", None, (north, 0.4, 0.0), None) for north in (119.0, 71.0, 32.0, 500.0)]
    series = series_of(lines, truth)
    assert [each.name for each in series] == ["person", "person #3", "person #7", "person #12"]
    assert [each.found for each in series] == [False, True, True, True]
    assert series[0].true_ned == (500.0, 0.4)
    assert [each.true_ned[0] for each in series[1:]] == [32.0, 71.0, 119.0]


def test_a_target_that_was_lost_and_found_again_is_one():
    lines = [*approach([1.0, 1.0], track=1), target(9.0, 100.0, -50.0, track=2)]
    (one,) = series_of(lines)
    assert one.name == "mark"
    assert len(one.points) == 3


def test_what_was_never_believed_is_no_target_unless_it_is_true():
    lines = approach([1.0, 1.0], state="tentative")
    assert series_of(lines) == []
    (one,) = series_of(lines, TRUTH)
    assert not one.found
    (one,) = series_of([], TRUTH)
    assert (one.found, one.points, one.true_ned) == (False, [], (100.0, -50.0))


def test_a_truth_without_a_label_is_anybodys():
    (one,) = series_of(approach([1.0, 0.5]), [TruthPoint("", None, (100.0, -50.0, 0.0), None)])
    assert one.last.error_m == pytest.approx(0.5)


def test_a_truth_that_walks_is_asked_at_the_time_of_each_frame():
    walk = [TruthPoint("mark", None, (100.0 + at_s, -50.0, 0.0), BEGUN + at_s) for at_s in (0.0, 2.0)]
    (one,) = series_of(approach([0.0, 0.0, 0.0]), walk)
    assert [each.error_m for each in one.points] == pytest.approx([0.0, 1.0, 2.0])


def test_another_filters_answer_is_that_of_the_same_target():
    ours = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.0), (2, 40.0))]
    theirs = [target(0.0, north, 0.0, track=track) for track, north in ((1, 41.0), (2, -0.5), (3, 90.0))]
    series = series_of(ours, others=[ReplayedLines("another", "paper", theirs)])
    assert [each.variants[0].last.north for each in series] == [-0.5, 41.0]


def test_a_filter_that_never_believed_has_no_answer():
    theirs = approach([1.0], state="tentative")
    (one,) = series_of(approach([1.0]), others=[ReplayedLines("another", "paper", theirs)])
    assert one.variants[0].last is None


def test_a_long_course_is_thinned_and_keeps_its_ends():
    (one,) = series_of(approach([at_s * 0.001 for at_s in range(3000)]), TRUTH)
    assert len(one.points) == 500
    assert one.points[0].error_m == pytest.approx(0.0)
    assert one.points[-1].error_m == pytest.approx(2.999)


def test_an_error_that_is_common_to_all_does_not_swap_their_truths():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 4.0, 8.0)]
    lines = [target(0.0, north + 2.5, 0.0, track=track) for track, north in ((5, 0.0), (6, 4.0), (7, 8.0))]
    series = series_of(lines, truth)
    assert [each.last.error_m for each in series] == pytest.approx([2.5, 2.5, 2.5])


def test_one_track_too_many_is_a_ghost():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 40.0)]
    lines = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.1), (2, 39.0), (3, 50.0))]
    series = series_of(lines, truth)
    assert [each.found for each in series] == [True, True, False]
    assert [each.ghost for each in series] == [False, False, True]
    assert [each.last.error_m for each in series] == [pytest.approx(0.1), pytest.approx(1.0), None]


def test_two_tracks_at_one_truth_are_a_target_and_a_ghost():
    lines = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.8), (2, 0.1))]
    series = series_of(lines, [TruthPoint("mark", None, (0.0, 0.0, 0.0), None)])
    assert [each.ghost for each in series] == [True, False]


def test_a_ghost_far_from_the_truth_that_was_missed_does_not_find_it():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 40.0)]
    lines = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.1), (2, 20.0))]
    series = {each.name: each for each in series_of(lines, truth)}
    assert {name: each.found for name, each in series.items()} == {"mark": False, "mark #1": True, "mark #2": False}
    assert series["mark #2"].ghost
    assert series["mark"].true_ned == (40.0, 0.0)


def test_an_error_that_is_larger_than_claimed_and_common_to_all_makes_no_ghosts():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 40.0)]
    lines = [target(0.0, north + 9.0, 0.0, 0.1, track=track) for track, north in ((1, 0.0), (2, 40.0))]
    assert [each.found for each in series_of(lines, truth)] == [True, True]


def test_a_target_whose_label_only_one_truth_has_is_found_however_far():
    (one,) = series_of(approach([70.0]), TRUTH)
    assert one.found
    assert one.last.error_m == pytest.approx(70.0)


def test_a_label_that_is_not_true_is_a_ghost_and_without_a_truth_nothing_is():
    lines = [*approach([0.0]), target(0.0, 0.0, 0.0, label="cat", track=2)]
    assert [(each.name, each.ghost) for each in series_of(lines, TRUTH)] == [("cat", True), ("mark", False)]
    assert not any(each.ghost for each in series_of(lines))


def test_tags_have_the_name_that_a_person_uses_unless_two_families_share_it():
    lines = [target(0.0, 0.0, 0.0, label=label) for label in ("tag36h11:19", "tag36h11:3")]
    assert [each.name for each in series_of(lines)] == ["tag 3", "tag 19"]
    lines.append(target(0.0, 0.0, 0.0, label="tag16h5:3"))
    assert [each.name for each in series_of(lines)] == ["tag 19", "tag16h5:3", "tag36h11:3"]


@pytest.mark.slow
def test_a_crowd_is_matched_one_to_one():
    lines = [target(0.0, float(track), 0.0, track=track) for track in range(300)]
    truth = [TruthPoint("mark", None, (float(north), 0.2, 0.0), None) for north in range(300)]
    series = series_of(lines, truth, [ReplayedLines("another", "paper", lines)])
    assert all(each.last.error_m == pytest.approx(0.2) for each in series if each.found)
    assert sum(each.found for each in series) == 300

"""Which lines are about one target, what it was off by, and what another filter made of the same one."""

import pytest
from report_lines import BEGUN, approach, header, summary, target

from fwav_companion.recording.truth import TruthPoint
from fwav_companion.tools.report import Replayed, tell

TRUTH = [TruthPoint("mark", None, (100.0, -50.0, 0.0), None)]


def courses_of(lines, truth=(), others=()):
    return tell([header(), *lines, summary()], title="", truth=truth, others=others).courses


def test_errors_and_claims_are_those_of_the_lines():
    (course,) = courses_of(approach([3.0, 2.0, 0.25], sigma_m=0.5), TRUTH)
    assert [each.error_m for each in course.instants] == pytest.approx([3.0, 2.0, 0.25])
    assert [each.at_s for each in course.instants] == pytest.approx([0.0, 1.0, 2.0])
    assert course.last.radius95_m == pytest.approx(0.5 * 5.991464547**0.5)
    assert course.true_ned == (100.0, -50.0)


def test_three_targets_of_one_label_are_three():
    lines = [
        target(at_s, 10.0 * track, 0.0, label="person", track=track) for at_s in (0.0, 1.0) for track in (3, 12, 7)
    ]
    truth = [TruthPoint("person", None, (north, 0.4, 0.0), None) for north in (119.0, 71.0, 32.0, 500.0)]
    courses = courses_of(lines, truth)
    assert [course.label for course in courses] == ["person", "person #3", "person #7", "person #12"]
    assert [course.found for course in courses] == [False, True, True, True]
    assert courses[0].true_ned == (500.0, 0.4)
    assert [course.true_ned[0] for course in courses[1:]] == [32.0, 71.0, 119.0]


def test_a_target_that_was_lost_and_found_again_is_one():
    lines = [*approach([1.0, 1.0], track=1), target(9.0, 100.0, -50.0, track=2)]
    (course,) = courses_of(lines)
    assert course.label == "mark"
    assert len(course.instants) == 3


def test_what_was_never_believed_is_no_target_unless_it_is_true():
    lines = approach([1.0, 1.0], state="tentative")
    assert courses_of(lines) == []
    (course,) = courses_of(lines, TRUTH)
    assert not course.found
    (course,) = courses_of([], TRUTH)
    assert (course.found, course.instants, course.true_ned) == (False, [], (100.0, -50.0))


def test_a_truth_without_a_label_is_anybodys():
    (course,) = courses_of(approach([1.0, 0.5]), [TruthPoint("", None, (100.0, -50.0, 0.0), None)])
    assert course.last.error_m == pytest.approx(0.5)


def test_a_truth_that_walks_is_asked_at_the_time_of_each_frame():
    walk = [TruthPoint("mark", None, (100.0 + at_s, -50.0, 0.0), BEGUN + at_s) for at_s in (0.0, 2.0)]
    (course,) = courses_of(approach([0.0, 0.0, 0.0]), walk)
    assert [each.error_m for each in course.instants] == pytest.approx([0.0, 1.0, 2.0])


def test_another_filters_answer_is_that_of_the_same_target():
    ours = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.0), (2, 40.0))]
    theirs = [target(0.0, north, 0.0, track=track) for track, north in ((1, 41.0), (2, -0.5), (3, 90.0))]
    courses = courses_of(ours, others=[Replayed("another", "paper", theirs)])
    assert [course.others[0].last.north for course in courses] == [-0.5, 41.0]


def test_a_filter_that_never_believed_has_no_answer():
    theirs = approach([1.0], state="tentative")
    (course,) = courses_of(approach([1.0]), others=[Replayed("another", "paper", theirs)])
    assert course.others[0].last is None


def test_a_long_course_is_thinned_and_keeps_its_ends():
    (course,) = courses_of(approach([at_s * 0.001 for at_s in range(3000)]), TRUTH)
    assert len(course.instants) == 500
    assert course.instants[0].error_m == pytest.approx(0.0)
    assert course.instants[-1].error_m == pytest.approx(2.999)


def test_an_error_that_is_common_to_all_does_not_swap_their_truths():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 4.0, 8.0)]
    lines = [target(0.0, north + 2.5, 0.0, track=track) for track, north in ((5, 0.0), (6, 4.0), (7, 8.0))]
    courses = courses_of(lines, truth)
    assert [course.last.error_m for course in courses] == pytest.approx([2.5, 2.5, 2.5])


def test_one_track_too_many_is_measured_against_the_nearest_truth():
    truth = [TruthPoint("mark", None, (north, 0.0, 0.0), None) for north in (0.0, 40.0)]
    lines = [target(0.0, north, 0.0, track=track) for track, north in ((1, 0.1), (2, 39.0), (3, 50.0))]
    assert [course.last.error_m for course in courses_of(lines, truth)] == pytest.approx([0.1, 1.0, 10.0])


def test_a_crowd_is_told_too():
    lines = [target(0.0, float(track), 0.0, track=track) for track in range(300)]
    truth = [TruthPoint("mark", None, (float(north), 0.2, 0.0), None) for north in range(300)]
    courses = courses_of(lines, truth, [Replayed("another", "paper", lines)])
    assert all(course.last.error_m == pytest.approx(0.2) for course in courses if course.found)
    assert sum(course.found for course in courses) == 300

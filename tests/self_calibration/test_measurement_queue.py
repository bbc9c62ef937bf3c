"""The measurement queue: which tracks are taken next, and which measurements wait."""

from fwav_companion.self_calibration.measurement_queue import DelayedMeasurement, MeasurementQueue, most_taken
from fwav_companion.self_calibration.pixel_measurement import COMMON_COUNT

FRAME_NS = 33_000_000


def taught(frames, tracks, most, first=()):
    """Measurements taken from each frame, with every track seen in each; fixes are represented by their track alone."""
    lessons, taken = MeasurementQueue(), []
    for k in range(frames):
        each, lessons = lessons.taken(
            DelayedMeasurement(k * FRAME_NS, tuple((track, track) for track in tracks)), most, tracks, first
        )
        taken.append(each)
    return taken


def test_ten_targets_take_turns():
    taken = taught(50, range(10), 4)
    assert all(len(each) == 4 for each in taken)
    counts = [sum(track == t for each in taken for t, _, _ in each) for track in range(10)]
    assert counts == [20] * 10


def test_each_measurement_has_the_time_since_the_last_of_its_track():
    for each in taught(3, range(4), 4)[0]:
        assert each[2] == 0.0
    later = taught(12, range(10), 5)[2:]
    assert {round(since_s / 0.033, 6) for each in later for _, _, since_s in each} == {2.0}


def test_the_first_are_taken_before_those_that_wait():
    assert [[track for track, _, _ in each] for each in taught(5, range(4), 2, first=(3, 1))] == [[1, 3]] * 5


def test_those_that_ended_are_forgotten():
    lesson = DelayedMeasurement(0, tuple((track, track) for track in range(4)))
    _, lessons = MeasurementQueue().taken(lesson, 4, range(4))
    taken, lessons = lessons.taken(DelayedMeasurement(FRAME_NS, lesson.fixes), 4, (2, 3))
    assert [track for track, _, _ in taken] == [2, 3]
    assert set(lessons.taken_ns) == {2, 3}


def test_frames_wait_until_they_are_due():
    lessons = MeasurementQueue()
    for k in range(5):
        lessons = lessons.with_frame(k * FRAME_NS, [(1, k)])
    due, rest = lessons.due(2 * FRAME_NS)
    assert [lesson.host_ns // FRAME_NS for lesson in due] == [0, 1, 2]
    assert [lesson.host_ns // FRAME_NS for lesson in rest.waiting] == [3, 4]
    assert rest.due(2 * FRAME_NS) == ((), rest)


def test_a_frame_costs_the_same_however_many_targets_it_shows():
    sizes = {targets: COMMON_COUNT + 2 * targets for targets in range(1, 21)}
    assert all(most_taken(sizes[targets]) >= targets for targets in range(1, 6))
    ten = most_taken(sizes[10]) * sizes[10] ** 2
    assert most_taken(sizes[10]) >= 2
    assert all(
        min(targets, most_taken(size)) * size**2 <= 1.5 * ten for targets, size in sizes.items() if targets <= 13
    )
    assert most_taken(sizes[20]) == 2

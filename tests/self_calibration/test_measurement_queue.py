"""The measurement queue: which frames are taken together, and which fixes of them."""

from fwav_companion.self_calibration.measurement_queue import BATCH_NS, DelayedMeasurement, MeasurementQueue

FRAME_NS = 33_000_000


def frame(k, tracks=(1,)):
    """Fixes are represented by their track alone."""
    return DelayedMeasurement(k * FRAME_NS, tuple((track, track) for track in tracks))


def queued(*indices):
    queue = MeasurementQueue()
    for k in indices:
        queue = queue.with_frame(frame(k))
    return queue


def grouped(groups):
    return [[each.host_ns // FRAME_NS for each in group] for group in groups]


def test_frames_wait_until_their_group_is_due():
    queue = queued(*range(7))
    assert grouped(queue.due(BATCH_NS - 1)[0]) == []
    groups, rest = queue.due(4 * FRAME_NS + BATCH_NS)
    assert grouped(groups) == [[0, 1, 2], [3, 4, 5]]
    assert [each.host_ns // FRAME_NS for each in rest.waiting] == [6]
    assert rest.due(4 * FRAME_NS + BATCH_NS) == ([], rest)


def test_photographs_are_taken_one_by_one():
    assert grouped(queued(0, 200, 400).due(401 * FRAME_NS)[0]) == [[0], [200]]


def test_fixes_come_in_the_order_of_their_tracks_with_the_time_since_the_last():
    index, since_s, queue = MeasurementQueue().taken(frame(0, (3, 1)), {1, 3})
    assert (index, since_s) == ([1, 0], [0.0, 0.0])
    index, since_s, _ = queue.taken(frame(2, (1, 2, 3)), {1, 2, 3})
    assert index == [0, 1, 2]
    assert [round(each, 6) for each in since_s] == [0.066, 0.0, 0.066]


def test_those_that_ended_are_forgotten():
    _, _, queue = MeasurementQueue().taken(frame(0, range(4)), range(4))
    index, _, queue = queue.taken(frame(1, range(4)), (2, 3))
    assert index == [2, 3]
    assert set(queue.taken_ns) == {2, 3}

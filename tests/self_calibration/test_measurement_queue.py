"""The measurement queue: which frames are taken together, and which fixes of them."""

from fwav_companion.self_calibration.measurement_queue import (
    BATCH_NS,
    SEARCH_NS,
    DelayedMeasurement,
    MeasurementQueue,
    samples_of,
)

FRAME_NS = 33_000_000


def frame(k, tracks=(1,)):
    """Fixes are represented by their track alone."""
    return DelayedMeasurement(k * FRAME_NS, tuple((track, track) for track in tracks))


def tracks_of(fixes):
    return [track for track, _ in fixes]


def queued(*indices):
    queue = MeasurementQueue()
    for k in indices:
        queue = queue.with_frame(frame(k))
    return queue


def grouped(groups):
    return [[each.host_ns // FRAME_NS for each in group] for group in groups]


def test_frames_wait_until_their_batch_is_due():
    queue = queued(*range(15))
    assert grouped(queue.due(BATCH_NS - 1)[0]) == []
    batches, rest = queue.due(12 * FRAME_NS + BATCH_NS)
    assert grouped(batches) == [[*range(7)], [*range(7, 14)]]
    assert [each.host_ns // FRAME_NS for each in rest.waiting] == [14]
    assert rest.due(12 * FRAME_NS + BATCH_NS) == ([], rest)
    assert grouped(rest.due(14 * FRAME_NS + SEARCH_NS, SEARCH_NS)[0]) == [[14]]
    assert grouped(queue.due(4 * FRAME_NS + SEARCH_NS, SEARCH_NS)[0]) == [[0, 1, 2], [3, 4, 5]]


def test_many_fixes_make_more_batches():
    queue = MeasurementQueue()
    for k in range(10):
        queue = queue.with_frame(frame(k, range(15)))
    assert grouped(queue.due(BATCH_NS)[0]) == [[0, 1]]
    assert grouped(queue.due(20 * FRAME_NS + BATCH_NS)[0]) == [[0, 1], [2, 3], [4, 5], [6, 7], [8, 9]]


def test_frames_of_one_step_of_telemetry_are_one_sample():
    batch = tuple(frame(k) for k in range(10))
    assert grouped(samples_of(batch)) == [[0, 1, 2, 3], [4, 5, 6, 7], [8, 9]]
    assert grouped(samples_of((frame(0, range(50)),))) == [[0]]


def test_photographs_are_taken_one_by_one():
    assert grouped(queued(0, 200, 400).due(401 * FRAME_NS)[0]) == [[0], [200]]


def test_fixes_come_in_the_order_of_their_tracks_with_the_time_since_the_last():
    fixes, since_s, queue = MeasurementQueue().taken((frame(0, (3, 1)),), {1, 3})
    assert (tracks_of(fixes), since_s) == ([1, 3], [0.0, 0.0])
    fixes, since_s, _ = queue.taken((frame(2, (1, 2, 3)),), {1, 2, 3})
    assert tracks_of(fixes) == [1, 2, 3]
    assert [round(each, 6) for each in since_s] == [0.066, 0.0, 0.066]


def test_those_that_ended_are_forgotten():
    _, _, queue = MeasurementQueue().taken((frame(0, range(4)),), range(4))
    fixes, _, queue = queue.taken((frame(1, range(4)),), (2, 3))
    assert tracks_of(fixes) == [2, 3]
    assert set(queue.taken_ns) == {2, 3}


def test_the_fix_before_is_that_of_the_same_track():
    queue = MeasurementQueue()
    for k, tracks in enumerate(((1, 2), (2,), (1,))):
        fixes = tuple((track, f"{k} of {track}") for track in tracks)
        queue = queue.with_frame(DelayedMeasurement(k * FRAME_NS, fixes))
    assert queue.before(1, 3 * FRAME_NS) == "2 of 1"
    assert queue.before(1, 2 * FRAME_NS) == "0 of 1"
    assert queue.before(2, 2 * FRAME_NS) == "1 of 2"
    assert queue.before(1, 0) is None
    assert queue.before(3, 3 * FRAME_NS) is None

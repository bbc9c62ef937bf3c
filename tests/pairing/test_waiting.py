"""Frames wait for attitudes, for a limited time."""

from placing import MS, StillVehicle, frame

from fwav_companion.geometry.stamps import BootNs, HostNs
from fwav_companion.pairing import WaitingFrames
from fwav_companion.pairing.waiting import LEAST_PATIENCE_NS, LONGEST_AGE_NS, LONGEST_WAIT_NS, MOST_WAITING

NOW = HostNs(10**12)


def test_a_frame_goes_on_at_once_if_all_is_there():
    waiting, vehicle, one = WaitingFrames(), StillVehicle(), frame()
    waiting.put(one, BootNs(5000 * MS), NOW, NOW)
    assert waiting.take_ready(NOW, vehicle) == [one]
    assert waiting.take_ready(NOW, vehicle) == []
    assert waiting.wake_at is None


def test_it_waits_for_the_attitudes_and_no_longer():
    waiting, vehicle, one = WaitingFrames(), StillVehicle(), frame()
    vehicle.newest_ns = BootNs(4990 * MS)
    waiting.put(one, BootNs(5000 * MS), NOW, NOW)
    assert waiting.take_ready(NOW, vehicle) == []
    assert waiting.wake_at == NOW + LONGEST_WAIT_NS
    vehicle.newest_ns = BootNs(5000 * MS)
    assert waiting.take_ready(HostNs(NOW + 8 * MS), vehicle) == [one]


def test_it_goes_on_unready_when_its_time_is_up():
    waiting, vehicle, one = WaitingFrames(), StillVehicle(), frame()
    vehicle.newest_ns = BootNs(0)
    waiting.put(one, BootNs(5000 * MS), NOW, NOW)
    assert waiting.take_ready(HostNs(NOW + LONGEST_WAIT_NS - 1), vehicle) == []
    assert waiting.take_ready(HostNs(NOW + LONGEST_WAIT_NS), vehicle) == [one]


def test_what_was_late_already_waits_only_as_long_as_its_line_may_be_written():
    waiting, captured = WaitingFrames(), HostNs(NOW - 200 * MS)
    waiting.put(frame(), BootNs(5000 * MS), captured, NOW)
    assert waiting.wake_at == captured + LONGEST_AGE_NS
    later = WaitingFrames()
    later.put(frame(), BootNs(5000 * MS), HostNs(NOW - 400 * MS), NOW)
    assert later.wake_at == NOW + LEAST_PATIENCE_NS


def test_it_wakes_for_the_one_whose_time_is_up_first():
    waiting = WaitingFrames()
    waiting.put(frame(number=1), BootNs(5000 * MS), NOW, NOW)
    waiting.put(frame(number=2), BootNs(5000 * MS), HostNs(NOW - 300 * MS), HostNs(NOW + MS))
    assert waiting.wake_at == NOW + MS + LEAST_PATIENCE_NS


def test_nothing_to_wait_for():
    waiting, vehicle, one = WaitingFrames(), StillVehicle(), frame()
    waiting.put(one, None, NOW, NOW)
    assert waiting.take_ready(NOW, vehicle) == [one]


def test_a_later_frame_does_not_hold_up_an_earlier_one_nor_the_other_way_round():
    waiting, vehicle = WaitingFrames(), StillVehicle()
    vehicle.newest_ns = BootNs(5010 * MS)
    late, soon = frame(number=1), frame(number=2)
    waiting.put(late, BootNs(5050 * MS), NOW, NOW)
    waiting.put(soon, BootNs(5005 * MS), NOW, NOW)
    assert waiting.take_ready(NOW, vehicle) == [soon]
    assert len(waiting) == 1


def test_a_crowd_is_let_through():
    waiting, vehicle = WaitingFrames(), StillVehicle()
    vehicle.newest_ns = BootNs(0)
    frames = [frame(number=k) for k in range(MOST_WAITING + 3)]
    for one in frames:
        waiting.put(one, BootNs(5000 * MS), NOW, NOW)
    assert waiting.take_ready(NOW, vehicle) == frames[:3]
    assert len(waiting) == MOST_WAITING

"""Frames that come back or come twice: our own, duplicates, second ways and loops."""

from __future__ import annotations

from mavlink_wire import Wire
from routed_net import AUTOPILOT, GROUND, SECOND, Net, vehicle_and_ground

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S


def test_our_own_frames_that_come_back_are_counted_and_dropped() -> None:
    net = Net(wanted=("HEARTBEAT",))
    own = Wire(1, 191)
    received = net.node.receive("ground", own.heartbeat(18, 8), net.now)
    assert (received.messages, received.forwards) == ([], [])
    assert net.node.statistics(net.now)[1].echoes == 1
    assert net.node.statistics(net.now)[1].peers == []
    assert net.links_of("tablet", Wire(255, 1).command(1, 191)) == []


def test_a_frame_that_came_by_another_link_is_a_duplicate() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND, wanted=("ATTITUDE",))
    vehicle = Wire(1, 1)
    first, second = vehicle.attitude(1), vehicle.attitude(2)
    assert net.links_of("autopilot", first) == ["second", "ground"]
    assert net.links_of("second", first) == []
    assert net.links_of("second", second) == ["ground"]
    assert net.links_of("autopilot", second) == []
    third = vehicle.attitude(3)
    assert net.links_of("autopilot", third) == ["ground"]
    received = net.node.receive("second", third, net.now)
    assert (received.messages, received.forwards, list(received.frames)) == ([], [], [])
    assert [link.duplicates for link in net.node.statistics(net.now)] == [1, 2, 0]


def test_a_second_way_to_the_autopilot_is_learned_though_its_copies_always_come_second() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    vehicle, ground = vehicle_and_ground(net)
    for number in range(3):
        echo_perhaps = vehicle.attitude(number)
        assert net.links_of("autopilot", echo_perhaps) == ["second", "ground"]
        assert net.feed("second", echo_perhaps) == []
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    never_sent_there = vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
    assert net.links_of("autopilot", never_sent_there) == ["ground"]
    assert net.feed("second", never_sent_there) == []
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot", "second"]
    assert net.links_of("autopilot", vehicle.attitude(3)) == ["ground"]


def test_what_a_loop_brings_back_by_a_ground_link_is_no_second_way() -> None:
    net = Net()
    vehicle, ground = vehicle_and_ground(net)
    acknowledged = vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
    assert net.links_of("autopilot", acknowledged) == ["ground"]
    assert net.feed("tablet", acknowledged) == []
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]


def test_the_same_bytes_again_on_one_link_are_no_duplicate() -> None:
    net = Net()
    frame = Wire(1, 1).heartbeat()
    assert net.links_of("autopilot", frame) == ["ground", "tablet"]
    assert net.links_of("autopilot", frame) == ["ground", "tablet"]


def test_a_duplicate_may_be_late() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    vehicle = Wire(1, 1)
    net.feed("autopilot", vehicle.heartbeat())
    net.feed("second", vehicle.heartbeat())
    net.wait(400 * NS_PER_MS)
    frame = vehicle.attitude()
    net.feed("autopilot", frame)
    net.wait(480 * NS_PER_MS)
    net.feed("autopilot", vehicle.attitude(2))
    assert net.links_of("second", frame) == []


def test_the_same_bytes_much_later_on_another_link_are_no_duplicate() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    frame = Wire(1, 1).heartbeat()
    net.feed("autopilot", frame)
    net.wait(2 * NS_PER_S)
    assert "ground" in net.links_of("second", frame)


def test_a_loop_between_two_links_ends_at_once() -> None:
    """Whatever leaves by one ground link comes back by the other, both ways."""
    net = Net()
    queue = [("autopilot", Wire(1, 1).attitude(i)) for i in range(3)]
    sent = []
    while queue:
        link, frame = queue.pop(0)
        for out, data in net.feed(link, frame):
            sent.append((out, data))
            if out in ("ground", "tablet"):
                queue.append(("tablet" if out == "ground" else "ground", data))
    assert len(sent) == 3 * 2
    assert net.links_of("ground", Wire(255, 190).command(1, 1)) == ["autopilot"]

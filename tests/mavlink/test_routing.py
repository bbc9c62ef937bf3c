"""The routing rules, one test a rule, over a node without any socket."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire, dialect, unknown_frame

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.peers import MAX_PEERS, SILENT_NS

AUTOPILOT = LinkPolicy("autopilot", "autopilot")
SECOND = LinkPolicy("second", "autopilot")
GROUND = LinkPolicy("ground", "gcs")
ARM, GET_MESSAGE_INTERVAL, SET_MESSAGE_INTERVAL, REQUEST_MESSAGE = 400, 510, 511, 512
TABLET = LinkPolicy("tablet", "gcs")


class Net:
    """A node whose links are fed by hand, a millisecond apart."""

    def __init__(self, *links: LinkPolicy, wanted: tuple[str, ...] = (), system: int = 1) -> None:
        self.node = Node(links or (AUTOPILOT, GROUND, TABLET), wanted)
        self.node.adopt(system)
        self.now = HostNs(NS_PER_S)

    def feed(self, link: str, *frames: bytes) -> list[tuple[str, bytes]]:
        self.now = HostNs(self.now + NS_PER_MS)
        received = self.node.receive(link, b"".join(frames), self.now)
        return received.forwards

    def links_of(self, link: str, frame: bytes) -> list[str]:
        """The links that one frame is sent to; that it is unchanged is asserted here for all tests."""
        forwards = self.feed(link, frame)
        assert all(data == frame for _, data in forwards)
        return [name for name, _ in forwards]

    def wait(self, ns: int) -> None:
        self.now = HostNs(self.now + ns)


def vehicle_and_ground(net: Net) -> tuple[Wire, Wire]:
    vehicle, ground = Wire(1, 1), Wire(255, 190)
    net.feed("autopilot", vehicle.heartbeat())
    net.feed("ground", ground.heartbeat(dialect.MAV_TYPE_GCS, 8))
    return vehicle, ground


def test_a_broadcast_goes_everywhere_but_back() -> None:
    net = Net()
    assert net.links_of("autopilot", Wire(1, 1).attitude()) == ["ground", "tablet"]
    assert net.links_of("ground", Wire(255, 190).heartbeat(6, 8)) == ["autopilot", "tablet"]


def test_target_system_zero_goes_everywhere() -> None:
    net = Net()
    vehicle_and_ground(net)
    assert net.links_of("ground", Wire(255, 190).command(0, 0)) == ["autopilot", "tablet"]


def test_another_system_is_reached_where_it_was_seen_whatever_the_component() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    ground = Wire(255, 190)
    assert net.links_of("ground", ground.command(2, 1)) == []
    net.feed("second", Wire(2, 1).heartbeat())
    assert net.links_of("ground", ground.command(2, 1)) == ["second"]
    assert net.links_of("ground", ground.command(2, 77)) == ["second"]
    assert net.links_of("ground", ground.command(2, 0)) == ["second"]


def test_a_component_of_our_own_system_is_reached_where_that_component_was_seen() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    net.feed("autopilot", Wire(1, 1).heartbeat())
    net.feed("second", Wire(1, 154).heartbeat())
    ground = Wire(255, 190)
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    assert net.links_of("ground", ground.command(1, 154)) == ["second"]
    assert net.links_of("ground", ground.command(1, 155)) == []
    assert net.links_of("ground", ground.command(1, 0)) == ["autopilot", "second"]


def test_what_is_for_us_goes_no_further() -> None:
    net = Net(wanted=("COMMAND_LONG",))
    vehicle_and_ground(net)
    assert net.links_of("ground", Wire(255, 190).command(1, 191)) == []
    assert net.links_of("ground", Wire(255, 190).command(1, 100)) == []


@pytest.mark.parametrize(
    ("system", "component", "read"),
    [
        (0, 0, True),
        (1, 0, True),
        (1, 191, True),
        (1, 100, True),
        (0, 7, True),
        (1, 1, False),
        (2, 0, False),
        (2, 191, False),
    ],
)
def test_what_is_read_here(system, component, read) -> None:
    net = Net(wanted=("COMMAND_LONG",))
    received = net.node.receive("ground", Wire(255, 190).command(system, component), net.now)
    assert len(received.messages) == read


def test_truncated_targets_are_zero_and_go_everywhere() -> None:
    net = Net()
    vehicle_and_ground(net)
    frame = Wire(255, 190).frame("PARAM_REQUEST_LIST", 0, 0)
    assert frame[1] == 1
    assert net.links_of("ground", frame) == ["autopilot", "tablet"]


def test_unknown_and_signed_frames_go_on_byte_for_byte() -> None:
    net = Net(LinkPolicy("autopilot", "autopilot", datagrams=True), GROUND)
    assert net.links_of("autopilot", unknown_frame()) == ["ground"]
    wire = Wire(1, 1)
    wire.mav.signing.secret_key = b"a key that we do not have......."
    wire.mav.signing.sign_outgoing = True
    assert net.links_of("autopilot", wire.attitude()) == ["ground"]
    assert net.links_of("autopilot", Wire(3, 1, version=1).attitude()) == ["ground"]


def test_setup_signing_is_never_forwarded_and_never_recorded() -> None:
    net = Net()
    vehicle_and_ground(net)
    wire = Wire(255, 191)
    for target in ((1, 1), (0, 0), (255, 190)):
        frame = wire.frame("SETUP_SIGNING", *target, tuple(range(32)), 0)
        net.wait(NS_PER_S)
        received = net.node.receive("tablet", frame + wire.heartbeat(6, 8), net.now)
        assert [name for name, data in received.forwards if frame in data] == []
        assert [name for name, _ in received.forwards] == ["autopilot", "ground"]  # the heartbeat
        assert [raw.msgid for raw in received.frames] == [0]


def test_radio_status_and_adsb_never_reach_an_autopilot() -> None:
    net = Net(AUTOPILOT, GROUND, TABLET)
    vehicle_and_ground(net)
    radio = Wire(51, 68)
    assert net.links_of("ground", radio.frame("RADIO_STATUS", 1, 2, 3, 4, 5, 6, 7)) == ["tablet"]
    assert net.links_of("ground", radio.frame("RADIO", 1, 2, 3, 4, 5, 6, 7)) == ["tablet"]
    adsb = (1, 2, 3, 0, 4, 5, 6, 7, b"A", 0, 1, 2, 3)
    assert net.links_of("ground", radio.frame("ADSB_VEHICLE", *adsb)) == ["tablet"]
    assert net.links_of("autopilot", Wire(1, 1).frame("ADSB_VEHICLE", *adsb)) == ["ground", "tablet"]


STOPS = LinkPolicy("ground", "gcs", forward_rate_requests=False)


def test_a_ground_stations_request_for_streams_stops_where_the_link_stops_them() -> None:
    """This was the default before requests were merged."""
    net = Net(AUTOPILOT, STOPS, TABLET)
    _, ground = vehicle_and_ground(net)
    request = ground.frame("REQUEST_DATA_STREAM", 1, 1, 0, 4, 1)
    assert net.links_of("ground", request) == []
    assert net.node.statistics(net.now)[1].stopped == 1


def test_a_link_that_stops_rate_requests_stops_intervals_too_and_nothing_else() -> None:
    net = Net(AUTOPILOT, STOPS, TABLET)
    _, ground = vehicle_and_ground(net)
    assert net.links_of("ground", ground.command(1, 1, SET_MESSAGE_INTERVAL)) == []
    assert net.node.statistics(net.now)[1].stopped == 1
    for other in (ARM, REQUEST_MESSAGE, GET_MESSAGE_INTERVAL):
        assert net.links_of("ground", ground.command(1, 1, other)) == ["autopilot"]
    net.feed("tablet", Wire(1, 154).heartbeat())
    assert net.links_of("ground", ground.command(1, 154, SET_MESSAGE_INTERVAL)) == ["tablet"]


@pytest.mark.parametrize(("setting", "merged"), [(True, False), ("merge", True)])
def test_a_request_for_streams_passes_unchanged_and_is_reported(setting, merged) -> None:
    net = Net(AUTOPILOT, LinkPolicy("ground", "gcs", forward_rate_requests=setting))
    _, ground = vehicle_and_ground(net)
    frame = ground.frame("REQUEST_DATA_STREAM", 1, 1, 0, 4, 1)
    received = net.node.receive("ground", frame, net.now)
    assert received.forwards == [("autopilot", frame)]
    assert [(one.request.requester, one.merged) for one in received.rate_requests] == [("255/190 on ground", merged)]


def test_a_message_interval_that_passes_is_reported_and_other_commands_are_not() -> None:
    net = Net()
    _, ground = vehicle_and_ground(net)

    def reported(frame: bytes) -> list[str]:
        return [one.request.requester for one in net.node.receive("ground", frame, net.now).rate_requests]

    assert reported(ground.command(1, 1, SET_MESSAGE_INTERVAL)) == ["255/190 on ground"]
    assert reported(ground.command(1, 1, ARM)) == []
    by_int = ground.frame("COMMAND_INT", 1, 1, 0, SET_MESSAGE_INTERVAL, 0, 0, 1.0, 2.0, 3.0, 4.0, 5, 6, 7.0)
    assert reported(by_int) == ["255/190 on ground"]
    assert reported(ground.frame("MESSAGE_INTERVAL", 30, 250_000)) == ["255/190 on ground"]


def test_our_own_frames_that_come_back_are_counted_and_dropped() -> None:
    net = Net(wanted=("HEARTBEAT",))
    own = Wire(1, 191)
    received = net.node.receive("ground", own.heartbeat(18, 8), net.now)
    assert (received.messages, received.forwards) == ([], [])
    assert net.node.statistics(net.now)[1].echoes == 1
    assert net.node.statistics(net.now)[1].peers == []
    assert net.links_of("tablet", Wire(255, 1).command(1, 191)) == []


def test_adopting_a_system_forgets_our_own_under_it() -> None:
    net = Net(system=1)
    net.feed("ground", Wire(9, 191).heartbeat(18, 8))
    net.node.adopt(9)
    assert net.links_of("tablet", Wire(255, 1).command(9, 191)) == []
    assert net.node.system == 9


def test_adopting_the_same_system_again_changes_nothing() -> None:
    net = Net(system=9)
    version = net.node._router.version
    net.node.adopt(9)
    assert net.node._router.version == version


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


def test_two_vehicles_on_one_link_are_not_sent_their_own_frames() -> None:
    net = Net()
    net.feed("autopilot", Wire(1, 1).heartbeat())
    assert net.links_of("autopilot", Wire(2, 1).command(1, 1)) == []


def test_a_link_that_goes_down_is_forgotten() -> None:
    net = Net()
    vehicle, ground = vehicle_and_ground(net)
    net.node.link_down("autopilot")
    assert net.links_of("ground", ground.attitude()) == ["tablet"]
    net.node.link_up("autopilot")
    assert net.links_of("ground", ground.command(1, 1)) == []
    net.feed("autopilot", vehicle.heartbeat())
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]


def test_the_silent_are_forgotten_and_the_others_are_not() -> None:
    net = Net()
    _, ground = vehicle_and_ground(net)
    net.wait(SILENT_NS - NS_PER_S)
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    net.wait(10 * NS_PER_S)
    assert net.links_of("ground", ground.command(1, 1)) == []


def test_a_restart_clears_the_systems_routes() -> None:
    net = Net(AUTOPILOT, SECOND, GROUND)
    vehicle, ground = Wire(1, 1), Wire(255, 190)
    net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, 90_000), Wire(1, 154).heartbeat(), Wire(2, 1).heartbeat())
    net.feed("second", Wire(1, 155).heartbeat())
    net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, 91_000))
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]
    rebooted = Wire(1, 1)
    for second in range(3):
        assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]
        net.feed("autopilot", rebooted.frame("SYSTEM_TIME", 0, 500 + 1000 * second))
        net.wait(NS_PER_S)
    assert net.links_of("ground", ground.command(1, 154)) == []
    assert net.links_of("ground", ground.command(1, 155)) == []
    assert net.links_of("ground", ground.command(1, 1)) == ["autopilot"]
    assert net.links_of("ground", ground.command(2, 1)) == ["autopilot"]


def test_a_forged_clock_clears_no_route_of_a_station_that_is_still_heard() -> None:
    net = Net()
    vehicle_and_ground(net)
    station = Wire(255, 190)
    net.feed("ground", station.frame("SYSTEM_TIME", 0, 90_000))
    for second in range(10):
        net.wait(NS_PER_S)
        net.feed("ground", station.heartbeat(6, 8))
        net.feed("tablet", Wire(255, 190).frame("SYSTEM_TIME", 0, 500 + second))
        assert "ground" in net.links_of("autopilot", Wire(1, 1).frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190))


def test_one_clock_that_goes_back_is_no_restart() -> None:
    net = Net(AUTOPILOT, GROUND)
    vehicle, ground = vehicle_and_ground(net)
    net.feed("autopilot", Wire(1, 154).heartbeat(26, 8))
    for boot_ms in (90_000, 500, 92_000, 600, 94_000):
        net.feed("autopilot", vehicle.frame("SYSTEM_TIME", 0, boot_ms))
        net.wait(NS_PER_S)
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]


def test_clocks_of_different_components_are_not_compared() -> None:
    net = Net()
    _, ground = vehicle_and_ground(net)
    net.feed("autopilot", Wire(1, 1).frame("SYSTEM_TIME", 0, 90_000), Wire(1, 240).frame("SYSTEM_TIME", 0, 5))
    net.feed("autopilot", Wire(1, 154).heartbeat())
    net.feed("autopilot", Wire(1, 240).frame("SYSTEM_TIME", 0, 6))
    assert net.links_of("ground", ground.command(1, 154)) == ["autopilot"]


def test_thinning_on_the_way_out() -> None:
    net = Net(AUTOPILOT, LinkPolicy("ground", "gcs", max_rate_hz={"ATTITUDE": 4}), TABLET)
    vehicle = Wire(1, 1)
    out = []
    for i in range(1000):
        net.wait(9 * NS_PER_MS)
        out += [name for name, _ in net.feed("autopilot", vehicle.attitude(i))]
    assert out.count("tablet") == 1000
    assert out.count("ground") == pytest.approx(40, abs=1)
    assert net.node.statistics(net.now)[1].thinned == 1000 - out.count("ground")


def test_strangers_do_not_fill_the_tables() -> None:
    net = Net()
    for system in range(1, 31):
        for component in range(1, 51):
            net.feed("ground", Wire(system, component).heartbeat())
    (link,) = [link for link in net.node.statistics(net.now) if link.name == "ground"]
    assert len(link.peers) <= MAX_PEERS

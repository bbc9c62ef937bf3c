"""The routing rules, one test a rule, over a node without any socket."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire, unknown_frame
from routed_net import (
    ARM,
    AUTOPILOT,
    GET_MESSAGE_INTERVAL,
    GROUND,
    REQUEST_MESSAGE,
    SECOND,
    SET_MESSAGE_INTERVAL,
    TABLET,
    Net,
    vehicle_and_ground,
)

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S
from fwav_companion.mavlink.router.node import LinkPolicy


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


def test_two_vehicles_on_one_link_are_not_sent_their_own_frames() -> None:
    net = Net()
    net.feed("autopilot", Wire(1, 1).heartbeat())
    assert net.links_of("autopilot", Wire(2, 1).command(1, 1)) == []


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

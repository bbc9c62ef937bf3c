"""What each role of a link may say: a link that is not an autopilot's never speaks as the autopilot."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.acceptance import SETTLING_NS
from fwav_companion.mavlink.router.link_reports import REPORT_NS
from fwav_companion.mavlink.router.node import LinkPolicy, Node, Received
from fwav_companion.pipeline.pipeline_factory import WANTED
from fwav_companion.types import Destination, NoticeCode, Outgoing

LINKS = (
    LinkPolicy("autopilot", "autopilot"),
    LinkPolicy("ground", "gcs"),
    LinkPolicy("tablet", "gcs"),
    LinkPolicy("mavros", "payload"),
)
INVALID = dialect.MAV_AUTOPILOT_INVALID


class Net:
    """A node with a vehicle of system 1, a station and a second companion program, heard for longer than it settles."""

    def __init__(self) -> None:
        self.node = Node(LINKS, WANTED)
        self.node.adopt(1, 1)
        self.now = HostNs(5_000 * NS_PER_S)
        self.vehicle, self.station, self.mavros = Wire(1, 1), Wire(255, 190), Wire(1, 240)
        self.feed("autopilot", self.vehicle.heartbeat())
        self.feed("ground", self.station.heartbeat(dialect.MAV_TYPE_GCS, INVALID), Wire(1, 191).heartbeat(18, INVALID))
        self.feed("mavros", self.mavros.heartbeat(18, INVALID))
        self.now = HostNs(self.now + SETTLING_NS)

    def feed(self, link: str, *frames: bytes) -> Received:
        self.now = HostNs(self.now + NS_PER_MS)
        return self.node.receive(link, b"".join(frames), self.now)

    def count(self, name: str, link: str) -> int:
        return next(getattr(traffic, name) for traffic in self.node.statistics(self.now) if traffic.name == link)


def claims(wire: Wire) -> list[bytes]:
    """What an autopilot says of itself: attitude, position, home, parameter, clock, answer, heartbeat."""
    return [
        wire.frame("ATTITUDE_QUATERNION", 9_500, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0),
        wire.frame("GLOBAL_POSITION_INT", 9_500, 100_000_000, 100_000_000, 0, 0, 0, 0, 0, 0),
        wire.frame("HOME_POSITION", 1, 1, 1, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0),
        wire.frame("PARAM_VALUE", b"PLND_LAG", 1e10, 9, 1, 0),
        wire.frame("SYSTEM_TIME", 0, 500),
        wire.frame("TIMESYNC", 5, 7),
        wire.heartbeat(),
    ]


@pytest.mark.parametrize("link", ["ground", "mavros"])
def test_only_an_autopilots_link_speaks_as_the_autopilot(link: str) -> None:
    net = Net()
    for frame in claims(Wire(1, 1)):
        received = net.feed(link, frame)
        assert (received.messages, received.forwards, list(received.frames)) == ([], [], [])
    assert net.count("own_ids_on_gcs", link) == len(claims(Wire(1, 1)))
    # No route was taught: telemetry still goes to the link, and commands for the autopilot do not.
    assert link in [name for name, _ in net.feed("autopilot", net.vehicle.heartbeat()).forwards]
    assert [name for name, _ in net.feed("tablet", Wire(254, 1).command(1, 1)).forwards] == ["autopilot"]
    assert len(net.feed("autopilot", *claims(net.vehicle)).messages) == len(claims(net.vehicle))


def test_a_route_that_was_learned_before_the_adoption_is_forgotten() -> None:
    node = Node(LINKS, WANTED)
    node.receive("ground", Wire(7, 1).heartbeat(), HostNs(NS_PER_S))
    node.receive("autopilot", Wire(7, 1).attitude(), HostNs(NS_PER_S))
    node.adopt(7, 1)
    received = node.receive("autopilot", Wire(7, 1).heartbeat(), HostNs(2 * NS_PER_S))
    assert "ground" in [name for name, _ in received.forwards]
    assert node.receive("ground", Wire(7, 1).heartbeat(), HostNs(2 * NS_PER_S)).forwards == []


def test_no_vehicle_is_heard_on_a_ground_link() -> None:
    net = Net()
    received = net.feed("ground", Wire(42, 1).heartbeat())
    assert received.messages == []
    assert list(received.frames) == [], "a replay knows no links: it would adopt from them"
    assert [name for name, _ in received.forwards] == ["autopilot", "tablet", "mavros"]


def test_a_gimbal_is_believed_on_payload_links_and_not_on_ground_links() -> None:
    net = Net()
    wire = Wire(1, 154)
    attitude = wire.frame("GIMBAL_DEVICE_ATTITUDE_STATUS", 0, 0, 500, 12, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0)
    distance = wire.frame("DISTANCE_SENSOR", 500, 10, 1000, 100, 0, 0, 25, 0)
    for frame in (attitude, distance):
        assert net.feed("ground", frame).messages == []
    values = (0, 0, 600, 12, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0)
    received = net.feed("mavros", Wire(1, 154).frame("GIMBAL_DEVICE_ATTITUDE_STATUS", *values))
    assert [message.name for message in received.messages] == ["GIMBAL_DEVICE_ATTITUDE_STATUS"]


def test_requests_of_our_own_system_are_read_on_every_link() -> None:
    net = Net()
    for link, wire in (("ground", Wire(1, 195)), ("mavros", net.mavros)):
        assert [m.name for m in net.feed(link, wire.command(1, 191)).messages] == ["COMMAND_LONG"]


def test_a_late_echo_of_a_whole_stream_is_nothing_but_a_count() -> None:
    """A station that forwards through a second radio returns everything three seconds later."""
    net = Net()
    sent: list[tuple[HostNs, bytes]] = []
    for step in range(1200):
        frame = net.vehicle.attitude(step * 10)
        assert len(net.feed("autopilot", frame).messages) == 1
        sent.append((net.now, frame))
        net.now = HostNs(net.now + 9 * NS_PER_MS)
        if sent[0][0] <= net.now - 3 * NS_PER_S:
            received = net.feed("tablet", sent.pop(0)[1])
            assert (received.messages, received.forwards) == ([], [])
    assert net.count("own_ids_on_gcs", "tablet") > 800


def test_an_echo_of_ours_differs_from_a_second_program() -> None:
    net = Net()
    fields = {"type": 18, "autopilot": 8, "base_mode": 0, "custom_mode": 0, "system_status": 4}
    beat = Outgoing(name="HEARTBEAT", fields=fields, to=Destination.EVERYONE, component=191)
    for _ in range(10):
        frames = dict(net.node.encode(beat, net.now))
        net.now = HostNs(net.now + 3 * NS_PER_S)
        assert net.feed("tablet", frames["ground"]).forwards == []
    assert (net.count("echoes", "tablet"), net.count("id_conflict", "tablet")) == (10, 0)
    second = Wire(1, 191)
    second.mav.seq = 77
    received = net.feed("tablet", second.heartbeat(18, INVALID), second.command(1, 1))
    assert [name for name, _ in received.forwards] == ["autopilot"]
    assert received.messages == []
    assert list(received.frames) == []
    assert net.count("id_conflict", "tablet") == 2


def test_what_was_refused_is_reported_once_a_minute_with_its_causes_in_order() -> None:
    net = Net()
    assert net.node.notices(net.now) == []
    reported = []
    for second in range(150):
        net.feed("ground", Wire(1, 1).heartbeat())
        reported += [(second, notice) for notice in net.node.notices(net.now)]
        net.now = HostNs(net.now + NS_PER_S - NS_PER_MS)
    assert [second for second, _ in reported] == [0, 60, 120]
    assert {notice.code for _, notice in reported} == {NoticeCode.OWN_IDS_ON_GCS}
    text = reported[0][1].text
    order = [text.index(cause) for cause in ("forwards back", 'role = "autopilot"', "another vehicle", "forgery")]
    assert order == sorted(order)
    assert "'ground'" in text
    net.feed("tablet", Wire(1, 191).frame("PING", 1, 1, 0, 0))
    (conflict,) = net.node.notices(net.now)
    assert conflict.code is NoticeCode.ID_CONFLICT
    assert "component_id = 192" in conflict.text
    assert len(net.node.notices(HostNs(net.now + 2 * REPORT_NS))) == 1
    assert net.node.notices(HostNs(net.now + 4 * REPORT_NS)) == [], "nothing more came"


def test_what_is_shed_is_counted_and_reported() -> None:
    net = Net()
    for _ in range(20):
        net.feed("ground", b"\xfe" * 1000)
    assert net.count("shed_bytes", "ground") > 15_000
    (notice,) = net.node.notices(net.now)
    assert notice.code is NoticeCode.BYTES_SHED
    assert "'ground'" in notice.text
    assert net.node.notices(net.now) == []


def test_telemetry_for_ground_stations_does_not_go_to_payloads() -> None:
    net = Net()
    fields = {"severity": 4, "text": "x"}
    text = Outgoing(name="STATUSTEXT", fields=fields, to=Destination.GROUND_LINKS, component=191)
    assert [name for name, _ in net.node.encode(text, net.now)] == ["ground", "tablet"]
    everyone = Outgoing(name="STATUSTEXT", fields=fields, to=Destination.EVERYONE, component=191)
    assert [name for name, _ in net.node.encode(everyone, net.now)] == ["autopilot", "ground", "tablet", "mavros"]


def test_frames_pass_between_payload_and_autopilot_by_the_routing_rules() -> None:
    net = Net()
    assert [name for name, _ in net.feed("mavros", net.mavros.command(1, 1)).forwards] == ["autopilot"]
    answer = net.vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 1, 240)
    assert [name for name, _ in net.feed("autopilot", answer).forwards] == ["mavros"]


@pytest.mark.parametrize("link", ["autopilot", "mavros"])
@pytest.mark.parametrize("forged_first", [False, True])
def test_component_heard_on_the_vehicles_links_keeps_its_route_and_its_frames_reach_stations(
    link: str, forged_first: bool
) -> None:
    """A gimbal (1, 154), and one DEBUG frame in its name on a link of ground stations."""
    net, gimbal, forged = Net(), Wire(1, 154), Wire(1, 154).frame("DEBUG", 1, 0, 0.0)
    if forged_first:
        net.feed("ground", forged)
    for _ in range(3):
        attitude = gimbal.frame("GIMBAL_DEVICE_ATTITUDE_STATUS", 0, 0, 1, 0, (1.0, 0, 0, 0), 0.0, 0.0, 0.0, 0)
        forwards = net.feed(link, attitude).forwards
        assert ("ground", attitude) in forwards
        assert ("tablet", attitude) in forwards
        net.feed("ground", forged)
    command = net.station.frame("COMMAND_LONG", 1, 154, 1000, 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    assert net.feed("ground", command).forwards == [(link, command)]
    assert net.feed("tablet", Wire(250, 1).frame("COMMAND_LONG", 1, 154, 1000, 0, *[0.0] * 7)).forwards[0][0] == link


@pytest.mark.parametrize(("link", "read"), [("ground", []), ("mavros", ["GIMBAL_MANAGER_STATUS"])])
def test_a_vehicle_of_system_0_is_not_reported_by_a_station(link: str, read: list[str]) -> None:
    """Betaflight sends with system 0, and our own id is another: neither is the vehicle's on a station's link."""
    net = Net()
    net.node.adopt(1, 1, vehicle=0)
    frame = Wire(0, 154).frame("GIMBAL_MANAGER_STATUS", 1, 0, 1, 1, 191, 0, 0)
    assert [message.name for message in net.feed(link, frame).messages] == read


def test_frames_of_a_payload_that_a_station_forged_in_advance_are_read() -> None:
    """A gimbal's heartbeat has 256 variants, by its sequence number: a stranger sends all of them beforehand."""
    net, gimbal, forger = Net(), Wire(1, 154), Wire(1, 154)
    net.feed("mavros", gimbal.frame("DEBUG", 1, 0, 0.0))
    for _ in range(3):
        net.feed("ground", *(forger.heartbeat(26, INVALID) for _ in range(256)))
        received = net.feed("mavros", gimbal.heartbeat(26, INVALID))
        assert [(message.name, message.link) for message in received.messages] == [("HEARTBEAT", "mavros")]
    assert net.count("duplicates", "mavros") == 0

"""With a key: what an unsigned, forged or late frame may teach the router, and what of it reaches the vehicle."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire, dialect, unknown_frame

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node, SigningPolicy
from fwav_companion.pipeline.pipeline_factory import WANTED

KEY = bytes(range(32))
START = 40_000_000_000_000
MINUTE = 6_000_000


class SignedWire(Wire):
    def __init__(self, system: int, component: int, key: bytes = KEY, link_id: int = 9) -> None:
        super().__init__(system, component)
        self.mav.signing.secret_key = key
        self.mav.signing.link_id = link_id
        self.mav.signing.timestamp = START
        self.mav.signing.sign_outgoing = True


class Net:
    """A vehicle and a station, both signing, and a tablet that does not."""

    def __init__(self, *accept_unsigned: str, relay_unsigned: bool = False) -> None:
        links = (
            LinkPolicy("autopilot", "autopilot"),
            LinkPolicy("ground", "gcs"),
            LinkPolicy("tablet", "gcs", relay_unsigned=relay_unsigned, datagrams=True),
            LinkPolicy("gimbal", "payload"),
        )
        policy = SigningPolicy(key=KEY, timestamp=START, accept_unsigned=frozenset(accept_unsigned))
        self.node = Node(links, WANTED, signing=policy)
        self.node.adopt(1, 1)
        self.now = HostNs(1000 * NS_PER_S)
        self.vehicle, self.station, self.gimbal = SignedWire(1, 1), SignedWire(255, 190), SignedWire(1, 154)
        self.links_of("autopilot", self.vehicle.heartbeat())
        self.links_of("ground", self.station.heartbeat(dialect.MAV_TYPE_GCS, 8))
        self.links_of("gimbal", self.gimbal.heartbeat(dialect.MAV_TYPE_GIMBAL, 8))

    def links_of(self, link: str, frame: bytes) -> list[str]:
        self.now = HostNs(self.now + NS_PER_MS)
        return [name for name, _ in self.node.receive(link, frame, self.now).forwards]

    def read(self, link: str, frame: bytes) -> list[str]:
        self.now = HostNs(self.now + NS_PER_MS)
        return [message.name for message in self.node.receive(link, frame, self.now).messages]

    def count(self, name: str, link: str) -> int:
        return next(getattr(each, name) for each in self.node.statistics(self.now) if each.name == link)


WIRES = ["unsigned", "another key", "a station's ids"]


def attacks(wire: Wire) -> dict[str, bytes]:
    """What would act on the vehicle."""
    return {
        "force disarm": wire.frame("COMMAND_LONG", 1, 1, 400, 0, 0.0, 21196.0, *[0.0] * 5),
        "to all": wire.command(0, 0),
        "parameter": wire.frame("PARAM_SET", 1, 1, b"PLND_LAG", 1.0, 9),
        "mode": wire.frame("SET_MODE", 1, 1, 4),
        "rc": wire.frame("RC_CHANNELS_OVERRIDE", 1, 1, *[1500] * 8),
        "manual": wire.frame("MANUAL_CONTROL", 1, 0, 0, 0, 0, 0),
        "setpoint": wire.frame("SET_ATTITUDE_TARGET", 1, 1, 1, 0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.5),
        "ftp": wire.frame("FILE_TRANSFER_PROTOCOL", 0, 1, 1, bytes(251)),
        "serial": wire.frame("SERIAL_CONTROL", 0, 0, 0, 0, 1, bytes(70)),
        "position": wire.frame("GPS_INPUT", 0, 0, 0, 0, 0, 3, 1, 1, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 9),
        "simulation": wire.frame("HIL_STATE", 0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
        "rates": wire.frame("REQUEST_DATA_STREAM", 1, 1, 0, 1, 0),
        "gimbal": wire.command(1, 154),
        "unknown": unknown_frame(system=254),
        "target to follow": wire.frame(
            "FOLLOW_TARGET",
            1,
            3,
            480000000,
            110000000,
            500.0,
            *[(1.0,) * 3] * 2,
            (1.0, 0.0, 0.0, 0.0),
            *[(0.0,) * 3] * 2,
            0,
        ),
        "place": wire.frame("VISION_POSITION_ESTIMATE", 1, *[1.0] * 6),
        "height": wire.frame("DISTANCE_SENSOR", 1, 20, 2000, 100, 0, 1, 25, 0),
        "corrections": wire.frame("GPS_RTCM_DATA", 0, 180, bytes(180)),
    }


@pytest.mark.parametrize("name", attacks(Wire(254, 190)))
@pytest.mark.parametrize("wire", [Wire(254, 190), SignedWire(254, 190, bytes(32)), Wire(255, 190)], ids=WIRES)
def test_nothing_unsigned_or_wrongly_signed_reaches_the_vehicle(name: str, wire: Wire) -> None:
    net = Net()
    assert not {"autopilot", "gimbal"} & set(net.links_of("tablet", attacks(wire)[name]))
    assert net.count("peers", "tablet") == []


@pytest.mark.parametrize("name", attacks(Wire(254, 190)))
def test_what_asks_for_something_is_relayed_unsigned_only_where_the_configuration_says_so(name: str) -> None:
    frame = attacks(Wire(254, 190))[name]
    net = Net("tablet")
    assert not {"autopilot", "gimbal"} & set(net.links_of("tablet", frame))
    relaying = Net("tablet", relay_unsigned=True)
    assert relaying.links_of("tablet", frame)[0] == ("gimbal" if name == "gimbal" else "autopilot")
    assert Net(relay_unsigned=True).links_of("tablet", frame) in ([], ["ground"]), "the link is not in accept_unsigned"


def test_the_same_frames_signed_reach_the_vehicle() -> None:
    net = Net()
    for frame in (net.station.command(1, 1), net.station.frame("MANUAL_CONTROL", 1, 0, 0, 0, 0, 0)):
        assert "autopilot" in net.links_of("ground", frame)


def test_a_forged_sender_does_not_take_a_route() -> None:
    net = Net()
    for _ in range(3):
        net.links_of("tablet", Wire(255, 190).heartbeat(6, 8))
        net.links_of("tablet", SignedWire(255, 190, bytes(32)).heartbeat(6, 8))
    assert "ground" in net.links_of("autopilot", net.vehicle.heartbeat())
    assert net.links_of("autopilot", net.vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)) == ["ground"]
    # Nor by a clock that goes back.
    net.links_of("ground", net.station.frame("SYSTEM_TIME", 0, 90_000))
    for second in range(5):
        net.now = HostNs(net.now + NS_PER_S)
        net.links_of("ground", Wire(255, 190).frame("SYSTEM_TIME", 0, 500 + second))
    assert net.links_of("autopilot", net.vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)) == ["ground"]


def test_unsigned_telemetry_teaches_routes_where_it_is_accepted() -> None:
    net = Net("tablet")
    assert net.read("tablet", Wire(254, 190).heartbeat(6, 8)) == ["HEARTBEAT"]
    assert net.links_of("autopilot", net.vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 254, 190)) == ["tablet"]
    assert net.read("tablet", Wire(254, 190).command(1, 191)) == []


def test_a_radio_report_is_read_and_teaches_no_peer() -> None:
    net = Net()
    frame = Wire(51, 68).frame("RADIO_STATUS", 1, 2, 10, 4, 5, 6, 7)
    assert net.links_of("ground", frame) == ["tablet"]
    assert [peer.system for peer in net.count("peers", "ground")] == [255]
    assert net.count("thinning", "ground").txbuf == 10


def test_a_genuine_frame_that_comes_late_is_a_copy_and_not_a_forgery() -> None:
    net = Net()
    frames = [net.station.heartbeat(6, 8) for _ in range(5)]
    for frame in frames:
        net.links_of("ground", frame)
    net.now = HostNs(net.now + 3 * NS_PER_S)
    for frame in frames:
        assert net.links_of("tablet", frame) == []
    assert (net.count("late_copy", "tablet"), net.count("refused_signatures", "tablet")) == (5, 0)
    assert net.count("peers", "tablet") == []


def test_a_sender_whose_clock_is_far_behind_is_named_as_such() -> None:
    net = Net()
    old = SignedWire(254, 190)
    old.mav.signing.timestamp = START - 2 * MINUTE
    assert net.links_of("tablet", old.heartbeat(6, 8)) == []
    assert (net.count("outdated", "tablet"), net.count("refused_signatures", "tablet")) == (1, 0)


def test_a_signed_copy_over_a_redundant_link_is_a_duplicate() -> None:
    policy = SigningPolicy(key=KEY, timestamp=START)
    links = (LinkPolicy("a", "autopilot"), LinkPolicy("b", "autopilot"), LinkPolicy("ground", "gcs"))
    node = Node(links, WANTED, signing=policy)
    node.adopt(1, 1)
    vehicle, now = SignedWire(1, 1), HostNs(NS_PER_S)
    answer = vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
    node.receive("a", answer, now)
    assert node.receive("b", answer, now).forwards == []
    assert [link.late_copy for link in node.statistics(now)] == [0, 0, 0]
    station = SignedWire(255, 190)
    forwards = node.receive("ground", station.command(1, 1), now).forwards
    assert [name for name, _ in forwards] == ["a", "b"], "both ways are known"


@pytest.mark.parametrize("name", ["place", "height"])
def test_unsigned_sensors_of_the_vehicles_own_links_reach_the_autopilot(name: str) -> None:
    net = Net("gimbal")
    assert "autopilot" in net.links_of("gimbal", attacks(Wire(1, 240))[name])
    assert "autopilot" not in Net().links_of("gimbal", attacks(Wire(1, 240))[name])


def test_frames_that_are_not_verified_take_little_of_a_slow_link() -> None:
    """Also where they bear the ids of a genuine station, and are never thinned for a verified one."""
    links = (
        LinkPolicy("autopilot", "autopilot"),
        LinkPolicy("tablet", "gcs", datagrams=True),
        LinkPolicy("radio", "gcs", max_bytes_per_s=2000.0, max_rate_hz={"HEARTBEAT": 2.0}),
    )
    node = Node(links, WANTED, signing=SigningPolicy(key=KEY, timestamp=START))
    node.adopt(1, 1)
    vehicle, station, forged = SignedWire(1, 1), SignedWire(255, 190), Wire(255, 190)
    unsigned, genuine = 0, []
    for tick in range(3000):
        now = HostNs(1000 * NS_PER_S + tick * 10 * NS_PER_MS)
        passed = node.receive("tablet", forged.heartbeat(6, 8) + forged.command(0, 0), now).forwards
        unsigned += sum(len(data) for name, data in passed if name == "radio")
        if tick % 100 == 99:
            for link, frame in (("autopilot", vehicle.heartbeat()), ("tablet", station.heartbeat(6, 8))):
                genuine += [name for name, _ in node.receive(link, frame, now).forwards if name == "radio"]
    assert 0 < unsigned <= 0.06 * 30.0 * 2000.0
    assert len(genuine) == 2 * 30

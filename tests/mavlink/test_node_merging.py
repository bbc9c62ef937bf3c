"""The node on links that merge requests for message rates: which messages pass, which are thinned, and the status."""

from __future__ import annotations

import msgspec
import pytest
from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.wire.rate_messages import OwnStreams
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import Destination, Outgoing
from sitl_mock.codec import NUMBERS

QUATERNION = NUMBERS["ATTITUDE_QUATERNION"]
T0 = HostNs(NS_PER_S)


class Relay:
    """An autopilot, a link that merges, and one on which requests pass as they are."""

    def __init__(self, **policy) -> None:
        links = [
            LinkPolicy("autopilot", "autopilot"),
            LinkPolicy("ground", "gcs", **policy),
            LinkPolicy("plain", "gcs", forward_rate_requests=True),
        ]
        self.node = Node(links, [])
        self.node.adopt(1)
        self.node.share(OwnStreams(1, 1, {QUATERNION: 0.0}))
        self.vehicle, self.ground = Wire(1, 1), Wire(255, 190)
        self.now = T0
        self.feed("autopilot", self.vehicle.heartbeat())
        self.feed("ground", self.ground.heartbeat(dialect.MAV_TYPE_GCS, 8))

    def feed(self, link: str, *frames: bytes) -> list[str]:
        """The links that each frame was sent to; frames arrive one millisecond apart."""
        self.now = HostNs(self.now + NS_PER_MS)
        return [name for name, _ in self.node.receive(link, b"".join(frames), self.now).forwards]

    def quaternion(self) -> bytes:
        return self.vehicle.frame("ATTITUDE_QUATERNION", 5, 1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3)

    def count(self, link: str, seconds: float, hz: float = 100.0) -> int:
        """The number of quaternions that are sent to the link."""
        gone = 0
        for _ in range(round(seconds * hz)):
            self.now = HostNs(self.now + round(NS_PER_S / hz) - NS_PER_MS)
            gone += self.feed("autopilot", self.quaternion()).count(link)
        return gone


def test_what_only_we_asked_for_goes_only_where_requests_are_not_merged():
    assert Relay().feed("autopilot", Relay().quaternion()) == ["plain"]


def test_a_station_that_asks_gets_it_at_its_rate_from_then_on():
    relay = Relay()
    frame = relay.ground.frame("COMMAND_LONG", 1, 1, 511, 0, QUATERNION, 1e6 / 20, 0, 0, 0, 0, 0)
    assert relay.feed("ground", frame) == ["autopilot"]
    assert relay.count("ground", 10.0) == pytest.approx(200, abs=2)
    assert dict(relay.node.demanded) == {QUATERNION: pytest.approx(20.0)}


def test_a_stranger_that_asks_with_many_ids_takes_no_rate_from_a_station_that_is_heard():
    relay = Relay()

    def ask(station: Wire, hz: float, source: str) -> None:
        frame = station.frame("COMMAND_LONG", 1, 1, 511, 0, QUATERNION, 1e6 / hz, 0, 0, 0, 0, 0)
        relay.node.receive("ground", frame, relay.now, source)

    ask(relay.ground, 20.0, "10.0.0.1")
    relay.now = HostNs(relay.now + NS_PER_S)
    for system in range(100, 130):
        ask(Wire(system, 190), 1.0, "10.0.0.66")
    assert 95 <= relay.count("ground", 5.0) <= 105
    ask(Wire(254, 190), 40.0, "10.0.0.2")
    assert 195 <= relay.count("ground", 5.0) <= 205, "the last place is for an address that has none"


def test_another_vehicles_attitude_passes_untouched():
    relay = Relay()
    other = Wire(7, 1)
    gone = [relay.feed("autopilot", other.attitude(i)).count("ground") for i in range(50)]
    assert sum(gone) == 50


def test_a_message_that_is_requested_once_passes_once():
    relay = Relay()
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 512, 0, QUATERNION, 0, 0, 0, 0, 0, 0))
    gone = [relay.feed("autopilot", relay.quaternion()).count("ground") for _ in range(5)]
    assert gone == [1, 0, 0, 0, 0]


def test_a_message_that_is_requested_once_passes_though_the_link_is_full():
    relay = Relay(max_bytes_per_s=300.0)
    battery = relay.vehicle.frame("BATTERY_STATUS", 0, 1, 1, 2500, [4000] * 10, 100, 100, 10, 80)
    imu = relay.vehicle.frame("HIGHRES_IMU", 1, *[1.5] * 13, 7, 1)
    for _ in range(300):
        relay.feed("autopilot", imu)
    assert relay.feed("autopilot", battery).count("ground") == 0
    number = NUMBERS["BATTERY_STATUS"]
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 512, 0, number, 0, 0, 0, 0, 0, 0))
    assert relay.feed("autopilot", battery).count("ground") == 1
    assert relay.feed("autopilot", battery).count("ground") == 0


def test_a_station_is_forgotten_a_minute_after_its_last_heartbeat():
    relay = Relay()
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 511, 0, QUATERNION, 1e5, 0, 0, 0, 0, 0))
    for _ in range(100):
        relay.now = HostNs(relay.now + NS_PER_S)
        relay.feed("ground", relay.ground.heartbeat(dialect.MAV_TYPE_GCS, 8))
    assert relay.count("ground", 2.0) == pytest.approx(20, abs=1)
    relay.now = HostNs(relay.now + 66 * NS_PER_S)
    assert relay.count("ground", 2.0) == 0


def timesync(node: Node, now: HostNs, ts1: int) -> None:
    fields = {"tc1": 0, "ts1": ts1, "target_system": 0, "target_component": 0}
    fields = {name: fields[name] for name in ("tc1", "ts1")}
    node.encode(Outgoing(name="TIMESYNC", fields=fields, to=Destination.AUTOPILOT, component=191), now)


def test_a_station_whose_heartbeats_a_stranger_sends_in_advance_keeps_its_rates():
    """A heartbeat has 256 variants. The station's own were dropped as copies, and its rates after a minute."""
    relay = Relay()
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 511, 0, QUATERNION, 1e6 / 20, 0, 0, 0, 0, 0))
    for _ in range(90):
        beat = relay.ground.heartbeat(dialect.MAV_TYPE_GCS, 8)
        relay.feed("plain", beat)
        assert relay.feed("ground", beat) == []
        relay.count("ground", 1.0, hz=10.0)
    assert relay.count("ground", 1.0) == pytest.approx(20, abs=1)


@pytest.mark.parametrize("ts1", [123_456_789_012, 0xF0_1234, 1])
def test_the_answer_to_our_timesync_reaches_no_other_clock_filter(ts1):
    relay = Relay()
    timesync(relay.node, relay.now, ts1)
    assert relay.feed("autopilot", relay.vehicle.frame("TIMESYNC", 777_000, ts1)) == ["plain"]
    assert relay.feed("autopilot", relay.vehicle.frame("TIMESYNC", 777_000, ts1 + 1)) == ["ground", "plain"]
    assert relay.feed("autopilot", relay.vehicle.frame("TIMESYNC", 0, ts1)) == ["ground", "plain"], "a request"


def test_a_parameter_list_waits_for_a_slow_link_and_is_sent_while_nothing_comes():
    relay = Relay(max_bytes_per_s=1000.0)
    frames = [
        relay.vehicle.frame("PARAM_VALUE", f"P_{number}".encode(), 1.0 + number, 9, 60, number) for number in range(60)
    ]
    received = relay.node.receive("autopilot", b"".join(frames), relay.now)
    arrived = b"".join(data for name, data in received.forwards if name == "ground")
    assert len(arrived) < 600
    while (due := relay.node.wake_at) is not None:
        assert due > relay.now
        relay.now = due
        arrived += b"".join(data for _, data in relay.node.on_wake(due).forwards)
    assert arrived == b"".join(frames)
    assert relay.now - T0 < 6 * NS_PER_S


@pytest.mark.parametrize("flood", ["HEARTBEAT", "LOG_DATA", "ATTITUDE"])
def test_a_flood_of_another_stations_link_leaves_a_slow_link_three_quarters_of_its_bytes(flood):
    """A stranger's heartbeats at ten times a radio's rate left the vehicle's telemetry nothing."""
    relay = Relay(max_bytes_per_s=2000.0)
    strangers = [Wire(2 + k, 1) for k in range(50)]
    frames = {
        "HEARTBEAT": [each.heartbeat() for each in strangers],
        "LOG_DATA": [each.frame("LOG_DATA", 1, 0, 90, [1] * 90) for each in strangers],
        "ATTITUDE": [each.attitude(5) for each in strangers],
    }[flood]
    sent = {"vehicle": 0, "strangers": 0}
    for step in range(1500):
        relay.now = HostNs(relay.now + 8 * NS_PER_MS)
        beat = [relay.vehicle.heartbeat()] if step % 100 == 0 else []
        mixed = relay.node.receive("autopilot", b"".join([relay.vehicle.attitude(step), *beat]), relay.now).forwards
        relay.now = HostNs(relay.now + NS_PER_MS)
        mixed += relay.node.receive("plain", b"".join(frames[:20]), relay.now).forwards
        if relay.node.wake_at is not None and relay.node.wake_at <= relay.now:
            mixed += relay.node.on_wake(relay.now).forwards
        for link, data in mixed if step >= 400 else ():
            for frame in Scanner(datagrams=True).feed(data) if link == "ground" else ():
                sent["vehicle" if frame.system == 1 else "strangers"] += len(frame.data)
    seconds = 1100 * 0.009
    assert sent["strangers"] / seconds <= 0.27 * 2000.0
    assert sent["vehicle"] / seconds >= 0.6 * 2000.0


def test_a_radio_that_reports_a_full_buffer_is_sent_less_on_its_own_link_alone():
    relay = Relay()
    radio = Wire(51, 68)
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 511, 0, QUATERNION, 1e4, 0, 0, 0, 0, 0))
    relay.feed("ground", radio.frame("RADIO_STATUS", 200, 200, 100, 40, 40, 0, 0))
    assert relay.count("ground", 3.0) >= 297
    for _ in range(3):
        relay.feed("ground", radio.frame("RADIO_STATUS", 200, 200, 10, 40, 40, 0, 0))
        assert relay.count("plain", 1.0) == 100
    assert relay.count("ground", 1.0) < 20


def test_the_status_says_what_is_thinned_on_each_link_and_why():
    relay = Relay(max_bytes_per_s=1000.0, max_rate_hz={"VFR_HUD": 2})
    relay.feed("ground", relay.ground.frame("COMMAND_LONG", 1, 1, 511, 0, NUMBERS["ATTITUDE"], 1e5, 0, 0, 0, 0, 0))
    for i in range(400):
        relay.now = HostNs(relay.now + 9 * NS_PER_MS)
        relay.feed(
            "autopilot", relay.quaternion(), relay.vehicle.attitude(i),
            relay.vehicle.frame("VFR_HUD", 1.0, 1.0, 3, 4, 5.0, 6.0),
            relay.vehicle.frame("HIGHRES_IMU", i, *[1.5] * 13, 7, 1),
        )  # fmt: skip
    autopilot, ground, plain = relay.node.statistics(relay.now)
    rows = {(row.message, row.why): row.at_most_hz for row in ground.thinning.messages}
    assert [why for message, why in rows if message == "ATTITUDE_QUATERNION"] == ["only_ours"]
    assert rows["ATTITUDE_QUATERNION", "only_ours"] == 0.0
    assert rows["ATTITUDE", "asked"] == 10.0
    assert rows["VFR_HUD", "max_rate_hz"] == 2.0
    assert rows["HIGHRES_IMU", "max_bytes_per_s"] == ground.thinning.common_hz
    assert ground.thinning.max_bytes_per_s == 1000.0
    assert ground.thinning.sent_bytes_per_s == pytest.approx(950.0, rel=0.1)
    assert ground.thinned == sum(row.thinned for row in ground.thinning.messages)
    assert (autopilot.thinning.messages, plain.thinning.messages) == ([], [])
    msgspec.json.encode(ground)

"""Rate requests beyond the ration are answered TEMPORARILY_REJECTED and do not reach the autopilot."""

from __future__ import annotations

from random import Random

import pytest
from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.ration import LINK_BURST, MAX_SOURCES, SOURCE_BURST, Ration
from fwav_companion.mavlink.router.station_rates import MAX_ASKERS
from fwav_companion.mavlink.wire.rate_messages import RateRequest, rate_request
from fwav_companion.mavlink.wire.scanner import Scanner
from fwav_companion.types import NoticeCode
from sitl_mock.codec import Listener

T0 = HostNs(NS_PER_S)


def taken(ration: Ration, senders: list[int], seconds: float, a_second: float) -> int:
    """The number of requests that pass, of ``a_second`` from each sender."""
    steps = round(seconds * a_second)
    return sum(
        ration.takes(sender, HostNs(T0 + round(step / a_second * NS_PER_S)))
        for step in range(steps)
        for sender in senders
    )


def test_a_sender_may_send_forty_at_once_and_two_a_second():
    assert taken(Ration(), [1], 0.1, 1000.0) == SOURCE_BURST
    assert taken(Ration(), [1], 100.0, 10.0) in range(238, 242)


def test_a_link_passes_six_a_second_whoever_asks():
    assert taken(Ration(), list(range(10)), 100.0, 10.0) in range(int(LINK_BURST) + 594, int(LINK_BURST) + 602)


def test_a_sender_that_asks_moderately_is_not_hurt_by_another_that_floods():
    ration = Ration()
    passed = 0
    for step in range(10_000):
        now = HostNs(T0 + step * 10 * NS_PER_MS)
        ration.takes(1, now)
        passed += step % 100 == 0 and ration.takes(2, now)
    assert passed == 100


def test_invented_senders_fill_no_table():
    ration = Ration()
    taken(ration, list(range(1000)), 1.0, 1.0)
    assert len(ration._sources) <= MAX_SOURCES


@pytest.mark.parametrize("rotates", [False, True], ids=["the same strangers", "ever new strangers"])
def test_strangers_from_many_addresses_leave_the_ration_of_a_station_that_is_heard(rotates: bool):
    """The station sends heartbeats, asks for twenty messages at once, and a minute later for seven more."""
    ration, passed, asked = Ration(), 0, 0
    for step in range(1800):
        now = HostNs(T0 + step * 100 * NS_PER_MS)
        if step % 10 == 0:
            ration.hear("station", now)
        if step > 100:
            for k in range(60):
                ration.takes(f"10.0.{step if rotates else 0}.{k}", now)
        if step in range(600, 620) or step in range(1200, 1207):
            asked += 1
            passed += ration.takes("station", now)
    assert (passed, asked) == (27, 27)


def test_a_ration_shared_by_strangers_stays_that_of_the_link():
    ration, passed = Ration(), 0
    for step in range(1000):
        now = HostNs(T0 + step * 100 * NS_PER_MS)
        passed += sum(ration.takes(f"10.0.{step}.{k}", now) for k in range(30))
    assert 600 < passed <= LINK_BURST + 600


def test_a_busy_source_among_idle_ones_has_its_two_a_second():
    ration = Ration()
    for k in range(12):
        ration.hear(k, T0)
    for second in range(100):
        for k in range(12):
            ration.hear(k, HostNs(T0 + second * NS_PER_S))
    passed = sum(ration.takes(0, HostNs(T0 + 100 * NS_PER_S + k * 100 * NS_PER_MS)) for k in range(300))
    assert passed in range(98, 102)


def test_a_command_beyond_the_ration_is_answered_and_goes_nowhere():
    node = Node([LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs"), LinkPolicy("tablet", "gcs")], [])
    node.adopt(1)
    vehicle, station = Wire(1, 1), Wire(255, 190)
    node.receive("autopilot", vehicle.heartbeat(), T0)
    node.receive("ground", station.heartbeat(dialect.MAV_TYPE_GCS, 8), T0)
    went: dict[str, int] = {}
    answers = []
    for i in range(50):
        command = station.frame("COMMAND_LONG", 1, 1, 511, 0, 30, 1e5 + i, 0, 0, 0, 0, 0)
        for link, data in node.receive("ground", command, T0).forwards:
            went[link] = went.get(link, 0) + 1
            answers += Listener().feed(data) if link == "ground" else []
    assert went == {"autopilot": 40, "ground": 10}
    assert {(each.name, each.fields["command"], each.fields["result"]) for each in answers} == {("COMMAND_ACK", 511, 1)}
    assert {(each.system, each.component, each.fields["target_system"]) for each in answers} == {(1, 191, 255)}
    asked_once = station.frame("COMMAND_LONG", 1, 1, 512, 0, 30, 0, 0, 0, 0, 0, 0)
    assert [link for link, _ in node.receive("ground", asked_once, T0).forwards] == ["autopilot"]
    group = station.frame("REQUEST_DATA_STREAM", 1, 1, 0, 4, 1)
    assert node.receive("ground", group, T0).forwards == [], "a message is not acknowledged"
    assert node.statistics(T0)[1].stopped == 11


def test_one_address_has_one_ration_whatever_ids_it_speaks_with():
    """Two a second, as a station has, so that the link's six are left to others."""
    node = Node([LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs")], [])
    node.adopt(1)
    node.receive("autopilot", Wire(1, 1).heartbeat(), T0)

    def passed(sender: int, source: str) -> bool:
        station = Wire(sender, 190)
        node.receive("ground", station.heartbeat(dialect.MAV_TYPE_GCS, 8), T0, source)
        command = station.frame("COMMAND_LONG", 1, 1, 511, 0, 30, 1e5, 0, 0, 0, 0, 0)
        return any(link == "autopilot" for link, _ in node.receive("ground", command, T0, source).forwards)

    assert sum(passed(60 + k, "10.0.0.66") for k in range(100)) == SOURCE_BURST
    assert passed(255, "10.0.0.7")
    (notice,) = node.notices(T0)
    assert notice.code is NoticeCode.RATE_REQUESTS_REJECTED
    assert "60 requests" in notice.text
    assert "159/190 10.0.0.66" in notice.text
    assert node.notices(HostNs(T0 + NS_PER_S)) == []


def test_autopilot_is_asked_for_no_more_than_the_table_says():
    """Whoever asks for what: each rate that reaches the autopilot is in the table then, and ends with its station."""
    node = Node([LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs")], [])
    node.adopt(1)
    node.receive("autopilot", Wire(1, 1).heartbeat(), T0)
    draw, now = Random(3), T0
    passed = 0
    for k in range(2000):
        now = HostNs(now + NS_PER_S)
        station, source = Wire(200 + draw.randrange(30), 190), f"10.0.0.{draw.randrange(5)}"
        hz = draw.choice([1, 10, 1000, 65_535])
        interval = (draw.choice([30, 33, 50_000 + k]), 1e6 / hz, 0, 0, 0, 0, 0)
        frame = draw.choice(
            [
                station.frame("COMMAND_LONG", 1, 1, 511, 0, *interval),
                station.frame("COMMAND_INT", 1, 1, 0, 511, 0, 0, *interval),
                station.frame("MESSAGE_INTERVAL", draw.choice([30, 40_000 + k % 20_000]), -(-1_000_000 // hz)),
                station.frame("REQUEST_DATA_STREAM", 1, 1, draw.choice([0, 6, 10, 12]), hz, 1),
            ]
        )
        node.receive("ground", station.heartbeat(dialect.MAV_TYPE_GCS, 8), now, source)
        for request in asked_of_autopilot(node.receive("ground", frame, now, source).forwards):
            passed += 1
            over = {msgid: rate for msgid, rate in request.rates.items() if rate > node.demanded.get(msgid, 0.0)}
            assert over == {}
    assert passed > 500
    node.receive("autopilot", Wire(1, 1).heartbeat(), HostNs(now + 70 * NS_PER_S))
    assert node.demanded == {}


def asked_of_autopilot(forwards) -> list[RateRequest]:
    frames = (frame for link, data in forwards if link == "autopilot" for frame in Scanner(datagrams=True).feed(data))
    return [request for frame in frames if (request := rate_request(frame, "ground", "")) is not None]


def test_ninth_station_of_a_link_that_asks_for_more_is_rejected_and_the_log_names_it():
    node = Node([LinkPolicy("autopilot", "autopilot"), LinkPolicy("ground", "gcs")], [])
    node.adopt(1)
    node.receive("autopilot", Wire(1, 1).heartbeat(), T0)
    results = []
    for k in range(MAX_ASKERS + 1):
        station = Wire(240 + k, 190)
        node.receive("ground", station.heartbeat(dialect.MAV_TYPE_GCS, 8), T0, f"10.0.0.{k}")
        command = station.frame("COMMAND_LONG", 1, 1, 511, 0, 30, 1e4 - k, 0, 0, 0, 0, 0)
        forwards = node.receive("ground", command, T0, f"10.0.0.{k}").forwards
        results.append([link for link, _ in forwards])
    assert results == [["autopilot"]] * MAX_ASKERS + [["ground"]]
    (notice,) = node.notices(T0)
    assert "248/190 10.0.0.8" in notice.text

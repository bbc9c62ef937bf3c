"""Rate requests beyond the ration are answered TEMPORARILY_REJECTED and do not reach the autopilot."""

from __future__ import annotations

from mavlink_wire import Wire, dialect

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.ration import LINK_BURST, MAX_SOURCES, SOURCE_BURST, Ration
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

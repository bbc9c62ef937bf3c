"""What a node sends of its own: sizes against the budget, sequence numbers, and which TIMESYNC it remembers."""

from __future__ import annotations

import pytest
from mavlink_wire import Wire, parse

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.link_limiter import STATIONS_SHARE
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.sending import MAX_TIMESYNCS
from fwav_companion.mavlink.router.signing_policy import SigningPolicy
from fwav_companion.mavlink.wire.definitions import BY_NAME
from fwav_companion.types import Destination, Outgoing

KEY = bytes(range(32))
GROUND, TABLET = LinkPolicy("ground", "gcs", max_bytes_per_s=50_000.0), LinkPolicy("tablet", "gcs")


def value(name: str = "height", component: int = 191) -> Outgoing:
    fields = {"time_boot_ms": 70_000, "name": name, "value": 12.5}
    return Outgoing(name="NAMED_VALUE_FLOAT", fields=fields, to=Destination.GROUND, component=component)


@pytest.mark.parametrize("signed", [False, True])
def test_what_is_offered_to_a_link_is_what_its_frames_have(signed: bool) -> None:
    """Ten frames a second for three seconds; the load is measured over whole seconds."""
    policy = SigningPolicy(key=KEY, timestamp=10**9) if signed else None
    node = Node([GROUND, TABLET], [], signing=policy)
    sizes = []
    for k in range(31):
        now = HostNs(NS_PER_S + k * 100 * NS_PER_MS)
        sizes += [len(data) for link, data in node.encode(value(), now) if link == "ground"]
    ground, _ = node.statistics(now)
    assert len(set(sizes)) == 1
    assert ground.thinning.offered_bytes_per_s == pytest.approx(10.0 * sizes[0])
    assert ground.thinning.sent_bytes_per_s == pytest.approx(10.0 * sizes[0])


def test_each_component_counts_its_frames_on_each_link() -> None:
    node = Node([LinkPolicy("ground", "gcs"), TABLET], [])
    seen: dict[tuple[str, int], list[int]] = {}
    for k in range(600):
        for link, data in node.encode(value(component=191 if k % 3 else 100), HostNs(k * NS_PER_MS)):
            (message,) = parse(data)
            seen.setdefault((link, message.get_srcComponent()), []).append(message.get_seq())
    for (_, component), numbers in seen.items():
        assert numbers == [k % 256 for k in range(400 if component == 191 else 200)]
    assert len(seen) == 4


def test_answers_to_a_station_take_a_quarter_of_a_limited_link_however_often_it_asks() -> None:
    """A camera's description is six times as long as its request; the link of the vehicle is not limited so."""
    budget = 3000.0
    links = [LinkPolicy("ground", "gcs", max_bytes_per_s=budget), LinkPolicy("fc", "autopilot", max_bytes_per_s=budget)]
    node, sizes = Node(links, []), {"ground": 0, "fc": 0}
    node.adopt(1)
    vehicle, passed = Wire(1, 1), 0
    for k in range(500):  # 10 s; 50 requests and 50 attitudes a second
        now = HostNs(NS_PER_S + k * 20 * NS_PER_MS)
        for link in sizes:
            for name, values in (("COMMAND_ACK", (512, 0, 0, 0, 255, 190)), ("CAMERA_SETTINGS", (70_000, 0, 1.0, 1.0))):
                fields = dict(zip(BY_NAME[name].field_names, values, strict=False))
                answer = Outgoing(name=name, fields=fields, to=Destination.REPLY, component=100, link=link)
                sizes[link] += sum(len(data) for _, data in node.encode(answer, now))
        passed += len(node.receive("fc", vehicle.attitude(k), now).forwards)
    assert sizes["ground"] == pytest.approx(10 * STATIONS_SHARE * budget, rel=0.1)
    assert sizes["fc"] > 2 * sizes["ground"]
    assert passed * len(vehicle.attitude()) > 10 * 0.5 * budget


def test_the_newest_requests_for_the_time_are_remembered() -> None:
    node = Node([LinkPolicy("autopilot", "autopilot")], [])
    for k in range(MAX_TIMESYNCS + 10):
        fields = {"tc1": 0, "ts1": k}
        node.encode(Outgoing(name="TIMESYNC", fields=fields, to=Destination.AUTOPILOT, component=191), HostNs(k))
    assert list(node._sender.timesyncs) == list(range(10, MAX_TIMESYNCS + 10))

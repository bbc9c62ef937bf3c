"""What a node sends of its own: sizes against the budget, sequence numbers, and which TIMESYNC it remembers."""

from __future__ import annotations

import pytest
from mavlink_wire import parse

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.sending import MAX_TIMESYNCS
from fwav_companion.mavlink.router.signing_policy import SigningPolicy
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


def test_the_newest_requests_for_the_time_are_remembered() -> None:
    node = Node([LinkPolicy("autopilot", "autopilot")], [])
    for k in range(MAX_TIMESYNCS + 10):
        fields = {"tc1": 0, "ts1": k}
        node.encode(Outgoing(name="TIMESYNC", fields=fields, to=Destination.AUTOPILOT, component=191), HostNs(k))
    assert list(node._sender.timesyncs) == list(range(10, MAX_TIMESYNCS + 10))

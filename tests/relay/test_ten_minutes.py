"""Two ground stations and a rebooting autopilot on four links for ten minutes, in invented time: no frame that must
pass by the rules is lost, doubled or changed, and no frame passes that must not.
"""

from collections import Counter
from collections.abc import Iterator

import pytest
from relay_story import LINKS, LOSS, STATION_LINKS, VEHICLE_LINKS, Event, story

from fwav_companion.geometry.stamps import HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node

START_NS = 5_000_000_000_000


@pytest.fixture(scope="module")
def ten_minutes() -> list[Event]:
    return list(story(600))


def relayed(node: Node, events: list[Event]) -> Iterator[tuple[str, bytes]]:
    """(link, bytes) as they leave."""
    for event in events:
        now = HostNs(START_NS + event.at_ms * 1_000_000)
        if node.wake_at is not None and node.wake_at <= now:
            yield from node.on_wake(now).forwards
        yield from node.receive(event.link, event.frame, now).forwards


def node_of(links: tuple[str, ...], *, datagrams: bool) -> Node:
    """A node that does not merge rate requests, because merging thins attitudes: the test is of the routing alone."""
    roles = {link: "autopilot" if link in VEHICLE_LINKS else "gcs" for link in links}
    policies = [
        LinkPolicy(link, role, forward_rate_requests=False, datagrams=datagrams) for link, role in roles.items()
    ]
    node = Node(policies, wanted=())
    node.adopt(1)
    return node


def split(data: bytes) -> Iterator[bytes]:
    """Whole MAVLink 2 frames, by the lengths in their headers."""
    while data:
        length = data[1] + 12
        yield data[:length]
        data = data[length:]


def test_every_frame_that_must_pass_does_and_no_other(ten_minutes: list[Event]):
    due, came = {link: bytearray() for link in LINKS}, {link: bytearray() for link in LINKS}
    for event in ten_minutes:
        for link in event.to:
            due[link] += event.frame
    node = node_of(LINKS, datagrams=True)
    for link, data in relayed(node, ten_minutes):
        came[link] += data
    assert came == due
    assert len(ten_minutes) > 110_000
    assert sum(len(event.to) for event in ten_minutes) > 120_000
    for link in node.statistics(HostNs(START_NS + 600_000_000_000)):
        assert (link.bad_checksums, link.not_understood, link.echoes) == (0, 0, 0)
        for peer in link.peers:
            loss = LOSS if link.name in VEHICLE_LINKS else 0.0
            assert peer.loss == pytest.approx(loss, abs=0.3 * loss)


def test_over_streams_ground_stations_get_the_same(ten_minutes: list[Event]):
    """A frame of an unknown id waits for the next one where its end is unknown: only the order may differ."""
    due = {link: Counter(event.frame for event in ten_minutes if link in event.to) for link in STATION_LINKS}
    came: dict[str, Counter[bytes]] = {link: Counter() for link in LINKS}
    for link, data in relayed(node_of(LINKS, datagrams=False), ten_minutes):
        came[link].update(split(data))
    for link in STATION_LINKS:
        assert came[link] == due[link]

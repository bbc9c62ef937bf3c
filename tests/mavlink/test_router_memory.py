"""The router's tables are bounded together, whatever senders and targets are invented; genuine peers keep theirs."""

from __future__ import annotations

import gc
import tracemalloc

import pytest
from mavlink_wire import Wire

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.peers import MAX_PEER_STREAMS, MAX_PEERS, SILENT_NS
from fwav_companion.mavlink.wire.definitions import BY_NAME, DEFINITIONS
from fwav_companion.mavlink.wire.frames import checksum
from fwav_companion.pipeline.pipeline_factory import WANTED

LIMIT_BYTES = 4 * 2**20
LINKS = (
    LinkPolicy("autopilot", "autopilot"),
    LinkPolicy("ground", "gcs", max_rate_hz={"HEARTBEAT": 1.0, "ATTITUDE": 1.0}, datagrams=True, max_bytes_per_s=9000),
    LinkPolicy("tablet", "gcs", max_rate_hz={"HEARTBEAT": 1.0}, datagrams=True, max_bytes_per_s=9000),
    LinkPolicy("mavros", "payload", datagrams=True),
)


def frame(msgid: int, system: int, component: int, seq: int, target: tuple[int, int] = (1, 1)) -> bytes:
    definition = DEFINITIONS[msgid]
    payload = bytearray(b"\1" * definition.length)
    if definition.target_system_offset >= 0:
        payload[definition.target_system_offset] = target[0]
    if definition.target_component_offset >= 0:
        payload[definition.target_component_offset] = target[1]
    body = bytes((len(payload), 0, 0, seq, system, component)) + definition.id_bytes + bytes(payload)
    return b"\xfd" + body + checksum(body + definition.crc_byte).to_bytes(2, "little")


def flood(node: Node, count: int) -> HostNs:
    """Invented senders, messages, gaps and targets on every link, and a genuine station once a second."""
    ids = sorted(msgid for msgid, known in DEFINITIONS.items() if known.length < 60)
    now, station = HostNs(1000 * NS_PER_S), Wire(255, 190)
    for number in range(count):
        now = HostNs(now + 20 * NS_PER_MS)
        if number % 50 == 0:
            node.receive("ground", station.heartbeat(6, 8), now)
        link = LINKS[1 + number % 3].name
        system, component = 2 + number * 7 % 240, number * 11 % 256
        burst = [
            frame(ids[(number + i) % len(ids)], system, component, i * 37 % 256, (number % 256, i * 5 % 256))
            for i in range(12)
        ]
        node.receive(link, b"".join(burst) + bytes(2000), now)
        if number % 500 == 0:
            node.statistics(now)
    return now


def test_all_tables_together_take_at_most_four_mebibytes() -> None:
    list(BY_NAME.values())
    flood(Node(LINKS, WANTED), 300)  # what is computed on first use
    node = Node(LINKS, WANTED)
    gc.collect()
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    flood(node, 800)
    gc.collect()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    peers = [peer for port in node._router.ports for peer in port.peers.values()]
    assert len(peers) <= MAX_PEERS
    assert node._router._tables.streams == sum(len(peer.streams) for peer in peers) <= MAX_PEER_STREAMS
    assert after - before <= LIMIT_BYTES


def test_invented_senders_do_not_take_a_genuine_stations_route() -> None:
    node = Node(LINKS, WANTED)
    node.adopt(1, 1)
    now = flood(node, 2000)
    answer = Wire(1, 1).frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
    assert "ground" in [name for name, _ in node.receive("autopilot", answer, now).forwards]


def keep_alive_invented_senders(node: Node, now: HostNs, source: str) -> HostNs:
    """As many senders as the tables hold, each heard over three seconds."""
    for seq in range(4):
        for number in range(MAX_PEERS):
            node.receive("ground", frame(0, 2 + number // 100, 1 + number % 100, seq), now, source)
        now = HostNs(now + NS_PER_S)
    return now


def test_invented_senders_that_stay_keep_no_component_from_the_vehicles_links() -> None:
    """The autopilot's line is unplugged for a moment: what it had in the tables is gone."""
    node, vehicle, station = Node(LINKS, WANTED), Wire(1, 1), Wire(255, 190)
    node.adopt(1, 1)
    now = HostNs(1000 * NS_PER_S)
    node.receive("autopilot", vehicle.heartbeat(), now)
    node.receive("tablet", station.heartbeat(6, 8), now, "10.0.0.2")
    now = keep_alive_invented_senders(node, now, "10.0.0.66")
    node.link_down("autopilot")
    now = keep_alive_invented_senders(node, now, "10.0.0.66")
    node.link_up("autopilot")
    node.receive("autopilot", vehicle.heartbeat(), now)
    forwards = node.receive("tablet", station.command(1, 1), now, "10.0.0.2").forwards
    assert [name for name, _ in forwards] == ["autopilot"]


def test_invented_senders_of_one_host_keep_no_station_of_another_out() -> None:
    node, vehicle, station = Node(LINKS, WANTED), Wire(1, 1), Wire(255, 190)
    node.adopt(1, 1)
    now = HostNs(1000 * NS_PER_S)
    node.receive("autopilot", vehicle.heartbeat(), now)
    now = keep_alive_invented_senders(node, now, "10.0.0.66")
    node.receive("ground", station.heartbeat(6, 8), now, "10.0.0.2")
    answer = vehicle.frame("COMMAND_ACK", 400, 0, 0, 0, 255, 190)
    assert [name for name, _ in node.receive("autopilot", answer, now).forwards] == ["ground"]
    assert node._router._tables.peers == sum(len(port.peers) for port in node._router.ports) <= MAX_PEERS
    for number in range(60):  # and the station stays, though the others come again
        now = HostNs(now + 25 * NS_PER_MS)
        node.receive("ground", frame(0, 100 + number, 1, 0), now, "10.0.0.66")
    answer = vehicle.frame("COMMAND_ACK", 400, 1, 0, 0, 255, 190)
    assert [name for name, _ in node.receive("autopilot", answer, now).forwards] == ["ground"]


@pytest.mark.parametrize("restarts", [3])
def test_the_count_of_streams_follows_what_is_forgotten(restarts: int) -> None:
    node = Node(LINKS, WANTED)
    flood(node, 200)
    for link in ("ground", "tablet", "mavros") * restarts:
        node.link_down(link)
        node.link_up(link)
    assert (node._router._tables.peers, node._router._tables.streams) == (0, 0)


def test_stations_that_come_and_go_leave_no_reference_cycles() -> None:
    """A full search for garbage comes every few minutes: until then cycles would stay."""
    node, stations = Node(LINKS, WANTED), [Wire(system, 190) for system in range(200, 230)]
    gc.collect()
    gc.disable()
    try:
        for visit in range(3):
            for station in stations:
                node.receive("ground", station.heartbeat(6, 8), HostNs(1000 * NS_PER_S + visit * 2 * SILENT_NS))
        assert gc.collect() == 0
    finally:
        gc.enable()

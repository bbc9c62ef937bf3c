"""Counted losses are the true ones, for any order and any wrap of the counter."""

from __future__ import annotations

import random
import tracemalloc

import pytest
from mavlink_wire import Wire, unknown_frame

from fwav_companion.geometry.stamps import NS_PER_MS, NS_PER_S, HostNs
from fwav_companion.mavlink.router.node import LinkPolicy, Node
from fwav_companion.mavlink.router.peers import Peer
from fwav_companion.types.network_status import PeerStatistics

STEP = 10 * NS_PER_MS


def heard(frames: list[bytes], step: int = STEP) -> PeerStatistics:
    node = Node([LinkPolicy("a", "autopilot", datagrams=True)], [])
    now = HostNs(0)
    for frame in frames:
        now = HostNs(now + step)
        node.receive("a", frame, now)
    (link,) = node.statistics(now)
    return link.peers[0]


def sent(count: int) -> list[bytes]:
    wire = Wire(1, 1)
    return [wire.attitude(i) for i in range(count)]


@pytest.mark.parametrize("loss", [0.0, 0.01, 0.2, 0.7])
def test_random_loss_through_many_wraps(loss) -> None:
    rng = random.Random(3)
    frames = sent(3000)
    kept = [frame for i, frame in enumerate(frames) if i in (0, 2999) or rng.random() >= loss]
    peer = heard(kept)
    assert (peer.received, peer.lost) == (len(kept), 3000 - len(kept))
    assert peer.loss == pytest.approx(1 - len(kept) / 3000)


def test_frames_out_of_order_are_late_not_lost() -> None:
    rng = random.Random(4)
    frames = sent(2000)
    shuffled = sorted(range(2000), key=lambda i: i + rng.uniform(0, 8) * (0 < i < 1999))
    peer = heard([frames[i] for i in shuffled])
    assert (peer.received, peer.lost) == (2000, 0)
    assert peer.late > 100


def test_loss_and_disorder_together() -> None:
    rng = random.Random(5)
    frames = sent(2000)
    kept = [i for i in range(2000) if i in (0, 1999) or rng.random() > 0.1]
    kept.sort(key=lambda i: i + rng.uniform(0, 4) * (0 < i < 1999))
    peer = heard([frames[i] for i in kept])
    assert (peer.received, peer.lost) == (len(kept), 2000 - len(kept))


def test_frames_sent_twice_are_neither_lost_nor_more() -> None:
    frames = sent(1000)
    doubled = [copy for frame in frames for copy in (frame, frame)]
    peer = heard(doubled)
    assert (peer.received, peer.lost) == (1000, 0)


def test_a_frame_sent_twice_a_round_after_one_of_its_number_was_lost_is_no_late_one() -> None:
    frames = sent(300)
    peer = heard([*frames[:10], *frames[11:267], frames[266], *frames[267:]])
    assert (peer.received, peer.lost, peer.late) == (299, 1, 0)


def test_after_a_restart_the_counts_begin_again_and_no_frame_is_missing() -> None:
    """Three times a clock that went back, a second apart, show the restart; its sequence goes on from there."""
    before, after = Wire(1, 1), Wire(1, 1)
    frames = [before.frame("SYSTEM_TIME", 0, 90_000 + 1000 * i) for i in range(30)]
    frames += [after.frame("SYSTEM_TIME", 0, 500 + 1000 * i) for i in range(20)]
    peer = heard(frames, NS_PER_S)
    assert peer.received < 20
    assert (peer.lost, peer.late) == (0, 0)


def test_a_long_outage_is_counted_as_far_as_the_counter_shows() -> None:
    frames = sent(600)
    node = Node([LinkPolicy("a", "autopilot", datagrams=True)], [])
    for i, frame in enumerate(frames):
        if not 100 <= i < 340:
            node.receive("a", frame, HostNs(i * STEP))
    assert node.statistics(HostNs(NS_PER_S))[0].peers[0].lost == 240


def test_components_and_links_are_counted_apart() -> None:
    node = Node([LinkPolicy("a", "autopilot"), LinkPolicy("b", "gcs")], [])
    one, two, ground = Wire(1, 1), Wire(1, 154), Wire(255, 190)
    for i in range(100):
        now = HostNs(i * STEP)
        first, second = one.attitude(i), two.heartbeat()
        node.receive("a", first, now)
        if i % 2 == 0:
            node.receive("a", second, now)
        node.receive("b", ground.heartbeat(6, 8), now)
    a, b = node.statistics(HostNs(NS_PER_S))
    assert [(peer.component, peer.lost) for peer in a.peers] == [(1, 0), (154, 49)]
    assert [(peer.component, peer.lost) for peer in b.peers] == [(190, 0)]


def test_rates_by_message_since_the_last_look() -> None:
    node = Node([LinkPolicy("a", "autopilot", datagrams=True)], [])
    wire = Wire(1, 1)
    for i in range(400):
        now = HostNs(i * STEP)
        node.receive("a", wire.attitude(i), now)
        if i % 100 == 99:
            node.receive("a", wire.heartbeat() + unknown_frame(seq=(i + i // 100 + 2) % 256), now)
            wire.mav.seq = (wire.mav.seq + 1) % 256
            (link,) = node.statistics(now)
    assert link.peers[0].rates_hz == pytest.approx({"ATTITUDE": 100.0, "HEARTBEAT": 1.0, "unknown": 1.0})
    (again,) = node.statistics(HostNs(now + NS_PER_MS))
    assert again.peers[0].rates_hz == link.peers[0].rates_hz
    (silent,) = node.statistics(HostNs(now + 5 * NS_PER_S))
    assert silent.peers[0].rates_hz == pytest.approx({"ATTITUDE": 0.0, "HEARTBEAT": 0.0, "unknown": 0.0})
    assert silent.peers[0].silent_s == pytest.approx(5.0)


def test_what_a_link_reports() -> None:
    node = Node([LinkPolicy("a", "autopilot", datagrams=True), LinkPolicy("g", "gcs")], [])
    frame = bytearray(Wire(1, 1).attitude())
    frame[20] ^= 1
    node.receive("a", bytes(frame), HostNs(0))
    node.receive("g", Wire(255, 190).heartbeat(6, 8), HostNs(0))
    node.link_down("a")
    a, g = node.statistics(HostNs(NS_PER_S))
    assert (a.name, a.up, a.bytes_in, a.bad_checksums, a.skipped_bytes) == ("a", False, len(frame), 1, len(frame))
    assert (g.up, g.ground_station) == (True, True)
    assert not node.statistics(HostNs(10 * NS_PER_S))[1].ground_station


def test_a_message_that_is_new_since_the_last_look_counts_from_zero() -> None:
    node, wire = Node([LinkPolicy("a", "autopilot")], []), Wire(1, 1)
    node.receive("a", wire.heartbeat(), HostNs(0))
    node.statistics(HostNs(0))
    for i in range(5):
        node.receive("a", wire.attitude(i), HostNs(i * STEP))
    (link,) = node.statistics(HostNs(2 * NS_PER_S))
    assert link.peers[0].rates_hz == {"HEARTBEAT": 0.0, "ATTITUDE": 2.5}


def test_peers_beyond_the_list_are_counted_and_the_vehicle_and_the_busiest_are_listed() -> None:
    node = Node([LinkPolicy("a", "autopilot"), LinkPolicy("g", "gcs")], [])
    node.adopt(1)
    now = HostNs(0)
    for system in range(200, 2, -1):
        wire = Wire(system, 1)
        for _ in range(3 if system < 34 else 1):  # 31 busy ones
            now = HostNs(now + NS_PER_MS)
            node.receive("a", wire.heartbeat(), now)
    node.receive("a", Wire(1, 1).heartbeat(), now)
    a, _ = node.statistics(now)
    assert [peer.system for peer in a.peers] == [1, *range(3, 34)]
    assert a.peers_left_out == 199 - 32


@pytest.mark.parametrize("seed", range(4))
def test_counts_are_those_of_the_true_numbers(seed) -> None:
    """The truth by numbers that never wrap: what is beyond the last 32 numbers is forgotten."""
    rng = random.Random(seed)
    frames = sent(4000)
    order = [i for i in range(4000) if i in (0, 3999) or rng.random() > 0.15]
    order += [i for i in order[1:-1] if rng.random() < 0.1]  # copies
    order.sort(key=lambda i: i + rng.uniform(0, 20) * (0 < i < 3999))
    newest, missing, lost, late, repeated = 0, set[int](), 0, 0, 0
    for i in order[1:]:
        if i > newest:
            missing |= set(range(newest + 1, i))
            lost += i - newest - 1
            newest = i
        elif i in missing and newest - i < 32:
            missing.remove(i)
            lost, late = lost - 1, late + 1
        else:
            repeated += 1
    peer = heard([frames[i] for i in order])
    assert (peer.lost, peer.late, peer.received) == (lost, late, len(order) - repeated)
    assert min(lost, late, repeated) > 100


def test_an_invented_peer_with_gaps_takes_at_most_700_bytes() -> None:
    node = Node([LinkPolicy("a", "autopilot", datagrams=True)], [])
    node.receive("a", sent(1)[0], HostNs(0))
    (frame,) = node.receive("a", Wire(1, 1).attitude(), HostNs(1)).frames
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    peers = [Peer(frame, HostNs(10**12)) for _ in range(500)]
    for peer in peers:
        for seq in (40, 80, 120):
            peer.on_gap(seq, HostNs(10**12))
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert (after - before) / len(peers) <= 700

"""Frames that wait for a slow line: the service's own first, then each origin in its turn."""

import struct

from fastcrc.crc16 import mcrf4xx

from fwav_companion.fair_queues import MOST_HOSTS
from fwav_companion.links.fair_frame_queue import PIECE_BYTES, FairFrameQueue, pieces

FLOOD, STATION = ("ground", "10.0.0.66"), ("ground", "10.0.0.2")


def frame(number: int, length: int = 9) -> bytes:
    """A heartbeat of a given length that carries a number."""
    payload = struct.pack("<I", number) + bytes(length - 4)
    header = bytes((length, 0, 0, number & 255, 255, 190, 0, 0, 0))
    return b"\xfd" + header + payload + mcrf4xx(header + payload + b"\x32").to_bytes(2, "little")


def drained(waiting: FairFrameQueue) -> list[bytes]:
    taken = []
    while data := waiting.take():
        taken.append(data)
    assert waiting.total_bytes == 0
    return taken


def shed(waiting: FairFrameQueue, capacity: int) -> None:
    while waiting.total_bytes > capacity:
        waiting.drop()


def test_own_frames_leave_first_and_are_dropped_last():
    waiting = FairFrameQueue()
    for number in range(100):
        waiting.put(frame(number), STATION)
        waiting.put(frame(1000 + number), None)
    shed(waiting, 50 * len(frame(0)))
    assert drained(waiting) == [frame(1050 + number) for number in range(50)]


def test_a_flood_drops_no_frame_of_another_origin_and_each_waits_for_one_piece_of_the_flood():
    waiting, station = FairFrameQueue(), [frame(number) for number in range(20)]
    for each in station:
        waiting.put(b"".join(frame(5000 + k, 200) for k in range(150)), FLOOD)  # a read of 32 kB
        waiting.put(each, STATION)
        shed(waiting, 2880)
    left = drained(waiting)
    assert [each for each in left if each in station] == station
    assert max(left.index(each) for each in station) <= 2 * len(station)
    assert sum(map(len, left)) > 2500, "the flood's newest frames leave, too"


def test_a_flood_of_origins_shares_one_queue_beyond_the_most():
    waiting = FairFrameQueue()
    waiting.put(frame(5000), STATION)
    for host in range(1000):
        waiting.put(frame(host), ("ground", f"10.0.{host // 256}.{host % 256}"))
    shed(waiting, 40 * len(frame(0)))
    left = drained(waiting)
    assert left[0] == frame(5000)
    assert len(left) == 40
    assert left[-1] == frame(999)
    assert len({*left[:MOST_HOSTS]}) == MOST_HOSTS


def test_a_flood_of_hosts_takes_no_turn_of_another_link():
    """The autopilot's frames came after sixteen strangers, and shared the queue of all others: 1000 frames waited."""
    waiting = FairFrameQueue()
    for host in range(1000):
        waiting.put(frame(host), ("ground", f"10.0.{host // 256}.{host % 256}"))
    waiting.put(frame(5000), ("autopilot", "127.0.0.1"))
    assert frame(5000) in drained(waiting)[: MOST_HOSTS + 2]


def test_frames_are_divided_into_pieces_of_whole_frames():
    frames = [frame(number, 4 + number % 252) for number in range(600)]
    divided = pieces(b"".join(frames))
    assert b"".join(divided) == b"".join(frames)
    assert max(map(len, divided)) <= PIECE_BYTES
    ends, at = set(), 0
    for each in frames:
        ends.add(at := at + len(each))
    at = 0
    for piece in divided:
        at += len(piece)
        assert at in ends

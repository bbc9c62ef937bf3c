"""A faulty wire, each kind of fault."""

from random import Random

import numpy as np

from sitl_mock import WireOptions
from sitl_mock.codec import Listener, Speaker
from sitl_mock.wire import Wire

FRAMES = [Speaker(1, 1).frame("SYSTEM_TIME", {"time_unix_usec": i, "time_boot_ms": i}) for i in range(2000)]
MS = 1_000_000


def carried(**options):
    wire = Wire(WireOptions(**options), 0, Random(5))
    return [(i * MS, wire.carry(frame, i * MS)) for i, frame in enumerate(FRAMES)]


def test_delay_and_exponential_jitter():
    delays = [pieces[0][0] - sent for sent, pieces in carried(delay_s=0.002, jitter_s=0.0004)]
    assert min(delays) >= 2 * MS
    assert np.mean(delays) / MS == np.clip(np.mean(delays) / MS, 2.35, 2.55)


def test_order_is_kept():
    arrivals = [pieces[0][0] for _, pieces in carried(delay_s=0.0, jitter_s=0.01)]
    assert arrivals == sorted(arrivals)


def test_loss():
    lost = sum(not pieces for _, pieces in carried(loss=0.1))
    assert 150 < lost < 250


def test_damage_is_one_byte():
    damaged = [
        sum(a != b for a, b in zip(pieces[0][1], frame, strict=True))
        for (_, pieces), frame in zip(carried(corruption=0.2), FRAMES, strict=True)
    ]
    assert set(damaged) == {0, 1}
    assert 320 < sum(damaged) < 480


def test_byte_by_byte_is_the_same_bytes():
    pieces = [piece for _, several in carried(byte_by_byte=True) for piece in several]
    assert all(len(data) == 1 for _, data in pieces)
    assert [at for at, _ in pieces] == sorted(at for at, _ in pieces)
    assert b"".join(data for _, data in pieces) == b"".join(FRAMES)


def test_silence():
    quiet = [sent for sent, pieces in carried(silences=((0.5, 1.0),)) if not pieces]
    assert (min(quiet), max(quiet), len(quiet)) == (500 * MS, 999 * MS, 500)


def test_the_listener_survives_damage():
    listener = Listener()
    heard = [h for _, pieces in carried(corruption=0.1) for _, data in pieces for h in listener.feed(data)]
    assert 1700 < len(heard) < 1900
    assert listener.damaged > 0
    assert listener.feed(bytes(range(256)) * 4) == []

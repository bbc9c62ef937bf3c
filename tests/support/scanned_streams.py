"""Streams of good frames, and what the scanner finds in bytes that arrive in pieces."""

from __future__ import annotations

import random
from itertools import pairwise

from mavlink_wire import Wire

from fwav_companion.mavlink.wire.scanner import Scanner

LONGEST = 280
"""Bytes of the longest frame: header 10, payload 255, checksum 2, signature 13."""


def scanned(data: bytes, cuts: list[int] | None = None) -> list[bytes]:
    """The frames of a stream that is then quiet, divided at the given places."""
    scanner = Scanner()
    edges = [0, *sorted(cut % (len(data) + 1) for cut in cuts or []), len(data)]
    frames = [frame for start, end in pairwise(edges) for frame in scanner.feed(data[start:end])]
    return [frame.data for frame in frames + scanner.settle()]


def good_frames(count: int = 40) -> list[bytes]:
    one, two, old = Wire(1, 1), Wire(255, 190), Wire(3, 1, version=1)
    makers = (one.attitude, one.heartbeat, two.heartbeat, old.attitude, lambda: two.command(1, 1))
    return [makers[i % len(makers)]() for i in range(count)]


def is_subsequence(wanted: list[bytes], found: list[bytes]) -> bool:
    rest = iter(found)
    return all(any(frame == other for other in rest) for frame in wanted)


def corrupted(frame: bytes, rng: random.Random) -> bytes:
    at = rng.randrange(len(frame))
    kind = rng.choice(("altered", "lost", "added", "burst"))
    if kind == "lost":
        return frame[:at] + frame[at + 1 :]
    if kind == "added":
        return frame[:at] + bytes((rng.randrange(256),)) + frame[at:]
    width = 1 if kind == "altered" else 6
    noise = bytes(byte ^ rng.randrange(1, 256) for byte in frame[at : at + width])
    return frame[:at] + noise + frame[at + width :]

"""Good frames lost next to corrupted ones: 0 of 10 200 allowed, where pymavlink loses some.

``python -m tests.benchmarks.corruption``
"""

from __future__ import annotations

import io
import random

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.mavlink.wire.scanner import Scanner
from tests.benchmarks.figure import Figure
from tests.benchmarks.standard_stream import frames

GOOD = 10_200
EVERY = 20
CHUNK = 256


def _stream() -> tuple[bytes, list[bytes]]:
    """(stream, good frames): one byte of every twentieth frame is altered."""
    rng = random.Random(2)
    pieces, good = [], []
    for i, frame in enumerate(frames(GOOD * EVERY // (EVERY - 1) + EVERY)):
        if i % EVERY == EVERY // 2:
            at = rng.randrange(len(frame))
            pieces.append(frame[:at] + bytes((frame[at] ^ rng.randrange(1, 256),)) + frame[at + 1 :])
        elif len(good) < GOOD:
            pieces.append(frame)
            good.append(frame)
    return b"".join(pieces), good


def _lost(good: list[bytes], found: list[bytes]) -> int:
    """The number of good frames that were not found. Frames are compared by their bytes and counted, because many
    heartbeats are equal.
    """
    left: dict[bytes, int] = {}
    for frame in found:
        left[frame] = left.get(frame, 0) + 1
    lost = 0
    for frame in good:
        if left.get(frame, 0):
            left[frame] -= 1
        else:
            lost += 1
    return lost


def measure() -> list[Figure]:
    stream, good = _stream()
    chunks = [stream[i : i + CHUNK] for i in range(0, len(stream), CHUNK)]
    scanner = Scanner()
    ours = [frame.data for chunk in chunks for frame in scanner.feed(chunk)] + [raw.data for raw in scanner.settle()]
    parser = dialect.MAVLink(io.BytesIO())
    parser.robust_parsing = True
    theirs = [
        bytes(message.get_msgbuf())
        for chunk in chunks
        for message in parser.parse_buffer(chunk) or ()
        if message.get_type() != "BAD_DATA"
    ]
    detail = f"pymavlink loses {_lost(good, theirs)} of {len(good)}"
    return [Figure("good frames lost beside corrupted ones", _lost(good, ours), 0, False, detail)]


if __name__ == "__main__":
    for figure in measure():
        print(figure)

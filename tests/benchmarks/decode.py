"""Decoding the standard stream, every checksum checked and only wanted messages unpacked, against pymavlink.

``python -m tests.benchmarks.decode``
"""

from __future__ import annotations

import io

from pymavlink.dialects.v20 import ardupilotmega as dialect

from fwav_companion.mavlink.wire.codec import decode
from fwav_companion.mavlink.wire.definitions import definition_of
from fwav_companion.mavlink.wire.scanner import Scanner
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.standard_stream import WANTED, frames

FRAMES = 10_000
CHUNK = 256


def measure() -> list[Figure]:
    stream = b"".join(frames(FRAMES))
    chunks = [stream[i : i + CHUNK] for i in range(0, len(stream), CHUNK)]
    wanted = frozenset(definition_of(name).msgid for name in WANTED)

    def ours() -> int:
        scanner = Scanner()
        count = 0
        for chunk in chunks:
            found = scanner.feed(chunk)
            count += len(found)
            for frame in found:
                if frame.flow.msgid in wanted:
                    decode(frame, "autopilot")
        return count

    def theirs() -> int:
        parser = dialect.MAVLink(io.BytesIO())
        parser.robust_parsing = True
        return sum(len(parser.parse_buffer(chunk) or ()) for chunk in chunks)

    if not ours() == theirs() == FRAMES:
        raise AssertionError("not every frame was found")
    ours_s, theirs_s = interleaved(ours, theirs)
    detail = f"ours {ours_s / FRAMES * 1e6:.2f} us, pymavlink {theirs_s / FRAMES * 1e6:.2f} us a frame"
    return [Figure("decode the standard stream, against pymavlink", theirs_s / ours_s, 6.0, True, detail)]


if __name__ == "__main__":
    for figure in measure():
        print(figure)

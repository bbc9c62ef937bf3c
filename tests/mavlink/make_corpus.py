"""Writes tests/mavlink/corpus: streams that hide frames, each with the frames that must be found in it.

``PYTHONPATH=tests/support python -m tests.mavlink.make_corpus``. ``NAME.bin`` is the stream; ``NAME.frames`` holds
the good frames in order, one in hex a line. The files are kept even when this changes: what once was hard stays a test.
"""

from __future__ import annotations

import random
from pathlib import Path

from mavlink_wire import Wire, unknown_frame

FOLDER = Path(__file__).parent / "corpus"


def spoilt(frame: bytes, index: int, value: int) -> bytes:
    return frame[:index] + bytes((value,)) + frame[index + 1 :]


def streams() -> dict[str, list[tuple[bytes, bool]]]:
    """Pieces of each stream by its name, each with whether it is a frame that must be found."""
    rng = random.Random(20260101)
    a, b, one = Wire(1, 1), Wire(255, 190), Wire(2, 1, version=1)
    good = [a.attitude(i) for i in range(4)] + [b.command(1, 1), one.attitude(9), a.heartbeat()]
    noise = bytes(rng.choices(range(256), k=300))
    tunnel = a.frame("TUNNEL", 1, 1, 0, 60, (b.command(1, 1, 400) + bytes(128))[:128])
    starts = bytes(rng.choices(b"\xfd\xfe", k=120))
    return {
        "plain": [(frame, True) for frame in good],
        "noise_between": [piece for frame in good for piece in ((noise[: rng.randrange(60)], False), (frame, True))],
        "length_spoilt": [
            (good[0], True),
            (spoilt(good[1], 1, 255), False),
            *[(frame, True) for frame in good[2:]] * 3,
        ],
        "length_shorter": [(good[0], True), (spoilt(good[1], 1, 3), False), *[(frame, True) for frame in good[2:]]],
        "id_spoilt_in_noise": [
            (noise[:40], False),
            (spoilt(good[0], 9, 0x77)[2:], False),
            (good[1], True),
            (good[2], True),
        ],
        "byte_lost": [(good[0], True), (good[1][:7] + good[1][8:], False), *[(frame, True) for frame in good[2:]]],
        "start_bytes_only": [(starts, False), *[(frame, True) for frame in good] * 8],
        "unknown_flags": [(good[0], True), (spoilt(good[1], 2, 0x80), False), (good[2], True)],
        "frame_in_a_frame": [(good[0], True), (tunnel, True), (good[1], True)],
        "unknown_between": [
            (good[0], True),
            (unknown_frame(), True),
            (good[1], True),
            (unknown_frame(seq=7), True),
            (good[2], True),
        ],
        "unknown_swallows": [
            (noise[:9], False),
            (b"\xfd\xf0\0\0\0\1\1\xaa\xbb\xcc", False),
            *[(frame, True) for frame in good] * 3,
        ],
        "empty_payload": [(good[0], True), (b"\xfd\0\0\0\0\1\1\0\0\0\0\0", False), (good[1], True)],
    }


def main() -> None:
    FOLDER.mkdir(exist_ok=True)
    for name, pieces in streams().items():
        (FOLDER / f"{name}.bin").write_bytes(b"".join(piece for piece, _ in pieces))
        frames = [piece.hex() for piece, is_frame in pieces if is_frame]
        (FOLDER / f"{name}.frames").write_text("".join(f"{frame}\n" for frame in frames))


if __name__ == "__main__":
    main()

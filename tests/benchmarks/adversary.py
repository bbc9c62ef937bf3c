"""Cost of the scanner for any bytes, against a genuine stream of as many bytes.

``python -m tests.benchmarks.adversary``

The bytes are those that cost most: start bytes everywhere, headers that ask for long checksums and overlap, frames of
unknown ids around one another, and valid frames as short as possible, from known senders and from ever new ones.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from functools import cache

from fwav_companion.mavlink.wire.definitions import BY_NAME, DEFINITIONS
from fwav_companion.mavlink.wire.frames import checksum
from fwav_companion.mavlink.wire.scanner import Scanner
from tests.benchmarks.figure import Figure, interleaved
from tests.benchmarks.standard_stream import frames

WORST_NAMED = 3
SIZE = 1 << 18
CHUNK = 1024
LONG = BY_NAME["FILE_TRANSFER_PROTOCOL"]
HEARTBEAT = BY_NAME["HEARTBEAT"]


def _filled(piece: bytes) -> bytes:
    return (piece * (SIZE // len(piece) + 1))[:SIZE]


def _joined(pieces: Iterator[bytes]) -> bytes:
    data = bytearray()
    while len(data) < SIZE:
        data += next(pieces)
    return bytes(data[:SIZE])


def _v2(payload: bytes, msgid: int, system: int, component: int, seq: int) -> bytes:
    body = bytes((len(payload), 0, 0, seq, system, component)) + msgid.to_bytes(3, "little") + payload
    return b"\xfd" + body + checksum(body + DEFINITIONS[msgid].crc_byte).to_bytes(2, "little")


def _v1(payload: bytes, msgid: int, system: int, component: int, seq: int) -> bytes:
    body = bytes((len(payload), seq, system, component, msgid)) + payload
    return b"\xfe" + body + checksum(body + DEFINITIONS[msgid].crc_byte).to_bytes(2, "little")


def _short_frames(make: Callable[..., bytes], payload: bytes) -> Iterator[bytes]:
    seq = 0
    while True:
        yield make(payload, HEARTBEAT.msgid, 1, 1, seq)
        seq = (seq + 1) & 0xFF


def _new_senders(make: Callable[..., bytes], payload: bytes) -> Iterator[bytes]:
    number = 0
    while True:
        yield make(payload, HEARTBEAT.msgid, 1 + number % 255, number // 255 % 256, number & 0xFF)
        number += 1


def _altered(every: int) -> Iterator[bytes]:
    rng = random.Random(3)
    for i, frame in enumerate(frames(SIZE // 12)):
        at = rng.randrange(len(frame))
        yield frame if i % every else frame[:at] + bytes((frame[at] ^ rng.randrange(1, 256),)) + frame[at + 1 :]


def _alternating(genuine: bytes, hostile: bytes) -> Iterator[bytes]:
    """A genuine frame, and as many hostile bytes as the chunk holds: the link yields a frame in every chunk."""
    while True:
        yield genuine + hostile[: CHUNK - len(genuine)]


@cache
def patterns() -> dict[str, bytes]:
    """Adversarial streams by name."""
    rng = random.Random(1)
    lengths = [n for n, known in DEFINITIONS.items() if n == known.base_length and n < 0xFD]
    header = b"\xfd\xff\0\0\0\1\1" + LONG.id_bytes
    signed = b"\xfd\xff\1\0\0\1\1" + LONG.id_bytes
    unknown = b"\xfd\xff\0\0\0\1\1\xef\xcd\xab"
    heartbeat = _v2(bytes(9), 0, 1, 1, 0)
    known = b"\xfd\xff\0\0\0\1\1\0\0\0"
    overlapping = {f"MAVLink 1 headers inside one another, length {n}": _filled(bytes((0xFE, n))) for n in lengths[:3]}
    return {
        "0xFE": _filled(b"\xfe"),
        "0xFD": _filled(b"\xfd"),
        "0xFD 0xFE": _filled(b"\xfd\xfe"),
        "0xFD 0x00": _filled(b"\xfd\0"),
        "0xFD 0x01 0x00": _filled(b"\xfd\1\0"),
        **overlapping,
        "long headers every 10 bytes": _filled(header),
        "signed long headers every 10 bytes": _filled(signed),
        "unknown long headers every 10 bytes": _filled(unknown),
        "unknown headers, then start bytes": _filled(unknown + b"\xfe" * 255),
        "random bytes": rng.randbytes(SIZE),
        "random start bytes": bytes(rng.choices(b"\xfd\xfe\0\1\x09", k=SIZE)),
        "long frames with a wrong checksum": _filled(header + bytes(255) + b"\1\2"),
        "short frames with a wrong checksum": _filled(b"\xfd\1\0\0\0\1\1\0\0\0\1\1\1"),
        "each standard frame altered": _joined(_altered(1)),
        "a heartbeat, then 0xFE": _joined(_alternating(heartbeat, b"\xfe" * CHUNK)),
        "a heartbeat, then long headers": _joined(_alternating(heartbeat, header * 100)),
        "a heartbeat, then long headers of its flow": _joined(_alternating(heartbeat, known * 100)),
        "a heartbeat, then beginnings of headers": _joined(_alternating(heartbeat, b"\xfd\xfd\0\0" * 256)),
        "shortest valid frames": _joined(_short_frames(_v2, b"\1")),
        "shortest valid MAVLink 1 frames": _joined(_short_frames(_v1, bytes(9))),
        "shortest valid frames of new senders": _joined(_new_senders(_v2, b"\1")),
        "valid MAVLink 1 frames of new senders": _joined(_new_senders(_v1, bytes(9))),
    }


def scan(data: bytes, *, datagrams: bool = False) -> Scanner:
    """The scanner after a stream in chunks."""
    scanner = Scanner(datagrams=datagrams)
    for at in range(0, len(data), CHUNK):
        scanner.feed(data[at : at + CHUNK])
    return scanner


def ratios() -> dict[str, float]:
    """CPU time of each pattern against the genuine stream."""
    genuine = _joined(iter(frames(SIZE // 12)))
    found = {}
    for name, data in patterns().items():
        for kind, datagrams in (("", False), (" as datagrams", True)):
            genuine_s, hostile_s = interleaved(
                lambda datagrams=datagrams: scan(genuine, datagrams=datagrams),
                lambda data=data, datagrams=datagrams: scan(data, datagrams=datagrams),
                rounds=3,
            )
            found[name + kind] = hostile_s / genuine_s
    return found


def measure() -> list[Figure]:
    table = sorted(ratios().items(), key=lambda item: -item[1])
    named = "; ".join(f"{name} {ratio:.1f}" for name, ratio in table[:WORST_NAMED])
    detail = f"{named}; {len(table) - WORST_NAMED} others are cheaper"
    return [Figure("any bytes through the scanner, against genuine ones", table[0][1], 4.0, False, detail)]


if __name__ == "__main__":
    for pattern, cost in sorted(ratios().items(), key=lambda item: -item[1]):
        print(f"{cost:4.1f} {pattern}")

"""Joins frames that go to one link at one time, because a send costs more than the whole relaying of a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

JOINED_BYTES: Final = 1200
"""Largest size of a send, bytes: below what IPv6 carries unfragmented everywhere (1280)."""


def coalesced(sends: Sequence[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
    """Return for each link its frames in order, joined to pieces of whole frames that fit a datagram."""
    by_link: dict[str, list[bytes]] = {}
    for name, data in sends:
        if name in by_link:
            by_link[name].append(data)
        else:
            by_link[name] = [data]
    return [(name, piece) for name, datas in by_link.items() for piece in _cut(datas)]


def _cut(frames: Sequence[bytes]) -> Iterator[bytes]:
    coalesced = b"".join(frames)
    if len(coalesced) <= JOINED_BYTES:
        yield coalesced
        return
    start = size = 0
    for i, frame in enumerate(frames):
        if size + len(frame) > JOINED_BYTES:
            yield b"".join(frames[start:i])
            start, size = i, 0
        size += len(frame)
    yield b"".join(frames[start:])

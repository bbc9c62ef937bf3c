"""What goes to one link at one time goes together: a send costs more than all the rest of relaying a frame."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

JOINED_BYTES: Final = 1200
"""Of frames in one send: below what IPv6 carries in one piece everywhere (1280), so that no datagram is cut in two."""


def coalesced(sends: Sequence[tuple[str, bytes]]) -> list[tuple[str, bytes]]:
    """For each link its frames one after another, in pieces of whole frames that are not too long for a datagram."""
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

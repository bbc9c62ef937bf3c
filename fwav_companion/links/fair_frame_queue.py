"""PURE: frames that wait for a line slower than what is sent to it: which leave first, and which are dropped."""

from __future__ import annotations

from collections import deque
from typing import TypeAlias

Origin: TypeAlias = tuple[str, str]
"""(link, host) from which forwarded frames came; the host is "" where the link has only one peer."""

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
V1_AROUND, V2_AROUND = 8, 12
"""Bytes of a frame without its payload: header and checksum."""
SIGNATURE_BYTES = 13
SIGNED_FLAG = 0x01
"""Bit of a v2 frame's third byte."""
PIECE_BYTES = 280
"""Bytes that leave in one go: the longest frame. A read of a flood is 32 kB, six seconds of a line at 57600 baud."""
MOST_HOSTS = 16
"""Hosts of one link with a queue of their own: more than a vehicle has stations. Beyond it, newcomers of the link share
one: strangers with any number of addresses take no turn of another link, such as the autopilot's."""
_OTHERS = "others"
HELD: Origin = ("", "held")
"""Origin of frames that the router held back."""


class FairFrameQueue:
    """Queues of whole frames: the service's own, and one for each origin of forwarded ones.

    The service's own leave first and are dropped last: whoever sends more to another link than this line takes must not
    keep LANDING_TARGET, heartbeats and the clock's requests from the autopilot. Origins take turns, and the one with
    most bytes loses its oldest ones, as the newest telemetry is the most useful: a flood costs no other station frames.
    """

    def __init__(self) -> None:
        self.bytes = 0
        """Bytes of all frames that wait."""
        self._own: deque[bytes] = deque()
        self._forwarded: dict[Origin, deque[bytes]] = {}
        """Queues that are not empty, in the order of their turns."""
        self._bytes_of: dict[Origin, int] = {}

    def put(self, data: bytes, origin: Origin | None) -> None:
        """Add whole frames. ``origin``: None for the service's own."""
        self.bytes += len(data)
        if origin is None:
            self._own.append(data)
            return
        if origin not in self._forwarded and sum(link == origin[0] for link, _ in self._forwarded) >= MOST_HOSTS:
            origin = (origin[0], _OTHERS)
        queue = self._forwarded.setdefault(origin, deque())
        if len(data) <= PIECE_BYTES:
            queue.append(data)
        else:
            queue.extend(pieces(data))
        self._bytes_of[origin] = self._bytes_of.get(origin, 0) + len(data)

    def take(self) -> bytes:
        """Remove and return the frames that leave next; b"" if none wait."""
        if self._own:
            data = self._own.popleft()
            self.bytes -= len(data)
            return data
        if not self._forwarded:
            return b""
        origin = next(iter(self._forwarded))
        data = self._remove(origin)
        if origin in self._forwarded:
            self._forwarded[origin] = self._forwarded.pop(origin)
        return data

    def drop(self) -> None:
        """Remove the frames whose loss costs least."""
        if self._forwarded:
            self._remove(max(self._bytes_of, key=self._bytes_of.__getitem__))
        elif self._own:
            self.bytes -= len(self._own.popleft())

    def clear(self) -> None:
        """Remove all."""
        self._own.clear()
        self._forwarded.clear()
        self._bytes_of.clear()
        self.bytes = 0

    def _remove(self, origin: Origin) -> bytes:
        queue = self._forwarded[origin]
        data = queue.popleft()
        self.bytes -= len(data)
        self._bytes_of[origin] -= len(data)
        if not queue:
            del self._forwarded[origin], self._bytes_of[origin]
        return data


def pieces(data: bytes) -> list[bytes]:
    """Divide whole frames into pieces of whole frames, PIECE_BYTES long at most. Bytes that are no frame may be cut."""
    divided: list[bytes] = []
    begin = at = 0
    while at < len(data):
        end = min(at + length_at(data, at), len(data))
        if end - begin > PIECE_BYTES and at > begin:
            divided.append(data[begin:at])
            begin = at
        at = end
    divided.append(data[begin:])
    return divided


def length_at(data: bytes, at: int) -> int:
    """Length of the frame that begins here; 1 if no frame does; more than the rest of the data if its header is cut."""
    magic = data[at]
    if magic not in (V1_MAGIC, V2_MAGIC):
        return 1
    if len(data) - at < 3:
        return 3
    payload = data[at + 1]
    if magic == V1_MAGIC:
        return payload + V1_AROUND
    return payload + V2_AROUND + (SIGNATURE_BYTES if data[at + 2] & SIGNED_FLAG else 0)

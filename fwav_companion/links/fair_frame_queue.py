"""PURE: frames that wait for a line slower than what is sent to it: which leave first, and which are dropped."""

from __future__ import annotations

from collections import deque

from fwav_companion.fair_queues import FrameQueues, Origin

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
V1_AROUND, V2_AROUND = 8, 12
"""Bytes of a frame without its payload: header and checksum."""
SIGNATURE_BYTES = 13
SIGNED_FLAG = 0x01
"""Bit of a v2 frame's third byte."""
PIECE_BYTES = 280
"""Bytes that leave in one go: the longest frame. A read of a flood is 32 kB, six seconds of a line at 57600 baud."""
HELD: Origin = ("", "held")
"""Origin of frames that the router held back."""


class FairFrameQueue:
    """Queues of whole frames: the service's own, and one for each origin of forwarded ones.

    The service's own leave first and are dropped last: whoever sends more to another link than this line takes must not
    keep LANDING_TARGET, heartbeats and the clock's requests from the autopilot. Origins take turns, and the one with
    most bytes loses its oldest ones, as the newest telemetry is the most useful: a flood costs no other station frames.
    """

    def __init__(self) -> None:
        self._own: deque[bytes] = deque()
        self._own_bytes = 0
        self._forwarded = FrameQueues()

    @property
    def total_bytes(self) -> int:
        """Bytes of all frames that wait."""
        return self._own_bytes + self._forwarded.total_bytes

    def put(self, data: bytes, origin: Origin | None) -> None:
        """Add whole frames. ``origin``: None for the service's own."""
        if origin is None:
            self._own.append(data)
            self._own_bytes += len(data)
            return
        for piece in pieces(data) if len(data) > PIECE_BYTES else (data,):
            self._forwarded.put(origin, piece)

    def take(self) -> bytes:
        """Remove and return the frames that leave next; b"" if none wait."""
        return self._take_own() if self._own else self._forwarded.take() or b""

    def drop(self) -> None:
        """Remove the frames whose loss costs least."""
        if self._forwarded:
            self._forwarded.drop()
        elif self._own:
            self._take_own()

    def clear(self) -> None:
        """Remove all."""
        self._own.clear()
        self._own_bytes = 0
        self._forwarded.clear()

    def _take_own(self) -> bytes:
        data = self._own.popleft()
        self._own_bytes -= len(data)
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

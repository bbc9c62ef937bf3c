"""Byte streams of whole MAVLink frames: cut at frame ends on reception, bounded and never cut on sending."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

from fwav_companion.links.base import LinkReceiver

V1_MAGIC, V2_MAGIC = 0xFE, 0xFD
V1_AROUND, V2_AROUND = 8, 12
"""Bytes of a frame without its payload: header and checksum."""
SIGNATURE_BYTES = 13
SIGNED_FLAG = 0x01
"""Bit of a v2 frame's third byte."""


class FrameCutter:
    """Passes whole frames of one client and keeps the incomplete one, at most 280 bytes.

    So the bytes of two clients of one link never mix inside a frame. Frame ends follow from the headers alone. The
    checksum is not checked: bytes that are not a frame pass unchanged and in order, and none is lost or added.
    """

    __slots__ = ("_begun",)

    def __init__(self) -> None:
        self._begun = b""

    def cut(self, data: bytes) -> bytes:
        """All bytes up to the end of the last whole frame; b"" while no frame ends."""
        if self._begun:
            data = self._begun + data
        at, end = 0, len(data)
        while at < end:
            step = _length_at(data, at)
            if at + step > end:
                break
            at += step
        self._begun = data[at:]
        return data[:at] if self._begun else data


def _length_at(data: bytes, at: int) -> int:
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


class BoundedWriter:
    """Writes the bytes that the system accepts, queues the rest, and drops the oldest unbegun chunk of a full queue.

    The newest telemetry is the most useful. A chunk is always completed once its first bytes have left. The service's
    own chunks leave before forwarded ones and are dropped last: whoever sends more to another link than this line takes
    must not keep LANDING_TARGET, heartbeats and the clock's requests from the autopilot.
    """

    def __init__(self, fd: int, write: Callable[[bytes], int], capacity: int, receiver: LinkReceiver) -> None:
        """``write`` is the non-blocking system call on ``fd``; ``capacity`` the bytes that may wait unbegun."""
        self._fd = fd
        self._write = write
        self._capacity = capacity
        self._receiver = receiver
        self._loop = asyncio.get_running_loop()
        self._begun = b""
        """Rest of the chunk whose first bytes have left."""
        self._own: deque[bytes] = deque()
        self._forwarded: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._watching = False
        """Whether the loop reports when the system has room: exactly while bytes are left to write."""

    def send(self, data: bytes, *, own: bool = False) -> None:
        """Write whole frames, now or when there is room. ``own``: before forwarded ones."""
        (self._own if own else self._forwarded).append(data)
        self._waiting_bytes += len(data)
        if not self._watching:
            self._write_on()
        while self._waiting_bytes > self._capacity:
            self._waiting_bytes -= len((self._forwarded or self._own).popleft())
            self._receiver.traffic.dropped += 1

    def close(self) -> None:
        """Discard the waiting bytes."""
        self._begun = b""
        self._own.clear()
        self._forwarded.clear()
        self._watch()

    def _write_on(self) -> None:
        """Write until nothing is left or the system accepts no more."""
        try:
            while self._begun or self._own or self._forwarded:
                if not self._begun:
                    self._begun = (self._own or self._forwarded).popleft()
                    self._waiting_bytes -= len(self._begun)
                written = self._write(self._begun)
                self._receiver.traffic.bytes_out += written
                self._begun = self._begun[written:]
        except BlockingIOError:
            pass
        except OSError as error:
            self.close()
            self._receiver.on_lost(error.strerror or str(error))
        self._watch()

    def _watch(self) -> None:
        """Register with the loop while something is left to write, and unregister afterwards."""
        wanted = bool(self._begun or self._own or self._forwarded)
        if wanted and not self._watching:
            self._loop.add_writer(self._fd, self._write_on)
        elif self._watching and not wanted:
            self._loop.remove_writer(self._fd)
        self._watching = wanted

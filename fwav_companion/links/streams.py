"""Byte streams of whole MAVLink frames: cut at frame ends on reception, bounded and never cut on sending."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import LinkReceiver
from fwav_companion.links.fair_frame_queue import PIECE_BYTES, FairFrameQueue, length_at


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
            step = length_at(data, at)
            if at + step > end:
                break
            at += step
        self._begun = data[at:]
        return data[:at] if self._begun else data


class BoundedWriter:
    """Writes the bytes that the system accepts, queues the rest, and drops from a full queue.

    Frames are always completed once their first bytes have left. Which leave and are dropped first: see
    :class:`FairFrameQueue`.
    """

    def __init__(self, fd: int, write: Callable[[bytes], int], capacity: int, receiver: LinkReceiver) -> None:
        """``write`` is the non-blocking system call on ``fd``; ``capacity`` the bytes that may wait unbegun."""
        self._fd = fd
        self._write = write
        self._capacity = capacity
        self._receiver = receiver
        self._loop = asyncio.get_running_loop()
        self._begun = b""
        """Rest of the frames whose first bytes have left."""
        self._waiting = FairFrameQueue()
        self._watching = False
        """Whether the loop reports when the system has room: exactly while bytes are left to write."""

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Write whole frames, now or when there is room. ``origin``: None for the service's own."""
        left = data if self._watching else self._write_now(data, divides=origin is not None)
        if left:
            self._waiting.put(left, origin)
        while self._waiting.total_bytes > self._capacity:
            self._waiting.drop()
            self._receiver.traffic.dropped += 1
        self._watch()

    def close(self) -> None:
        """Discard the waiting bytes."""
        self._begun = b""
        self._waiting.clear()
        self._watch()

    def _write_now(self, data: bytes, *, divides: bool) -> bytes:
        """Write to a line that nothing waits for. Returns frames that it did not begin, if ``divides``."""
        written = self._written(data)
        if not written or written == len(data):
            return data[written:]
        end = 0 if divides and len(data) > PIECE_BYTES else len(data)
        while end < written:
            end += length_at(data, end)
        self._begun = data[written:end]
        return data[end:]

    def _write_on(self) -> None:
        """Write until nothing is left or the system accepts no more."""
        while self._begun or self._waiting.total_bytes:
            if not self._begun:
                self._begun = self._waiting.take()
            written = self._written(self._begun)
            if not written:
                break
            self._begun = self._begun[written:]
        self._watch()

    def _written(self, data: bytes) -> int:
        """Return the number of bytes that the system accepts; of a lost line it takes all."""
        try:
            written = self._write(data)
        except BlockingIOError:
            return 0
        except OSError as error:
            self._waiting.clear()
            self._receiver.on_lost(error.strerror or str(error))
            return len(data)
        self._receiver.traffic.bytes_out += written
        return written

    def _watch(self) -> None:
        """Register with the loop while something is left to write, and unregister afterwards."""
        wanted = bool(self._begun or self._waiting.total_bytes)
        if wanted and not self._watching:
            self._loop.add_writer(self._fd, self._write_on)
        elif self._watching and not wanted:
            self._loop.remove_writer(self._fd)
        self._watching = wanted

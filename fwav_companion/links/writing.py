"""Writing to a stream that may not take it all at once: bounded, never blocking, never cutting a frame."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable

from fwav_companion.links.base import Ear


class BoundedWriter:
    """Writes at once what the system takes, queues the rest, and drops the oldest that was not begun when it is full.

    The newest telemetry is worth most. A chunk of which bytes have left is finished, whatever waits behind it.
    """

    def __init__(self, fd: int, write: Callable[[bytes], int], capacity: int, ear: Ear) -> None:
        """``write`` is the non-blocking system call on ``fd``; ``capacity`` the bytes that may wait unbegun."""
        self._fd = fd
        self._write = write
        self._capacity = capacity
        self._ear = ear
        self._loop = asyncio.get_running_loop()
        self._begun = b""
        """The rest of a chunk whose first bytes have left."""
        self._waiting: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._watching = False
        """Whether the loop tells us when the system has room: so long as anything is left to write."""

    def send(self, data: bytes) -> None:
        """Write ``data``, whole frames, now or when there is room."""
        self._waiting.append(data)
        self._waiting_bytes += len(data)
        if not self._watching:
            self._write_on()
        while self._waiting_bytes > self._capacity:
            self._waiting_bytes -= len(self._waiting.popleft())
            self._ear.traffic.dropped += 1

    def close(self) -> None:
        """Forget what waits."""
        self._begun = b""
        self._waiting.clear()
        self._watch()

    def _write_on(self) -> None:
        """Write until nothing is left or the system takes no more."""
        try:
            while self._begun or self._waiting:
                if not self._begun:
                    self._begun = self._waiting.popleft()
                    self._waiting_bytes -= len(self._begun)
                written = self._write(self._begun)
                self._ear.traffic.bytes_out += written
                self._begun = self._begun[written:]
        except BlockingIOError:
            pass
        except OSError as error:
            self.close()
            self._ear.lost(error.strerror or str(error))
        self._watch()

    def _watch(self) -> None:
        """Have the loop tell when there is room, exactly while something is left to write."""
        wanted = bool(self._begun or self._waiting)
        if wanted and not self._watching:
            self._loop.add_writer(self._fd, self._write_on)
        elif self._watching and not wanted:
            self._loop.remove_writer(self._fd)
        self._watching = wanted

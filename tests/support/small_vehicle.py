"""An autopilot of a few messages in a thread, over a pseudo-terminal or a datagram socket, that faults happen to."""

from __future__ import annotations

import os
import pty
import select
import socket
import threading
import time
import tty
from contextlib import suppress
from pathlib import Path

from mavlink_wire import Wire, parse


class Line:
    """One end of a pseudo-terminal, behind a path that stays when it is replaced by another: a USB adapter."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self.plug()

    def plug(self) -> None:
        """Appear under the path, as another device."""
        self._fd, self._other = pty.openpty()
        tty.setraw(self._fd)
        os.set_blocking(self._fd, False)
        self._path.unlink(missing_ok=True)
        self._path.symlink_to(os.ttyname(self._other))
        os.close(self._other)

    def unplug(self) -> None:
        """Disappear."""
        self._path.unlink()
        os.close(self._fd)

    def write(self, data: bytes) -> None:
        with suppress(OSError):  # nothing is plugged in, or the daemon does not read
            os.write(self._fd, data)

    def read(self) -> bytes:
        with suppress(OSError):
            if select.select([self._fd], [], [], 0.0)[0]:
                return os.read(self._fd, 65536)
        return b""

    def close(self) -> None:
        with suppress(OSError):
            os.close(self._fd)


class Datagrams:
    """A socket that sends to the daemon."""

    def __init__(self, port: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.setblocking(False)

    def write(self, data: bytes) -> None:
        with suppress(OSError):
            self._socket.send(data)

    def read(self) -> bytes:
        with suppress(OSError):
            return self._socket.recv(65536)
        return b""

    def close(self) -> None:
        self._socket.close()


class SmallVehicle:
    """Heartbeats, attitudes at 25 Hz, positions at 5 Hz, the time, and answers to TIMESYNC while the block runs."""

    def __init__(self, line: Line | Datagrams, system: int = 1) -> None:
        self._line = line
        self._wire = Wire(system, 1)
        self._stop_it = threading.Event()
        self._thread = threading.Thread(target=self._run)
        self.boot_s = time.monotonic() - 100.0
        """Its boot, by this machine's clock."""
        self.quiet = threading.Event()
        """Whether it says nothing."""

    def __enter__(self) -> SmallVehicle:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop_it.set()
        self._thread.join()
        self._line.close()

    def reboot(self) -> None:
        """Begin again: the clock since boot at zero, the sequence too."""
        self.boot_s = time.monotonic()
        self._wire.mav.seq = 0

    def _run(self) -> None:
        beat, due_s = 0, time.monotonic()
        while not self._stop_it.wait(max(0.0, due_s - time.monotonic())):
            due_s += 0.04
            heard = parse(self._line.read())
            if self.quiet.is_set():
                continue
            for message in heard:
                if message.get_type() == "TIMESYNC" and message.tc1 == 0:
                    self._line.write(self._wire.frame("TIMESYNC", self._boot_ns(), message.ts1))
            self._line.write(b"".join(self._due(beat)))
            beat += 1

    def _due(self, beat: int) -> list[bytes]:
        boot_ms = self._boot_ns() // 1_000_000
        frames = [self._wire.frame("ATTITUDE_QUATERNION", boot_ms, 1.0, *(0.0,) * 6)]
        if beat % 5 == 0:
            place = (481_372_000, 115_756_000, 530_000, 12_000)
            frames.append(self._wire.frame("GLOBAL_POSITION_INT", boot_ms, *place, 0, 0, 0, 0))
        if beat % 25 == 0:
            frames.append(self._wire.heartbeat())
            frames.append(self._wire.frame("SYSTEM_TIME", time.time_ns() // 1000, boot_ms))
        return frames

    def _boot_ns(self) -> int:
        return round((time.monotonic() - self.boot_s) * 1e9)

"""Forwards messages between the mock and the daemon, and records those to the autopilot."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import threading
import time
from typing import Any

from processes import free_port
from pymavlink.dialects.v20 import ardupilotmega as dialect

SO_TIMESTAMPNS = 35
"""Linux's socket option (asm-generic/socket.h): the kernel's time of reception, CLOCK_REALTIME, with each datagram."""
TIMESPEC = struct.Struct("qq")


class Tap:
    """Active while the block runs; the mock must connect to :attr:`port`."""

    def __init__(self, service_port: int) -> None:
        self.port = free_port()
        self.seen: list[tuple[float, Any]] = []
        """(time, message) of everything sent to the autopilot, by the kernel: this thread's work is not in it."""
        self._vehicle = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._vehicle.bind(("127.0.0.1", self.port))
        self._service = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._service.connect(("127.0.0.1", service_port))
        self._service.setblocking(False)
        self._service.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._peer: tuple[str, int] | None = None
        self._parser = dialect.MAVLink(None)
        self._parser.robust_parsing = True
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self) -> Tap:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
        self._vehicle.close()
        self._service.close()

    def names(self) -> set[str]:
        """Names of all messages so far."""
        return {message.get_type() for _, message in list(self.seen)}

    def rates(self, component: int, names: tuple[str, ...], seconds: float) -> dict[str, float]:
        """Rates at which the component sends these messages from now on, Hz."""
        start = time.monotonic()
        time.sleep(seconds)
        heard = [message for at, message in list(self.seen) if at >= start]
        reported = [message.get_type() for message in heard if message.get_srcComponent() == component]
        return {name: reported.count(name) / seconds for name in names}

    def _run(self) -> None:
        while not self._stop.is_set():
            for ready in select.select([self._vehicle, self._service], [], [], 0.1)[0]:
                # The daemon may not run yet or no longer, and a socket reported as readable may have nothing to read.
                with contextlib.suppress(ConnectionRefusedError, BlockingIOError):
                    (self._upward if ready is self._vehicle else self._downward)()

    def _upward(self) -> None:
        data, self._peer = self._vehicle.recvfrom(65536)
        self._service.send(data)

    def _downward(self) -> None:
        data, ((_, _, stamp), *_), _, _ = self._service.recvmsg(65536, socket.CMSG_SPACE(TIMESPEC.size))
        whole_s, ns = TIMESPEC.unpack(stamp)
        at_s = whole_s + ns / 1e9 - (time.time() - time.monotonic())
        self.seen += [(at_s, message) for message in self._parser.parse_buffer(data) or []]
        if self._peer is not None:
            self._vehicle.sendto(data, self._peer)

"""SHELL: detections of another process, as UDP or Unix datagrams. One datagram, one frame."""

from __future__ import annotations

import asyncio
import os
import socket
import stat
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import TypeAlias

from fwav_companion.blocking import in_daemon_thread
from fwav_companion.geometry.stamps import HostNs, whole_microseconds
from fwav_companion.nouns import Frame, NoFrame, Reason
from fwav_companion.vision.wall_clock import ClockStep, WallClock
from fwav_companion.vision.wire import parse_frame

LARGEST_DATAGRAM = 65536
"""Over 200 bytes for each of 256 detections; also the largest that UDP carries."""
DRAIN_LIMIT = 64
"""Datagrams of one wake: two seconds of any camera."""
RETRY_S = 1.0
"""An address or a folder that is not there at boot is tried this often."""
CLOCKS_APART_NS = 200_000
"""A reading of both clocks that took longer was interrupted, and is taken again."""

Endpoint: TypeAlias = tuple[str, int] | str
"""(host, port) for UDP, or the absolute path of a Unix socket."""


def read_clocks() -> tuple[HostNs, int]:
    """The host's clock and the wall clock at one instant, nanoseconds."""
    for _ in range(5):
        before = time.monotonic_ns()
        unix_ns = time.time_ns()
        after = time.monotonic_ns()
        if after - before < CLOCKS_APART_NS:
            break
    return whole_microseconds((before + after) // 2), unix_ns


class DetectionsIn:
    """Listens for frames, and goes on listening: an address that is not there yet, a socket file that was deleted."""

    def __init__(
        self,
        endpoint: Endpoint,
        wall_clock: WallClock,
        *,
        on_frame: Callable[[Frame | NoFrame], None],
        on_state: Callable[[bool, str], None],
        on_step: Callable[[ClockStep], None],
        clocks: Callable[[], tuple[HostNs, int]] = read_clocks,
    ) -> None:
        """``on_state`` tells whether it listens, and why not; ``on_step`` that the wall clock was set."""
        self._endpoint = endpoint
        self._wall_clock = wall_clock
        self._on_frame = on_frame
        self._on_state = on_state
        self._on_step = on_step
        self._clocks = clocks
        self._buffer = bytearray(LARGEST_DATAGRAM)
        self._socket: socket.socket | None = None
        self._inode = 0
        self._listens: bool | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def address(self) -> object:
        """Where it listens now; None while it does not."""
        return self._socket.getsockname() if self._socket is not None else None

    def start(self) -> None:
        """Begin; from a running loop, once."""
        self._task = asyncio.get_running_loop().create_task(self._stay_open(), name="detections")

    def close(self) -> None:
        """End it at once; no callback follows."""
        if self._task is not None:
            self._task.cancel()
        self._release()

    async def _stay_open(self) -> None:
        while True:
            if self._socket is None or self._file_is_gone():
                await self._open()
            await asyncio.sleep(RETRY_S)

    async def _open(self) -> None:
        self._release()
        try:
            self._socket = await self._bound()
        except OSError as error:
            self._tell(listens=False, why=os.strerror(error.errno) if error.errno and error.errno > 0 else str(error))
            return
        asyncio.get_running_loop().add_reader(self._socket, self._drain, self._socket)
        self._tell(listens=True, why="")

    async def _bound(self) -> socket.socket:
        if isinstance(self._endpoint, str):
            sock, self._inode = _bound_to_path(self._endpoint)
            return sock
        host, port = self._endpoint
        family, address = await in_daemon_thread(partial(_look_up, host, port), name=f"look up {host}")
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.bind(address)
        except OSError:
            sock.close()
            raise
        return sock

    def _drain(self, sock: socket.socket) -> None:
        arrival_ns, unix_ns = self._clocks()
        step = self._wall_clock.observe(arrival_ns, unix_ns)
        if step is not None:
            self._on_step(step)
        for _ in range(DRAIN_LIMIT):
            try:
                length = sock.recv_into(self._buffer, 0, socket.MSG_TRUNC)
            except OSError:  # nothing more, or nothing that could be had: the next wake tells
                return
            self._on_frame(self._parsed(length, arrival_ns))

    def _parsed(self, length: int, arrival_ns: HostNs) -> Frame | NoFrame:
        if length > LARGEST_DATAGRAM:
            return NoFrame(Reason.MALFORMED, f"a datagram of {length} bytes, accepted: {LARGEST_DATAGRAM}")
        return parse_frame(bytes(memoryview(self._buffer)[:length]), arrival_ns, self._wall_clock)

    def _tell(self, *, listens: bool, why: str) -> None:
        if listens is not self._listens:
            self._listens = listens
            self._on_state(listens, why)

    def _file_is_gone(self) -> bool:
        """Whether the socket's file was deleted or replaced: nobody could reach us any more, and nothing would say."""
        if not isinstance(self._endpoint, str):
            return False
        try:
            return Path(self._endpoint).lstat().st_ino != self._inode
        except OSError:
            return True

    def _release(self) -> None:
        sock, self._socket = self._socket, None
        if sock is None:
            return
        asyncio.get_running_loop().remove_reader(sock)
        sock.close()
        if isinstance(self._endpoint, str) and not self._file_is_gone():
            with suppress(OSError):
                Path(self._endpoint).unlink()


def _look_up(host: str, port: int) -> tuple[socket.AddressFamily, tuple[object, ...]]:
    family, _, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
    return family, address


def _bound_to_path(path: str) -> tuple[socket.socket, int]:
    """A Unix socket at the path, for its owner and group, and its inode. What a killed process left is removed."""
    sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        _remove_left_over(path)
        sock.bind(path)
        Path(path).chmod(0o660)
        return sock, Path(path).lstat().st_ino
    except OSError:
        sock.close()
        raise


def _remove_left_over(path: str) -> None:
    """Remove a socket that nobody listens on; leave everything else for ``bind`` to complain about."""
    try:
        if not stat.S_ISSOCK(Path(path).lstat().st_mode):
            return
    except OSError:
        return
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(path)
        except ConnectionRefusedError:
            Path(path).unlink()
        except OSError:
            return

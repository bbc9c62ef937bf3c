"""SHELL: receives detections of another process as UDP or Unix datagrams, one frame per datagram."""

from __future__ import annotations

import asyncio
import os
import socket
import stat
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TypeAlias

from fwav_companion.addresses import resolve
from fwav_companion.types import NoFrame, Reason
from fwav_companion.vision.frame_receiver import FrameReceiver

LARGEST_DATAGRAM = 65536
"""Size of the receive buffer, bytes: over 200 for each of 256 detections; also the largest datagram of UDP."""
DRAIN_LIMIT = 8
"""Most datagrams per wake-up, so that the links have their turn in between."""
SOCKET_MODE = 0o660
"""Permissions of the socket's file: detectors reach the socket as members of the service's group."""
RETRY_S = 1.0
"""Interval of attempts while an address or a folder does not exist, as at boot."""

Endpoint: TypeAlias = tuple[str, int] | str
"""(host, port) for UDP, or the absolute path of a Unix socket."""


class DetectionsIn:
    """Listens for frames, and reopens its socket: for an address that appears late, or a deleted socket file."""

    def __init__(
        self,
        endpoint: Endpoint,
        receiver: FrameReceiver,
        on_state: Callable[[bool, str], None],
    ) -> None:
        """``on_state`` is called at each change with whether it listens, and why not."""
        self._endpoint = endpoint
        self._receiver = receiver
        self._on_state = on_state
        self._buffer = bytearray(LARGEST_DATAGRAM)
        self._socket: socket.socket | None = None
        self._inode = 0
        self._listens: bool | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def address(self) -> object:
        """The address on which it listens; None while it does not."""
        return self._socket.getsockname() if self._socket is not None else None

    def start(self) -> None:
        """Begin to listen. Called once, from a running loop."""
        self._task = asyncio.get_running_loop().create_task(self._stay_open(), name="detections")

    def close(self) -> None:
        """Close the socket at once; no callback follows."""
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
        family, address = (await resolve(host, port, socket.SOCK_DGRAM))[0]
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            sock.bind(address)
        except OSError:
            sock.close()
            raise
        return sock

    def _drain(self, sock: socket.socket) -> None:
        for _ in range(DRAIN_LIMIT):
            try:
                length = sock.recv_into(self._buffer, 0, socket.MSG_TRUNC)
            except OSError:  # no more data, or an error that the next wake-up repeats
                return
            if length > LARGEST_DATAGRAM:
                detail = f"a datagram of {length} bytes, accepted: {LARGEST_DATAGRAM}"
                self._receiver.on_frame(NoFrame(Reason.MALFORMED, detail))
            else:
                self._receiver.hear(bytes(memoryview(self._buffer)[:length]))

    def _tell(self, *, listens: bool, why: str) -> None:
        if listens is not self._listens:
            self._listens = listens
            self._on_state(listens, why)

    def _file_is_gone(self) -> bool:
        """Whether the socket's file was deleted or replaced: senders could not reach it any more, without an error."""
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


def _bound_to_path(path: str) -> tuple[socket.socket, int]:
    """A Unix socket at the path, for owner and group, and its inode. The socket of a killed process is removed."""
    sock = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
    try:
        sock.setblocking(False)
        _remove_left_over(path)
        os.fchmod(sock.fileno(), SOCKET_MODE)  # a socket's file gets these permissions, less the umask, as it appears
        sock.bind(path)
        Path(path).chmod(SOCKET_MODE)
        return sock, Path(path).lstat().st_ino
    except OSError:
        sock.close()
        raise


def _remove_left_over(path: str) -> None:
    """Remove a socket file on which no process listens; anything else remains, and ``bind`` reports it."""
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

"""The far end of a link of any kind, made of plain sockets and pseudo-terminals."""

from __future__ import annotations

import os
import pty
import select
import socket
import time
import tty
from abc import ABC, abstractmethod
from collections.abc import Iterator

from mavlink_wire import Wire
from processes import free_port

PATIENCE_S = 20.0
OURS = {(1, 191), (1, 100)}
"""The daemon's own components."""
HELLO = Wire(200, 200).frame("PING", 0, 1, *(1, 191))
"""A valid frame that makes its source a peer of a UDP server, and that the daemon does not forward: it is for it."""


class Peer(ABC):
    """Sends bytes and collects what arrives; :attr:`url` is the daemon's configured URL for it."""

    url: str

    def __init__(self) -> None:
        self.came = b""

    def meet(self) -> None:
        """Make this peer known to the running daemon, whose heartbeat has arrived."""
        self.connect()
        deadline = time.monotonic() + PATIENCE_S
        while not select.select([self.fileno()], [], [], 1.0)[0]:
            assert time.monotonic() < deadline, f"no heartbeat by {self.url}"
            self.greet()

    def connect(self) -> None:  # noqa: B027  # a serial line is there
        """Connect from this side."""

    def greet(self) -> None:  # noqa: B027  # only a UDP server learns its peers
        """Greet again: the daemon may not have listened."""

    @abstractmethod
    def send(self, data: bytes) -> None:
        """Send bytes to the daemon."""

    @abstractmethod
    def fileno(self) -> int:
        """The descriptor that becomes readable when bytes have come."""

    @abstractmethod
    def take(self) -> bytes:
        """The bytes that can be read now."""

    @abstractmethod
    def close(self) -> None:
        """Close the link."""

    def collect(self, count: int) -> list[bytes]:
        """Foreign frames, once ``count`` of them have arrived."""
        frames = self.wait_for(count)
        self.came = b""
        return frames

    def wait_for(self, count: int) -> list[bytes]:
        """Wait for ``count`` foreign frames without removing them."""
        deadline = time.monotonic() + PATIENCE_S
        while len(frames := foreign_frames(self.came)) < count:
            assert time.monotonic() < deadline, f"only {len(frames)} of {count} frames came by {self.url}"
            self.listen(0.1)
        return frames

    def listen(self, seconds: float) -> None:
        """Read what arrives within this time, or its first part: a line without a reader is soon full."""
        if select.select([self.fileno()], [], [], seconds)[0]:
            self.came += self.take()


def foreign_frames(data: bytes) -> list[bytes]:
    """Whole MAVLink frames, by the lengths in their headers, but for the daemon's own."""
    return [frame for frame in _frames(data) if (frame[3:5] if frame[0] == 0xFE else frame[5:7]) not in _OURS_BYTES]


_OURS_BYTES = {bytes(component) for component in OURS}


def _frames(data: bytes) -> Iterator[bytes]:
    while len(data) > 2:
        if data[0] == 0xFE:
            length = data[1] + 8
        else:
            assert data[0] == 0xFD, f"no frame begins with {data[:8].hex()}"
            length = data[1] + 12 + 13 * (data[2] & 1)
        if len(data) < length:
            return
        yield data[:length]
        data = data[length:]


class UdpPeer(Peer):
    """``kind``: udpin, udpout or udpbcast, as the daemon sees it."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
        self._daemon: tuple[str, int] | None = None
        if kind == "udpin":
            port = free_port()
            self._daemon = ("127.0.0.1", port)
            self._socket.bind(("127.0.0.1", 0))
            self.url = f"udpin://127.0.0.1:{port}"
            return
        host = "127.0.0.1" if kind == "udpout" else "127.255.255.255"
        self._socket.bind((host, 0))
        self.url = f"{kind}://{host}:{self._socket.getsockname()[1]}"

    def connect(self) -> None:
        if self._daemon is not None:
            self.greet()
            return
        self._socket.settimeout(PATIENCE_S)
        _, self._daemon = self._socket.recvfrom(65536, socket.MSG_PEEK)

    def greet(self) -> None:
        if self.url.startswith("udpin"):
            self.send(HELLO)

    def send(self, data: bytes) -> None:
        assert self._daemon is not None
        sender = self._socket
        if self.url.startswith("udpbcast"):  # a broadcast address cannot be a source
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                sender.sendto(data, self._daemon)
            return
        sender.sendto(data, self._daemon)

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> bytes:
        return self._socket.recv(65536)

    def close(self) -> None:
        self._socket.close()


class TcpPeer(Peer):
    """``kind``: tcpin or tcpout, as the daemon sees it."""

    def __init__(self, kind: str) -> None:
        super().__init__()
        self._connection: socket.socket | None = None
        self._port = free_port()
        self.url = f"{kind}://127.0.0.1:{self._port}"
        self._listener = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        self._listens = kind == "tcpout"
        if self._listens:
            self._listener.bind(("127.0.0.1", self._port))
            self._listener.listen()
            self._listener.settimeout(PATIENCE_S)

    def connect(self) -> None:
        if self._listens:
            self._connection, _ = self._listener.accept()
        else:
            self._connection = socket.create_connection(("127.0.0.1", self._port), PATIENCE_S)
        self._connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    @property
    def _socket(self) -> socket.socket:
        assert self._connection is not None
        return self._connection

    def send(self, data: bytes) -> None:
        self._socket.sendall(data)

    def fileno(self) -> int:
        return self._socket.fileno()

    def take(self) -> bytes:
        return self._socket.recv(65536)

    def close(self) -> None:
        self._listener.close()
        if self._connection is not None:
            self._connection.close()


class SerialPeer(Peer):
    """The other end of a pseudo-terminal."""

    def __init__(self) -> None:
        super().__init__()
        self._end, self._line = pty.openpty()
        tty.setraw(self._end)
        self.url = f"serial://{os.ttyname(self._line)}:921600"

    def send(self, data: bytes) -> None:
        while data:
            data = data[os.write(self._end, data) :]

    def fileno(self) -> int:
        return self._end

    def take(self) -> bytes:
        return os.read(self._end, 65536)

    def close(self) -> None:
        os.close(self._end)
        os.close(self._line)


def peer_of(kind: str) -> Peer:
    """The peer for the scheme of the daemon's URL."""
    if kind == "serial":
        return SerialPeer()
    return TcpPeer(kind) if kind.startswith("tcp") else UdpPeer(kind)

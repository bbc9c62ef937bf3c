"""Links of the live mock: UDP, TCP, a serial device or its own pty. No call blocks; a peer is not required."""

from __future__ import annotations

import contextlib
import os
import re
import selectors
import socket
import termios
import time
import tty
from collections.abc import Iterator
from typing import Any, Protocol

READ_BYTES = 65536
LARGEST_PORT = 65535
MAX_PEERS = 8
"""Most peers of a listening socket: the newest replaces the oldest."""
CONNECT_AGAIN_S = 0.5


class Transport(Protocol):
    """One link of the mock."""

    name: str
    """Address by which a peer reaches it: with the bound port, or the pty's path."""

    def files(self) -> list[Any]:
        """Files to select on."""

    def receive(self, ready: Any) -> bytes:
        """Bytes received on one of these files."""

    def send(self, data: bytes) -> None:
        """Sends the bytes; undeliverable bytes are lost without an error, as on a wire."""

    def close(self) -> None:
        """Closes the link."""


class UdpOut:
    """UDP socket that sends to one address."""

    def __init__(self, host: str, port: int) -> None:
        self.name = f"udpout:{host}:{port}"
        self._socket = _datagram_socket(host)
        with _closed_on_failure(self._socket):
            self._socket.connect((host, port))

    def files(self) -> list[Any]:
        """Returns the socket."""
        return [self._socket]

    def receive(self, ready: Any) -> bytes:
        """Receives one datagram; a refused connection counts as silence."""
        try:
            return bytes(ready.recv(READ_BYTES))
        except (BlockingIOError, ConnectionError):
            return b""

    def send(self, data: bytes) -> None:
        """Sends one datagram."""
        with contextlib.suppress(OSError):
            self._socket.send(data)

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


class UdpIn:
    """UDP socket that listens and sends to every peer that has sent to it."""

    def __init__(self, host: str, port: int) -> None:
        self._socket = _datagram_socket(host)
        with _closed_on_failure(self._socket):
            self._socket.bind((host, port))
        self.name = f"udpin:{host}:{self._socket.getsockname()[1]}"
        self._peers: dict[Any, None] = {}

    def files(self) -> list[Any]:
        """Returns the socket."""
        return [self._socket]

    def receive(self, ready: Any) -> bytes:
        """Receives one datagram and remembers its sender."""
        try:
            data, peer = ready.recvfrom(READ_BYTES)
        except (BlockingIOError, ConnectionError):
            return b""
        self._peers.pop(peer, None)
        self._peers[peer] = None
        if len(self._peers) > MAX_PEERS:
            del self._peers[next(iter(self._peers))]
        return bytes(data)

    def send(self, data: bytes) -> None:
        """Sends one datagram to each peer."""
        for peer in self._peers:
            with contextlib.suppress(OSError):
                self._socket.sendto(data, peer)

    def close(self) -> None:
        """Closes the socket."""
        self._socket.close()


class Tcp:
    """TCP server (``listening``), or a client that reconnects."""

    def __init__(self, host: str, port: int, listening: bool) -> None:
        self._address = (host, port)
        self._clients: list[socket.socket] = []
        self._server: socket.socket | None = None
        self._again_at = 0.0
        if listening:
            self._server = socket.create_server(self._address, family=_family(host))
            self._server.setblocking(False)
            port = self._server.getsockname()[1]
        self.name = f"{'tcpin' if listening else 'tcpout'}:{host}:{port}"

    def files(self) -> list[Any]:
        """The server and its clients, or the connection."""
        if self._server is not None:
            return [self._server, *self._clients]
        if not self._clients and time.monotonic() >= self._again_at:
            self._again_at = time.monotonic() + CONNECT_AGAIN_S
            with contextlib.suppress(OSError):
                self._adopt(socket.create_connection(self._address, timeout=CONNECT_AGAIN_S))
        return list(self._clients)

    def receive(self, ready: Any) -> bytes:
        """Receives bytes of a client; accepts a new client, drops a disconnected one."""
        if self._server is not None and ready is self._server:
            with contextlib.suppress(OSError):
                self._adopt(self._server.accept()[0])
            return b""
        try:
            data = bytes(ready.recv(READ_BYTES))
        except BlockingIOError:
            return b""
        except OSError:
            data = b""
        if not data:
            self._drop(ready)
        return data

    def send(self, data: bytes) -> None:
        """Sends to every client; drops one that cannot keep up, since half a frame would be damage."""
        for client in list(self._clients):
            try:
                client.sendall(data)
            except OSError:
                self._drop(client)

    def close(self) -> None:
        """Closes all sockets."""
        for one in [*self._clients, *([self._server] if self._server else [])]:
            one.close()

    def _adopt(self, client: socket.socket) -> None:
        client.setblocking(False)
        client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._clients.append(client)
        if len(self._clients) > MAX_PEERS:
            self._drop(self._clients[0])

    def _drop(self, client: socket.socket) -> None:
        self._clients.remove(client)
        client.close()


class Serial:
    """A terminal device in raw mode; without a path a pty, whose other end's path is the name."""

    def __init__(self, path: str = "") -> None:
        self._other_end: int | None = None
        if path:
            self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        else:
            # The other end stays open here too, so that the line survives a companion that closes it.
            self._fd, self._other_end = os.openpty()
            path = os.ttyname(self._other_end)
            tty.setraw(self._other_end, termios.TCSANOW)
            os.set_blocking(self._fd, False)
        tty.setraw(self._fd, termios.TCSANOW)
        self.name = f"serial:{path}"

    def files(self) -> list[Any]:
        """Returns the descriptor."""
        return [self._fd]

    def receive(self, ready: Any) -> bytes:
        """Returns the received bytes."""
        try:
            return os.read(ready, READ_BYTES)
        except OSError:
            return b""

    def send(self, data: bytes) -> None:
        """Sends what fits; the rest is lost, as on a UART."""
        with contextlib.suppress(OSError):
            os.write(self._fd, data)

    def close(self) -> None:
        """Closes both ends."""
        os.close(self._fd)
        if self._other_end is not None:
            os.close(self._other_end)


def open_transport(url: str) -> Transport:
    """Opens udpout: | udpin: | tcpin: | tcpout:HOST:PORT, serial:/dev/NAME, or pty; ``//`` after the colon is allowed.

    Raises ValueError for anything else, and OSError, with the URL in it, where the link cannot be opened.
    """
    try:
        return _opened(url)
    except (OSError, termios.error) as error:
        why = os.strerror(error.args[0]) if isinstance(error, termios.error) else error.strerror
        raise OSError(f"{url}: {why}") from None


def _opened(url: str) -> Transport:
    if url == "pty":
        return Serial()
    if serial := re.fullmatch(r"serial:(?://)?(/[^:]+)(?::\d+)?", url):
        return Serial(serial[1])
    match = re.fullmatch(r"(udpout|udpin|tcpin|tcpout):(?://)?\[?(.*?)]?:(\d+)", url)
    if not match:
        raise ValueError(
            f"{url!r} is not a link: expected udpout|udpin|tcpin|tcpout:HOST:PORT, serial:/dev/NAME, or pty"
        )
    kind, host, port = match[1], match[2], port_from(match[3], url)
    if kind == "udpout":
        return UdpOut(host, port)
    if kind == "udpin":
        return UdpIn(host, port)
    return Tcp(host, port, listening=kind == "tcpin")


def port_from(text: str, address: str) -> int:
    """Port number of an address from its digits. Raises ValueError for text that is not a port."""
    if int(text) > LARGEST_PORT:
        raise ValueError(f"{address!r}: {text} is not a port: expected 0 to {LARGEST_PORT}")
    return int(text)


def wait(transport: Transport, timeout_s: float) -> list[bytes]:
    """Received data; waits at most ``timeout_s`` for the first of it."""
    with selectors.DefaultSelector() as selector:
        for file in transport.files():
            selector.register(file, selectors.EVENT_READ)
        ready = [key.fileobj for key, _ in selector.select(timeout_s)]
    return [data for file in ready if (data := transport.receive(file))]


def _family(host: str) -> int:
    return socket.AF_INET6 if ":" in host else socket.AF_INET


@contextlib.contextmanager
def _closed_on_failure(one: socket.socket) -> Iterator[None]:
    try:
        yield
    except OSError:
        one.close()
        raise


def _datagram_socket(host: str) -> socket.socket:
    one = socket.socket(_family(host), socket.SOCK_DGRAM)
    one.setblocking(False)
    return one

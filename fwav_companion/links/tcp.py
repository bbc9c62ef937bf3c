"""TCP links: a client of one server, and a server of several clients."""

from __future__ import annotations

import asyncio
import socket

from fwav_companion.addresses import SocketAddress, resolve
from fwav_companion.errors import LinkError
from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import DRAIN_LIMIT, STREAM_READ_BYTES, Connection, LinkReceiver, Opener
from fwav_companion.links.places import MAX_PLACES, YIELDS_AFTER_S, Places
from fwav_companion.links.streams import BoundedWriter, FrameCutter
from fwav_companion.links.url import TcpUrl, host_and_port
from fwav_companion.types.network_status import LinkReport

CONNECT_WAIT_S = 5.0
"""Longest wait for a connection: a reachable server answers within a round trip; Linux would try for two minutes."""
UNANSWERED_MS = 10_000
"""Time without an acknowledgement that ends a connection: a peer that lost power does not close it."""
QUEUE_BYTES = 65536
"""Capacity of a queue: about three seconds of the busiest telemetry; older telemetry is useless."""


def tcp_opener(url: TcpUrl) -> Opener:
    """The opener that a TCP URL names."""
    return TcpServerOpener(url) if url.kind == "tcpin" else TcpClientOpener(url)


class TcpClientOpener:
    """Connects to one server."""

    def __init__(self, url: TcpUrl) -> None:
        self._url = url

    async def open(self, receiver: LinkReceiver) -> Connection:
        """A stream to the first of the host's addresses that accepts. OSError or LinkError of the last attempt."""
        failure: OSError | LinkError = LinkError("no address")
        for family, address in await resolve(self._url.host, self._url.port, socket.SOCK_STREAM):
            try:
                return TcpStream(await connected(family, address), receiver)
            except TimeoutError:
                failure = LinkError(f"no answer within {CONNECT_WAIT_S:g} s")
            except OSError as error:
                failure = error
        raise failure

    def close(self) -> None:
        """Nothing is under way between two tries."""


async def connected(family: socket.AddressFamily, address: SocketAddress) -> socket.socket:
    """A connected socket with this room's options. OSError, or TimeoutError."""
    sock = socket.socket(family, socket.SOCK_STREAM)
    try:
        sock.setblocking(False)
        async with asyncio.timeout(CONNECT_WAIT_S):
            await asyncio.get_running_loop().sock_connect(sock, address)
        _set_options(sock)
    except BaseException:
        sock.close()
        raise
    return sock


class TcpServerOpener:
    """Listens for clients."""

    def __init__(self, url: TcpUrl) -> None:
        self._url = url

    async def open(self, receiver: LinkReceiver) -> Connection:
        """A listening socket with its clients. OSError if the address does not exist, or is taken."""
        family, address = (await resolve(self._url.host, self._url.port, socket.SOCK_STREAM))[0]
        sock = socket.socket(family, socket.SOCK_STREAM)
        try:
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            sock.bind(address)
            sock.listen(MAX_PLACES)
        except OSError:
            sock.close()
            raise
        return TcpServer(sock, receiver)

    def close(self) -> None:
        """Nothing is under way between two tries."""


class TcpStream:
    """One connected stream, from a client or to a server."""

    def __init__(self, sock: socket.socket, receiver: LinkReceiver) -> None:
        self._socket = sock
        self._receiver = receiver
        self._loop = asyncio.get_running_loop()
        self._writer = BoundedWriter(sock.fileno(), sock.send, QUEUE_BYTES, receiver)
        self._loop.add_reader(sock, self._read)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Write whole frames now, or queue them."""
        self._writer.send(data, origin=origin)

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes."""
        self._read()

    def close(self) -> None:
        """Release the socket."""
        self._loop.remove_reader(self._socket)
        self._writer.close()
        self._socket.close()

    def status(self) -> LinkReport:
        """No further entries."""
        return LinkReport()

    def _read(self) -> None:
        try:
            data = self._socket.recv(STREAM_READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._receiver.on_lost(error.strerror or str(error))
            return
        if data:
            self._receiver.on_bytes(data)
        else:
            self._loop.remove_reader(self._socket)  # an end of file stays readable
            self._receiver.on_lost("closed by the peer")


class TcpServer:
    """Receives whole frames from each client and sends to all of them."""

    def __init__(self, sock: socket.socket, receiver: LinkReceiver) -> None:
        self._socket = sock
        self._receiver = receiver
        self._clients: dict[str, TcpStream] = {}
        """Streams by address."""
        self._places = Places[str](self._displace, silent_s=YIELDS_AFTER_S)
        self._refused = 0
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._accept)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:
        """Send to each client. Without clients nothing is counted as dropped."""
        for client in list(self._clients.values()):
            client.send(data, origin=origin)

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes of each client."""
        for client in list(self._clients.values()):
            client.poll()

    def close(self) -> None:
        """Release the listening socket and every client's."""
        self._loop.remove_reader(self._socket)
        self._socket.close()
        for client in self._clients.values():
            client.close()
        self._clients.clear()

    def status(self) -> LinkReport:
        """The clients in order of arrival, and the number of clients for which there was no room."""
        return LinkReport(clients=list(self._clients), refused=self._refused)

    def _accept(self) -> None:
        for _ in range(DRAIN_LIMIT):
            try:
                sock, address = self._socket.accept()
            except BlockingIOError:
                return
            except ConnectionError:  # the client gave up while it waited
                continue
            except OSError as error:  # out of file descriptors: the socket stays readable, so close it and retry later
                self._loop.remove_reader(self._socket)
                self._receiver.on_lost(error.strerror or str(error))
                return
            self._welcome(sock, *address[:2])

    def _welcome(self, sock: socket.socket, host: str, port: int) -> None:
        name = host_and_port(host, port)
        if not self._places.take(name, host, self._loop.time()):
            sock.close()
            self._refused += 1
            self._receiver.refused(name)
            return
        sock.setblocking(False)
        _set_options(sock)
        cutter = FrameCutter()

        def on_bytes(data: bytes) -> bool:
            whole = cutter.cut(data)
            self._receiver.traffic.source = host
            valid = bool(whole) and self._receiver.on_bytes(whole)
            if valid and name in self._places.of:
                self._places.of[name].heard_s = self._loop.time()
            return valid

        def on_lost(_why: str) -> None:
            self._dismiss(name)

        self._clients[name] = TcpStream(sock, LinkReceiver(on_bytes, on_lost, self._receiver.traffic))

    def _displace(self, name: str) -> None:
        """Close a client that has lost its place, and report it."""
        self._receiver.refused(name)
        self._dismiss(name)

    def _dismiss(self, name: str) -> None:
        self._places.of.pop(name, None)
        client = self._clients.pop(name, None)
        if client is not None:
            client.close()


def _set_options(sock: socket.socket) -> None:
    """Send frames at once, and notice a vanished peer whether this side sends or only receives."""
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, UNANSWERED_MS)
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPIDLE, 5)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPINTVL, 2)
    sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_KEEPCNT, 3)

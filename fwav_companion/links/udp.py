"""UDP links: a server that remembers its clients, a client of one peer, a broadcaster.

The kernel's buffer is the only queue.
"""

from __future__ import annotations

import asyncio
import errno
import socket

from fwav_companion.addresses import SocketAddress, resolve
from fwav_companion.fair_queues import Origin
from fwav_companion.links.base import DRAIN_LIMIT, READ_BYTES, SLICE_BYTES, Connection, LinkReceiver
from fwav_companion.links.udp_clients import Clients
from fwav_companion.links.url import UdpUrl, host_and_port
from fwav_companion.types.network_status import LinkReport

FORGETTING_PERIOD_S = 10.0
"""Interval between two searches for silent clients."""

BURST_S = 0.001
"""Time since the last read below which datagrams are a burst, and are read together. Otherwise a single datagram is
read: the check for another one takes a system call and an exception, a tenth of the whole work for a datagram."""

ROUTE_GONE = {errno.ENETUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL, errno.EINVAL, errno.ENODEV}
"""Send errors that end a connection: the interface, route or own address is gone. Linux gives EINVAL if the own
address of a connected socket was removed. Any other error (no listener, buffer full, host silent, datagram too long)
only loses the one datagram."""


class UdpOpener:
    """Opens the socket that a UDP URL names."""

    def __init__(self, url: UdpUrl) -> None:
        self._url = url

    async def open(self, receiver: LinkReceiver) -> Connection:
        """A bound, connected or broadcasting socket. OSError if the address, interface or route is missing."""
        family, address = (await resolve(self._url.host, self._url.port, socket.SOCK_DGRAM))[0]
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            if self._url.kind == "udpin":
                sock.bind(address)
                return UdpServer(sock, receiver)
            if self._url.kind == "udpbcast":
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                return UdpBroadcaster(sock, address, receiver)
            sock.connect(address)
            return UdpClient(sock, receiver)
        except OSError:
            sock.close()
            raise

    def close(self) -> None:
        """Nothing is under way between two tries."""


class UdpSocket:
    """Common part of the three kinds: drains on reception, and isolates the failure of a single datagram on sending."""

    def __init__(self, sock: socket.socket, receiver: LinkReceiver) -> None:
        self._socket = sock
        self._receiver = receiver
        self._loop = asyncio.get_running_loop()
        self._read_s = self._loop.time()
        # One buffer for all reads: CPython would allocate READ_BYTES for each and shrink it, and in a flood the holes
        # that remained between longer-lived objects took 4 MiB in five minutes.
        self._buffer = bytearray(READ_BYTES)
        self._received = memoryview(self._buffer)
        self._loop.add_reader(sock, self._on_readable)

    def close(self) -> None:
        """Release the socket."""
        self._loop.remove_reader(self._socket)
        self._socket.close()

    def status(self) -> LinkReport:
        """No further entries."""
        return LinkReport()

    def poll(self) -> None:
        """Pass on a bounded part of the received bytes."""
        self._drain()

    def _on_readable(self) -> None:
        alone = self._loop.time() - self._read_s > BURST_S
        self._drain(1 if alone else DRAIN_LIMIT)
        self._read_s = self._loop.time()

    def _drain(self, most: int = DRAIN_LIMIT) -> None:
        """Pass on the received datagrams, joined, so that a burst costs the link one call. ``most``: largest number of
        reads.
        """
        datagrams: list[bytes] = []
        size = 0
        for _ in range(most):
            try:
                length = self._socket.recv_into(self._buffer)
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram did not reach a listener; others follow
                continue
            if length:
                datagrams.append(bytes(self._received[:length]))
                size += length
            if size >= SLICE_BYTES:
                break
        if datagrams:
            self._receiver.on_bytes(datagrams[0] if len(datagrams) == 1 else b"".join(datagrams))

    def _send_to(self, address: SocketAddress, data: bytes) -> None:
        try:
            self._socket.sendto(data, address)
        except OSError as error:
            self._failed(error)
        else:
            self._receiver.traffic.bytes_out += len(data)

    def _failed(self, error: OSError) -> None:
        self._receiver.traffic.dropped += 1
        if error.errno in ROUTE_GONE:
            self._receiver.on_lost(error.strerror or str(error))


class UdpClient(UdpSocket):
    """Sends to one peer, and receives from it only."""

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:  # noqa: ARG002  # no frame waits here
        """Send one datagram to the peer. A refusal reported here belongs to an earlier one: this one is sent again."""
        try:
            try:
                self._socket.send(data)
            except ConnectionRefusedError:
                self._socket.send(data)
        except OSError as error:
            self._failed(error)
        else:
            self._receiver.traffic.bytes_out += len(data)


class UdpBroadcaster(UdpSocket):
    """Sends to a broadcast address, and receives every answer to its port."""

    def __init__(self, sock: socket.socket, address: SocketAddress, receiver: LinkReceiver) -> None:
        super().__init__(sock, receiver)
        self._address = address

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:  # noqa: ARG002  # no frame waits here
        """Broadcast one datagram."""
        self._send_to(self._address, data)


class UdpServer(UdpSocket):
    """Receives from every sender, and sends to the senders of recent valid frames."""

    def __init__(self, sock: socket.socket, receiver: LinkReceiver) -> None:
        super().__init__(sock, receiver)
        self._clients = Clients()
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)

    def send(self, data: bytes, *, origin: Origin | None = None) -> None:  # noqa: ARG002  # no frame waits here
        """Send one datagram to each client. Without clients nothing is counted as dropped."""
        for address in self._clients:
            self._send_to(address, data)

    def close(self) -> None:
        """Release the socket and remove all clients."""
        self._forgetting.cancel()
        super().close()

    def status(self) -> LinkReport:
        """The clients in order of arrival, and the number of valid frames whose source found no room."""
        clients = [host_and_port(*address[:2]) for address in self._clients]
        return LinkReport(clients=clients, refused=self._clients.refused)

    def _drain(self, most: int = DRAIN_LIMIT) -> None:
        """Pass on the received datagrams, joining successive ones of one source. ``most``: largest number of reads."""
        joined: list[bytes] = []
        source: SocketAddress | None = None
        size = 0
        for _ in range(most):
            try:
                length, address = self._socket.recvfrom_into(self._buffer)
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram did not reach a listener; others follow
                continue
            if source is not None and address != source:
                self._deliver(source, joined)
                joined = []
            source = address
            joined.append(bytes(self._received[:length]))
            size += length
            if size >= SLICE_BYTES:
                break
        if source is not None:
            self._deliver(source, joined)

    def _deliver(self, source: SocketAddress, datagrams: list[bytes]) -> None:
        whole = self._clients.whole_frames(source, b"".join(datagrams))
        self._receiver.traffic.source = source[0]
        if whole and self._receiver.on_bytes(whole) and not self._clients.on_valid(source, self._loop.time()):
            self._receiver.refused(host_and_port(*source[:2]))

    def _forget_silent(self) -> None:
        self._clients.forget_silent(self._loop.time())
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)

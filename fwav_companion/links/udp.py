"""UDP links: a server that remembers its clients, a client of one peer, a broadcaster.

The kernel's buffer is the only queue.
"""

from __future__ import annotations

import asyncio
import errno
import socket
from collections.abc import Iterator

from fwav_companion.addresses import SocketAddress, resolve
from fwav_companion.links.base import DRAIN_LIMIT, READ_BYTES, Connection, Ear
from fwav_companion.links.streams import FrameCutter
from fwav_companion.links.url import UdpUrl, host_and_port
from fwav_companion.types.network_status import LinkReport

MAX_CLIENTS = 16
"""More ground stations than one vehicle ever has. Each costs a copy of everything that is sent."""
CLIENT_SILENT_S = 60.0
"""Peers send heartbeats at 1 Hz. A client that is silent for a minute is removed until it sends again."""
FORGETTING_PERIOD_S = 10.0
"""Interval between two searches for silent clients."""

ROUTE_GONE = {errno.ENETUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL, errno.EINVAL, errno.ENODEV}
"""Send errors that end a connection: the interface, route or own address is gone. Linux gives EINVAL where the own
address of a connected socket was removed. Any other error (no listener, buffer full, host silent, datagram too long)
costs the one datagram."""


class UdpOpener:
    """Opens the socket that a UDP URL names."""

    def __init__(self, url: UdpUrl) -> None:
        self._url = url

    async def open(self, ear: Ear) -> Connection:
        """A bound, connected or broadcasting socket. OSError where address, interface or route is missing."""
        family, address = (await resolve(self._url.host, self._url.port, socket.SOCK_DGRAM))[0]
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            if self._url.kind == "udpin":
                sock.bind(address)
                return UdpServer(sock, ear)
            if self._url.kind == "udpbcast":
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
                return UdpBroadcaster(sock, address, ear)
            sock.connect(address)
            return UdpClient(sock, ear)
        except OSError:
            sock.close()
            raise

    def close(self) -> None:
        """Nothing is under way between two tries."""


class UdpSocket:
    """Common part of the three kinds: drains on reception, and isolates the failure of a single datagram on sending."""

    def __init__(self, sock: socket.socket, ear: Ear) -> None:
        self._socket = sock
        self._ear = ear
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._drain)

    def close(self) -> None:
        """Release the socket."""
        self._loop.remove_reader(self._socket)
        self._socket.close()

    def status(self) -> LinkReport:
        """No further entries."""
        return LinkReport()

    def _drain(self) -> None:
        """Pass on the received datagrams, joined: a burst costs the link one call."""
        datagrams: list[bytes] = []
        for _ in range(DRAIN_LIMIT):
            try:
                data = self._receive()
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram did not reach a listener; others follow
                continue
            if data:
                datagrams.append(data)
        if datagrams:
            self._ear.heard(datagrams[0] if len(datagrams) == 1 else b"".join(datagrams))

    def _receive(self) -> bytes:
        return self._socket.recv(READ_BYTES)

    def _send_to(self, address: SocketAddress, data: bytes) -> None:
        try:
            self._socket.sendto(data, address)
        except OSError as error:
            self._failed(error)
        else:
            self._ear.traffic.bytes_out += len(data)

    def _failed(self, error: OSError) -> None:
        self._ear.traffic.dropped += 1
        if error.errno in ROUTE_GONE:
            self._ear.lost(error.strerror or str(error))


class UdpClient(UdpSocket):
    """Sends to one peer, and receives from it only."""

    def send(self, data: bytes) -> None:
        """Send one datagram to the peer. A refusal reported here is of an earlier one, so this one is sent again."""
        try:
            try:
                self._socket.send(data)
            except ConnectionRefusedError:
                self._socket.send(data)
        except OSError as error:
            self._failed(error)
        else:
            self._ear.traffic.bytes_out += len(data)


class UdpBroadcaster(UdpSocket):
    """Sends to a broadcast address, and receives every answer to its port."""

    def __init__(self, sock: socket.socket, address: SocketAddress, ear: Ear) -> None:
        super().__init__(sock, ear)
        self._address = address

    def send(self, data: bytes) -> None:
        """Broadcast one datagram."""
        self._send_to(self._address, data)


class UdpServer(UdpSocket):
    """Receives from every sender, and sends to those that it heard recently."""

    def __init__(self, sock: socket.socket, ear: Ear) -> None:
        super().__init__(sock, ear)
        self._clients = Clients()
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)

    def send(self, data: bytes) -> None:
        """Send one datagram to each client. Without clients nothing is counted as dropped."""
        for address in self._clients:
            self._send_to(address, data)

    def close(self) -> None:
        """Release the socket and remove all clients."""
        self._forgetting.cancel()
        super().close()

    def status(self) -> LinkReport:
        """The clients in order of arrival."""
        return LinkReport(clients=[host_and_port(*address[:2]) for address in self._clients])

    def _receive(self) -> bytes:
        data, address = self._socket.recvfrom(READ_BYTES)
        return self._clients.whole_frames(address, data, self._loop.time())

    def _forget_silent(self) -> None:
        self._clients.forget_silent(self._loop.time())
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)


class Clients:
    """Client addresses with the time of their last datagram (seconds of any one clock) and their frame cutters."""

    def __init__(self) -> None:
        self._heard_at: dict[SocketAddress, float] = {}
        self._cutters: dict[SocketAddress, FrameCutter] = {}

    def __iter__(self) -> Iterator[SocketAddress]:
        """The addresses in order of arrival."""
        return iter(self._heard_at)

    def whole_frames(self, address: SocketAddress, data: bytes, now_s: float) -> bytes:
        """Register the sender and return the bytes that may be passed on now. A single client needs no cutting."""
        if address not in self._heard_at and len(self._heard_at) >= MAX_CLIENTS:
            self._forget(min(self._heard_at, key=self._heard_at.__getitem__))
        self._heard_at[address] = now_s
        if len(self._heard_at) == 1:
            return data
        return self._cutters.setdefault(address, FrameCutter()).cut(data)

    def forget_silent(self, now_s: float) -> None:
        """Remove the clients that have been silent for CLIENT_SILENT_S."""
        for address in [a for a, heard_at in self._heard_at.items() if now_s - heard_at > CLIENT_SILENT_S]:
            self._forget(address)

    def _forget(self, address: SocketAddress) -> None:
        del self._heard_at[address]
        self._cutters.pop(address, None)

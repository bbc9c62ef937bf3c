"""UDP: a server that remembers its clients, a client of one peer, a broadcaster. The kernel's buffer is the queue."""

from __future__ import annotations

import asyncio
import errno
import socket

from fwav_companion.addresses import SocketAddress, resolve
from fwav_companion.links.base import DRAIN_LIMIT, READ_BYTES, Connection, Ear
from fwav_companion.links.clients import Clients
from fwav_companion.links.url import UdpUrl, host_and_port

FORGETTING_PERIOD_S = 10.0
"""How often silent clients are looked for."""

ROUTE_GONE = {errno.ENETUNREACH, errno.ENETDOWN, errno.EADDRNOTAVAIL, errno.EINVAL, errno.ENODEV}
"""Errors of sending that end a connection: no interface, route or own address any more. EINVAL is what Linux gives
where the own address of a connected socket was taken away. All others (no listener, buffer full, host silent, datagram
too long) cost the one datagram."""


class UdpOpener:
    """Opens what a UDP URL names."""

    def __init__(self, url: UdpUrl) -> None:
        self._url = url

    async def open(self, ear: Ear) -> Connection:
        """A bound, connected or broadcasting socket. OSError without address, interface or route."""
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
    """What the three have in common: draining, and sending so that one bad datagram is no more than that."""

    def __init__(self, sock: socket.socket, ear: Ear) -> None:
        self._socket = sock
        self._ear = ear
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self._drain)

    def close(self) -> None:
        """Release the socket."""
        self._loop.remove_reader(self._socket)
        self._socket.close()

    def status(self) -> dict[str, object]:
        """Nothing more to tell."""
        return {}

    def _drain(self) -> None:
        """Hand on what has arrived, joined: a burst costs the listener one call."""
        datagrams: list[bytes] = []
        for _ in range(DRAIN_LIMIT):
            try:
                data = self._receive()
            except BlockingIOError:
                break
            except OSError:  # an earlier datagram met no listener: it was dropped there, others follow
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
    """Speaks to one peer, and hears it alone."""

    def send(self, data: bytes) -> None:
        """One datagram to the peer. A refusal reported here is of an earlier one: this one is sent still."""
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
    """Speaks to a broadcast address, and hears everyone who answers its port."""

    def __init__(self, sock: socket.socket, address: SocketAddress, ear: Ear) -> None:
        super().__init__(sock, ear)
        self._address = address

    def send(self, data: bytes) -> None:
        """One datagram to all."""
        self._send_to(self._address, data)


class UdpServer(UdpSocket):
    """Hears everyone, and speaks to all it has heard of late."""

    def __init__(self, sock: socket.socket, ear: Ear) -> None:
        super().__init__(sock, ear)
        self._clients = Clients()
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)

    def send(self, data: bytes) -> None:
        """One datagram to each client; with none, nobody misses it and nothing is counted."""
        for address in self._clients:
            self._send_to(address, data)

    def close(self) -> None:
        """Release the socket and forget everyone."""
        self._forgetting.cancel()
        super().close()

    def status(self) -> dict[str, object]:
        """The clients, in the order they were learned."""
        return {"clients": [host_and_port(*address[:2]) for address in self._clients]}

    def _receive(self) -> bytes:
        data, address = self._socket.recvfrom(READ_BYTES)
        return self._clients.whole_frames(address, data, self._loop.time())

    def _forget_silent(self) -> None:
        self._clients.forget_silent(self._loop.time())
        self._forgetting = self._loop.call_later(FORGETTING_PERIOD_S, self._forget_silent)

"""SHELL: looks up hosts without blocking the loop; errors say in words why a host has no address."""

from __future__ import annotations

import socket
from functools import partial
from typing import Any, Final, TypeAlias

from fwav_companion.blocking import in_daemon_thread

SocketAddress: TypeAlias = tuple[Any, ...]
"""(host, port) or (host, port, flow, scope)."""

Resolved: TypeAlias = tuple[socket.AddressFamily, SocketAddress]

NO_SUCH_HOST: Final = {socket.EAI_NONAME, socket.EAI_NODATA}
"""A name server answered that the name does not exist or has no address. With other errors no server answered."""


async def resolve(host: str, port: int, kind: socket.SocketKind) -> list[Resolved]:
    """The addresses of a host, the preferred one first, at least one. OSError, in words, if it has none now.

    A numeric address needs no look-up. A name is looked up in a daemon thread: without a network that takes seconds.
    """
    try:
        try:
            return _look_up(host, port, kind, socket.AI_NUMERICHOST)
        except socket.gaierror:
            return await in_daemon_thread(partial(_look_up, host, port, kind, 0), name=f"look up {host}")
    except socket.gaierror as error:
        raise OSError(_why_not(host, error)) from None


def _look_up(host: str, port: int, kind: socket.SocketKind, flags: int) -> list[Resolved]:
    found = socket.getaddrinfo(host, port, type=kind, flags=flags | socket.AI_NUMERICSERV)
    return [(family, address) for family, _, _, _, address in found]


def _why_not(host: str, error: socket.gaierror) -> str:
    if error.errno in NO_SUCH_HOST:
        return f"no such host: {host}"
    return f"{host} cannot be looked up: {error.strerror}"

"""Hosts to socket addresses, without ever blocking the loop."""

from __future__ import annotations

import socket
from functools import partial
from typing import Any, TypeAlias

from fwav_companion.blocking import in_daemon_thread

SocketAddress: TypeAlias = tuple[Any, ...]
"""(host, port) or (host, port, flow, scope)."""

Resolved: TypeAlias = tuple[socket.AddressFamily, SocketAddress]


async def resolve(host: str, port: int, kind: socket.SocketKind) -> list[Resolved]:
    """The addresses of a host, the preferred one first, at least one. OSError where there is none now.

    A numeric one needs no look-up; a name is looked up in a daemon thread: without a network that takes seconds.
    """
    try:
        found = _look_up(host, port, kind, socket.AI_NUMERICHOST)
    except socket.gaierror:
        found = await in_daemon_thread(partial(_look_up, host, port, kind, 0), name=f"look up {host}")
    return found


def _look_up(host: str, port: int, kind: socket.SocketKind, flags: int) -> list[Resolved]:
    found = socket.getaddrinfo(host, port, type=kind, flags=flags | socket.AI_NUMERICSERV)
    return [(family, address) for family, _, _, _, address in found]

"""Host headers, and which hosts are this machine alone. PURE, shared by all that answers browsers."""

from __future__ import annotations

import ipaddress


def is_loopback(host: str) -> bool:
    """Whether an address or name reaches only this machine."""
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def name_and_port(host: str) -> tuple[str, int | None]:
    """Name and port of a Host header (RFC 9110, 7.2); port 80 where it is left out, None for one that is no number."""
    name, separator, port = host.rpartition(":")
    if not separator or (host.startswith("[") and host.endswith("]")):
        return host.strip("[]"), 80
    return name.strip("[]"), int(port) if port.isdecimal() and len(port) <= 5 else None

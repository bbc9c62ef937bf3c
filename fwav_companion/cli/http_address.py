"""`--http HOST:PORT`: where a page is served, with a token beyond loopback."""

from __future__ import annotations

import secrets
from typing import TYPE_CHECKING

from fwav_companion.errors import UserError
from fwav_companion.http_hosts import is_loopback

if TYPE_CHECKING:
    from fwav_companion.ground.ground_process import PageAddress


def http_address(text: str) -> PageAddress:
    """The address of the option. UserError where it is none."""
    from fwav_companion.ground.ground_process import PageAddress

    host, separator, port = text.rpartition(":")
    host = host.strip("[]")
    if not separator or not host or not port.isdecimal() or not 0 < int(port) < 65536:
        raise UserError(f"--http {text}: accepted: HOST:PORT, as 127.0.0.1:8080 or 0.0.0.0:8080")
    return PageAddress(host=host, port=int(port), token="" if is_loopback(host) else secrets.token_urlsafe(16))

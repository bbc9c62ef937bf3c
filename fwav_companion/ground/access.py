"""Decides by Host, Origin and token which HTTP requests are answered. Pure.

A page of another site cannot read this one: its requests have that site's Origin, and a name that it makes resolve to
this address (DNS rebinding) is not among the hosts that are served. Beyond loopback a token is required as well.
"""

from __future__ import annotations

import hmac
import ipaddress
from collections.abc import Mapping

import msgspec

from fwav_companion.http_hosts import is_loopback, name_and_port

COOKIE = "fwav_ground"
SECURITY_HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class AccessRules(msgspec.Struct, frozen=True, kw_only=True):
    """Access options with which the server was started."""

    host: str
    """Address that it listens on."""
    port: int
    token: str = ""
    """Token required in every request; "": none is required."""
    names: tuple[str, ...] = ()
    """Names of this machine, lower case."""

    def refusal(self, headers: Mapping[str, str], query_token: str, cookie: str) -> str | None:
        """Reason why a request is not answered; None if it is answered."""
        host = headers.get("Host", "").lower()
        if not self._is_ours(host):
            return "this name is not served here: use the address that the program printed"
        origin = headers.get("Origin")
        if origin is not None and origin.lower() != f"http://{host}":
            return "requests of another site are not answered"
        if headers.get("Sec-Fetch-Site", "none") not in ("none", "same-origin"):
            return "requests of another site are not answered"
        given = query_token or cookie
        if self.token and not hmac.compare_digest(given.encode(errors="replace"), self.token.encode()):
            return "the token is missing or wrong: use the address that the program printed"
        return None

    def _is_ours(self, host: str) -> bool:
        name, port = name_and_port(host)
        if port != self.port:
            return False
        if is_loopback(self.host):
            return name in ("localhost", "127.0.0.1", "::1", self.host)
        return _is_address(name) or name in self.names or name == self.host


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True

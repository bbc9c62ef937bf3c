"""The link of Cursor on Target: UDP, TCP or TLS, by a URL and files, or by a TAK data package."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fwav_companion.errors import UserError
from fwav_companion.links.base import Link, OnState
from fwav_companion.links.map_server import MapServer
from fwav_companion.links.reconnect import StayingConnected, make_link
from fwav_companion.links.url import CotUrl, TlsUrl, parse_cot_url

if TYPE_CHECKING:
    from fwav_companion.links.tak_package import TakServer

LONGEST_TLS_DELAY_S = 60.0
"""Longest delay before a retry: a handshake costs the server more than a connection, and many units may be refused."""


def make_map_link(server: MapServer, on_state: OnState) -> tuple[Link, CotUrl]:
    """The link, not started yet, and its URL. UserError for a file that cannot be used."""
    packed = _packed(server)
    url = _url(server, packed)
    if not isinstance(url, TlsUrl):
        return make_link("cot", url, _ignore_bytes, on_state), url
    from fwav_companion.links.tls import TlsClientOpener
    from fwav_companion.links.tls_identity import client_context, read_files

    if packed is not None:
        files = packed.files
    else:
        files = read_files(
            client=server.client_cert, client_key=server.client_key, password_file=server.password_file, ca=server.ca
        )
    opener = TlsClientOpener(url, client_context(files), server.server_name)
    link = StayingConnected("cot", opener, _ignore_bytes, on_state, longest_delay_s=LONGEST_TLS_DELAY_S)
    return link, url


def map_url(server: MapServer) -> CotUrl:
    """The address, from the URL, else from the package. UserError where neither gives one."""
    return _url(server, None if server.url else _packed(server))


def _packed(server: MapServer) -> TakServer | None:
    if not server.package:
        return None
    from fwav_companion.links.tak_package import read_package

    return read_package(server.package)


def _url(server: MapServer, packed: TakServer | None) -> CotUrl:
    if server.url:
        return parse_cot_url(server.url)
    if packed is None:
        raise UserError("neither a URL nor a TAK data package is given")
    return packed.url


def _ignore_bytes(_link: str, _data: bytes) -> bool:
    """Ignore bytes from a map server: events of other units."""
    return False

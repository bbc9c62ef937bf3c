"""A link of the kind that its URL names."""

from __future__ import annotations

from fwav_companion.links.base import Link, OnBytes, OnState, Opener
from fwav_companion.links.reconnect import StayingConnected
from fwav_companion.links.url import LinkUrl, SerialUrl, UdpUrl


def make_link(name: str, url: LinkUrl, on_bytes: OnBytes, on_state: OnState) -> Link:
    """The link, not started yet."""
    return StayingConnected(name, _opener(url), on_bytes, on_state)


def _opener(url: LinkUrl) -> Opener:
    """Imported as needed: a board without a serial link does not carry pyserial."""
    if isinstance(url, UdpUrl):
        from fwav_companion.links.udp import UdpOpener

        return UdpOpener(url)
    if isinstance(url, SerialUrl):
        from fwav_companion.links.serial import SerialOpener

        return SerialOpener(url)
    from fwav_companion.links.tcp import tcp_opener

    return tcp_opener(url)

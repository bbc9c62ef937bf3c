"""The addresses that the service may exchange packets with, from the configured links. PURE."""

from __future__ import annotations

import ipaddress
import re
from collections.abc import Iterator
from urllib.parse import urlsplit

from fwav_companion.config import Config
from fwav_companion.errors import UserError
from fwav_companion.fleet.options import FleetTable
from fwav_companion.links.map_link import map_url
from fwav_companion.links.url import SerialUrl, UnixUrl
from fwav_companion.vision.preview_address import parse_preview

IP_PROTOCOLS = ("tcp", "udp", "tls", "quic", "ws")
"""Protocols of Zenoh's endpoints on the network; the others are sockets and serial lines of this board."""
HEADER = "# Written by `fwav-companion install` from the configured links: run it again when they change.\n"


class OpenAccessError(UserError):
    """An address is configured that does not bound the peers. The message names it."""


def drop_in(config: Config) -> str:
    """Return the unit's drop-in that denies every address but those configured. OpenAccessError."""
    allowed = sorted({str(network) for network in _networks(config)} - {"127.0.0.0/8", "::1/128"})
    allow = "".join(f"IPAddressAllow={network}\n" for network in allowed)
    return f"{HEADER}[Service]\nIPAddressDeny=any\nIPAddressAllow=localhost\n{allow}"


def _networks(config: Config) -> Iterator[ipaddress.IPv4Network | ipaddress.IPv6Network]:
    urls = [link.parsed_url for link in config.link] + [config.detections.parsed_url]
    if config.map_server is not None:
        cot = map_url(config.map_server)
        yield _network(cot.host, str(cot), listens=False)
    for url in urls:
        if not isinstance(url, SerialUrl | UnixUrl | None):
            yield _network(url.host, str(url), listens=url.kind in ("udpin", "tcpin"))
    if config.vision is not None:
        yield from _of_pictures(config.vision.source)
        yield from _of_preview(config.vision.preview)
    if config.fleet is not None:
        yield from _of_fleet(config.fleet)


def _of_pictures(source: str) -> Iterator[ipaddress.IPv4Network | ipaddress.IPv6Network]:
    if "://" in source:
        parts = urlsplit(source)
        yield _network(parts.hostname or "", source, listens=parts.scheme == "udp")


def _of_preview(preview: str) -> Iterator[ipaddress.IPv4Network | ipaddress.IPv6Network]:
    address = parse_preview(preview)
    if address is not None:
        yield _network(address.host, f"[vision] preview {address.host}:{address.port}", listens=True)


def _of_fleet(fleet: FleetTable) -> Iterator[ipaddress.IPv4Network | ipaddress.IPv6Network]:
    """Yield the endpoints of the bus. OpenAccessError where peers are found, or named in a file of Zenoh's."""
    if fleet.scouting:
        raise OpenAccessError("[fleet] scouting finds peers at any address")
    if fleet.config and not fleet.connect:
        raise OpenAccessError(f"[fleet] config {fleet.config} may name any address")
    for endpoint in (*fleet.connect, *fleet.listen):
        protocol, _, rest = endpoint.partition("/")
        if protocol in IP_PROTOCOLS:
            host = re.split(r"[?#]", rest)[0].rpartition(":")[0].strip("[]")
            yield _network(host, f"[fleet] {endpoint}", listens=endpoint in fleet.listen)


def _network(host: str, url: str, *, listens: bool) -> ipaddress.IPv4Network | ipaddress.IPv6Network:
    """Return the network of the peers of one URL. A broadcast address ending in .255 is taken for a /24."""
    try:
        address = ipaddress.ip_address("127.0.0.1" if host == "localhost" else host)
    except ValueError:
        raise OpenAccessError(f"{url} has a name, whose address may change") from None
    if address.is_loopback:
        return ipaddress.ip_network("127.0.0.0/8" if address.version == 4 else "::1/128")
    if listens:
        raise OpenAccessError(f"{url} hears any address")
    if url.startswith("udpbcast"):
        if address.version == 4 and address.packed[3] == 255 and address.packed[:3] != b"\xff" * 3:
            return ipaddress.ip_network(f"{address}/24", strict=False)
        raise OpenAccessError(f"{url} reaches a network whose size is not known")
    return ipaddress.ip_network(address)

"""Parses link URLs. This is pure text work: no socket is imported and no name is looked up."""

from __future__ import annotations

import ipaddress
import re
from typing import Literal, TypeAlias

import msgspec

from fwav_companion.errors import UserError

SERIAL_FORMS = "serial:///dev/NAME:BAUD | serial://VID:PID:BAUD"
LINK_FORMS = f"{SERIAL_FORMS} | udpin:// | udpout:// | udpbcast:// | tcpin:// | tcpout://HOST:PORT"
DETECTIONS_FORMS = "udpin://HOST:PORT | unix:///PATH"
COT_FORMS = "udpout://HOST:PORT | udpbcast://HOST:PORT | tcpout://HOST:PORT | tls://HOST:PORT"

UDP_KINDS = ("udpin", "udpout", "udpbcast")
TCP_KINDS = ("tcpin", "tcpout")
PYMAVLINK_KINDS = {"tcp": "tcpout", "tcpin": "tcpin", "udp": "udpin"} | {kind: kind for kind in UDP_KINDS}
"""Kinds of pymavlink's ``KIND:HOST:PORT`` notation, where a bare ``udp`` listens."""

MEANT_KINDS = {
    "udp": "udpin:// (listens) or udpout:// (sends)",
    "tcp": "tcpout:// (connects) or tcpin:// (listens)",
    "serial_flowcontrol": "serial://",
} | {kind: f"{kind}://" for kind in (*UDP_KINDS, *TCP_KINDS, "serial")}
"""Kinds that the user may mean by MAVSDK's and other notations, by the notation in lower case."""

BAUD_LIMITS = (300, 12_000_000)
"""Range of baud rates, bits per second: from the slowest radio in use to the fastest USB bridge (FT232H)."""
USB_IDS = re.compile(r"(?:0x)?([0-9a-fA-F]{1,4}):(?:0x)?([0-9a-fA-F]{1,4})")
"""VID:PID in hexadecimal."""
LONGEST_NAME = 253
"""Most characters of a host name."""
UNIX_PATH_BYTES = 107
"""Most bytes of a Unix socket's path: sockaddr_un has 108 bytes, one of them the terminator (unix(7))."""


class UrlError(UserError):
    """The text is not a usable URL. The message says what is accepted."""


class SerialUrl(msgspec.Struct, frozen=True):
    """A serial device, by its path, or by the USB ids that identify it under any name."""

    baud: int
    """Bits per second."""
    device: str = ""
    """Absolute path; "" if the ids identify the device."""
    vendor_id: int = 0
    product_id: int = 0

    def __str__(self) -> str:
        """The URL in the ``serial://`` notation."""
        where = self.device or f"{self.vendor_id:04x}:{self.product_id:04x}"
        return f"serial://{where}:{self.baud}"


class UdpUrl(msgspec.Struct, frozen=True):
    """UDP: listening, sending to one peer, or broadcasting."""

    kind: Literal["udpin", "udpout", "udpbcast"]
    host: str
    """Name or address; IPv6 without brackets."""
    port: int

    def __str__(self) -> str:
        """The URL in the ``KIND://`` notation."""
        return f"{self.kind}://{host_and_port(self.host, self.port)}"


class TcpUrl(msgspec.Struct, frozen=True):
    """TCP: listening for clients, or connecting to a server."""

    kind: Literal["tcpin", "tcpout"]
    host: str
    """Name or address; IPv6 without brackets."""
    port: int

    def __str__(self) -> str:
        """The URL in the ``KIND://`` notation."""
        return f"{self.kind}://{host_and_port(self.host, self.port)}"


class TlsUrl(msgspec.Struct, frozen=True):
    """TLS: connecting to a server."""

    host: str
    """Name or address; IPv6 without brackets."""
    port: int
    kind: Literal["tls"] = "tls"

    def __str__(self) -> str:
        """The URL."""
        return f"tls://{host_and_port(self.host, self.port)}"


class UnixUrl(msgspec.Struct, frozen=True):
    """A Unix datagram socket."""

    path: str
    """Absolute path."""

    def __str__(self) -> str:
        """The URL."""
        return f"unix://{self.path}"


LinkUrl: TypeAlias = SerialUrl | UdpUrl | TcpUrl
CotUrl: TypeAlias = UdpUrl | TcpUrl | TlsUrl


def parse_link_url(text: str) -> LinkUrl:
    """The URL of a [[link]], also in pymavlink's notation. UrlError."""
    scheme, separator, rest = text.partition("://")
    if not separator:
        return _parse_pymavlink(text)
    if scheme == "serial":
        return _parse_serial(rest)
    if scheme in UDP_KINDS or scheme in TCP_KINDS:
        return _parse_network(scheme, rest)
    raise UrlError(f'"{scheme}://" is not a kind of link; {_did_you_mean(scheme)}accepted: {LINK_FORMS}')


def parse_detections_url(text: str) -> UdpUrl | UnixUrl:
    """The URL at which detections arrive as datagrams. UrlError."""
    if text.startswith("unix://"):
        return _parse_unix(text.removeprefix("unix://"))
    if text.startswith("udpin:"):
        url = parse_link_url(text)
        if isinstance(url, UdpUrl):
            return url
    raise UrlError(f"{'did you mean udpin://? ' if _is_kind(text, 'udp') else ''}accepted: {DETECTIONS_FORMS}")


def parse_cot_url(text: str) -> CotUrl:
    """The URL to which Cursor on Target is sent. UrlError."""
    if text.startswith("tls://"):
        server = _parse_network("tls", text.removeprefix("tls://"))
        return TlsUrl(server.host, server.port)
    if text.startswith(("udpout:", "udpbcast:", "tcpout:", "tcp:")):
        url = parse_link_url(text)
        if not isinstance(url, SerialUrl):
            return url
    raise UrlError(f"{'did you mean udpout://? ' if _is_kind(text, 'udp') else ''}accepted: {COT_FORMS}")


def host_and_port(host: str, port: int) -> str:
    """HOST:PORT, with brackets around IPv6."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


def _did_you_mean(scheme: str) -> str:
    meant = MEANT_KINDS.get(scheme.lower())
    return "" if meant is None else f"did you mean {meant}? "


def _is_kind(text: str, kind: str) -> bool:
    """Whether the text begins with this kind of URL, as MAVSDK writes it."""
    return text.lower().startswith(f"{kind}:")


def _parse_pymavlink(text: str) -> LinkUrl:
    """A URL from ``udpin:host:port``, ``tcp:host:port`` or ``/dev/ttyX,baud``."""
    if text.startswith("/"):
        device, separator, baud = text.partition(",")
        if not separator:
            raise UrlError(f"{_no_baud(text)} accepted: {SERIAL_FORMS}")
        return SerialUrl(device=device, baud=_baud(baud))
    kind, _, rest = text.partition(":")
    if kind not in PYMAVLINK_KINDS:
        raise UrlError(f"accepted: {LINK_FORMS}")
    return _parse_network(PYMAVLINK_KINDS[kind], rest)


def _parse_serial(rest: str) -> SerialUrl:
    where, separator, baud = rest.rpartition(":")
    if not separator or USB_IDS.fullmatch(rest):
        raise UrlError(f"{_no_baud(rest)} accepted: {SERIAL_FORMS}")
    if where.startswith("/"):
        if where.endswith("/"):
            raise UrlError(f"it does not name a device; accepted: {SERIAL_FORMS}")
        return SerialUrl(device=where, baud=_baud(baud))
    ids = USB_IDS.fullmatch(where)
    if ids is None:
        raise UrlError(f'"{where}" is neither an absolute path nor VID:PID in hexadecimal; accepted: {SERIAL_FORMS}')
    return SerialUrl(vendor_id=int(ids[1], 16), product_id=int(ids[2], 16), baud=_baud(baud))


def _no_baud(where: str) -> str:
    """The error of a device without a baud rate, or with one but without ``serial://``."""
    device, _, baud = where.rpartition(":")
    if device.startswith("/") and baud.isdigit():
        return f"did you mean serial://{device}:{baud}?"
    return f"it has no baud rate; did you mean serial://{where}:57600 or :921600?"


def _parse_network(kind: str, rest: str) -> UdpUrl | TcpUrl:
    host_text, separator, port_text = rest.rpartition(":")
    if not separator:
        raise UrlError(f"it has no port; accepted: {kind}://HOST:PORT")
    host, port = _host(kind, host_text), _port(port_text)
    if kind in UDP_KINDS:
        return UdpUrl(kind=kind, host=host, port=port)  # type: ignore[arg-type]  # a member of UDP_KINDS
    return TcpUrl(kind=kind, host=host, port=port)  # type: ignore[arg-type]  # a member of TCP_KINDS


def _parse_unix(path: str) -> UnixUrl:
    if not path.startswith("/") or path.endswith("/") or "\0" in path:
        raise UrlError("it needs an absolute path; accepted: unix:///PATH")
    if len(path.encode(errors="replace")) > UNIX_PATH_BYTES:
        raise UrlError(f"its path is longer than the {UNIX_PATH_BYTES} bytes that a Unix socket can have")
    return UnixUrl(path)


def _host(kind: str, text: str) -> str:
    if not text:
        listening = "127.0.0.1 for this board alone, 0.0.0.0 for every network" if kind.endswith("in") else "an address"
        raise UrlError(f"it does not name a host; accepted: {kind}://HOST:PORT ({listening})")
    if text.startswith("["):
        return _host_v6(kind, text)
    numeric = re.fullmatch(r"[0-9.]+", text) is not None
    if (numeric and not _is_address(text, 4)) or not _is_name(text):
        raise UrlError(f'"{text}" is not a host; accepted: a name, an IPv4 address, or an IPv6 address in [brackets]')
    return text


def _host_v6(kind: str, text: str) -> str:
    if kind == "udpbcast":
        raise UrlError("IPv6 has no broadcast; accepted: udpbcast://IPV4-BROADCAST-ADDRESS:PORT")
    if not text.endswith("]") or not _is_address(text[1:-1], 6):
        raise UrlError(f'"{text}" is not an IPv6 address in brackets; accepted: as [::1]')
    return text[1:-1]


def _is_name(text: str) -> bool:
    """Whether it is a host name: labels of 1 to 63 characters, 253 in all (RFC 1035 2.3.4), final dot optional."""
    return (
        len(text) <= LONGEST_NAME and re.fullmatch(r"[A-Za-z0-9_-]{1,63}(\.[A-Za-z0-9_-]{1,63})*\.?", text) is not None
    )


def _is_address(text: str, version: int) -> bool:
    try:
        return ipaddress.ip_address(text).version == version
    except ValueError:
        return False


def _port(text: str) -> int:
    if re.fullmatch(r"[0-9]{1,5}", text) is None or not 1 <= int(text) <= 65535:
        raise UrlError(f'"{text}" is not a port; accepted: 1 to 65535')
    return int(text)


def _baud(text: str) -> int:
    low, high = BAUD_LIMITS
    if re.fullmatch(r"[0-9]{1,8}", text) is None or not low <= int(text) <= high:
        raise UrlError(f'"{text}" is not a baud rate; accepted: {low} to {high}, for example 921600')
    return int(text)

"""What to do about a link, by its kind: nobody looks for a cable where there is none."""

from __future__ import annotations

from typing import Final

from fwav_companion.links.url import LinkUrl, SerialUrl

COMMON_BAUDS: Final = "57600, 115200, 230400, 460800, 921600, 1500000"
_LISTENING: Final = (
    "have the other end send to this board and that port: MAVProxy --out, an [UdpEndpoint] of mavlink-router, "
    "PX4's MAV_n_REMOTE_PRT; is a firewall between?"
)
_SENDING: Final = "see that an autopilot or router listens at that address and answers; is a firewall between?"
_UNHEARD: Final = {
    "udpin": _LISTENING,
    "udpout": _SENDING,
    "udpbcast": _SENDING,
    "tcpin": "have the other end connect to this board's address and that port; is a firewall between?",
    "tcpout": "it is connected and silent: is that the port on which MAVLink is spoken?",
}


def unheard(url: LinkUrl) -> str:
    """Not a byte came."""
    if isinstance(url, SerialUrl):
        return "see to cable (TX to RX), power, and the autopilot's port: SERIALn_PROTOCOL 2, or MAV_n_CONFIG on PX4"
    return _UNHEARD[url.kind]


def garbled(url: LinkUrl) -> str:
    """Bytes came that are no MAVLink."""
    if isinstance(url, SerialUrl):
        return f"wrong baud rate? set [[link]] url to the autopilot's SERIALn_BAUD: one of {COMMON_BAUDS}"
    return "something else speaks on that port: see what sends there"


def lossy(url: LinkUrl) -> str:
    """Frames are missing."""
    if isinstance(url, SerialUrl):
        return "fewer streams or a higher baud rate; flow control; a shorter, better shielded cable"
    return "fewer streams; a wire instead of a radio, or a better place for its antennas; is the sender overloaded?"

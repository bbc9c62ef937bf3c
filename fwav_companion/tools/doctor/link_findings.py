"""Links: is the device there and free, does MAVLink arrive, does enough of it arrive, is it accepted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from errno import EACCES, EADDRNOTAVAIL
from typing import Final

from fwav_companion.config import LinkConfig
from fwav_companion.links.url import LinkUrl, SerialUrl
from fwav_companion.tools.doctor.evidence import Evidence, SerialPort
from fwav_companion.tools.doctor.finding import Finding, Level, access_fix
from fwav_companion.types.network_status import REQUESTS, LinkStatistics, PeerStatistics
from fwav_companion.types.status import RunStatus

LISTENED_S: Final = 2.0
"""Time of listening after which silence is judged, seconds: heartbeats come once a second."""
GARBAGE_BYTES: Final = 500
"""Bytes that are not MAVLink: fewer may come from plugging in a cable, or be a boot loader's greeting."""
GARBAGE_SHARE: Final = 0.2
"""Share of the bytes that are not MAVLink. A line at the right baud rate loses single frames, never a fifth."""
LOSS: Final = 0.02
"""Largest share of lost frames: beyond it, attitudes are missing where they are needed."""
LOSS_FRAMES: Final = 50
FIRST_USERS_PORT: Final = 1024
"""First port for users: lower ports are for root (ip(7), CAP_NET_BIND_SERVICE)."""

COMMON_BAUDS: Final = "57600, 115200, 230400, 460800, 921600, 1500000"
_LISTENING: Final = (
    "have the other end send to this board and that port: MAVProxy --out, an [UdpEndpoint] of mavlink-router, "
    "PX4's MAV_n_REMOTE_PRT; check for a firewall"
)
_SENDING: Final = "check that an autopilot or router listens at that address and answers; check for a firewall"
_SILENT: Final = {
    "udpin": _LISTENING,
    "udpout": _SENDING,
    "udpbcast": _SENDING,
    "tcpin": "have the other end connect to this board's address and that port; check for a firewall",
    "tcpout": "the connection is open and silent: check that this port speaks MAVLink",
}
_SILENT_SERIAL: Final = (
    "check the cable (TX to RX), power, and the autopilot's port: SERIALn_PROTOCOL 2, or MAV_n_CONFIG on PX4"
)


def port_findings(evidence: Evidence) -> Iterator[Finding]:
    """Yield what the operating system reports of the devices of serial links."""
    for port in evidence.board.ports:
        yield from _serial(port, evidence.board.user)


def link_findings(evidence: Evidence, status: RunStatus) -> Iterator[Finding]:
    """Yield what the service reports of its links."""
    ports = {port.link: port for port in evidence.board.ports}
    for link in evidence.config.link:
        report, port = status.link(link.name), ports.get(link.name)
        if report.state == "down" and (port is None or (port.exists and port.allowed)):
            yield _down(evidence, link, report.why)
        if report.state == "up" and link.role == "autopilot":
            yield from _received(evidence, status, link)
        if report.state == "up":
            yield from _claimed_ids(f"link {link.name}", status.traffic_of(link.name))
            yield from _shed(link, status.traffic_of(link.name))
            yield from _outdated(status, link)


def judged_loss(status: RunStatus, link: LinkConfig, peer: PeerStatistics) -> float | None:
    """Return the loss of a peer by its sequence numbers, 0 to 1; None where they show none.

    Sequence numbers show a loss only on the sender's own link (MAVLink guide, packet_loss): another sender's frames may
    be forwarded in part. So it is judged for the adopted autopilot, on serial or where nothing else sends.
    """
    autopilot, senders = status.autopilot, status.traffic_of(link.name).peers
    if autopilot is None or (peer.system, peer.component) != (autopilot.system, autopilot.component):
        return None
    if not isinstance(link.parsed_url, SerialUrl) and len(senders) > 1:
        return None
    return peer.loss


def _serial(port: SerialPort, user: str) -> Iterator[Finding]:
    yield from _closed_port(port, user)
    yield from _shared_port(port)


def _closed_port(port: SerialPort, user: str) -> Iterator[Finding]:
    """Yield why the port cannot be opened."""
    where = f"link {port.link}"
    if not port.exists:
        there = f"; present: {', '.join(port.others)}" if port.others else "; no serial device is present"
        yield Finding(
            "port_missing",
            Level.ERROR,
            where,
            problem=f"{port.device} does not exist{there}",
            fix="plug it in, or set [[link]] url to one that is; on a Raspberry Pi, enable_uart=1 in config.txt",
        )
    elif not port.allowed:
        yield Finding(
            "port_permission",
            Level.ERROR,
            where,
            problem=f"{user or 'this user'} may not read and write {port.device}",
            fix=access_fix(port.device, port.group, usual="dialout", user=user),
        )


def _shared_port(port: SerialPort) -> Iterator[Finding]:
    """Yield what else uses the port, and whether its hardware is too slow."""
    where = f"link {port.link}"
    if port.console:
        yield Finding(
            "serial_console",
            Level.ERROR,
            where,
            problem=f"the kernel's console uses {port.device} ({port.console})",
            fix=f"remove console={port.name} from cmdline.txt (raspi-config: serial login shell off), and reboot",
        )
    if port.bluetooth:
        yield Finding(
            "bluetooth_on_port",
            Level.ERROR,
            where,
            problem=f"Bluetooth uses {port.device} ({port.bluetooth})",
            fix="dtoverlay=disable-bt in config.txt, sudo systemctl disable hciuart, reboot",
        )
    elif port.mini_uart and port.baud > 115_200:
        yield Finding(
            "mini_uart",
            Level.WARNING,
            where,
            problem=f"{port.device} is the mini UART: its speed follows the core clock; {port.baud} baud loses bytes",
            fix="dtoverlay=disable-bt in config.txt gives serial0 the full UART",
        )


def _down(evidence: Evidence, link: LinkConfig, why: str) -> Finding:
    where, holder = f"link {link.name}", evidence.board.holders.get(link.name, "")
    level = Level.ERROR if link.role == "autopilot" else Level.WARNING
    if "in use" in why or "busy" in why or holder:
        by = f" by {holder}" if holder else ""
        return Finding(
            "port_taken",
            level,
            where,
            problem=f"{link.url} is in use{by} ({why})",
            fix="end that program, or use another port",
        )
    return Finding(
        "link_down",
        level,
        where,
        problem=f"{link.url}: {why}",
        fix=_down_fix(link.parsed_url, why),
    )


def _down_fix(url: LinkUrl, why: str) -> str:
    """Return what to change for a link that does not open, by the system's reason."""
    if os.strerror(EADDRNOTAVAIL) in why:
        return "name an address of this board (`ip address` lists them), or 0.0.0.0 for all"
    if os.strerror(EACCES) in why and not isinstance(url, SerialUrl):
        return f"a port from {FIRST_USERS_PORT}: those below are for root"
    return "check that the other end runs and the URL is right"


def _received(evidence: Evidence, status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    where, traffic = f"link {link.name}", status.traffic_of(link.name)
    if traffic.bytes_in == 0:
        if status.up_s >= LISTENED_S:
            fix = _silent_fix(link.parsed_url)
            yield Finding("nothing_heard", Level.ERROR, where, problem=f"{link.url} received no byte", fix=fix)
        return
    if _is_garbage(traffic):
        yield _garbage(link, traffic)
    if traffic.echoes > 0:
        yield Finding(
            "echo",
            Level.WARNING,
            where,
            problem=f"{traffic.echoes} of this service's own frames came back",
            fix="a crossed wire (RX to our own TX), or a router that sends back: take it out of the loop",
        )
    yield from _loss(status, link, traffic)
    yield from _signatures(evidence, status, link)


def _claimed_ids(where: str, traffic: LinkStatistics) -> Iterator[Finding]:
    if traffic.own_ids_on_gcs > 0:
        yield Finding(
            "own_ids_on_gcs",
            Level.WARNING,
            where,
            problem=f"{traffic.own_ids_on_gcs} frames came with the autopilot's ids, and were dropped",
            fix="a station that forwards back: stop that; a second way to the autopilot: "
            'role = "autopilot"; another vehicle: give it another system id; else a forgery: set [signing]',
        )
    if traffic.id_conflict > 0:
        yield Finding(
            "id_conflict",
            Level.WARNING,
            where,
            problem=f"another program uses this service's ids ({traffic.id_conflict} frames)",
            fix="set [vehicle] component_id = 192",
        )


def _shed(link: LinkConfig, traffic: LinkStatistics) -> Iterator[Finding]:
    if traffic.shed_bytes > 0 and not (link.role == "autopilot" and _is_garbage(traffic)):
        yield Finding(
            "shed_bytes",
            Level.WARNING,
            f"link {link.name}",
            problem=f"{traffic.shed_bytes} bytes were dropped unread: too many on this link are not MAVLink",
            fix="find what sends there; let a firewall pass the known senders alone, or listen on another address",
        )


def _outdated(status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    outdated, alone = status.traffic_of(link.name).outdated, link.role == "autopilot" and status.autopilot is None
    if outdated > 0:
        yield Finding(
            "outdated_signatures",
            Level.ERROR if alone else Level.WARNING,
            f"link {link.name}",
            problem=f"{outdated} rightly signed frames were refused: their sender's clock is over a minute behind",
            fix="give the sender the time (GPS or NTP) and let it send again; check this board's own time: timedatectl",
        )


def _silent_fix(url: LinkUrl) -> str:
    return _SILENT_SERIAL if isinstance(url, SerialUrl) else _SILENT[url.kind]


def _is_garbage(traffic: LinkStatistics) -> bool:
    return traffic.skipped_bytes > max(GARBAGE_BYTES, GARBAGE_SHARE * traffic.bytes_in)


def _garbage(link: LinkConfig, traffic: LinkStatistics) -> Finding:
    share = round(100 * traffic.skipped_bytes / traffic.bytes_in)
    fix = (
        f"wrong baud rate: set [[link]] url to the autopilot's SERIALn_BAUD, one of {COMMON_BAUDS}"
        if isinstance(link.parsed_url, SerialUrl)
        else "another protocol is spoken on that port: check what sends there"
    )
    level = Level.WARNING if traffic.peers else Level.ERROR
    problem = f"{share} % of {traffic.bytes_in} bytes are not MAVLink"
    return Finding("garbage", level, f"link {link.name}", problem=problem, fix=fix)


def _loss(status: RunStatus, link: LinkConfig, traffic: LinkStatistics) -> Iterator[Finding]:
    fix = (
        "fewer streams or a higher baud rate; flow control; a shorter or shielded cable"
        if isinstance(link.parsed_url, SerialUrl)
        else "fewer streams; a wire instead of a radio, or a better place for its antennas; check the sender's load"
    )
    for peer in traffic.peers:
        loss = judged_loss(status, link, peer)
        if loss is not None and loss > LOSS and peer.received >= LOSS_FRAMES:
            problem = f"{100.0 * loss:.1f} % of the autopilot's frames are lost"
            yield Finding("loss", Level.WARNING, f"link {link.name}", problem=problem, fix=fix)


def _signatures(evidence: Evidence, status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    where, traffic = f"link {link.name}", status.traffic_of(link.name)
    level = Level.ERROR if status.autopilot is None else Level.WARNING
    unanswered = status.timesync.exchanges == 0 and status.timesync.requests >= REQUESTS
    if traffic.refused_signatures > 0:
        yield Finding(
            "wrong_signature",
            level,
            where,
            problem=f"{traffic.refused_signatures} frames are signed with another key",
            fix="give the autopilot and [signing] key_file the same key",
        )
    elif traffic.refused_unsigned > 0:
        yield Finding(
            "unsigned",
            level,
            where,
            problem=f"{traffic.refused_unsigned} unsigned frames were not believed, since [signing] is set",
            fix=f'set the key in the autopilot, or [signing] accept_unsigned = ["{link.name}"] on a trusted wire',
        )
    elif traffic.signed_unverified > 0 and evidence.config.signing is None and unanswered:
        yield Finding(
            "no_signing_key",
            Level.WARNING,
            where,
            problem="the autopilot signs its frames, and no key is configured: it ignores what this service sends",
            fix="set [signing] key_file to the autopilot's key",
        )

"""Links: is the device there and free, does MAVLink arrive, does enough of it arrive, is it accepted."""

from __future__ import annotations

import os
from collections.abc import Iterator
from errno import EACCES, EADDRNOTAVAIL
from typing import Final

from fwav_companion.config import LinkConfig
from fwav_companion.links.url import LinkUrl, SerialUrl
from fwav_companion.tools.doctor.evidence import Evidence, SerialPort
from fwav_companion.tools.doctor.finding import Finding, access_case
from fwav_companion.tools.doctor.finding_table import make_finding
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
            yield from _claimed_ids(link, status.traffic_of(link.name))
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
    if not port.exists:
        yield make_finding(
            "port_missing",
            "others" if port.others else "none",
            link=port.link,
            device=port.device,
            others=", ".join(port.others),
        )
    elif not port.allowed:
        yield make_finding(
            "port_permission",
            access_case(port.group),
            link=port.link,
            device=port.device,
            group=port.group,
            user=user or "this user",
            member=user or "$USER",
        )


def _shared_port(port: SerialPort) -> Iterator[Finding]:
    """Yield what else uses the port, and whether its hardware is too slow."""
    if port.console:
        yield make_finding("serial_console", link=port.link, device=port.device, console=port.console, name=port.name)
    if port.bluetooth:
        yield make_finding("bluetooth_on_port", link=port.link, device=port.device, bluetooth=port.bluetooth)
    elif port.mini_uart and port.baud > 115_200:
        yield make_finding("mini_uart", link=port.link, device=port.device, baud=port.baud)


def _down(evidence: Evidence, link: LinkConfig, why: str) -> Finding:
    holder = evidence.board.holders.get(link.name)
    if "in use" in why or "busy" in why or holder:
        return make_finding("port_taken", link.role, link=link.name, url=link.url, holder=holder, why=why)
    return make_finding("link_down", link.role, _obstacle(link.parsed_url, why), link=link.name, url=link.url, why=why)


def _obstacle(url: LinkUrl, why: str) -> str:
    """Return what keeps a link from opening, by the system's reason."""
    if os.strerror(EADDRNOTAVAIL) in why:
        return "address"
    return "privilege" if os.strerror(EACCES) in why and not isinstance(url, SerialUrl) else "other_end"


def _received(evidence: Evidence, status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    traffic = status.traffic_of(link.name)
    if traffic.bytes_in == 0:
        if status.up_s >= LISTENED_S:
            yield make_finding("nothing_heard", _kind(link.parsed_url), link=link.name, url=link.url)
        return
    if _is_garbage(traffic):
        yield _garbage(link, traffic)
    if traffic.echoes > 0:
        yield make_finding("echo", link=link.name, echoes=traffic.echoes)
    yield from _loss(status, link, traffic)
    yield from _signatures(evidence, status, link)


def _claimed_ids(link: LinkConfig, traffic: LinkStatistics) -> Iterator[Finding]:
    if traffic.own_ids_on_gcs > 0:
        yield make_finding("own_ids_on_gcs", link=link.name, frames=traffic.own_ids_on_gcs)
    if traffic.id_conflict > 0:
        yield make_finding("id_conflict", link=link.name, frames=traffic.id_conflict)


def _shed(link: LinkConfig, traffic: LinkStatistics) -> Iterator[Finding]:
    if traffic.shed_bytes > 0 and not (link.role == "autopilot" and _is_garbage(traffic)):
        yield make_finding("shed_bytes", link=link.name, shed_bytes=traffic.shed_bytes)


def _outdated(status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    outdated, alone = status.traffic_of(link.name).outdated, link.role == "autopilot" and status.autopilot is None
    if outdated > 0:
        case = "no_autopilot" if alone else "autopilot"
        yield make_finding("outdated_signatures", case, link=link.name, frames=outdated)


def _kind(url: LinkUrl) -> str:
    return "serial" if isinstance(url, SerialUrl) else url.kind


def _is_garbage(traffic: LinkStatistics) -> bool:
    return traffic.skipped_bytes > max(GARBAGE_BYTES, GARBAGE_SHARE * traffic.bytes_in)


def _garbage(link: LinkConfig, traffic: LinkStatistics) -> Finding:
    return make_finding(
        "garbage",
        "peers" if traffic.peers else "no_peer",
        _kind(link.parsed_url),
        link=link.name,
        percent=round(100 * traffic.skipped_bytes / traffic.bytes_in),
        bytes_in=traffic.bytes_in,
    )


def _loss(status: RunStatus, link: LinkConfig, traffic: LinkStatistics) -> Iterator[Finding]:
    for peer in traffic.peers:
        loss = judged_loss(status, link, peer)
        if loss is not None and loss > LOSS and peer.received >= LOSS_FRAMES:
            yield make_finding("loss", _kind(link.parsed_url), link=link.name, percent=100.0 * loss)


def _signatures(evidence: Evidence, status: RunStatus, link: LinkConfig) -> Iterator[Finding]:
    traffic = status.traffic_of(link.name)
    case = "no_autopilot" if status.autopilot is None else "autopilot"
    unanswered = status.timesync.exchanges == 0 and status.timesync.requests >= REQUESTS
    if traffic.refused_signatures > 0:
        yield make_finding("wrong_signature", case, link=link.name, frames=traffic.refused_signatures)
    elif traffic.refused_unsigned > 0:
        yield make_finding("unsigned", case, link=link.name, frames=traffic.refused_unsigned)
    elif traffic.signed_unverified > 0 and evidence.config.signing is None and unanswered:
        yield make_finding("no_signing_key", link=link.name)

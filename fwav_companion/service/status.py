"""SHELL: reports of this run: the status, and the messages to systemd (sd_notify(3))."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path

import msgspec

from fwav_companion import __version__
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.links.base import Link
from fwav_companion.service.parts import ServiceParts
from fwav_companion.types.network_status import LinkStatistics
from fwav_companion.types.status import IntakeReport, RunStatus
from fwav_companion.vision.supervisor import VisionProcess

MAX_STATUS_BYTES = 65536
MAX_LISTED_MESSAGES = 32
"""Most thinned messages of a link that are listed in a status that would be too long."""


class StatusReport:
    """Collects the status of every part."""

    def __init__(self, parts: ServiceParts, links: Mapping[str, Link], vision: VisionProcess | None) -> None:
        self._parts = parts
        self._links = links
        self._vision = vision
        self._started_ns = parts.clock.now()

    def at(self, now: HostNs) -> RunStatus:
        """Status of the whole service."""
        parts = self._parts
        return RunStatus(
            **msgspec.structs.asdict(parts.pipeline.status(now)),
            version=__version__,
            pid=os.getpid(),
            config=parts.config.file,
            config_path=str(Path(parts.config.file).absolute()),
            time_unix=parts.clock.unix_us(now) / 1e6,
            time_monotonic=now / NS_PER_S,
            up_s=(now - self._started_ns) / NS_PER_S,
            internal_faults=parts.log.faults,
            links={name: link.status() for name, link in self._links.items()},
            traffic=parts.node.statistics(now),
            intake=self._intake(now),
            vision=None if self._vision is None else self._vision.status(),
            recording=parts.journal.state,
        )

    def _intake(self, now: HostNs) -> IntakeReport:
        arrivals = self._parts.arrivals
        age_s = (now - arrivals.last_ns) / NS_PER_S if arrivals.count else None
        return IntakeReport(came=arrivals.count, age_s=age_s, why=self._parts.log.deaf_because)


def encoded(status: RunStatus) -> bytes:
    """Return the status as JSON of at most MAX_STATUS_BYTES: if it is longer, peers are left out and counted."""
    data = msgspec.json.encode(status)
    if len(data) <= MAX_STATUS_BYTES:
        return data
    return msgspec.json.encode(msgspec.structs.replace(status, traffic=[_shortened(link) for link in status.traffic]))


def _shortened(link: LinkStatistics) -> LinkStatistics:
    thinning = msgspec.structs.replace(link.thinning, messages=link.thinning.messages[:MAX_LISTED_MESSAGES])
    left_out = link.peers_left_out + len(link.peers)
    return msgspec.structs.replace(link, peers=[], peers_left_out=left_out, thinning=thinning)


class SystemdNotifier:
    """Messages of a Type=notify service over systemd's datagram socket, if there is one. Never blocks, never raises."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        """``environment``: with $NOTIFY_SOCKET if systemd sets it."""
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{path[1:]}" if path.startswith("@") else path
        self._socket: socket.socket | None = None
        if path.startswith(("@", "/")):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)

    def ready(self) -> None:
        """Report that the start is done: links are configured."""
        self._send("READY=1")

    def stopping(self) -> None:
        """Report that a clean stop has begun."""
        self._send("STOPPING=1")

    def alive(self) -> None:
        """Ping the watchdog."""
        self._send("WATCHDOG=1")

    def close(self) -> None:
        """Release the socket."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _send(self, message: str) -> None:
        if self._socket is None:
            return
        try:
            self._socket.sendto(message.encode(errors="replace"), self._address)
        except OSError:  # the manager is restarting or busy: the service goes on, the next message may arrive
            return

"""SHELL: reports of this run: the status, and the messages to systemd (sd_notify(3))."""

from __future__ import annotations

import os
import socket
from collections.abc import Mapping
from pathlib import Path

import msgspec

from fwav_companion import __version__
from fwav_companion.config import Config
from fwav_companion.geometry.stamps import NS_PER_S, HostNs
from fwav_companion.links.base import Link
from fwav_companion.mavlink.router.node import Node
from fwav_companion.pipeline.pipeline import Pipeline
from fwav_companion.service.journal import Journal
from fwav_companion.service.log import ServiceLog
from fwav_companion.service.timer import HostClock
from fwav_companion.types.network_status import LinkStatistics
from fwav_companion.types.status import IntakeReport, RunStatus
from fwav_companion.vision.supervisor import VisionProcess

MAX_STATUS_BYTES = 65536
MAX_LISTED_MESSAGES = 32
"""Thinned messages of a link in a status that would be too long."""


class StatusReport:
    """Collects the status of every part; counts the frames that arrive, used or not."""

    def __init__(
        self,
        config: Config,
        clock: HostClock,
        node: Node,
        links: Mapping[str, Link],
        vision: VisionProcess | None,
        journal: Journal,
        pipeline: Pipeline,
        log: ServiceLog,
    ) -> None:
        self._config = config
        self._clock = clock
        self._node = node
        self._links = links
        self._vision = vision
        self._journal = journal
        self._pipeline = pipeline
        self._log = log
        self._came, self._came_ns = 0, HostNs(0)
        self._started_ns = clock.now()

    def frame_came(self, now: HostNs) -> None:
        """Count a frame from another process or from our own camera."""
        self._came, self._came_ns = self._came + 1, now

    def at(self, now: HostNs) -> RunStatus:
        """Status of the whole service."""
        return RunStatus(
            **msgspec.structs.asdict(self._pipeline.status(now)),
            version=__version__,
            pid=os.getpid(),
            config=self._config.file,
            config_path=str(Path(self._config.file).absolute()),
            time_unix=self._clock.unix_us(now) / 1e6,
            time_monotonic=now / NS_PER_S,
            up_s=(now - self._started_ns) / NS_PER_S,
            internal_faults=self._log.faults,
            links={name: link.status() for name, link in self._links.items()},
            traffic=self._node.statistics(now),
            intake=self._intake(now),
            vision=None if self._vision is None else self._vision.status(),
            recording=self._journal.state,
        )

    def _intake(self, now: HostNs) -> IntakeReport:
        age_s = (now - self._came_ns) / NS_PER_S if self._came else None
        return IntakeReport(came=self._came, age_s=age_s, why=self._log.deaf_because)


def encoded(status: RunStatus) -> bytes:
    """Return the status as JSON of at most MAX_STATUS_BYTES: peers are left out, and counted, where it is longer."""
    data = msgspec.json.encode(status)
    if len(data) <= MAX_STATUS_BYTES:
        return data
    return msgspec.json.encode(msgspec.structs.replace(status, traffic=[_shortened(link) for link in status.traffic]))


def _shortened(link: LinkStatistics) -> LinkStatistics:
    thinning = msgspec.structs.replace(link.thinning, messages=link.thinning.messages[:MAX_LISTED_MESSAGES])
    left_out = link.peers_left_out + len(link.peers)
    return msgspec.structs.replace(link, peers=[], peers_left_out=left_out, thinning=thinning)


class SystemdNotifier:
    """Messages of a Type=notify service over systemd's datagram socket; none elsewhere. Never blocks, never raises."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        """``environment``: with $NOTIFY_SOCKET and $WATCHDOG_USEC as systemd sets them."""
        path = environment.get("NOTIFY_SOCKET", "")
        self._address = f"\0{path[1:]}" if path.startswith("@") else path
        self._socket: socket.socket | None = None
        if path.startswith(("@", "/")):
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM | socket.SOCK_CLOEXEC)
            self._socket.setblocking(False)
        self.watchdog_period_s: float | None = _watchdog_period_s(environment) if self._socket is not None else None
        """Interval at which :meth:`alive` is expected, seconds: half of systemd's limit. None: no watchdog."""

    def ready(self) -> None:
        """Report that the start is done: links are configured."""
        self._send("READY=1")

    def stopping(self) -> None:
        """Report that a clean stop has begun."""
        self._send("STOPPING=1")

    def alive(self) -> None:
        """Ping the watchdog."""
        self._send("WATCHDOG=1")

    def status(self, text: str) -> None:
        """Set the line of ``systemctl status``."""
        self._send(f"STATUS={' '.join(text.split())}")

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


def _watchdog_period_s(environment: Mapping[str, str]) -> float | None:
    """Half of $WATCHDOG_USEC, if it is meant for this process."""
    microseconds, pid = environment.get("WATCHDOG_USEC", ""), environment.get("WATCHDOG_PID", "")
    if not microseconds.isdecimal() or int(microseconds) == 0 or pid not in ("", str(os.getpid())):
        return None
    return int(microseconds) * 1e-6 / 2
